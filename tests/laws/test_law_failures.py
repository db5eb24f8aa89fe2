"""Laws that raise or demand NaN during a run: its last message names law, line and signal."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig_command import rig_here
from test_adding_a_law import PAGE, write_example

from rig.analysis.rows import row_table
from rig.processes.loop_process import _failure_text
from rig.processes.not_finite import first_not_finite
from rig.realtime.compiled_tick import EXCEPTION_TEXT
from rig.realtime.reasons import Reason
from rig.recording.runs import open_run
from rig.recording.runs.folder import STATUS
from tests.docs.blocks import file_of

GOOD = file_of(PAGE, "growing_damping.py")
LATE = """\
    ticks = state.ticks + 1
    if ticks == 3500:
        {code}
    return State(c0, c1, ticks),"""  # after the 2 s of the trial


def run_of(folder: Path, code: str, *options: str) -> tuple[str, dict[str, Any], int]:
    """Run a law with code that acts after 3.5 s; return errors, status, and the code's line."""
    path = write_law(folder, code)
    law = (folder / "growing_damping.py").read_text()
    exit_code, _, errors = rig_here("run", path, "--runs", folder / "runs", *options)
    assert exit_code != 0
    (run,) = (folder / "runs").iterdir()
    line = law.partition(code)[0].count("\n") + 1
    return errors, json.loads((run / STATUS).read_text()), line


def write_law(folder: Path, code: str) -> Path:
    """Write a campaign and its law, whose code acts after 3.5 s."""
    path = write_example(folder)
    law = GOOD.replace("    c1: Ramp\n", "    c1: Ramp\n    ticks: int\n", 1)
    law = law.replace("ramp_start(0.0))", "ramp_start(0.0), 0)", 1)
    law = law.replace("    return State(c0, c1),", LATE.format(code=code), 1)
    (folder / "growing_damping.py").write_text(law)
    return path


def test_exception_of_a_law_is_named_with_its_line(tmp_path: Path) -> None:
    errors, status, line = run_of(tmp_path, "force = force / 0.0", "--interpreted")
    text = f"growing_damping.py:{line}: ZeroDivisionError: float division by zero"
    assert status["status"] == "crashed"
    assert status["reason"].startswith("loop: the law raised an exception: ")
    assert status["reason"].endswith(text)
    assert text in errors


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(
    "code",
    [
        "force = force / (0.0 * force)",
        "force = 1.0 / (1.0 / (0.0 * force))",  # without the check of a division: 0.0
        "force = force + ticks // (ticks - 3500)",
        "force = force + ticks % (ticks - 3500)",
        "force = (force,)[ticks]",
    ],
)
def test_an_exception_ends_a_run_in_the_same_tick_in_both_executions(
    code: str, tmp_path: Path
) -> None:
    found = []
    for execution in ("interpreted", "compiled"):
        folder = tmp_path / execution
        folder.mkdir()
        path = write_law(folder, code)
        if execution == "compiled":
            assert rig_here("compile", path)[0] == 0
        option = ["--interpreted"] if execution == "interpreted" else []
        assert rig_here("run", path, "--runs", folder / "runs", *option)[0] != 0
        (run,) = (folder / "runs").iterdir()
        status = json.loads((run / STATUS).read_text())
        assert status["compiled_from"] == (1 if execution == "compiled" else -1)
        found.append((status["status"], status["ticks"]))
    assert found[0] == found[1]
    assert found[0][0] == "crashed"
    assert EXCEPTION_TEXT in status["reason"]


@pytest.mark.long
def test_an_edit_of_an_imported_module_is_never_served_stale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    path = write_example(tmp_path)
    law = "import own_gains.part\n" + GOOD.replace("clamp(-", "own_gains.part.GAIN * clamp(-", 1)
    assert "GAIN" in law
    (tmp_path / "growing_damping.py").write_text(law)
    (tmp_path / "own_gains").mkdir()
    (tmp_path / "own_gains" / "__init__.py").write_text("")

    def powers(gain: float, *options: str) -> list[float]:
        (tmp_path / "own_gains" / "part.py").write_text(f"GAIN = {gain}\n")
        for command in (["compile"], ["run", "--runs", str(tmp_path / "runs"), *options]):
            arguments = [sys.executable, "-m", "rig", *command, str(path)]
            subprocess.run(arguments, check=True, capture_output=True)
        newest = max((tmp_path / "runs").iterdir(), key=lambda run: run.stat().st_ctime)
        compiled_from = json.loads((newest / STATUS).read_text())["compiled_from"]
        assert compiled_from == (-1 if options else 1)
        found: list[float] = row_table(newest)["power_mechanical_2"].values.tolist()
        return found

    assert powers(1.0) != powers(2.0)
    assert powers(2.0) == powers(2.0, "--interpreted")


@pytest.mark.parametrize("options", [("--interpreted",), ()])
def test_nan_of_a_law_is_named(options: tuple[str, ...], tmp_path: Path) -> None:
    """3500 ticks of 1 ms after the law's start, which is at the end of the tare."""
    errors, status, _ = run_of(tmp_path, "force = 1e400 - 1e400", *options)
    assert (status["status"], status["reason"]) == ("fault", "NOT_FINITE")
    (message,) = status["messages"]
    assert message.startswith("the law of the axis heave demanded nan at ")
    # By the record, in which the tick after that of the demand is the last one of the loop.
    (run,) = (tmp_path / "runs").iterdir()
    log = open_run(run)
    (tick, *_) = np.flatnonzero(np.isnan(log["heave.demand.force"].values)).tolist()
    position, velocity = (
        float(log[f"heave.estimate.{each}"].values[tick]) for each in ("position", "velocity")
    )
    row = int(log["plan.row"].values[tick])
    assert message.endswith(
        f"{'' if row < 0 else f', row {row}'}, at position {position:.2g} m and velocity "
        f"{velocity:.2g} m/s (log field heave.demand.force)"
    )
    assert message in errors
    assert "`rig plot last`" in rig_here("show", run)[1]


def row(time: float, reason: Reason = Reason.NONE, **values: float) -> dict[str, float]:
    fields = {"heave.sense.current": 0.0, "heave.demand.force": 0.0, "load.lcb": 0.0}
    named = {name.replace("__", "."): value for name, value in values.items()}
    return {"time": time, "safety.reason": reason, **fields, "probe": float("nan"), **named}


def test_first_signal_is_the_cause_of_the_others() -> None:
    nan, trip = float("nan"), Reason.NOT_FINITE
    sensed = [row(0.0), row(1.0), row(2.0, trip, load__lcb=nan, heave__sense__current=nan)]
    assert first_not_finite(sensed) == (
        "the first value that is no number was nan at 2.000 s (log field heave.sense.current)"
    )
    late = [row(0.0), row(1.0, heave__demand__force=float("inf")), row(2.0, trip, load__lcb=nan)]
    assert first_not_finite(late) == (
        "the law of the axis heave demanded inf at 1.000 s (log field heave.demand.force)"
    )
    moving = {"plan__row": 3, "heave__estimate__position": 0.11, "heave__estimate__velocity": 0.31}
    units = {"heave.estimate.position": "m", "heave.estimate.velocity": "m/s"}
    ticks = [row(0.0, **moving), row(5.085, heave__demand__force=nan, **moving), row(5.086, trip)]
    assert first_not_finite(ticks, units) == (
        "the law of the axis heave demanded nan at 5.085 s, row 3, at position 0.11 m and velocity "
        "0.31 m/s (log field heave.demand.force)"
    )
    assert not first_not_finite([row(0.0), row(1.0, load__lcb=nan), row(2.0, Reason.POSITION)])


def test_exception_of_compiled_code_says_how_to_get_its_line() -> None:
    assert _failure_text(ArithmeticError(EXCEPTION_TEXT)) == (
        "the compiled tick raised an exception; `rig run --interpreted` names its file and line"
    )
