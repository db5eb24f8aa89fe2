"""Runs with a compiled tick: from the first tick, from one in the middle, and not at all."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from golden_bench import GOLDEN
from rehearsing import CONFIGS, SilentView, rehearse, write_campaign, write_repeated_row

from rig.compilation.tick_code import compile_tick
from rig.execution.task import run_task
from rig.kinds.rig_file import kind_of_task
from rig.processes.run_types import ExecutionMode, Snapshot, Task
from rig.processes.tick_compiler import compile_job, source_of
from rig.realtime.compiled_tick import FILES, is_complete, read_objects, with_checksum
from rig.realtime.object_code import ObjectCodeError
from rig.recording.runs import open_run

pytestmark = pytest.mark.sampled(pool="compiled rehearsals")

QUICK = CONFIGS / "campaigns" / "quick.yaml"
SESSION = GOLDEN / "bench_flap.yaml"


def open_task(path: Path) -> tuple[Task, ExecutionMode]:
    """Return a campaign or session as a task, and the mode of its rehearsal."""
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path)
    assert report.ok, report.text()
    mode = tasks.rehearsal_mode(report.checked, real_clock=False)
    return tasks.execution_task(report.checked, report.plan), mode


def code_folders(path: Path) -> dict[str, Path | None]:
    """Return the folders of the code of a campaign or session, as `rig compile` names them."""
    task, mode = open_task(path)
    jobs = {"tick": compile_job(task), "rehearsal": compile_job(task, mode)}
    folders = {name: compile_tick(source_of(task.tick, job)) for name, job in jobs.items()}
    return folders if mode.coupled else {**folders, "rehearsal": None}


def run(path: Path, runs: Path, **changes: Any) -> tuple[Path, dict[str, Any]]:
    """Rehearse a campaign or session; return folder and status."""
    task, mode = open_task(path)
    ended = run_task(task, runs, SilentView(), mode._replace(**changes))
    return ended.folder, json.loads((ended.folder / "run.json").read_text())


def assert_same_record(one: Path, other: Path) -> None:
    first, second = open_run(one), open_run(other)
    assert set(first.data_vars) == set(second.data_vars)
    for name in first.data_vars:
        np.testing.assert_array_equal(first[name].values, second[name].values, str(name))


@pytest.mark.slow
def test_a_run_changes_over_while_it_ticks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The code appears in the cache during the run; no bit of the record shows it."""
    code = code_folders(QUICK)["rehearsal"]
    assert code is not None
    expected, status = run(QUICK, tmp_path, interpreted=True)
    assert status["compiled_from"] == -1
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    place = tmp_path / "cache" / "wec-rig" / code.name

    def provide() -> None:
        while not list(tmp_path.glob("*_quick/run.mcap.part0"))[-1:] or time.monotonic() < begin:
            time.sleep(0.05)
        for name in FILES:
            place.mkdir(parents=True, exist_ok=True)
            shutil.copy(code / name, place / f".{name}")
            (place / f".{name}").rename(place / name)

    begin = time.monotonic() + 1.0
    thread = threading.Thread(target=provide)
    thread.start()
    folder, status = run(QUICK, tmp_path)
    thread.join()
    assert 100 < status["compiled_from"] < status["ticks"] - 100
    assert_same_record(expected, folder)


@pytest.mark.slow
@pytest.mark.parametrize("path", [QUICK, SESSION], ids=lambda path: path.stem)
def test_a_run_with_code_in_the_cache_is_compiled_from_its_beginning(
    path: Path, tmp_path: Path
) -> None:
    code_folders(path)
    folder, status = run(path, tmp_path)
    assert (status["status"], status["compiled_from"]) == ("complete", 1)
    assert not (folder / "compiler.stderr").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_damaged_code_is_not_run_and_compiled_anew(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block of zeros, as after a power cut; with it, the process of the loop would die."""
    code = code_folders(QUICK)["rehearsal"]
    assert code is not None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    place = tmp_path / "cache" / "wec-rig" / code.name
    shutil.copytree(code, place)
    content = bytearray((place / name).read_bytes())
    at = len(content) // 2 // 512 * 512
    assert any(content[at : at + 512])
    content[at : at + 512] = bytes(512)
    (place / name).write_bytes(content)
    with pytest.raises(ObjectCodeError, match="is damaged; rig compile compiles it anew"):
        read_objects(place)
    _, status = run(QUICK, tmp_path)  # too short to wait for the compiler
    assert (status["status"], status["compiled_from"]) == ("complete", -1)
    assert not any((place / each).exists() for each in FILES)
    (place / name).write_bytes(content[:-2000])
    assert not is_complete(place)


@pytest.mark.slow
def test_the_compiler_of_a_killed_run_ends(tmp_path: Path) -> None:
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    campaign = CONFIGS / "campaigns" / "default.yaml"
    command = [sys.executable, "-m", "rig", "run", str(campaign), "--runs", str(tmp_path)]
    running = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60.0

    def compilers() -> list[str]:
        found = subprocess.run(
            ["pgrep", "-f", "rig.processes.tick_compiler"],
            check=False, capture_output=True, text=True,
        ).stdout.split()  # fmt: skip
        own = []
        for number in found:
            with suppress(OSError):  # it has ended since
                if str(tmp_path) in Path(f"/proc/{number}/environ").read_text():
                    own.append(number)
        return own

    while not compilers():
        assert time.monotonic() < end
        time.sleep(0.1)
    running.kill()
    running.wait()
    while compilers():
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.slow
def test_a_compiled_session_of_the_bench_has_the_record_of_an_interpreted_one(
    tmp_path: Path,
) -> None:
    code_folders(SESSION)
    expected, status = run(SESSION, tmp_path, interpreted=True)
    assert (status["status"], status["compiled_from"]) == ("complete", -1)
    folder, status = run(SESSION, tmp_path)
    assert status["compiled_from"] == 1
    assert_same_record(expected, folder)


@pytest.mark.slow
def test_a_plant_with_a_hoist_is_called_by_the_compiled_tick(tmp_path: Path) -> None:
    codes = code_folders(GOLDEN / "hoist.yaml")
    assert codes["rehearsal"] is None
    expected, _ = run(GOLDEN / "hoist.yaml", tmp_path, interpreted=True)
    folder, status = run(GOLDEN / "hoist.yaml", tmp_path)
    assert 0 < status["compiled_from"] < 100
    assert_same_record(expected, folder)


@pytest.mark.slow
def test_code_that_cannot_be_used_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run goes on interpreted; its status has the reason."""
    code = code_folders(SESSION)["rehearsal"]
    assert code is not None
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    place = tmp_path / "cache" / "wec-rig" / code.name
    place.mkdir(parents=True)
    for name in FILES:
        (place / name).write_bytes(with_checksum(b"no code"))
    _, status = run(SESSION, tmp_path)
    assert (status["status"], status["compiled_from"]) == ("complete", -1)
    (message,) = status["messages"]
    assert message.startswith("the tick ran interpreted, its code cannot be used: damaged object")


@pytest.mark.slow
@pytest.mark.parametrize("path", [QUICK, SESSION], ids=lambda path: path.stem)
def test_the_command_compiles_ahead(path: Path) -> None:
    folders = code_folders(path)
    done = rig("compile", path, "--json")
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert {name: found[name] for name in folders} == {k: str(v) for k, v in folders.items()}


@pytest.mark.slow
@pytest.mark.parametrize("killed", ["rig.processes.loop_process", "rig.processes.logger"])
def test_a_killed_process_of_a_compiled_run_costs_no_row(killed: str, tmp_path: Path) -> None:
    """Half an hour of rig time takes some seconds; the kill comes in the middle of it."""
    campaign = write_repeated_row(tmp_path, 250)
    code_folders(campaign)
    killed_at: list[float] = []

    def kill_once(snapshot: Snapshot) -> None:
        time_now = snapshot.row.get("time", 0.0)
        if time_now > 200.0 and not killed_at:
            killed_at.append(time_now)
            for process in Path("/proc").glob("[0-9]*"):
                with suppress(OSError):
                    parent = int((process / "stat").read_text().rsplit(")", 1)[1].split()[1])
                    arguments = (process / "cmdline").read_bytes().split(b"\0")
                    if parent == os.getpid() and killed.encode() in arguments:
                        os.kill(int(process.name), signal.SIGKILL)

    ended = rehearse(campaign, tmp_path / "runs", kill_once, interpreted=False)
    rows = open_run(ended.folder, fields=["tick"])["tick"].values
    assert np.array_equal(rows, np.arange(len(rows)))
    assert (ended.outcome.unsaved, len(rows)) == (0, ended.outcome.ticks)
    assert 200.0 < killed_at[0] < 1500.0
    if killed == "rig.processes.logger":
        assert (ended.outcome.status, ended.outcome.logger_restarts) == ("complete", 1)
        assert ended.outcome.compiled_from == 1
    else:
        assert (ended.outcome.status, rows[-1] > 200_000) == ("crashed", True)


@pytest.mark.slow
def test_a_law_that_cannot_be_compiled_runs_interpreted(tmp_path: Path) -> None:
    """The command names the reason; the run itself is complete."""
    law = tmp_path / "sorted_law.py"
    source = (CONFIGS.parent / "controllers" / "impedance.py").read_text()
    first = "def step("
    assert source.count(first) == 1
    source = source.replace(
        first, 'def _name() -> str:\n    return "{}".format(sorted({"a": 1}))\n\n\ndef step('
    )
    at = source.index("    ", source.index("def step("))
    body = source.index('"""', source.index('"""', at) + 3) + 3
    law.write_text(source[:body] + "\n    _name()" + source[body:])
    campaign = write_campaign(
        tmp_path,
        law=str(law),
        sea={"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5},
        tare={"duration_s": 1},
        start={"lead_in_s": 6},
        timing={"settle_s": 2, "interval_s": 4},
        matrix={"list": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]},
    )
    done = rig("compile", campaign)
    assert done.returncode == 1
    assert "the tick cannot be compiled, so it runs interpreted" in done.stderr
    assert "sorted_law.py" in done.stderr
    _, status = run(campaign, tmp_path / "runs")
    assert (status["status"], status["compiled_from"]) == ("complete", -1)
