"""Sessions on the simulated bench: the plan, the two-pass correction, torque control, the command.

The runs are short; docs/explanation/plants.md has the results of complete sessions.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.kinds.oswec_bench.rehearsal.devices import connect
from rig.kinds.oswec_bench.rehearsal.job import plant_settings
from rig.kinds.oswec_bench.sessions.assemble import (
    bench_params,
    motor_radians_per_count,
    shaft_radians_per_count,
)
from rig.kinds.oswec_bench.sessions.check import check_session
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import plan_session
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.realtime import cycle
from rig.realtime.reasons import Reason
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import STOP_0
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

DT = 0.001
DEGREE = math.pi / 180.0
Rows = dict[int, dict[str, np.ndarray[Any, Any]]]


def load_session(folder: Path, **keys: Any) -> Session:
    """Return a session on the shipped bench; the default keys are those of a short driveline."""
    content = {
        "name": "test",
        "session": "driveline",
        "rig": str(CONFIGS / "rigs" / "oswec_bench.yaml"),
        "timing": {"rise_s": 1.5, "settle_periods": 0, "periods": 2},
        "tare": {"duration_s": 0.5},
        **keys,
    }
    report = check_session(write_yaml(folder / f"{content['name']}.yaml", content))
    assert report.ok, report.text()
    assert report.checked is not None
    return report.checked


def measure_rows(session: Session) -> Rows:
    """Run the loop's cycle without its processes; return every row's measurement as arrays."""
    plan = plan_session(session)
    params, step = bench_params(session, plan), cycle.make(KIND)
    devices = connect(plant_settings(session), DT)
    state, no_delay = cycle.start(KIND, params, 0), cycle.Timing(0.0, 0.0, 0)
    motor, shaft = motor_radians_per_count(session.rig), shaft_radians_per_count(session.rig)
    samples: dict[int, list[tuple[float, ...]]] = {}
    tick = 0
    while state.safety.mode != STOP_0:
        sense = devices.read(tick * DT)
        state, command, row = step(params, state, sense, NO_REQUEST, tick, no_delay, 1, DT)
        devices.write(command)
        if row.plan.phase == Phase.MEASURE:
            samples.setdefault(row.plan.row, []).append((
                row.reference.angle, row.correction.angle,
                row.encoders.motor_counts * motor, row.encoders.shaft_counts * shaft,
                row.load.tz - row.tared.torque, row.reference.torque,
                row.shaft.velocity, row.command.current,
            ))  # fmt: skip
        tick += 1
    assert state.safety.reason == Reason.PLAN_END, state.safety.reason
    names = (
        *("reference", "correction", "motor", "shaft"),
        *("torque", "torque_reference", "velocity", "current"),
    )
    return {
        number: dict(zip(names, np.array(values).T, strict=True))
        for number, values in samples.items()
    }


def detrended(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the values without mean and slope (the drift of whole periods)."""
    at = np.arange(values.size)
    return values - np.polyval(np.polyfit(at, values, 1), at)


def tracking_error(row: dict[str, np.ndarray[Any, Any]]) -> float:
    """Return the 95th percentile of reference less shaft (deg); shaft readings are a tick old."""
    error = detrended(row["reference"][:-1] - row["shaft"][1:])
    return float(np.percentile(np.abs(error), 95.0)) / DEGREE


def point(row: dict[str, np.ndarray[Any, Any]], settings: dict[str, float], number: int) -> Any:
    """Return a row's driveline point, from its fundamentals, as in a calibration file."""
    turn = np.exp(-2j * np.pi * np.arange(row["motor"].size) * DT / settings["period_s"])
    motor, shaft = (2.0 * np.mean(detrended(row[name]) * turn) for name in ("motor", "shaft"))
    return {
        "row": number,
        **settings,
        "rms_velocity_rad_per_s": float(row["velocity"].std()),
        "rms_torque_n_m": float(row["torque"].std()),
        "amplitude_difference_deg": float(abs(motor) - abs(shaft)) / DEGREE,
        "phase_shift_percent": float(np.angle(motor / shaft)) / (2.0 * math.pi) * 100.0,
    }


ROW_SETTINGS = [
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
    """Write the constants of uncorrected rows to files; return the folder and the rows."""
    folder = tmp_path_factory.mktemp("passes")
    header = {"name": "driveline", "rig": "OSWEC bench", "run": "r1", "date": "2026-11-22"}
    write_yaml(folder / "loop.yaml", header | {"constants": LOOP})
    rows = measure_rows(
        load_session(folder, name="plain", rows=ROW_SETTINGS, calibrations=["loop.yaml"])
    )
    points = [point(rows[i], settings, i) for i, settings in enumerate(ROW_SETTINGS)]
    shape = {"torque_n_m": [-95.0, -9.4, -1.0, 1.0, 9.4, 95.0]}
    shape["deflection_deg"] = [-0.253, -0.0808, -0.029, 0.029, 0.0808, 0.253]  # thesis, Fig. 2.9
    results = {"constants": LOOP, "driveline": points, "deflection_map": shape}
    write_yaml(folder / "driveline.yaml", header | results)
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
    """The regressions exclude the tested row; the uncorrected row had the same constants."""
    folder, plain = first_pass
    settings = {"name": "corrected", "rows": ROW_SETTINGS[:1], "correction": correction}
    rows = measure_rows(load_session(folder, **settings))
    before, after = tracking_error(plain[0]), tracking_error(rows[0])
    assert 0.15 < before < 0.3
    assert after <= 0.5 * before
    assert np.abs(rows[0]["correction"]).max() < 1.0 * DEGREE


def test_an_irregular_motion_is_corrected_component_by_component(
    first_pass: tuple[Path, Rows],
) -> None:
    folder, _ = first_pass
    keys: dict[str, Any] = {
        "irregular": {"low_hz": 0.4, "high_hz": 1.0, "repeat_s": 10, "seed": 3},
        "rows": [{"amplitude_deg": 15, "damping_n_m_s_per_rad": 83.3}],
        "timing": {"rise_s": 2.0, "settle_periods": 0, "periods": 1},
    }
    plain = load_session(folder, name="irregular", calibrations=["loop.yaml"], **keys)
    before = measure_rows(plain)[0]
    conditions = {
        "row": 0, "amplitude_deg": 15.0, "period_s": 10.0, "damping_n_m_s_per_rad": 83.3,
        "rms_velocity_rad_per_s": float(before["velocity"].std()),
        "rms_torque_n_m": float(before["torque"].std()),
        "amplitude_difference_deg": 0.0, "phase_shift_percent": 0.0,  # not used for conditions
    }  # fmt: skip
    header = {"name": "driveline", "rig": "OSWEC bench", "run": "r2", "date": "2026-11-22"}
    write_yaml(folder / "conditions.yaml", header | {"driveline": [conditions]})
    correction = {
        "kind": "online",
        "regressions": "driveline.yaml",
        "conditions": "conditions.yaml",
    }
    session = load_session(folder, name="irregular_online", correction=correction, **keys)
    parts = plan_session(session).setpoints[1].components
    assert len(parts.omega) == 7  # 0.4 .. 1 Hz
    assert len(set(parts.gain)) == len(set(parts.advance)) == 1
    assert parts.gain[0] > 1.0
    after = measure_rows(session)[0]
    assert np.abs(after["reference"]).max() == pytest.approx(15.0 * DEGREE, rel=0.01)
    assert tracking_error(after) <= 0.5 * tracking_error(before)


def test_closed_torque_loop_reduces_the_effect_of_wrong_constants(tmp_path: Path) -> None:
    """Compare rms of reference less load-cell torque; both loops use nominal constants."""
    errors = {}
    for control in ("open loop", "closed loop"):
        session = load_session(
            tmp_path,
            name="torque",
            session="torque_tracking",
            shaft="clamped",
            control=control,
            rows=[{"torque_amplitude_n_m": 40, "period_s": 5}],
            timing={"rise_s": 1, "settle_periods": 0, "periods": 1},
        )
        row = measure_rows(session)[0]
        error = row["torque_reference"][:-1] - row["torque"][1:]
        errors[control] = float(np.sqrt(np.mean(error**2)))
        assert np.abs(row["current"]).max() < 5.0
    assert errors["closed loop"] <= errors["open loop"] / 3.0
    assert errors["open loop"] > 0.5


def test_the_plan_of_table_2_1() -> None:
    report = check_session(CONFIGS / "sessions" / "driveline.yaml")
    assert report.checked is not None
    assert report.plan is not None
    rows, plan = report.plan.rows, report.plan
    assert [(r.values["amplitude_deg"], r.values["damping_n_m_s_per_rad"]) for r in rows][-4:] == [
        (15.0, 104.0), (20.0, 42.0), (20.0, 62.5), (20.0, 104.0),
    ]  # fmt: skip
    assert len(rows) == 15
    assert {r.periods for r in rows} == {26}
    assert plan.phases["measure"] == pytest.approx(15 * 26 * 1.5)
    first = plan.segments.row.index(0)
    phases = [Phase(p).name for p in plan.segments.phase[first : first + 4]]
    assert phases == ["MOVING", "SETTLE", "MEASURE", "TAIL"]
    assert plan.segments.waves[first : first + 4] == (0, 1, 1, 1)
    assert set(plan.segments.restart[first : first + 4]) == {first}
    (one,) = zip(*plan.setpoints[plan.segments.setpoint[first]].components, strict=True)
    assert one == (5.0 * DEGREE, pytest.approx(2.0 * math.pi / 1.5), 0.0, 1.0, 0.0)


def test_the_command_runs_a_session_and_writes_its_record(tmp_path: Path) -> None:
    """The session has few rows: the test is of the way from the file to the folder."""
    rows = [dict(settings, period_s=0.75) for settings in ROW_SETTINGS[:1]]
    content = {
        "name": "short",
        "session": "driveline",
        "rig": str(CONFIGS / "rigs" / "oswec_bench.yaml"),
        "rows": rows,
        "timing": {"rise_s": 0.75, "settle_periods": 0, "periods": 2},
        "tare": {"duration_s": 0.5},
    }
    path = write_yaml(tmp_path / "short.yaml", content)
    code, out, _ = rig_here("check", path)
    assert code == 0
    assert "velocity loop, sine, correction: none" in out
    code, out, _ = rig_here("bench", path, "--runs", tmp_path, "--json")
    assert code == 0, out
    printed = json.loads(out)
    assert (printed["status"], printed["reason"]) == ("complete", "PLAN_END")
    folder = Path(printed["folder"])
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
