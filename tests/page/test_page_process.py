"""The page's process: it finds its run by its input, and says why it ended."""

from __future__ import annotations

import io
import json
import sys
import threading
import time
from pathlib import Path

import pytest
from rig_command import rig_here

from rig.cli.output import FAILED
from rig.execution.task import View
from rig.page import process
from rig.page.process import ERRORS, PageOfRun, wait_for_run
from rig.processes.run_types import Snapshot
from rig.recording.runs.create import BusyError


@pytest.fixture
def broken_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a program that fails with a message in place of Python."""
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\nread folder\necho first >&2\necho no module rig >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))


@pytest.mark.usefixtures("broken_page")
def test_a_page_that_ends_at_once_says_why_in_one_line(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    folder = runs / "run"
    page = PageOfRun(runs)
    (early,) = runs.iterdir()
    assert early.name.endswith(".stderr")
    folder.mkdir()
    page.run_began(folder)
    assert page.failure() == f"the page ended: no module rig ({folder / ERRORS})"
    page.close()
    assert (folder / ERRORS).read_text() == "first\nno module rig\n"
    assert [each.name for each in runs.iterdir()] == ["run"]


@pytest.mark.usefixtures("broken_page")
def test_the_error_output_of_a_run_that_never_began_is_removed(tmp_path: Path) -> None:
    page = PageOfRun(tmp_path / "runs")
    page.close()
    assert page.failure() == "", "the run says why it did not begin"
    assert list((tmp_path / "runs").iterdir()) == []


@pytest.mark.parametrize(
    ("rows", "shown"), [([], False), ([{}], False), ([{}, {"time": 0.0}, {"time": 0.1}], True)]
)
def test_the_address_is_printed_when_the_run_starts(
    rows: list[dict[str, float | int]],
    shown: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A run that is refused, before its folder is there or after that, has no page."""

    def refuse(task: object, runs: Path, view: View, *_: object) -> None:
        for row in rows:
            view(Snapshot(row, 0, 0, ""))
        raise BusyError("the wire is taken")

    monkeypatch.setattr("rig.api.campaign_run.run_task", refuse)
    code, output, errors = rig_here("run", "quick", "--page", "--json", "--runs", tmp_path)
    assert code == FAILED
    assert "the wire is taken" in output
    assert errors.count("page: http://127.0.0.1:") == shown


def test_the_page_of_the_next_stage_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    """A browser that was there finds it at the same address, and no one reads of a failure."""
    first = PageOfRun(tmp_path / "runs")
    first.run_began(tmp_path)
    second = PageOfRun(tmp_path / "runs", first)
    try:
        assert second.url == first.url
        assert first.failure() == ""
        first.close()
    finally:
        second.end()
        second.close()


def test_a_page_without_a_run_ends(tmp_path: Path) -> None:
    with pytest.raises(TimeoutError, match="no run began"):
        wait_for_run(io.BytesIO(b""))
    (tmp_path / "run.json").write_text(json.dumps({"status": "complete"}))
    with pytest.raises(TimeoutError, match="the run is complete already"):
        wait_for_run(io.BytesIO(bytes(tmp_path) + b"\n"))


def test_the_page_waits_until_its_run_listens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It asks for the socket of a known folder; no other run is looked at."""
    (tmp_path / "run.json").write_text(json.dumps({"status": "running"}))
    clients: list[Path] = []

    class Client:
        def __init__(self, folder: Path) -> None:
            clients.append(folder)

        def close(self) -> None:
            pass

    monkeypatch.setattr(process, "RequestClient", Client)
    found: list[Path] = []
    source = io.BytesIO(bytes(tmp_path) + b"\n")
    thread = threading.Thread(target=lambda: found.append(wait_for_run(source)))
    thread.start()
    time.sleep(0.3)
    assert clients == []
    (tmp_path / "requests.sock").touch()
    thread.join(10)
    assert found == clients == [tmp_path]
