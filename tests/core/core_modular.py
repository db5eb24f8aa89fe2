"""A modular rig at rest, with two axes and two sensors."""

from __future__ import annotations

from typing import Any

from modular_rigs import axis_sense, composed, measuring, sense, two_axes
from modular_rigs import params as modular_params

_RIG, _LIMITS = two_axes()
_TICK = composed(_RIG)
KIND = _TICK.KIND


def params() -> Any:
    """Return the loop's parameters, without gains."""
    no_gains = dict.fromkeys(_RIG.axes, (0.0, 0.0, 0.0))
    return modular_params(_RIG, _LIMITS, measuring(10, 10), **no_gains)


class Quiet:
    """Devices of a rig whose axes never move."""

    def read(self, now: float) -> Any:
        return sense(
            _TICK, axis_sense(1000), axis_sense(-20), pto_force=(3.0, 0.0), dc_power=(-5.0, 0.0)
        )
