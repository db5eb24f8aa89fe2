"""Identification of motor and drive from the power analyser: winding resistance, drive losses.

    P_AC - P_shaft = R i^2 / (3/2)                     by row, i the drive current (Kt N i = F)
    P_DC - P_AC = fixed + a |i| + b i^2                 by blocks of a tenth of a second

The custom drive's loss also depends on the voltage of its bus, u = V / V_rated,

    P_DC - P_AC = (p + q u) + (a + c u) |i| + b i^2

if the bus voltage differs between rows. Otherwise p and a contain the voltage-dependent part and
hold at that voltage, modulation and frequency only.
"""

from collections.abc import Sequence

import numpy as np

from rig.kinds.wavebot.twin.group import Group, least_squares
from rig.kinds.wavebot.twin.records import Record

RESISTANCE = "winding_resistance"
COTS = ("fixed_loss", "linear_loss", "square_loss")
FIXED, SWITCHED, CONDUCTION, SWITCHED_LINEAR, SQUARE = CUSTOM = (
    "fixed_loss", "switched_loss", "conduction_loss", "switched_linear_loss", "square_loss",
)  # fmt: skip
MIN_VOLTAGE_SPREAD = 0.02  # relative standard deviation of the voltage that shows its effect
SINGLE_VOLTAGE_UNCERTAINTY = 0.1  # relative, at other voltages than the only measured one


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
