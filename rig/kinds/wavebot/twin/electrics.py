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

from rig.kinds.wavebot.twin.group import Group, add_uncertainty, least_squares
from rig.kinds.wavebot.twin.records import Record

RESISTANCE = "winding_resistance"
COTS = ("fixed_loss", "linear_loss", "square_loss")
FIXED, SWITCHED, CONDUCTION, SWITCHED_LINEAR, SQUARE = CUSTOM = (
    "fixed_loss", "switched_loss", "conduction_loss", "switched_linear_loss", "square_loss",
)  # fmt: skip
MIN_VOLTAGE_SPREAD = (
    0.02  # relative standard deviation of the bus voltage above which its effect is estimated
)
SINGLE_VOLTAGE_UNCERTAINTY = (
    0.1  # relative uncertainty at other voltages of a loss measured at one voltage
)


def identify_winding(records: Sequence[Record]) -> Group:
    """Estimate the winding resistance, ohm."""
    current_square = np.array([record.current_square for record in records])
    copper_loss = np.array([record.ac - record.shaft for record in records])
    source = f"{len(records)} rows, AC minus shaft power over current squared"
    return least_squares((RESISTANCE,), (current_square / 1.5)[:, None], copper_loss, source)


def identify_drive_loss(records: Sequence[Record], rated_voltage: float | None) -> Group:
    """Estimate the drive's losses; ``rated_voltage`` (V) is None for a commercial drive."""
    blocks = [one.power for one in records]
    current_magnitude, current_square, loss, voltage = (
        np.concatenate(each) for each in zip(*blocks, strict=True)
    )
    one = np.ones_like(current_magnitude)
    source = (
        f"{len(records)} rows, {current_magnitude.size} blocks of DC minus AC power over current"
    )
    if rated_voltage is None:
        return least_squares(
            COTS, np.array([one, current_magnitude, current_square]).T, loss, source
        )
    if float(np.std(voltage)) > MIN_VOLTAGE_SPREAD * float(np.mean(voltage)):
        voltage_ratio = voltage / rated_voltage
        columns = np.array(
            [
                one,
                voltage_ratio,
                current_magnitude,
                voltage_ratio * current_magnitude,
                current_square,
            ]
        ).T
        return least_squares(CUSTOM, columns, loss, source)
    at_one_voltage = least_squares(
        (FIXED, CONDUCTION, SQUARE), np.array([one, current_magnitude, current_square]).T, loss,
        f"{source}, bus at {np.mean(voltage):.3g} V",
    )  # fmt: skip
    for name in (FIXED, CONDUCTION):
        at_one_voltage = add_uncertainty(
            at_one_voltage, name, SINGLE_VOLTAGE_UNCERTAINTY * at_one_voltage.by_name[name]
        )
    return at_one_voltage
