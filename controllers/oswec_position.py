"""Position of the OSWEC's shaft: a periodic reference, and what makes the shaft follow it.

The drive takes velocities; the shaft trails the motor by backlash, friction and torsion of the
driveline (OSWEC thesis (University of Washington), section 2.3.1). The reference is a sum of
cosines of the row's own clock t, grown and faded by an envelope e:

    theta(t) = e(t) sum_k A_k cos(w_k t + phi_k)                       (rad)

Correction per component, from regressions of earlier runs (thesis, section 2.3.2): the command is
amplified and advanced,

    theta_c(t) = e(t) sum_k g_k A_k cos(w_k (t + tau_k) + phi_k)

One component is the thesis's sinusoid, many are an irregular command. Correction in the instant,
from the piecewise-linear relation of driveline torque and deflection (thesis, Fig. 2.9): the motor
is put ahead by the deflection that the filtered torque says, within an authority in angle and
rate.

    T_f'' = w0^2 (T - T_f) - 2 w0 T_f'          theta_c = theta + D(T_f)

Bad input: NaN or infinity in clock, torque or components gives an output that is not finite, which
the limits turn into a stop.
"""

from math import cos, sin
from typing import NamedTuple

from controllers.blocks import clamp, finite
from controllers.signals import NewtonMetre, Radian, RadianPerSecond, Ratio, Second

PI = 3.141592653589793


class Component(NamedTuple):
    """One cosine of a reference, and how it is corrected."""

    amplitude: float  # rad; N*m where the reference is a torque
    omega: RadianPerSecond
    phase: Radian  # at zero of the clock
    gain: Ratio  # g: corrected over plain amplitude, 1 without correction
    advance: Second  # tau, 0 without correction
