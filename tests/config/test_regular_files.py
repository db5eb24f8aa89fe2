"""Whatever a person names in place of a file: it is refused at once, and the message says why."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from rig.config import ConfigError, LimitsFile, Place, load, load_mapping
from rig.config.any_rig_file import load_rig
from rig.identification import bem, comparison
from rig.interop.basin.recording import read_recording
from rig.interop.exchange.mask4_signals import read_signals
from rig.interop.legacy.table import read_table
from rig.interop.legacy.testlog import read_log
from rig.planning.campaign import matrix_csv
from rig.planning.session import open_session
from rig.recording.calibration.history import open_calibration
from rig.recording.runs import RunError, mcap_file, open_run
from rig.regular_file import CONFIG_MOST, MB, RECORD_MOST, TABLE_MOST, open_regular, read_regular
from sim_plant.bem import read_bem

Read = Callable[[Path], Any]
HERE = Place(Path("campaign.yaml"), 3)


@pytest.fixture(autouse=True)
def at_once() -> Iterator[None]:
    """A reader that waits for a FIFO, or reads a device without end, fails within seconds."""

    def late(*_: object) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def inherited(path: Path) -> Any:
    """A file that extends it."""
    child = path.with_name("child.yaml")
    child.write_text(f"extends: {path.name}\n")
    return load_mapping(child)


READERS: dict[str, tuple[str, Read, int | None]] = {  # by what: ending, reader, most bytes
    "campaign": (".yaml", load_mapping, CONFIG_MOST),
    "extends": (".yaml", inherited, CONFIG_MOST),
    "rig": (".yaml", load_rig, CONFIG_MOST),
    "limits": (".yaml", lambda path: load(path, LimitsFile), CONFIG_MOST),
    "session": (".yaml", open_session, CONFIG_MOST),
    "calibration": (".yaml", open_calibration, CONFIG_MOST),
    "matrix": (".csv", lambda path: matrix_csv.read(path, HERE), CONFIG_MOST),
    "elevation": (".csv", read_recording, RECORD_MOST),
    "basin record": (".twe", read_recording, RECORD_MOST),
    "old matrix": (".csv", read_table, TABLE_MOST),
    "old workbook": (".xlsx", read_table, TABLE_MOST),
    "old .mat": (".mat", read_table, TABLE_MOST),
    "test log": (".xlsx", read_log, TABLE_MOST),
    "MASK4 structure": (".mat", lambda path: read_signals(path, None), RECORD_MOST),
    "BEM of a device": (".npz", bem.read_bem, TABLE_MOST),
    "BEM of a device, netcdf": (".nc", bem.read_bem, TABLE_MOST),
    "BEM of the plant": (".npz", read_bem, None),
    "BEM of the plant, netcdf": (".nc", read_bem, None),
    "identification": (".json", comparison.read, TABLE_MOST),
    "record of a run": (".mcap", mcap_file.scan, None),
    "run": (".mcap", open_run, None),
}


def fifo(path: Path) -> None:
    os.mkfifo(path)


def zeros(path: Path) -> None:
    path.symlink_to("/dev/zero")


def unix_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        here = Path.cwd()
        os.chdir(path.parent)  # a path of a socket has 107 bytes at most
        try:
            one.bind(path.name)
        finally:
            os.chdir(here)


def folder(path: Path) -> None:
    path.mkdir()


SPECIAL = (
    (fifo, "FIFO"), (zeros, "device"), (unix_socket, "socket"), (folder, "directory"),
)  # fmt: skip


@pytest.mark.parametrize(("make", "word"), SPECIAL)
@pytest.mark.parametrize("what", READERS)
def test_what_is_no_file_is_refused_at_once(
    what: str, make: Callable[[Path], None], word: str, tmp_path: Path
) -> None:
    ending, read, _ = READERS[what]
    path = tmp_path / f"odd{ending}"
    make(path)
    if what == "run":
        word = "no "  # no such run; or a folder, and no run in it
    with pytest.raises((ConfigError, OSError, ValueError, RunError)) as refused:
        read(path)
    said = str(refused.value).lower()
    assert word.lower() in said or "not a regular file" in said or "no such device" in said
    assert f"odd{ending}" in said


@pytest.mark.parametrize("what", [name for name, entry in READERS.items() if entry[2]])
def test_a_file_that_is_too_large_names_the_limit(what: str, tmp_path: Path) -> None:
    ending, read, most = READERS[what]
    assert most is not None
    path = tmp_path / f"large{ending}"
    path.touch()
    os.truncate(path, most + 1)
    with pytest.raises((ConfigError, OSError, ValueError, RunError)) as refused:
        read(path)
    assert f"allowed at most {most / MB:g} MB" in str(refused.value)


def test_a_comment_of_60_mb_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "campaign.yaml"
    path.write_text("name: x\n# " + "x" * 60 * MB + "\n")
    with pytest.raises(ConfigError) as refused:
        load_mapping(path)
    (problem,) = refused.value.problems
    assert (problem.file, problem.line, problem.value) == (str(path), 1, str(path))
    assert problem.message.endswith("it has 60 MB or more; allowed at most 4 MB")


def test_problems_of_several_files_come_at_once(tmp_path: Path) -> None:
    """A rig and a matrix that are no files: both are named, each where it is asked for."""
    from rig.planning.campaign import check

    os.mkfifo(tmp_path / "rig.yaml")
    campaign = tmp_path / "campaign.yaml"
    campaign.write_text("name: x\nrig: rig.yaml\nsea: {kind: calm}\nmatrix:\n  csv: /dev/zero\n")
    said = {problem.key: problem for problem in check(campaign).problems}
    assert "FIFO" in said["rig"].message
    assert said["rig"].line == 2
    assert "device" in said["matrix.csv"].message
    assert said["matrix.csv"].line == 5


def test_links_are_followed_and_nothing_is_left_open(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"text")
    (tmp_path / "b").symlink_to("a")
    before = len(os.listdir("/proc/self/fd"))
    assert read_regular(tmp_path / "b", 4) == b"text"
    with pytest.raises(OSError, match="at most 3e-06 MB"):
        read_regular(tmp_path / "b", 3)
    with pytest.raises(FileNotFoundError) as gone:
        open_regular(tmp_path / "c")
    assert gone.value.filename == str(tmp_path / "c")
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_file_without_a_size_is_read_up_to_the_limit() -> None:
    """Those of /proc say that they are empty."""
    assert read_regular(Path("/proc/self/status"), 100_000).startswith(b"Name:")
    with pytest.raises(OSError, match="at most"):
        read_regular(Path("/proc/self/status"), 100)
