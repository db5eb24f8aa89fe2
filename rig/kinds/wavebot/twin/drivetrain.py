"""Identification of drivetrain, motor and drive.

Between torque sensor and load cell, friction and spring,

    F_TRS - F_LCB = B v + F_c tanh(v / v_c) + e K r sin(2 x / l)

line by line, with the lines of tanh and sine computed from the measured motion. B, F_c and the
share e of the spring map's rate that takes effect are least-squares estimates over all rows. Waves
load the guide sideways and add dry friction, so rows in waves have their own F_c, which the twin
uses.

From the power analyser, winding resistance and drive losses,

    P_AC - P_shaft = R i^2 / (3/2)                     by row, i the drive current (Kt N i = F)
    P_DC - P_AC = fixed + a |i| + b i^2                 by blocks of a tenth of a second

The custom drive's loss also depends on the voltage of its bus, u = V / V_rated,

    P_DC - P_AC = (p + q u) + (a + c u) |i| + b i^2

if the bus voltage differs between rows. Otherwise p and a contain the voltage-dependent part and
hold at that voltage, modulation and frequency only.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.kinds.wavebot.twin.group import Group, least_squares
from rig.kinds.wavebot.twin.records import Record
from rig.spectra.periods import Complexes, Floats, analyse, synthesise

VISCOUS, CALM, WAVES, EFFECT = "drivetrain_viscous", "coulomb_calm", "coulomb", "spring_effect"
MAX_DEVIATION = 0.05  # largest standard deviation at which the estimated spring share is used
RESISTANCE = "winding_resistance"
COTS = ("fixed_loss", "linear_loss", "square_loss")
FIXED, SWITCHED, CONDUCTION, SWITCHED_LINEAR, SQUARE = CUSTOM = (
    "fixed_loss", "switched_loss", "conduction_loss", "switched_linear_loss", "square_loss",
)  # fmt: skip
MIN_VOLTAGE_SPREAD = 0.02  # relative standard deviation of the voltage that shows its effect
SINGLE_VOLTAGE_UNCERTAINTY = 0.1  # relative, at other voltages than the only measured one


class DrivetrainShape(NamedTuple):
    """Known shape of the spring and friction laws, without their size."""

    sine: bool  # True: sine spring law, False: linear
    lever: float  # m/rad
    reach: float  # m, spring force amplitude divided by the map's rate
    coulomb_velocity: float  # m/s, width of the regularised sign


def read_shape(plant: dict[str, Any]) -> DrivetrainShape:
    """Return the shape that a plant file defines, as in its simulation."""

    def value(section: str, name: str) -> Any:
        return plant[section][name]["value"]

    half_angle, lever = float(value("spring", "fit_half_angle")), float(value("spring", "lever"))
    # Least-squares slope of sin 2 theta over +-half_angle, the definition of a spring map's rate.
    slope = (
        1.5
        * (0.5 * math.sin(2.0 * half_angle) - half_angle * math.cos(2.0 * half_angle))
        / half_angle**3
    )
    return DrivetrainShape(
        str(value("spring", "law")) == "sine",
        lever,
        lever / slope,
        float(value("pto", "coulomb_velocity")),
    )


def identify_drivetrain(records: Sequence[Record], shape: DrivetrainShape) -> Group:
    """Estimate viscous friction (N s/m), dry friction (N) and the share of the spring rate.

    ``coulomb`` is estimated from rows in waves, or from calm water if there are none. Raises
    ValueError if there are too few lines.
    """
    per_record = [_regressors(record, shape) for record in records]
    viscous, dry, spring = (np.concatenate(parts) for parts in zip(*per_record, strict=True))
    measured = np.concatenate([_real_and_imaginary(record.trs - record.lcb) for record in records])
    calm = np.repeat(
        [record.sea is None for record in records], [2 * len(each.velocity) for each in records]
    )
    friction = {VISCOUS: viscous}
    if calm.any():
        friction[WAVES if calm.all() else CALM] = dry * calm
    if not calm.all():
        friction[WAVES] = dry * ~calm
    source = f"{len(records)} rows, torque sensor minus load cell"
    group = least_squares(friction | {EFFECT: spring}, measured, source)
    if not (0.0 < group.deviation(EFFECT) < MAX_DEVIATION and group.by_name[EFFECT] > 0.0):
        group = least_squares(friction, measured - spring, source)
        group = group.with_value(EFFECT, 1.0, MAX_DEVIATION)
    return group.without(CALM)


def _regressors(record: Record, shape: DrivetrainShape) -> tuple[Floats, Floats, Floats]:
    """Return the regressors of viscous friction, dry friction and the full spring rate."""
    velocity, count, rate = record.velocity, len(record.velocity), record.setting["spring_rate"]
    position = velocity / (1j * record.omega)
    dry = analyse(np.tanh(synthesise(velocity) / shape.coulomb_velocity), count)
    spring = np.asarray(rate * position, dtype=np.complex128)
    if shape.sine:
        sine = np.sin(2.0 * synthesise(position) / shape.lever)
        spring = rate * shape.reach * analyse(sine, count)
    return _real_and_imaginary(velocity), _real_and_imaginary(dry), _real_and_imaginary(spring)


def _real_and_imaginary(lines: Complexes) -> Floats:
    """Return the real parts followed by the imaginary parts."""
    return np.concatenate([lines.real, lines.imag])


def identify_winding(records: Sequence[Record]) -> Group:
    """Estimate the winding resistance, ohm."""
    current_square = np.array([record.current_square for record in records])
    copper_loss = np.array([record.ac - record.shaft for record in records])
    source = f"{len(records)} rows, AC minus shaft power over current squared"
    return least_squares({RESISTANCE: current_square / 1.5}, copper_loss, source)


def identify_drive_loss(records: Sequence[Record], rated_voltage: float | None) -> Group:
    """Estimate the drive's losses; ``rated_voltage`` (V) is None for a commercial drive."""
    current, square, loss, voltage = (
        np.concatenate(each) for each in zip(*(one.power for one in records), strict=True)
    )
    one = np.ones_like(current)
    source = f"{len(records)} rows, {current.size} blocks of DC minus AC power over current"
    if rated_voltage is None:
        return least_squares(dict(zip(COTS, (one, current, square), strict=True)), loss, source)
    if float(np.std(voltage)) > MIN_VOLTAGE_SPREAD * float(np.mean(voltage)):
        ratio = voltage / rated_voltage
        regressors = (one, ratio, current, ratio * current, square)
        return least_squares(dict(zip(CUSTOM, regressors, strict=True)), loss, source)
    source = f"{source}, bus at {np.mean(voltage):.3g} V"
    group = least_squares({FIXED: one, CONDUCTION: current, SQUARE: square}, loss, source)
    for name in (FIXED, CONDUCTION):
        group = group.with_uncertainty(name, SINGLE_VOLTAGE_UNCERTAINTY * group.by_name[name])
    return group
