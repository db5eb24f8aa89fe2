"""Motor and drive from the power analyser: winding resistance, and what the drive loses.

    P_AC - P_shaft = R i^2 / (3/2)                     by row, i the drive current (Kt N i = F)
    P_DC - P_AC = fixed + a |i| + b i^2                 by blocks of a tenth of a second

The custom drive's loss also knows the voltage of its bus, u = V / V_rated,

    P_DC - P_AC = (p + q u) + (a + c u) |i| + b i^2

where the rows saw the bus at different voltages; else all of it stands in p and a, and holds at
that voltage, modulation and frequency.
"""

from collections.abc import Sequence

import numpy as np

from rig.identification.twin.group import Group, allowance, least_squares
from rig.identification.twin.records import Record

RESISTANCE = "winding_resistance"
COTS = ("fixed_loss", "linear_loss", "square_loss")
STANDING, SWITCHED, CONDUCTION, SWITCHED_LINEAR, SQUARE = CUSTOM = (
    "fixed_loss", "switched_loss", "conduction_loss", "switched_linear_loss", "square_loss",
)  # fmt: skip
SPREAD = 0.02  # of the bus voltage, standard deviation by mean, from which its part is told apart
ONE_VOLTAGE = 0.1  # share of a loss seen at one voltage only that may be otherwise at another


def winding(records: Sequence[Record]) -> Group:
    """Winding resistance, ohm."""
    square = np.array([one.current_square for one in records])
    lost = np.array([one.ac - one.shaft for one in records])
    source = f"{len(records)} rows, AC less shaft power over current squared"
    return least_squares((RESISTANCE,), (square / 1.5)[:, None], lost, source)


def drive_loss(records: Sequence[Record], rated_voltage: float | None) -> Group:
    """Loss of the drive; ``rated_voltage`` (V) is the custom drive's, None for a commercial one."""
    powers = [one.power for one in records]
    size, square, loss, voltage = (np.concatenate(each) for each in zip(*powers, strict=True))
    one = np.ones_like(size)
    source = f"{len(records)} rows, {size.size} blocks of DC less AC power over current"
    if rated_voltage is None:
        return least_squares(COTS, np.array([one, size, square]).T, loss, source)
    if float(np.std(voltage)) > SPREAD * float(np.mean(voltage)):
        u = voltage / rated_voltage
        columns = np.array([one, u, size, u * size, square]).T
        return least_squares(CUSTOM, columns, loss, source)
    held = least_squares(
        (STANDING, CONDUCTION, SQUARE), np.array([one, size, square]).T, loss,
        f"{source}, bus at {np.mean(voltage):.3g} V",
    )  # fmt: skip
    for name in (STANDING, CONDUCTION):
        held = allowance(held, name, ONE_VOLTAGE * held.known[name])
    return held
