"""Manual runs of the bench as people start them, and manual mode within a session."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from rig_command import rig
from test_hil_bench import rig_file
from test_manual_runs import Run, assert_replays, started

from rig.cli.output import OK, STOPPED
from rig.config.yaml_source import load_mapping
from rig.realtime.safety import RUN, STOP_2
from rig.realtime.sequence import MANUAL, STANDBY, Phase
from rig.recording.journal import JOURNAL
from rig.recording.runs import open_run

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
BENCH = CONFIGS / "rigs" / "oswec_bench.yaml"
pytestmark = [pytest.mark.slow, pytest.mark.realtime]
paired = pytest.mark.paired
MANUAL_RUN = ("manual", "--realtime", "--unattended")
SESSION = """\
name: short
session: driveline
rig: rig.yaml
rows:
  - {amplitude_deg: 10, damping_n_m_s_per_rad: 62.5, period_s: 1}
  - {amplitude_deg: 5, damping_n_m_s_per_rad: 83.3, period_s: 1}
timing: {rise_s: 0.5, settle_periods: 1, periods: 3}
tare: {duration_s: 0.5}
"""
RIG = f"extends: {BENCH}\n"


def to_manual(run: Run) -> None:
    run.until(lambda row: row["plan.phase"] == STANDBY)
    run.must("arm")
    run.must("confirm")
    run.until(lambda row: row["plan.phase"] == MANUAL and row["safety.mode"] == RUN)


def in_force(run: Run, values: dict[str, float], **signal: Any) -> None:
    found = run.must("set", values=values, signal=signal)
    assert found["facts"]["in_force"]


def refused(run: Run, name: str, *parts: str, **given: Any) -> None:
    found = run.ask(name, **given)
    assert not found["accepted"]
    for each in parts:
        assert each in found["reason"], found


@paired
def test_a_manual_run_of_the_velocity_loop(tmp_path: Path) -> None:
    """Jog, brake, signal, hold, undo; the kept row passes the check and runs."""
    with started(tmp_path, *MANUAL_RUN, campaign=SESSION, rig_text=RIG) as run:
        to_manual(run)
        in_force(run, {"velocity_rad_per_s": 0.2})
        time.sleep(1.5)
        refused(run, "keep", "velocity_rad_per_s: 0.2; a row moves around zero", "a row is a sine")
        sine = {"kind": "sine", "amplitude_deg": 5.0, "frequency_hz": 0.5}
        refused(run, "set", "allowed 0 with a signal on the angle", signal=sine)
        brake = {"velocity_rad_per_s": 0.0, "damping_n_m_s_per_rad": 42.0}
        in_force(run, brake, **sine)
        time.sleep(3.0)
        kept = run.must("keep", comment="a good one")["facts"]["file"]
        in_force(run, {}, kind="step", amplitude_deg=0.0, amplitude_rad_per_s=0.1)
        run.must("hold")
        run.until(lambda row: row["safety.mode"] == STOP_2)
        run.must("resume")
        run.until(lambda row: row["safety.mode"] == RUN)
        assert run.must("undo")["facts"]["in_force"]
        time.sleep(0.5)
        run.must("finish")
        assert run.process.wait(40.0) == OK
        folder = run.folder
    assert_replays(folder)
    rows = open_run(folder, fields=["plan.live", "shaft.angle", "load.tz", "command.brake_current"])
    jogged = rows["shaft.angle"][rows["plan.live"] == 1]
    assert float(jogged[-1] - jogged[0]) == pytest.approx(0.2 * 1.5, abs=0.15)
    assert float(abs(rows["load.tz"][rows["plan.live"] == 2]).max()) > 5.0  # 42 times 0.27 rad/s
    assert "a good one" in Path(kept).read_text()
    assert rig("check", kept).returncode == OK
    found = rig("run", kept, "--runs", tmp_path / "kept", "--json")
    assert found.returncode == OK, found.stderr
    (row,) = json.loads(next((tmp_path / "kept").glob("*/plan.json")).read_text())["rows"]
    assert (row["amplitude_deg"], row["period_s"]) == (5.0, 2.0)
    assert row["damping_n_m_s_per_rad"] == 42.0


@paired
def test_a_manual_run_of_the_torque_loop(tmp_path: Path) -> None:
    with started(tmp_path, *MANUAL_RUN, "--drive", "torque", "--clamped", campaign=BENCH) as run:
        to_manual(run)
        in_force(run, {"torque_n_m": 20.0})
        time.sleep(1.5)
        refused(
            run, "set", "together 130", "120 N*m", signal={"kind": "step", "amplitude_n_m": 110}
        )
        in_force(run, {"torque_n_m": 0.0}, kind="sine", amplitude_n_m=30.0, frequency_hz=0.2)
        time.sleep(2.0)
        kept = run.must("keep")["facts"]["file"]
        run.must("finish")
        assert run.process.wait(40.0) == OK
        folder = run.folder
    assert_replays(folder)
    rows = open_run(folder, fields=["plan.live", "reference.torque", "command.torque"])
    torque = rows["command.torque"][rows["plan.live"] == 1]
    assert float(torque[-1]) == pytest.approx(20.0)
    assert float(abs(torque.diff("time")).max()) <= 20.0 / 500 * 1.001  # ramped in 0.5 s
    assert rig("check", kept).returncode == OK


def test_a_manual_run_on_emulated_devices(tmp_path: Path) -> None:
    with started(tmp_path, "manual", "--sim", "--unattended", campaign=rig_file(tmp_path)) as run:
        to_manual(run)
        in_force(run, {"velocity_rad_per_s": -0.2, "brake_current_a": 0.1})
        time.sleep(1.5)
        run.must("finish")
        assert run.process.wait(40.0) == OK
        folder = run.folder
    assert_replays(folder)
    rows = open_run(folder, fields=["plan.live", "safety.mode", "shaft.angle"])
    turned = rows["shaft.angle"][(rows["plan.live"] == 1) & (rows["safety.mode"] == RUN)]
    assert float(turned[-1] - turned[0]) == pytest.approx(-0.25, abs=0.15)


@paired
def test_without_an_operator_the_bench_holds_and_stops(tmp_path: Path) -> None:
    soon = f"{RIG}operator: {{dead_man_s: 1}}\n"
    with started(tmp_path, "manual", "--realtime", campaign=SESSION, rig_text=soon) as run:
        run.until(lambda row: row["plan.phase"] == STANDBY)
        run.must("take_seat")
        run.must("arm")
        run.must("confirm")
        run.must("leave_seat")
        assert run.process.wait(60.0) == STOPPED
        folder = run.folder
    entries = [json.loads(line) for line in (folder / JOURNAL).read_text().splitlines()]
    own = [each["request"] for each in entries if each["origin"] == "supervisor"]
    assert own == ["hold", "stop"]


def points(folder: Path) -> list[dict[str, float]]:
    """Return the result of each row."""
    found: list[dict[str, float]] = load_mapping(folder / "calibration.yaml")[0]["driveline"]
    return found


@paired
def test_manual_mode_within_a_session(tmp_path: Path) -> None:
    """The interrupted row starts over, and the results are those of a run without interruption."""
    (tmp_path / "a").mkdir()
    rig_text = f"{RIG}operator: {{dead_man_s: none}}\n"
    with started(tmp_path / "a", "run", "--realtime", campaign=SESSION, rig_text=rig_text) as run:
        run.until(lambda row: row["plan.row"] == 0 and row["plan.phase"] == Phase.MEASURE)
        time.sleep(0.5)
        run.must("hold")
        run.until(lambda row: row["safety.mode"] == STOP_2)
        run.must("manual")
        chosen = run.must("state")["set"]
        assert chosen["signal"]["kind"] == "sine"
        assert chosen["signal"]["amplitude_deg"] == 10.0
        assert chosen["values"]["damping_n_m_s_per_rad"] == 62.5
        run.must("resume")
        run.until(lambda row: row["plan.phase"] == MANUAL and row["safety.mode"] == RUN)
        in_force(run, {"angle_deg": 8.0}, amplitude_deg=2.0)
        time.sleep(1.0)
        run.must("hold")
        run.until(lambda row: row["safety.mode"] == STOP_2)
        run.must("campaign")
        run.must("resume")
        assert run.process.wait(90.0) == OK
        folder = run.folder
    assert_replays(folder)
    without = rig("run", tmp_path / "a" / "short.yaml", "--runs", tmp_path / "without")
    assert without.returncode == OK, without.stderr
    (reference,) = (tmp_path / "without").glob("*")
    for interrupted, each in zip(points(folder), points(reference), strict=True):
        # Scatter of three periods; a difference of two amplitudes of 10 deg has that of both.
        assert interrupted == pytest.approx(each, rel=0.03, abs=0.005)
