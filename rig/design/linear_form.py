"""The linear form of a law as gains of the impedance law: predictions need nothing else.

A law is predicted if its `linear` is a damper, a spring and a mass:

    F / v = Kp + Ki / (j omega) + Km j omega

with the same gains at every frequency. Then the loop's stability is exact, too.
"""

from typing import Any

import numpy as np

from controllers.signals import Gains
from rig.laws import Law

_OMEGA = np.linspace(0.3, 13.0, 9)  # rad/s, of waves of 0.05 .. 2 Hz
_TOLERANCE = 1e-9  # of the greatest force per velocity


class NotLinearError(ValueError):
    """A law that has no linear form of constant gains; the message is the reason."""


def linear_gains(law: Law, params: Any, set_point: Any) -> Gains:
    """Return the gains of a law's linear form at a set point; NotLinearError if it has none."""
    law, params, set_point = law.in_force(params, set_point)
    if law.linear is None:
        raise NotLinearError(f"the law {law.name} has no linear form")
    response = np.array([law.linear(params, set_point, float(omega)) for omega in _OMEGA])
    kp = float(response.real.mean())
    system = np.column_stack([-1.0 / _OMEGA, _OMEGA])
    (ki, km), *_ = np.linalg.lstsq(system, response.imag, rcond=None)
    fitted = kp + 1j * (system @ np.array([ki, km]))
    if not np.abs(fitted - response).max() <= _TOLERANCE * max(1.0, np.abs(response).max()):
        raise NotLinearError(
            f"the linear form of the law {law.name} is not that of a damper, a spring and a mass"
        )
    return Gains(kp, float(ki), float(km))
