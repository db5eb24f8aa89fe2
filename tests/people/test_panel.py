"""The panel of a run that people attend: prompts, set point, operator, and no time left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from attended_run import AttendedRun
from rich.console import Console

from rig.cli.run_panel import RunPanel
from rig.kinds.wavebot import display
from rig.processes.run_types import Snapshot
from rig.realtime.safety import OFF, RUN
from rig.realtime.sequence import MANUAL, STANDBY

COLUMNS: list[dict[str, Any]] = [
    {"key": "kp", "label": "Kp", "unit": "N*s/m", "part": "values"},
    {"key": "kind", "label": "signal", "part": "signal"},
    {"key": "amplitude", "label": "amplitude", "unit": "N", "part": "signal"},
]


def people(run: AttendedRun, **changes: Any) -> dict[str, Any]:
    signal = {"kind": "sine", "amplitude": 12.0}
    chosen = {"set": {"values": {"kp": -250.0}, "signal": signal}}
    return run.orders.describe() | chosen | changes


def snapshot(phase: int, mode: int, state: dict[str, Any], live: int = 0) -> Snapshot:
    row: dict[str, float | int] = {
        "time": 30.0, "plan.row": -1, "plan.phase": phase, "plan.live": live, "safety.mode": mode,
        "safety.reason": 0, "timing.skipped": 0, "power.samples": 0,
    }  # fmt: skip
    motion = ("estimate.position", "estimate.velocity", "command.force", "command.current")
    return Snapshot(row | {f"heave.{name}": 0.0 for name in motion}, 0, 0, "", "", state)


@pytest.fixture
def panel() -> RunPanel:
    plan: Any = SimpleNamespace(rows=[None], duration=60.0, axis_laws={"heave": None})
    found = RunPanel("title", "rehearsal", plan, display, quiet=False)
    found._live_display = False
    found.columns = COLUMNS
    return found


def text_of(panel: RunPanel, shown: Snapshot, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(display, "plan_position", lambda plan, row: ("row", "-"))
    console = Console(width=140)
    with console.capture() as captured:
        console.print(panel._panel(shown))
    return captured.get()


def test_standby_says_what_to_do(panel: RunPanel, monkeypatch: pytest.MonkeyPatch) -> None:
    run = AttendedRun(manual=True, dead_man_s=5.0)
    text = text_of(panel, snapshot(STANDBY, OFF, people(run)), monkeypatch)
    assert "rig request arm" in text
    assert "nobody; without one the rig holds, and stops after 5 s" in text
    assert "left at" not in text
    text = text_of(panel, snapshot(STANDBY, OFF, people(run, arming=True)), monkeypatch)
    assert "rig request confirm" in text


def test_manual_mode_shows_operator_and_set_point(
    panel: RunPanel, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = AttendedRun(manual=True)
    state = people(run, operator="ann", set_number=3)
    text = text_of(panel, snapshot(MANUAL, RUN, state, live=3), monkeypatch)
    for part in ("operator   ann", "3 in force", "Kp -250.0 N·s/m", "signal sine", "12.0 N"):
        assert part in text, text
    assert "armed" in text
    assert "0:30 rig time" in text
    assert "left at" not in text
    text = text_of(panel, snapshot(MANUAL, RUN, state, live=2), monkeypatch)
    assert "not yet in force" in text


def test_lines_come_with_changes_alone(
    panel: RunPanel, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = AttendedRun(manual=True)
    monkeypatch.setattr(display, "short_text", lambda *_: "")
    for _ in range(5):
        panel(snapshot(STANDBY, OFF, people(run)))
    assert capsys.readouterr().err.count("rig request arm") == 1
    for live in (0, 1, 1):
        panel(snapshot(MANUAL, RUN, people(run, set_number=1), live=live))
    assert capsys.readouterr().err.count("\n") == 2
