"""Estimates from synthetic records of devices with random parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS

from rig.kinds.wavebot.twin import drivetrain
from rig.kinds.wavebot.twin.group import Group, least_squares
from rig.kinds.wavebot.twin.hull import identify_hull
from rig.kinds.wavebot.twin.records import PowerBlocks, Record
from rig.kinds.wavebot.twin.seas import (
    SCALE,
    Coefficient,
    bem_deviation,
    excitation_scale,
    measured_bands,
)
from rig.spectra.periods import analyse, synthesise
from sim_plant.bem import excitation_at, read_bem

PERIOD, LINES = 20.0, 50
SHAPE = drivetrain.DrivetrainShape(True, 0.33047, 0.33047 / 1.649, 0.002)


def record(velocity: Any, lcb: Any, trs: Any, **more: Any) -> Record:
    """Return a row in calm water with lines 4 .. 20; other fields are zero or empty."""
    number = np.arange(1, LINES + 1)
    empty = np.zeros(0)
    fields: dict[str, Any] = {
        "row_label": "synthetic", "setting": {"spring_rate": 0.0}, "sea": None,
        "has_excitation": True,
        "period": PERIOD, "velocity": velocity, "trs": trs, "lcb": lcb,
        "excited": (number >= 4) & (number <= 20), "ac": 0.0, "dc": 0.0, "current_square": 0.0,
        "power": PowerBlocks(empty, empty, empty, empty), **more,
    }  # fmt: skip
    return Record(**fields)


def motion(rng: Any, size: float) -> Any:
    """Return the velocity lines of a multisine (m/s)."""
    number = np.arange(1, LINES + 1)
    lines = size * np.exp(2j * np.pi * rng.uniform(size=LINES))
    return np.where((number >= 4) & (number <= 20), lines, 0.0)


def test_synthesis_and_analysis_are_inverse() -> None:
    rng = np.random.default_rng(1)
    velocity = motion(rng, 0.05)
    assert analyse(synthesise(velocity), len(velocity)) == pytest.approx(velocity, abs=1e-12)
    v = synthesise(velocity)
    assert float(np.mean(v * v)) == pytest.approx(0.5 * np.sum(np.abs(velocity) ** 2))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hull_is_identified(seed: int) -> None:
    """Random inertia, damping and drag; the radiation does not have the fitted form."""
    rng = np.random.default_rng(seed)
    mass, stiffness = rng.uniform(800, 1600), rng.uniform(15_000, 30_000)
    viscous, quadratic = rng.uniform(200, 600), rng.uniform(600, 1800)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    s = 1j * omega
    # Bandpasses are passive for any parameters, and zero at rest and at infinity.
    z = mass * s + viscous + stiffness / s
    for centre, width, peak in ((3.2, 3.0, 1500.0), (5.0, 6.0, 400.0)):
        z = z + peak * width * s / (s * s + width * s + centre * centre)
    rows = []
    for size in (0.02, 0.05, 0.08):
        velocity = motion(rng, size)
        calm_record = record(velocity, velocity, velocity)
        v = synthesise(velocity)
        noise = rng.normal(size=(2, LINES)) * 0.2
        force = (
            z * velocity
            + quadratic * analyse(np.abs(v) * v, len(velocity))
            + noise[0]
            + 1j * noise[1]
        )
        rows.append(calm_record._replace(lcb=force))
    identified = identify_hull(rows)
    # Noise of 0.28 N per line in forces of about 100 N: 0.5 % of the drag's contribution.
    assert identified.quadratic.values[0] == pytest.approx(quadratic, rel=0.02)
    assert abs(identified.quadratic.values[0] - quadratic) < 4.0 * identified.quadratic.deviation(
        "viscous_quadratic"
    )
    lines = rows[0].excited
    assert identified.impedance == pytest.approx(z[lines], rel=0.01)
    assert identified.worst < 0.01
    s_watched = 1j * np.geomspace(0.01, 300.0, 400)
    denominator = np.polyval([1.0, *identified.radiation.denominator], s_watched)
    memory = np.polyval([*identified.radiation.numerator, 0.0], s_watched) / denominator
    assert (
        np.min(memory.real + identified.linear.by_name["viscous"]) > -1.0
    )  # N s/m: the hull is passive


def test_a_linear_hull_has_no_drag_and_a_single_line_is_refused() -> None:
    rng = np.random.default_rng(5)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    z = 1500j * omega + 900.0 + 24_000 / (1j * omega)
    rows = []
    for size in (0.02, 0.08):
        velocity = motion(rng, size)
        noise = rng.normal(size=(2, LINES)) * 0.2
        rows.append(record(velocity, z * velocity + noise[0] + 1j * noise[1], velocity))
    assert identify_hull(rows).quadratic.values == (0.0,)
    single_line = [one._replace(excited=np.arange(LINES) == 8) for one in rows]
    with pytest.raises(ValueError, match="1 lines are too few"):
        identify_hull(single_line)
    with pytest.raises(ValueError, match="no row in calm water"):
        identify_hull([one._replace(has_excitation=False) for one in rows])


def test_friction_and_spring_are_identified() -> None:
    rng = np.random.default_rng(9)
    viscous, dry, share, rate = 380.0, 62.0, 0.65, -9228.0
    rows = []
    for size in (0.02, 0.05, 0.08):
        velocity = motion(rng, size)
        sample_record = record(velocity, velocity, velocity, setting={"spring_rate": rate})
        v = synthesise(velocity)
        x = synthesise(velocity / (1j * sample_record.omega))
        spring = share * rate * SHAPE.reach * np.sin(2.0 * x / SHAPE.lever)
        drivetrain_force = viscous * v + dry * np.tanh(v / SHAPE.coulomb_velocity) + spring
        noise = rng.normal(size=(2, LINES)) * 0.2
        rows.append(
            sample_record._replace(
                trs=sample_record.lcb
                + analyse(drivetrain_force, len(velocity))
                + noise[0]
                + 1j * noise[1]
            )
        )
    identified = drivetrain.identify_drivetrain(rows, SHAPE).by_name
    assert identified[drivetrain.VISCOUS] == pytest.approx(viscous, rel=0.01)
    assert identified[drivetrain.WAVES] == pytest.approx(dry, rel=0.01)
    assert identified[drivetrain.EFFECT] == pytest.approx(share, rel=0.005)
    without_spring = [
        sample_record._replace(setting={"spring_rate": 0.0}) for sample_record in rows
    ]
    assert drivetrain.identify_drivetrain(without_spring, SHAPE).by_name[drivetrain.EFFECT] == 1.0


@pytest.mark.parametrize("voltages", [(75.0, 75.0), (67.0, 82.0)])
def test_drive_loss_is_identified(voltages: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    rows = []
    for voltage in voltages:
        size = np.abs(rng.normal(size=400)) * 8.0
        volts = voltage + 0.3 * rng.normal(size=400)
        voltage_ratio = volts / 75.0
        loss = 4.0 + 5.0 * voltage_ratio + (1.5 + 0.6 * voltage_ratio) * size + 0.015 * size * size
        loss = loss + 0.05 * rng.normal(size=400)
        power = PowerBlocks(size, size * size, loss, volts)
        nothing = np.zeros(LINES, dtype=complex)
        rows.append(record(nothing, nothing, nothing, power=power))
    identified = drivetrain.identify_drive_loss(rows, 75.0).by_name
    is_voltage_dependent = drivetrain.SWITCHED in identified
    assert is_voltage_dependent is (voltages[0] != voltages[1])
    for voltage_ratio in (voltages[0] / 75.0, voltages[1] / 75.0):
        for amperes in (0.0, 5.0, 15.0):
            predicted = identified["fixed_loss"] + identified["conduction_loss"] * amperes
            predicted += identified["square_loss"] * amperes**2
            predicted += (
                (identified.get(drivetrain.SWITCHED, 0.0) * voltage_ratio)
                if is_voltage_dependent
                else 0.0
            )
            predicted += (
                identified.get(drivetrain.SWITCHED_LINEAR, 0.0) * voltage_ratio * amperes
                if is_voltage_dependent
                else 0.0
            )
            expected = (
                4.0
                + 5.0 * voltage_ratio
                + (1.5 + 0.6 * voltage_ratio) * amperes
                + 0.015 * amperes**2
            )
            assert predicted == pytest.approx(expected, abs=0.1), (voltage_ratio, amperes)
    cots = drivetrain.identify_drive_loss(rows[:1], None).by_name
    assert set(cots) == set(drivetrain.COTS)


def test_winding_resistance_is_identified() -> None:
    velocity = motion(np.random.default_rng(2), 0.05)
    rows = []
    for square in (9.0, 40.0, 90.0):
        sample_record = record(velocity, velocity, 500.0 * velocity, current_square=square)
        rows.append(sample_record._replace(ac=sample_record.shaft + 0.5 * square / 1.5))
    assert drivetrain.identify_winding(rows).by_name[drivetrain.RESISTANCE] == pytest.approx(0.5)


def test_excitation_scale_is_identified() -> None:
    """A sea 7 % larger than commanded; only its own line is measured then."""
    rng = np.random.default_rng(4)
    omega = 2.0 * np.pi * np.arange(1, LINES + 1) / PERIOD
    z = 1500j * omega + 900.0 + 24_000 / (1j * omega)
    calm_records = []
    for size in (0.02, 0.08):
        velocity = motion(rng, size)
        calm_records.append(record(velocity, z * velocity, velocity))
    hull_model = identify_hull(calm_records)
    bem = Coefficient(np.array([0.05, 2.0]), np.array([9000.0 + 0j, 9000.0 + 0j]), "BEM paper")
    sea = {"repeat_s": 2.0, "cycles": [1], "amplitude_m": [0.1], "phase_rad": [0.0]}
    force = np.where(np.arange(1, LINES + 1) == 10, 1.07 * 9000.0 * 0.1, 0.0)
    velocity = force / (z + 2500.0)
    in_waves = record(
        velocity, z * velocity - force, velocity, sea=sea, has_excitation=False, excited=force > 0.0
    )
    scale = excitation_scale([*calm_records, in_waves], hull_model, bem)
    assert scale.by_name[SCALE] == pytest.approx(1.07, rel=0.003)
    assert measured_bands([*calm_records, in_waves], bem) == ((0.5, 0.5),)
    frequency = np.array([0.4, 0.5, 0.515, 0.65])
    left = bem_deviation(frequency, measured_bands([*calm_records, in_waves], bem))
    assert (left == 0.0).tolist() == [False, True, True, False]
    assert excitation_scale(calm_records, hull_model, bem).by_name[SCALE] == 1.0
    assert measured_bands(calm_records, bem) == ()
    wide = {**sea, "cycles": [1, 2], "amplitude_m": [0.1, 0.02], "phase_rad": [0.0, 0.0]}
    rows_in_wide = [in_waves._replace(sea=wide)]  # one factor for all its lines: in that sea only
    assert measured_bands(rows_in_wide, bem) == ()
    assert measured_bands(rows_in_wide, bem, dict(wide)) == ((0.5, 1.0),)
    identified = bem._replace(measured=((0.2, 1.0),))
    assert not bem_deviation(frequency, measured_bands(calm_records, identified)).any()


def test_an_unmeasured_excitation_has_the_error_of_an_earlier_tank() -> None:
    """Tank: waveBot_heaveModel.mat of the public fbWecCntrl repository; BEM: the shipped file.

    Both ratios, since either may be the truth; never more than 1.5 points of percent above them.
    """
    frequency = np.array([0.2, 0.4, 0.5, 0.65, 1.0])
    tank = np.array([21880.0, 12504.0, 8976.0, 5136.0, 2948.0])
    bem = np.abs(excitation_at(read_bem(CONFIGS / "plants" / "wavebot_bem.npz"), frequency))
    difference = np.maximum(np.abs(bem / tank - 1.0), np.abs(tank / bem - 1.0))
    allowed = bem_deviation(frequency, ())
    assert np.all(allowed > difference - 0.003)
    assert np.all(allowed < difference + 0.015)
    assert allowed[[2, 3]] == pytest.approx([0.10, 0.25])


def test_directions_reproduce_the_covariance() -> None:
    rng = np.random.default_rng(6)
    columns = rng.normal(size=(200, 3)) * np.array([1.0, 50.0, 0.01])
    regressors = dict(zip("abc", np.abs(columns).T, strict=True))
    estimate = least_squares(regressors, np.abs(columns).sum(axis=1), "paper")
    factor = rng.normal(size=(3, 3))
    group = Group(estimate.names, estimate.values, factor @ factor.T, "paper")
    steps = np.array([[step[name] for name in group.names] for step in group.directions()])
    assert steps.T @ steps == pytest.approx(group.covariance, rel=1e-9, abs=1e-9)
    with pytest.raises(ValueError, match="too few to estimate"):
        least_squares({"a": np.ones(2), "b": np.ones(2)}, np.ones(2), "paper")
