"""Parts of the commands that need no run: lookup of runs, messages, progress lines, endings."""

from __future__ import annotations

import importlib
import json
import math
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from rig.api import campaign_run
from rig.cli import run as run_command
from rig.cli.app import app
from rig.cli.input_files import find_run
from rig.cli.output import BAD_INPUT, FAILED, FAULT, OK, STOPPED
from rig.cli.run_panel import RunPanel
from rig.cli.runs import command as list_command
from rig.config.problems import Problem, error_text
from rig.execution.task import RunResult
from rig.kinds.wavebot import display
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.processes.run_types import Outcome, Snapshot
from rig.realtime.limits import LimitFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError

REFUSED = "the host did not grant what the rig file requires"


def folder_of(runs: Path, name: str, **status: object) -> Path:
    """Make a run's folder with its JSON files and no record."""
    folder = runs / name
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps(status))
    (folder / "config.json").write_text("{}")
    return folder


def test_last_is_the_run_that_started_last(tmp_path: Path) -> None:
    old = folder_of(tmp_path, "20260504T093000Z_a", started_utc="2026-05-04T09:30:00Z")
    new = folder_of(tmp_path, "20260504T093001Z_a", started_utc="2026-05-04T09:30:01+00:00")
    os.utime(old, (2e9, 2e9))  # touched later, e.g. by `rig plot`
    assert find_run(Path("last"), tmp_path) == new


def test_an_exact_id_wins_over_a_prefix(tmp_path: Path) -> None:
    first = folder_of(tmp_path, "20260504T093000Z_a")
    second = folder_of(tmp_path, "20260504T093000Z_a_2")
    assert find_run(Path(first.name), tmp_path) == first
    assert find_run(Path(second.name), tmp_path) == second
    with pytest.raises(RunError, match="2 runs begin so"):
        find_run(Path("20260504"), tmp_path)


def test_a_campaign_is_its_newest_run(tmp_path: Path) -> None:
    for second, name in enumerate(("sweep", "sweep", "sweep_2")):
        folder_of(tmp_path, f"20260504T09300{second}Z_{name}", campaign=name)
    folder_of(tmp_path, "sweep_long_ago", campaign="other")
    assert find_run(Path("sweep"), tmp_path).name == "20260504T093001Z_sweep"
    assert find_run(Path("sweep_2"), tmp_path).name == "20260504T093002Z_sweep_2"
    assert find_run(Path("sweep_long"), tmp_path).name == "sweep_long_ago"
    with pytest.raises(RunError, match=r"swoop: no such run or campaign in .*; the newest there"):
        find_run(Path("swoop"), tmp_path)


def test_a_narrow_list_keeps_the_run_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = "20260504T093000Z_a_campaign_with_a_rather_long_name"
    reason = "a_reason_without_any_space_in_it_that_must_be_folded"
    folder = folder_of(tmp_path, name, status="fault", reason=reason, mode="rehearsal")
    (folder / "run.mcap").write_bytes(b"x")
    for columns in ("100", "40"):
        monkeypatch.setenv("COLUMNS", columns)
        assert list_command(tmp_path, as_json=False) == OK
        lines = capsys.readouterr().out.splitlines()
        assert lines[1].startswith(name)
    monkeypatch.setenv("COLUMNS", "100")
    list_command(tmp_path, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    at = lines[0].index("reason")
    assert reason in "".join(line[at:].split()[0] for line in lines[1:] if line[at:].strip())


def test_an_unhandled_interrupt_ends_with_a_message(monkeypatch: pytest.MonkeyPatch) -> None:
    """For example during the check of a campaign; a run handles interrupts itself."""

    def interrupted(*_: object, **__: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.cli.check.open_task", interrupted)
    done = CliRunner().invoke(app, ["check", "x.yaml"])
    assert (done.exit_code, done.stderr) == (STOPPED, "\nrig check: interrupted\n")


def test_an_interrupt_during_the_import_ends_with_a_message(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupting:
        def __getattr__(self, name: str) -> object:
            raise KeyboardInterrupt

    command = importlib.import_module("rig.__main__")
    assert command.INTERRUPTED == STOPPED
    monkeypatch.setitem(sys.modules, "rig.cli.app", Interrupting())
    with pytest.raises(SystemExit) as ended:
        command.main()
    assert ended.value.code == STOPPED
    assert capsys.readouterr().err == "\nrig: interrupted\n"


def snapshot(**fields: float) -> Snapshot:
    row: dict[str, float | int] = {"time": 30.0, "plan.row": -1, "plan.phase": 0}
    return Snapshot(row | {"timing.skipped": 3, "power.samples": 0} | fields, 2, 0, "")


def test_lines_show_time_left_losses_and_each_notice_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [1000.0]
    monkeypatch.setattr("rig.cli.run_panel.time.monotonic", lambda: now[0])
    plan: Any = SimpleNamespace(duration=120.0, rows=[None] * 4, axis_laws=CampaignFile.axis_laws)
    view = RunPanel("title", "rehearsal", plan, display, quiet=False)
    view._live_display = False
    now[0] += 15.0
    monkeypatch.setattr(display, "plan_position", lambda plan, row: ("row", str(row["plan.row"])))
    view(snapshot(**{"plan.row": 0}))
    assert capsys.readouterr().err == ""
    view(snapshot(**{"plan.row": 1}))
    line = capsys.readouterr().err
    assert "row 0" in line
    for part in ("0:30 of 2:00", "0:45 left", "3 ticks skipped", "2 rows dropped"):
        assert part in line
    # 100 s of waves were planned from 20 s on; they began 9 s later, when the stator had arrived.
    plan.wave_seconds = 100.0
    now[0] += 15.0
    moved = snapshot(**{"time": 60.0, "plan.wave_clock": 31.0, "plan.row": 2})
    view(moved._replace(compiling=True))
    line = capsys.readouterr().err
    assert "1:00 of 2:09" in line
    assert " x real time (interpreted, compiling)  " in line
    now[0] += 15.0  # the stop at the end of the plan takes slightly longer than planned
    over = {"plan.phase": float(Phase.DONE), "safety.reason": float(Reason.PLAN_END)}
    view(snapshot(**{"time": 129.6, "plan.wave_clock": 100.6} | over))
    line = capsys.readouterr().err
    assert "2:10 of 2:10 rig time, 0:00 left" in line
    assert "compiling" not in line
    assert "row 2" in line
    view.notice = "stopping"
    for _ in range(3):
        view(snapshot())
    assert capsys.readouterr().err == "stopping\n"
    view.notice = "power off"
    view(snapshot())
    assert capsys.readouterr().err == "power off\n"


def test_the_line_of_a_row_has_no_powers_of_the_next_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A rehearsal of 50 times real time shows a row once or twice, sometimes only settling."""
    plan: Any = SimpleNamespace(duration=120.0, rows=[None] * 4, axis_laws=CampaignFile.axis_laws)
    view = RunPanel("title", "rehearsal", plan, display, quiet=False)
    view._live_display = False

    def shows(row: dict[str, float], measured: dict[str, float]) -> str:
        return f"[{row['mean']:g} at {row['plan.row']:g}, seen {measured.get('mean')}]"

    monkeypatch.setattr(display, "plan_position", lambda plan, row: ("row", str(row["plan.row"])))
    monkeypatch.setattr(display, "short_text", lambda plan, row, measured: shows(row, measured))
    seen = ((0, 5, -10.0), (0, 0, 0.0), (1, 0, 0.0), (2, 7, -11.0), (3, 2, -12.0))
    for number, samples, mean in seen:
        view(snapshot(**{"plan.row": number, "power.samples": samples, "mean": mean}))
    lines = capsys.readouterr().err.splitlines()
    expected = "[0 at 0, seen -10.0]", "[0 at 1, seen None]", "[-11 at 2, seen -11.0]"
    assert [line[line.index("[") : line.index("]") + 1] for line in lines] == list(expected)


@pytest.mark.parametrize(
    ("phase", "clock", "expected"),
    [
        (Phase.LEAD_IN, 45.2, "building up, 0:45 of 2:00"),
        (Phase.MEASURE, 320.0, "measuring the probes, 3:20 of 20:00"),
        (Phase.DONE, -1.0, "done"),
    ],
)
def test_a_run_without_the_device_shows_waves_instead_of_rows(
    phase: Phase,
    clock: float,
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The display has phase, time and probe levels, but no row, motion or power."""
    now = [1000.0]
    monkeypatch.setattr("rig.cli.run_panel.time.monotonic", lambda: now[0])
    phases = SimpleNamespace(lead_in=120.0, measure=1200.0)
    plan: Any = SimpleNamespace(duration=1320.0, wave_seconds=1320.0, rows=(), phases=phases)
    view = RunPanel("title", "rehearsal", plan, display, quiet=False)
    view._live_display = False
    now[0] += 15.0
    probes = snapshot(
        **{"plan.phase": float(phase), "plan.wave_clock": clock, "safety.mode": 0.0},
        **{"safety.reason": 0.0, "probes.probe_1": 0.0123, "probes.probe_2": -0.1},
        **{"probes.probe_3": 0.0},
    )
    view(probes)
    line = capsys.readouterr().err
    console = Console(width=100)
    with console.capture() as panel:
        console.print(view._panel(probes))
    for text in (line, panel.get()):
        assert "waves" in text
        assert f"without the device   {expected}" in text
        assert "1:  +12.3 mm   2: -100.0 mm   3:   +0.0 mm" in text
        assert "row -" not in text
        assert "not measuring" not in text


def play(
    monkeypatch: pytest.MonkeyPatch, folder: Path, outcome: Outcome, *, as_json: bool = False
) -> int:
    """Return the exit code of `rig run` for a valid campaign whose run has this outcome."""
    campaign = Path(__file__).resolve().parents[2] / "configs" / "campaigns" / "quick.yaml"
    monkeypatch.setattr(campaign_run, "run_task", lambda *a, **k: RunResult(folder, outcome, ""))
    options = campaign_run.RunOptions()
    return run_command.run_named("run", campaign, folder.parent, options, as_json=as_json)


def test_a_refused_run_prints_its_reason_and_has_no_products(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = folder_of(tmp_path, "refused")
    before = sorted(folder.iterdir())
    outcome = Outcome("refused", REFUSED, 0, 0, 0, 0, 0, {})
    assert play(monkeypatch, folder, outcome) == FAILED
    output = capsys.readouterr()
    assert f"Refused: {REFUSED}." in output.err
    assert "no products" not in output.out + output.err
    assert sorted(folder.iterdir()) == before
    assert play(monkeypatch, folder, outcome, as_json=True) == FAILED
    assert json.loads(capsys.readouterr().out)["products"] == []


def test_json_of_a_run_holds_no_nan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row: dict[str, float | int] = {"a": math.nan, "b": -math.inf, "c": 1.5, "tick": 7}
    outcome = Outcome("fault", "NOT_FINITE", 0, 0, 0, 0, 0, row)
    assert play(monkeypatch, folder_of(tmp_path, "x"), outcome, as_json=True) == FAULT
    text = capsys.readouterr().out
    assert "NaN" not in text
    assert json.loads(text)["last_row"] == {"a": None, "b": None, "c": 1.5, "tick": 7}


def test_json_of_a_run_has_names_for_its_codes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row: dict[str, float | int] = {
        "plan.phase": int(Phase.LEAD_IN),
        "safety.mode": int(Mode.STOP_1),
        "safety.reason": 1000,  # an unknown code stays a number
        "heave.command.limited": int(LimitFlag.CURRENT_PEAK | LimitFlag.MODE),
        "heave.warned": 0,
    }
    outcome = Outcome("fault", "POSITION", 0, 0, 0, 0, 0, row)
    assert play(monkeypatch, folder_of(tmp_path, "x"), outcome, as_json=True) == FAULT
    report = json.loads(capsys.readouterr().out)
    assert report["last_row"] == {
        "plan.phase": "LEAD_IN",
        "safety.mode": "STOP_1",
        "safety.reason": 1000,
        "heave.command.limited": ["CURRENT_PEAK", "MODE"],
        "heave.warned": [],
    }
    assert report["optima"] == []


def test_a_run_prints_only_the_first_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    warnings = tuple(Problem("a.yaml", line, "", None, "a stop is near") for line in range(1, 8))
    run_command.print_warnings(warnings, Path("a.yaml"))
    *lines, last = capsys.readouterr().err.splitlines()
    assert lines == [f"warning: a.yaml:{line}: a stop is near" for line in range(1, 6)]
    assert last == "and 2 more warnings; rig check a.yaml lists all"
    run_command.print_warnings((), Path("a.yaml"))
    assert capsys.readouterr().err == ""


def test_a_file_as_folder_of_runs_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "x"
    file.touch()
    with pytest.raises(SystemExit) as ended:
        list_command(file, as_json=False)
    assert ended.value.code == BAD_INPUT
    assert capsys.readouterr().err == f"rig runs: {file}: not a folder\n"


def test_the_text_of_a_system_error_has_no_number() -> None:
    text = error_text(FileNotFoundError(2, "No such file or directory", "runs/x.png"))
    assert text == "runs/x.png: No such file or directory"
    assert error_text(OSError("disk full; --output writes to another disk")).startswith("disk full")
    assert error_text(KeyError("no field 'x'")) == "no field 'x'"
