"""Sessions on the simulated bench: the plan, the two-pass correction, torque control, the command.

The runs are short; what a whole session gives is in docs/bench.md.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, yaml_file
from rig_command import rig_here

from rig.execution.rehearsal.bench_devices import connect
from rig.execution.rehearsal.bench_job import devices_of_session
from rig.kinds.oswec_bench import KIND
from rig.planning.session import Session, check_session, plan_session
from rig.planning.session.assemble import (
    bench_params,
    motor_radians_per_count,
    shaft_radians_per_count,
)
from rig.realtime import cycle
from rig.realtime.safety import STOP_0, Reason
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

DT = 0.001
DEGREE = math.pi / 180.0
Rows = dict[int, dict[str, np.ndarray[Any, Any]]]


def session_of(folder: Path, **keys: Any) -> Session:
    """A session on the shipped bench; what is not given is that of a short driveline."""
    whole = {
        "name": "test",
        "session": "driveline",
        "rig": str(CONFIGS / "rigs" / "oswec_bench.yaml"),
        "timing": {"rise_s": 1.5, "settle_periods": 0, "periods": 2},
        "tare": {"duration_s": 0.5},
        **keys,
    }
    report = check_session(yaml_file(folder / f"{whole['name']}.yaml", whole))
    assert report.ok, report.text()
    assert report.session is not None
    return report.session


def measured(session: Session) -> Rows:
    """Every row's measurement, as arrays; the loop's own cycle, without its processes."""
    plan = plan_session(session)
    params, step = bench_params(session, plan), cycle.make(KIND)
    devices = connect(devices_of_session(session), DT)
    state, still = cycle.start(KIND, params, 0), cycle.Timing(0.0, 0.0, 0)
    motor, shaft = motor_radians_per_count(session.rig), shaft_radians_per_count(session.rig)
    kept: dict[int, list[tuple[float, ...]]] = {}
    tick = 0
    while state.safety.mode != STOP_0:
        sense = devices.read(tick * DT)
        state, command, row = step(params, state, sense, 0, tick, still, 1, DT)
        devices.write(command)
        if row.plan.phase == Phase.MEASURE:
            kept.setdefault(row.plan.row, []).append((
                row.reference.angle, row.correction.angle,
                row.encoders.motor_counts * motor, row.encoders.shaft_counts * shaft,
                row.load.tz - row.tared.torque, row.reference.torque,
                row.shaft.velocity, row.command.current,
            ))  # fmt: skip
        tick += 1
    assert state.safety.reason == Reason.PLAN_END, Reason(state.safety.reason)
    names = ("wanted", "added", "motor", "shaft", "torque", "pull", "velocity", "current")
    return {
        number: dict(zip(names, np.array(values).T, strict=True)) for number, values in kept.items()
    }


def detrended(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Without its mean and its slope (the drift of whole periods)."""
    at = np.arange(values.size)
    return values - np.polyval(np.polyfit(at, values, 1), at)


def astray(row: dict[str, np.ndarray[Any, Any]]) -> float:
    """95th percentile of reference less shaft, deg; the shaft's reading is a tick old."""
    error = detrended(row["wanted"][:-1] - row["shaft"][1:])
    return float(np.percentile(np.abs(error), 95.0)) / DEGREE


def point(row: dict[str, np.ndarray[Any, Any]], asked: dict[str, float], number: int) -> Any:
    """What a row says of the driveline, by fundamentals, as a calibration file has it."""
    turn = np.exp(-2j * np.pi * np.arange(row["motor"].size) * DT / asked["period_s"])
    motor, shaft = (2.0 * np.mean(detrended(row[name]) * turn) for name in ("motor", "shaft"))
    return {
        "row": number,
        **asked,
        "rms_velocity_rad_per_s": float(row["velocity"].std()),
        "rms_torque_n_m": float(row["torque"].std()),
        "amplitude_difference_deg": float(abs(motor) - abs(shaft)) / DEGREE,
        "phase_shift_percent": float(np.angle(motor / shaft)) / (2.0 * math.pi) * 100.0,
    }


ASKED = [
    {"amplitude_deg": float(a), "damping_n_m_s_per_rad": float(r), "period_s": 1.5}
    for a, r in ((15, 83.3), (10, 62.5), (15, 42), (20, 104))
]
# As a driveline session finds them on the simulated bench (plants/oswec_bench.yaml).
LOOP = {
    "velocity_constant_loaded": {"value": 1.535, "unit": "rad/s/V", "uncertainty": 0.001},
    "velocity_loop_lag": {"value": 0.001, "unit": "s", "uncertainty": 0.0002},
}


@pytest.fixture(scope="module")
def first_pass(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Rows]:
    """Uncorrected rows, and the file of constants made of them."""
    folder = tmp_path_factory.mktemp("passes")
    known = {"name": "driveline", "rig": "OSWEC bench", "run": "r1", "date": "2026-11-22"}
    yaml_file(folder / "loop.yaml", known | {"constants": LOOP})
    rows = measured(session_of(folder, name="plain", rows=ASKED, calibrations=["loop.yaml"]))
    points = [point(rows[i], asked, i) for i, asked in enumerate(ASKED)]
    shape = {"torque_n_m": [-95.0, -9.4, -1.0, 1.0, 9.4, 95.0]}
    shape["deflection_deg"] = [-0.253, -0.0808, -0.029, 0.029, 0.0808, 0.253]  # thesis, Fig. 2.9
    found = {"constants": LOOP, "driveline": points, "deflection_map": shape}
    yaml_file(folder / "driveline.yaml", known | found)
    return folder, rows


@pytest.mark.parametrize(
    "correction",
    [
        {"kind": "online", "regressions": "driveline.yaml"},
        {"kind": "instantaneous", "map": "driveline.yaml"},
    ],
    ids=lambda one: one["kind"],
)
def test_a_corrected_shaft_is_half_as_far_from_its_reference(
    first_pass: tuple[Path, Rows], correction: dict[str, str]
) -> None:
    """Regressions without the judged row; the uncorrected row had the same constants."""
    folder, plain = first_pass
    asked = {"name": "corrected", "rows": ASKED[:1], "correction": correction}
    rows = measured(session_of(folder, **asked))
    before, after = astray(plain[0]), astray(rows[0])
    assert 0.15 < before < 0.3
    assert after <= 0.5 * before
    assert np.abs(rows[0]["added"]).max() < 1.0 * DEGREE


def test_an_irregular_motion_is_corrected_component_by_component(
    first_pass: tuple[Path, Rows],
) -> None:
    folder, _ = first_pass
    told: dict[str, Any] = {
        "irregular": {"low_hz": 0.4, "high_hz": 1.0, "repeat_s": 10, "seed": 3},
        "rows": [{"amplitude_deg": 15, "damping_n_m_s_per_rad": 83.3}],
        "timing": {"rise_s": 2.0, "settle_periods": 0, "periods": 1},
    }
    plain = session_of(folder, name="irregular", calibrations=["loop.yaml"], **told)
    before = measured(plain)[0]
    conditions = {
        "row": 0, "amplitude_deg": 15.0, "period_s": 10.0, "damping_n_m_s_per_rad": 83.3,
        "rms_velocity_rad_per_s": float(before["velocity"].std()),
        "rms_torque_n_m": float(before["torque"].std()),
        "amplitude_difference_deg": 0.0, "phase_shift_percent": 0.0,  # not used of conditions
    }  # fmt: skip
    known = {"name": "driveline", "rig": "OSWEC bench", "run": "r2", "date": "2026-11-22"}
    yaml_file(folder / "conditions.yaml", known | {"driveline": [conditions]})
    correction = {
        "kind": "online",
        "regressions": "driveline.yaml",
        "conditions": "conditions.yaml",
    }
    session = session_of(folder, name="irregular_online", correction=correction, **told)
    parts = plan_session(session).setpoints.components[1]
    assert len(parts) == 7  # 0.4 .. 1 Hz
    assert len({one.gain for one in parts}) == len({one.advance for one in parts}) == 1
    assert parts[0].gain > 1.0
    after = measured(session)[0]
    assert np.abs(after["wanted"]).max() == pytest.approx(15.0 * DEGREE, rel=0.01)
    assert astray(after) <= 0.5 * astray(before)


def test_closing_the_torque_loop_makes_the_spread_of_constants_matter_less(tmp_path: Path) -> None:
    """rms of wanted less measured torque on the load cell, both loops by nominal constants."""
    errors = {}
    for control in ("open loop", "closed loop"):
        session = session_of(
            tmp_path,
            name="torque",
            session="torque_tracking",
            shaft="clamped",
            control=control,
            rows=[{"torque_amplitude_n_m": 40, "period_s": 5}],
            timing={"rise_s": 1, "settle_periods": 0, "periods": 1},
        )
        row = measured(session)[0]
        errors[control] = float(np.sqrt(np.mean((row["pull"][:-1] - row["torque"][1:]) ** 2)))
        assert np.abs(row["current"]).max() < 5.0
    assert errors["closed loop"] <= errors["open loop"] / 3.0
    assert errors["open loop"] > 0.5


def test_the_plan_of_table_2_1() -> None:
    report = check_session(CONFIGS / "sessions" / "driveline.yaml")
    assert report.session is not None
    assert report.plan is not None
    rows, plan = report.plan.rows, report.plan
    assert [(r.values["amplitude_deg"], r.values["damping_n_m_s_per_rad"]) for r in rows][-4:] == [
        (15.0, 104.0), (20.0, 42.0), (20.0, 62.5), (20.0, 104.0),
    ]  # fmt: skip
    assert len(rows) == 15
    assert {r.periods for r in rows} == {26}
    assert plan.phases.measure == pytest.approx(15 * 26 * 1.5)
    first = plan.segments.row.index(0)
    phases = [Phase(p).name for p in plan.segments.phase[first : first + 4]]
    assert phases == ["MOVING", "SETTLE", "MEASURE", "TAIL"]
    assert plan.segments.waves[first : first + 4] == (0, 1, 1, 1)
    assert set(plan.segments.restart[first : first + 4]) == {first}
    (one,) = plan.setpoints.components[plan.segments.setpoint[first]]
    assert one == (5.0 * DEGREE, pytest.approx(2.0 * math.pi / 1.5), 0.0, 1.0, 0.0)


def test_the_command_runs_a_session_and_leaves_its_record(tmp_path: Path) -> None:
    """Few rows: what is tested is the way from the file to the folder."""
    rows = [dict(asked, period_s=0.75) for asked in ASKED[:1]]
    whole = {
        "name": "short",
        "session": "driveline",
        "rig": str(CONFIGS / "rigs" / "oswec_bench.yaml"),
        "rows": rows,
        "timing": {"rise_s": 0.75, "settle_periods": 0, "periods": 2},
        "tare": {"duration_s": 0.5},
    }
    path = yaml_file(tmp_path / "short.yaml", whole)
    code, out, _ = rig_here("check", path)
    assert code == 0
    assert "velocity loop, sine, correction: none" in out
    code, out, _ = rig_here("bench", path, "--runs", tmp_path, "--json")
    assert code == 0, out
    told = json.loads(out)
    assert (told["status"], told["reason"]) == ("complete", "PLAN_END")
    folder = Path(told["folder"])
    assert json.loads((folder / "config.json").read_text())["session"]["session"] == "driveline"
    plan = json.loads((folder / "plan.json").read_text())
    assert plan["rows"][0]["amplitude_deg"] == 15.0
    assert plan["scales"]["shaft_rad_per_count"] == pytest.approx(2.0 * math.pi / 2**19)
    data = open_run(folder, fields=["shaft.angle", "command.brake_current"], rows=[0])
    assert data["shaft.angle"].attrs["units"] == "rad"
    path.write_text(path.read_text().replace("driveline", "drive"))
    code, out, _ = rig_here("bench", path, "--runs", tmp_path, "--json")
    assert code == 2
    assert json.loads(out)["problems"][0]["key"] == "session"
