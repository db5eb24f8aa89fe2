"""A rig whose spring is tuned by an axis out of the water: check, rehearsal, sweep, replay."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from command_here import rig as rig_here
from mode_plants import DRIVE, HEAVE
from modular_rigs import (
    HEAVE as AXIS,
)
from modular_rigs import (
    HEAVE_LIMITS,
    STATIONS,
    limits_mapping,
    plant_mapping,
    rig_mapping,
    write_campaign,
)

from rig.analysis.rows import row_table
from rig.realtime.sequence import MEASURE
from rig.recording.runs import open_run

RADIUS, POSITIONS, RATES = 0.33, [-0.5, 0.0, 0.5], [5000.0, 400.0, -6000.0]
GEAR = 60.0  # rad/m, of a screw
GOALS = (-0.3, 0.3)
SENSORS = {
    "pto_force": {"signal": "heave.motor_force"},
    "dc_power": {"signal": "heave.electric_power"},
    "spring": {"signal": "heave.spring_force"},
    "stator": {"signal": "heave.stator_force"},
}


def plant() -> dict[str, Any]:
    """Return the plant of a hull and a slide on a screw, which friction holds without a drive."""
    axes = {
        "slide": {
            "moves_with": {"slide": 1.0}, "inertia": 300.0, "viscous_friction": 2000.0,
            "coulomb_friction": 400.0, "gear_ratio": GEAR,
        },
        "heave": {
            "moves_with": {"heave": 1.0}, "drive": {**DRIVE, "enable_delay_s": 0.01},
            "spring": {"rate": 1500.0},
            "magnetic_spring": {
                "pinion_radius": RADIUS, "stator": "slide", "pull": 1.0,
                "stator_positions": POSITIONS,
                "rates": {"value": RATES, "unit": "N/m", "source": "measured"},
            },
        },
    }  # fmt: skip
    modes = {"slide": {"mass": 30.0}, "heave": HEAVE}
    given = plant_mapping(modes=modes, sensors=SENSORS)
    axes = {name: {**given["axes"]["heave"], **axis} for name, axis in axes.items()}
    return given | {"axes": axes}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    force = {"unit": "N", "range": [-5000, 5000], "age_limit_s": 0.1}
    power = {"unit": "W", "range": [-20000, 20000], "age_limit_s": 0.5}
    kinds = {"pto_force": force, "dc_power": power, "spring": force, "stator": force}
    rig = rig_mapping(
        axes={"heave": AXIS, "slide": AXIS | {"gear_ratio_rad_per_m": GEAR, "gain_ramp_s": 0.5}},
        sensors=kinds,
        stations=STATIONS,
    )
    hold = {
        "use": "positioning", "hold_stiffness_n_per_m": 2e5, "hold_damping_n_s_per_m": 3000,
        "speed_m_per_s": 0.1,
    }  # fmt: skip
    return write_campaign(
        tmp_path_factory.mktemp("springs"),
        rig,
        limits_mapping(heave=HEAVE_LIMITS, slide=HEAVE_LIMITS),
        plant(),
        sea={"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.4},
        tare={"duration_s": 0.5},
        start={"lead_in_s": 8},
        timing={"settle_s": 10, "interval_s": 20},
        law={"heave": "impedance", "slide": hold},
        matrix={
            "list": [
                {"heave_kp_n_s_per_m": -3000, "heave_ki_n_per_m": 0, "slide_goal_m": goal}
                for goal in GOALS
            ]
        },
    )


@pytest.fixture(scope="module")
def run(campaign: Path) -> Path:
    """Return the folder of a rehearsal."""
    report = run_rig("check", campaign)
    assert (report["ok"], report["warnings"]) == (True, [])
    done = run_rig("run", campaign, "--runs", campaign.parent / "runs")
    assert (done["status"], done["reason"]) == ("complete", "PLAN_END")
    return Path(done["folder"])


def run_rig(*arguments: object) -> Any:
    """Return the JSON of a command that succeeds."""
    done = rig_here(*arguments, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_the_stator_sets_the_rate_of_the_spring(run: Path) -> None:
    """Both goals are held within friction and stator force by the stiffness, 4 mm; the forces are
    those of the table there, but for the age of a reading; the slide's drive bears the stator.
    """
    log = open_run(run)
    for row, goal in enumerate(GOALS):
        of_row = (log["plan.row"] == row) & (log["plan.phase"] == MEASURE)
        heave, slide, spring, stator, current = (
            np.asarray(log[name])[of_row]
            for name in (
                "heave.estimate.position", "slide.estimate.position", "spring.value",
                "stator.value", "slide.sense.current",
            )
        )  # fmt: skip
        assert np.abs(slide - goal).max() < 0.006
        rate, turn = np.interp(slide, POSITIONS, RATES), 2.0 * heave / RADIUS
        force = -1500.0 * heave - 0.5 * RADIUS * rate * np.sin(turn)
        assert np.ptp(force) > 80.0
        assert np.abs(spring - force).max() < 0.03 * np.ptp(force)
        gradient = RADIUS**2 / 2.0 * np.diff(RATES)[int(goal > 0.0)] / 0.5
        expected = 0.5 * gradient * np.cos(turn) - RADIUS**2 / 2.0 * np.abs(rate)
        assert np.abs(stator - expected).max() < 0.01 * np.abs(expected).max()
        drive_force = -1.5 * GEAR * current.mean()
        assert drive_force == pytest.approx(stator.mean(), abs=400.0)  # friction bears the rest


@pytest.mark.slow
def test_a_sweep_has_the_rows_of_the_run(campaign: Path, run: Path) -> None:
    swept = run_rig("sweep", campaign, "--sequential", "--sweeps", campaign.parent / "sweeps")
    logged = row_table(run)
    with xarray.load_dataset(swept["result"]) as rows:
        for name in ("power_mechanical", "power_dc", "stroke", "velocity_rms"):
            assert rows[name].values.tobytes() == logged[name].values.tobytes(), name
        power = rows["power_mechanical"].values
    assert abs(power[1] - power[0]) > 0.02 * abs(power[0])
    rates = "plant.axes.heave.spring.rate"
    options = ("--over", f"{rates}=1500,-4000", "--sweeps", campaign.parent / "sweeps")
    with xarray.load_dataset(run_rig("sweep", campaign, *options)["result"]) as rows:
        assert rows["stroke"].dims == (rates, "row")
        stroke = rows["stroke"].values
    assert np.all(np.abs(stroke[1] - stroke[0]) > 0.02 * stroke[0])


@pytest.mark.slow
def test_a_replay_repeats_the_run(run: Path) -> None:
    assert run_rig("replay", run)["same"] is True
