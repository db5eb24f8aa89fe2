"""Exports for the scripts of the MASK4 test: their steps in GNU Octave give our own numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from octave import run_octave
from scipy.io import loadmat
from synthetic_runs import (
    POWERS,
    Row,
    Shape,
    measured,
    phase_block,
    plan_json,
    stamped,
    write_run,
)

from rig.analysis.rows import row_table
from rig.identification.identify import identify
from rig.kinds.wavebot.mask4.export import export_structure
from rig.kinds.wavebot.spring_map.passes import FIT_HALF_ANGLE
from rig.kinds.wavebot.spring_map.result import spring_map
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import RunError

HERE = Path(__file__).resolve().parent
GOLDEN = HERE.parent / "batch" / "golden"
SHAPE = Shape(dt=0.005, lead_in=1000, settle=1000, periods=5, tail=1000, noise=5.0)
TIMING = (2.0, 20.0, 5.0, 5.0)  # s: T_rep, dT, dead time; NReps
INTERVAL = 4000  # samples of a row
POWER_COLUMNS = ("dc", "ac", "mechanical_1_demeaned", "mechanical_2_demeaned")


def make_rows(count: int = 4) -> list[Row]:
    """Return rows of which the second half has another spring rate."""
    return [
        Row(i, 0, 490.9 if 2 * i < count else -5715.0, -1000.0 - 500.0 * i, 100.0 * i,
            dict(zip(POWERS, (-60.0 - i, -50.0, -40.0 + i, -20.0 + 3.0 * i), strict=True)))
        for i in range(count)
    ]  # fmt: skip


def run_data(rows: Sequence[Row], shape: Shape = SHAPE, moving: int = 777) -> Any:
    """Return the ticks of a run; the stator moves for ``moving`` ticks, which is no interval."""
    random = np.random.default_rng(shape.seed)
    pieces = [phase_block(shape.lead_in, NO_ROW, Phase.LEAD_IN)]
    for i, row in enumerate(rows):
        if i and row.spring_rate != rows[i - 1].spring_rate:
            pieces.append(phase_block(moving, i, Phase.MOVING, row))
        pieces += [
            phase_block(shape.settle, i, Phase.SETTLE, row),
            measured(i, row, shape, random),
            phase_block(shape.tail, i, Phase.TAIL, row),
        ]
    done = phase_block(300, NO_ROW, Phase.DONE)
    done["safety.mode"], done["safety.reason"] = Mode.STOP_1, Reason.PLAN_END
    data = stamped(np.concatenate([*pieces, done]), shape.dt)
    # Between the rows, signals that would change every mean.
    outside = data["plan.phase"] != Phase.MEASURE
    data["power.dc"][outside] = data["load.lcb"][outside] = 1e6
    return data


def write(folder: Path, data: Any, rows: Sequence[Row], **plan: Any) -> Path:
    return write_run(folder / "run", data, plan_json(list(rows), SHAPE) | plan)


def export(run: Path, *options: object) -> Path:
    """Export a run for the scripts and return the file."""
    process = rig("export", run, "--as", "mat", "--for-scripts", *options, "--json")
    assert process.returncode == 0, process.stderr
    return Path(json.loads(process.stdout)["written"])


def remarks(run: Path) -> list[str]:
    """Return the remarks of an export, without the last one: the constants for the scripts."""
    return list(export_structure(run, for_scripts=True).remarks)


def powers_in_octave(mat: Path, timing: tuple[float, ...] = TIMING) -> np.ndarray:
    return run_octave(HERE / "mask4_powers.m", mat, *timing)


def stopped(data: Any, at: int) -> Any:
    """Return the data of a run that an operator stopped in tick ``at``."""
    cut = data[: at + 200].copy()
    cut["plan.row"][at:], cut["plan.phase"][at:] = NO_ROW, Phase.DONE
    cut["safety.mode"][at:], cut["safety.reason"][at:] = Mode.STOP_1, Reason.OPERATOR_STOP
    return cut


def window(data: Any, row: int) -> Any:
    return np.flatnonzero((data["plan.row"] == row) & (data["plan.phase"] == Phase.MEASURE))


# Runs and options that do not suit.


def test_a_run_without_rows_is_refused(tmp_path: Path) -> None:
    """The scripts would find no sample with runCounter 1."""
    path = tmp_path / "x.mat"
    process = rig("export", GOLDEN / "calibration.mcap", "--as", "mat", "--for-scripts", "-o", path)
    assert process.returncode == 2
    assert "no completely measured row for the scripts of the test" in process.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_ended_in_its_first_row_is_refused_with_the_reason(tmp_path: Path) -> None:
    rows = make_rows()
    data = run_data(rows)
    run = write(tmp_path, stopped(data, window(data, 0)[900]), rows)
    with pytest.raises(RunError, match="row 0 is left out: run stopped: OPERATOR_STOP"):
        export_structure(run, for_scripts=True)
    assert export_structure(run).remarks  # without the switch the file has what there is


def test_an_aborted_run_ends_after_its_last_complete_row(tmp_path: Path) -> None:
    rows = make_rows()
    data = run_data(rows)
    run = write(tmp_path, stopped(data, window(data, 2)[900]), rows)
    found = powers_in_octave(export(run))
    assert found[:, 0].tolist() == [-1000.0, -1500.0]
    assert remarks(run)[0] == "row 2 is left out: run stopped: OPERATOR_STOP"


def test_a_record_that_breaks_off_with_a_row_has_an_end_mark_nevertheless(tmp_path: Path) -> None:
    rows = make_rows(2)
    data = run_data(rows)
    last = np.flatnonzero(data["plan.phase"] == Phase.TAIL)[-1]
    run = write_run(tmp_path / "run", data[: last + 1], plan_json(rows, SHAPE), finish=False)
    assert len(powers_in_octave(export(run, "-o", tmp_path / "x.mat"))) == 2


def test_nan_is_kept_and_reported(tmp_path: Path) -> None:
    """A mean over them would be one of other times; the scripts give NaN."""
    rows = make_rows()
    data = run_data(rows)
    data["power.dc"][window(data, 1)[100:103]] = np.nan
    run = write(tmp_path, data, rows)
    assert remarks(run)[-1] == "power.dc is NaN in 3 samples of rows 1, and so will be results"
    found = powers_in_octave(export(run))
    assert np.isnan(found[:, 9]).tolist() == [False, True, False, False]
    assert np.isfinite(found[:, 10:]).all()


def test_rows_with_lost_ticks_and_of_another_length_are_left_out(tmp_path: Path) -> None:
    rows = make_rows(5)
    data = run_data(rows)
    tail = np.flatnonzero((data["plan.row"] == 3) & (data["plan.phase"] == Phase.TAIL))
    data = stamped(np.delete(data, tail[400:]), SHAPE.dt)  # somebody skipped the rest of the row
    data = np.delete(data, window(data, 1)[500:520])
    run = write(tmp_path, data, rows)
    reasons = [text for text in remarks(run) if "left out" in text]
    assert reasons == [
        "row 1 is left out: 20 of 2000 ticks missing from the record",
        "row 3 is left out: it has 3400 samples, 1000 of them to settle, others 4000 and 1000",
    ]
    assert powers_in_octave(export(run))[:, 0].tolist() == [-1000.0, -2000.0, -3000.0]


def test_ticks_that_the_loop_skipped_are_nan(tmp_path: Path) -> None:
    """A run at the rate of the file has no other tick in their place."""
    rows = make_rows()
    data = run_data(rows)
    missing = window(data, 2)[700]
    data["timing.skipped"][missing:] = 1
    run = write(tmp_path, np.delete(data, missing), rows)
    assert "the record lacks 1 of 16000 samples of rows: NaN" in remarks(run)
    speed = export_structure(run, for_scripts=True).buses["heaveSignals"]["heaveEncVel_m_s"]
    assert np.isnan(speed[24000 + 2 * INTERVAL + 1000 + 700, 0])
    assert np.isnan(speed[24000:]).sum() == 1


@pytest.mark.parametrize(
    ("run", "options", "message"),
    [
        ("cots", ("--as", "csv"), "signals for scripts work with mat only"),
        ("cots", ("--as", "netcdf"), "signals for scripts work with mat only"),
        ("cots", ("--as", "mat", "--rate", "100"), "100 Hz, but the scripts of the test count"),
        ("bench_flap", ("--as", "mat"), "no MASK4 structure without drive_command.settings."),
        ("modular", ("--as", "mat"), "no MASK4 structure without"),
    ],
)
def test_options_that_do_not_suit_are_refused(
    tmp_path: Path, run: str, options: tuple[str, ...], message: str
) -> None:
    path = tmp_path / "x"
    process = rig("export", GOLDEN / f"{run}.mcap", *options, "--for-scripts", "-o", path)
    assert process.returncode == 2
    assert message in process.stderr
    assert not path.exists()


# What the scripts find.


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four rows with a move of the stator, after a lead-in that is too short for the scripts."""
    rows = make_rows()
    return write(tmp_path_factory.mktemp("scripts"), run_data(rows), rows)


def test_power_surfaces_of_the_scripts_are_those_of_the_row_table(run: Path) -> None:
    found, table = powers_in_octave(export(run)), row_table(run)
    assert found[:, 0].tolist() == table["kp"].values.tolist()
    assert found[:, 1].tolist() == table["ki"].values.tolist()
    assert np.allclose(found[:, 2], table["spring_rate"], rtol=1e-12)
    own = np.stack([table[f"power_{name}"].values for name in POWER_COLUMNS], axis=1)
    assert np.allclose(found[:, 9:], own, rtol=1e-9)
    # Their window has one sample more, which begins the tail: here a power of 1 MW.
    samples = table["samples"].values
    assert np.allclose(found[:, 3], (samples * own[:, 0] + 1e6) / (samples + 1), rtol=1e-9)
    assert np.allclose(found[:, 7], table["stator_force_min"])
    assert np.allclose(found[:, 8], -table["slew_force_mean"])


@pytest.mark.parametrize("drive", ["cots", "custom"])
def test_recorded_rows_of_both_drives(drive: str, tmp_path: Path) -> None:
    run = GOLDEN / f"{drive}.mcap"
    found = powers_in_octave(export(run, "-o", tmp_path / "x.mat"), (1.0, 1.5, 0.5, 1.0))
    own = np.stack([row_table(run)[f"power_{name}"].values for name in POWER_COLUMNS], axis=1)
    assert np.allclose(found[:, 9:], own, rtol=1e-9)


def test_irregular_rows_last_to_the_end_of_their_interval(tmp_path: Path) -> None:
    shape = SHAPE._replace(periods=1, irregular_repeat=30.0, tail=0)
    rows = make_rows()
    plan = plan_json(rows, shape)
    run = write_run(tmp_path / "run", run_data(rows, shape), plan)
    assert remarks(run)[-1] == "makePowerSurfaces.m: dT = 35; deadSamps = 5*200"
    found = powers_in_octave(export(run), (0.0, 35.0, 5.0, 0.0))
    table = row_table(run)
    own = np.stack([table[f"power_{name}"].values for name in POWER_COLUMNS], axis=1)
    assert np.allclose(found[:, 9:], own, rtol=1e-9)


def test_impedances_of_the_scripts_are_ours(tmp_path: Path) -> None:
    """Within 0.05 %: the file has the estimated position, ours are by the encoder's counts."""
    run = GOLDEN / "open_loop.mcap"
    mat = export(run, "-o", tmp_path / "x.mat")
    assert "T_nom = 2; N_per = 1; ssTime = 10; runCounter 1 .. 2 are rows 0, 1" in remarks(run)[-1]
    models = {model.peak: model for model in identify([run]).models}
    assert len(models) == 2  # realisations of different peaks, so that ours does not combine them
    found_by_peak = {}
    for counter in (1, 2):
        found = run_octave(HERE / "mask4_impedance.m", mat, 2, 1, 10, counter)
        assert found[:, 0].tolist() == [0.5, 1.0]
        shaft, body = (found[:, i] + 1j * found[:, i + 1] for i in (5, 7))
        (peak,) = (
            peak
            for peak, model in models.items()
            if np.allclose(model.responses["Z_i"].value[:2], body, rtol=5e-4)
        )
        assert np.allclose(models[peak].responses["Z_id"].value[:2], shaft, rtol=5e-4)
        found_by_peak[peak] = body
    assert len(found_by_peak) == 2


def test_two_realisations_give_the_impedance_by_which_they_were_made(tmp_path: Path) -> None:
    """Two phase realisations of a multisine, least squares: closed form to rounding."""
    period, dt = 20.0, 0.005
    n = round(period / dt)
    frequency = np.arange(4, 21) / period
    omega = 2.0 * np.pi * frequency
    z_body = 1500.0 * 1j * omega + 1200.0 + 24000.0 / (1j * omega)
    z_shaft = z_body + 700.0 - 6000.0 / (1j * omega)
    random = np.random.default_rng(3)
    rows = [Row(i, 0, 490.9, 0.0, 0.0, dict.fromkeys(POWERS, 0.0)) for i in range(2)]
    pieces = [phase_block(100, NO_ROW, Phase.LEAD_IN)]
    for i, row in enumerate(rows):
        wave = 0.01 * np.exp(2j * np.pi * random.random(len(omega)))  # m, of position
        t = dt * np.arange(4 * n)
        turning = np.exp(1j * np.outer(omega, t))
        block = np.concatenate(
            [phase_block(2 * n, i, Phase.SETTLE, row), phase_block(2 * n, i, Phase.MEASURE, row)]
        )
        for name, line in (
            ("heave.estimate.position", wave),
            ("load.lcb", z_body * 1j * omega * wave),
            ("load.trs", z_shaft * 1j * omega * wave),
        ):
            block[name] = (line @ turning).real
        pieces.append(block)
    data = stamped(np.concatenate([*pieces, phase_block(20, NO_ROW, Phase.DONE)]), dt)
    data["safety.reason"][-20:] = Reason.PLAN_END
    run = write(tmp_path, data, rows, reference={"axis": "heave", "period_s": period})
    found = run_octave(HERE / "mask4_impedance.m", export(run), period, 2, 10, 1, 2)
    assert np.allclose(found[:, 0], frequency)
    assert np.allclose(found[:, 5] + 1j * found[:, 6], z_shaft, rtol=1e-9)
    assert np.allclose(found[:, 7] + 1j * found[:, 8], z_body, rtol=1e-9)


def hoisted(stations: dict[float, float], dt: float = 0.005) -> Any:
    """Return the ticks of a hoist run past stator positions (%) with spring rates (N/m)."""
    lever, slew_lever, speed = 0.33047, 0.254, 0.2  # m/rad, m, rad/s
    half = np.arange(-0.9, 0.9, speed * dt)  # rad
    angle = np.concatenate([half, -half])
    pieces = [phase_block(200, NO_ROW, Phase.TARE)]
    for i, (station, rate) in enumerate(stations.items()):
        moving = phase_block(400, i, Phase.MOVING)
        moving["load.slew"], moving["spring_sense.position"] = 5e3, station + 80.0
        block = phase_block(len(angle), i, Phase.MEASURE)
        peak = rate * lever * lever / 1.649  # N m; physics: T = Tp sin 2 theta
        block["load.rotor_angle"] = angle
        block["heave.estimate.velocity"] = np.where(np.arange(len(angle)) < len(half), 1, -1) * 0.05
        block["load.slew"] = peak * np.sin(2.0 * angle) / slew_lever + 8.0
        block["load.stator_a"] = 900.0
        block["spring_sense.position"] = station
        pieces += [moving, block]
    done = phase_block(20, NO_ROW, Phase.DONE)
    done["safety.reason"] = Reason.PLAN_END
    return stamped(np.concatenate([*pieces, done]), dt)


def test_the_spring_map_of_the_scripts_is_ours(tmp_path: Path) -> None:
    """Within 0.5 %: theirs is one fit of all samples, ours the mean of passes in bins of angle."""
    stations = {-33.0: 3379.0, 7.0: -2763.0, 67.0: -10013.0}
    rows = [Row(i, 0, rate, 0.0, 0.0, {}) for i, rate in enumerate(stations.values())]
    config = {
        "name": "map",
        "rig": {"spring": {"metres_per_radian": 0.33047, "mapping": {"slew_lever_m": 0.254}}},
        "plant": {"stator": {"travel": {"value": 0.2}}},
    }
    plan = plan_json(rows, SHAPE) | {"hoist": {"speed_m_per_s": 0.05}}
    run = write_run(tmp_path / "run", hoisted(stations), plan, config=config)
    found = run_octave(HERE / "mask4_spring.m", export(run))
    assert found[:, 0].tolist() == list(stations)
    assert np.allclose(found[:, 1], 7.5 * found[:, 0])  # turns of the motor
    assert np.allclose(found[:, 2], 0.002 / 0.0254 * found[:, 0])  # inches, travel of 0.2 m
    assert np.allclose(found[:, 4], spring_map(run)["rate"], rtol=5e-3)
    # The slope of sin 2 theta over the window is 1.649 (MASK4's own window).
    h = FIT_HALF_ANGLE
    slope = 1.5 * (math.sin(2 * h) - 2 * h * math.cos(2 * h)) / h**3 / 2.0
    assert slope == pytest.approx(1.649, abs=1e-3)
    assert np.allclose(found[:, 4], list(stations.values()), rtol=5e-3)
    assert np.allclose(found[:, 5], 900.0)


def test_the_switch_adds_fields_and_changes_no_other_value(tmp_path: Path) -> None:
    """At 1 kHz; the basin's common signals keep the run's even time."""
    shape = SHAPE._replace(dt=0.001, lead_in=500, settle=2500, tail=503, periods=1)
    rows = make_rows(2)
    run = write_run(tmp_path / "run", run_data(rows, shape, moving=1001), plan_json(rows, shape))
    plain, added = (
        loadmat(export(run, "-o", tmp_path / "a.mat")),
        export_structure(run).buses,
    )
    new = {
        ("heaveSignals", name)
        for name in ("heaveKpUsed", "heaveKiUsed", "heaveEncVel_rad_s", "heaveForceTRS_N_m")
    } | {
        ("magSpringSignals", name)
        for name in ("nanoRatePos_rev", "nanoRatePos_inch", "slewSpAngle_deg")
    } | {("fastLogBus", "heaveCurrent_A"), ("rigSignals", "leftOut")}  # fmt: skip
    fields = {
        (bus, name) for bus in plain if not bus.startswith("__") for name in plain[bus].dtype.names
    }
    assert fields - new == {(bus, name) for bus, values in added.items() for name in values}
    assert fields >= new
    for bus in ("setpointSignals", "waveData"):
        for name, values in added[bus].items():
            assert np.array_equal(plain[bus][name][0, 0], values), name
    speed, fast = (
        plain[bus][name][0, 0][:, 0]
        for bus, name in (("heaveSignals", "heaveEncVel_m_s"), ("fastLogBus", "heaveCurrent_A"))
    )
    assert fast.size == 5 * speed.size
    current = plain["heaveSignals"]["heaveForceI_N"][0, 0][:, 0] / 76.9750
    assert np.allclose(fast[::5], current, rtol=1e-5, equal_nan=True)
    time = plain["heaveSignals"]["time"][0, 0][:, 0]
    assert np.all(np.diff(time) > 0.0)
    kp = plain["expParamSignals"]["heaveKpUsed"][0, 0][:, 0]
    assert np.flatnonzero(kp == -999.0)[0] == 24000 + 2 * 1000 + 1  # rows of 5.003 s
