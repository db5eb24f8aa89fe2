"""Cogging of a permanent-magnet linear motor. Pure.

Its force per current is a constant (N/A) and it has no gear, so all else is that of a rotary motor.
"""

from __future__ import annotations

import math

from sim_plant.units import Metre, Newton


def cogging_force(amplitude: Newton, pitch: Metre, position: Metre) -> Newton:
    """Return -A sin(2 pi x / pitch): the force between magnets and slots, without any current.

    It has the potential energy A pitch / 2 pi (1 - cos(2 pi x / pitch)), so no mean power. Source:
    first harmonic in J. F. Gieras et al., Linear Synchronous Motors, chapter 3.
    """
    return -amplitude * math.sin(2.0 * math.pi * position / pitch)
