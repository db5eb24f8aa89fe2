"""What rubs beside the brake, behind the load cell: the bearing and, if there is one, a seal. Pure.

Both rub more in one direction than in the other and a little more at speed (OSWEC thesis, 3.2.2:
less than 0.4 N m, counter-clockwise more than clockwise).
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import NewtonMetre, NewtonMetreSecondPerRadian, RadianPerSecond


class DragParams(NamedTuple):
    """Friction of one part."""

    clockwise: NewtonMetre  # dry, as the shaft turns along positive angle
    counter: NewtonMetre
    viscous: NewtonMetreSecondPerRadian


def forward(params: DragParams, velocity: RadianPerSecond) -> NewtonMetre:
    """Give the torque that motion along positive angle has to overcome, not negative."""
    return params.clockwise + params.viscous * abs(velocity)


def back(params: DragParams, velocity: RadianPerSecond) -> NewtonMetre:
    """Give the torque that motion along negative angle has to overcome, not negative."""
    return params.counter + params.viscous * abs(velocity)
