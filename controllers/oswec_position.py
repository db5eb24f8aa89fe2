"""Position of the OSWEC's shaft: a periodic reference, and corrections that make the shaft follow.

The drive takes velocities; the shaft lags the motor by backlash, friction and torsion of the
driveline (OSWEC thesis (University of Washington), section 2.3.1). The reference is a sum of
cosines of the row's own clock t, with an envelope e that rises and falls:

    theta(t) = e(t) sum_k A_k cos(w_k t + phi_k)                       (rad)

Correction per component, from regressions of earlier runs (thesis, section 2.3.2): amplified
and advanced,

    theta_c(t) = e(t) sum_k g_k A_k cos(w_k (t + tau_k) + phi_k)

One component is the sinusoid of the thesis, many are an irregular command.

Instantaneous correction, from the piecewise-linear relation D of torque and deflection (thesis,
Fig. 2.9): the motor leads by the deflection that belongs to the measured torque T,

    T_f'' = w0^2 (T - T_f) - 2 w0 T_f'             theta_c(t) = theta(t) + D(T_f)

The filter is necessary because D is steep where the gears change flanks, and T responds to the
correction; for the same reason angle and rate of D(T_f) are bounded.

Bad input: NaN or infinity in clock, torque or components gives an output that is not finite, which
the limits turn into a stop.
"""

from math import cos, sin
from typing import NamedTuple

from controllers.blocks import clamp, finite, interpolate
from controllers.signals import (
    NewtonMetre,
    Radian,
    RadianPerSecond,
    Second,
    Turning,
)

PI = 3.141592653589793


class Components(NamedTuple):
    """Cosines of references with their corrections, by columns of one length."""

    amplitude: tuple[float, ...]  # rad; N*m where the reference is a torque
    omega: tuple[float, ...]  # rad/s
    phase: tuple[float, ...]  # rad, at clock zero
    gain: tuple[float, ...]  # 1, g: corrected over plain amplitude, 1 without correction
    advance: tuple[float, ...]  # s, tau, 0 without correction


class EnvelopeTimes(NamedTuple):
    """Times of the envelope on the row's own clock."""

    rise: Second  # duration of the rise from 0 to 1, and of the fall to 0
    fade_start: Second  # start of the fall


class PeriodicReference(NamedTuple):
    """A reference: its components, consecutive in a table of them, and its envelope."""

    first: int  # index of its first component
    length: int  # number of its components
    span: EnvelopeTimes


class Params(NamedTuple):
    """Parameters of the instantaneous correction; without a map there is none."""

    torques: tuple[float, ...]  # N*m, increasing, at least two; or empty
    deflections: tuple[float, ...]  # rad, lead of the motor over the shaft at each torque
    filter_omega: RadianPerSecond  # w0 of the torque filter
    max_angle: Radian  # bound of the correction, in both directions
    max_velocity: RadianPerSecond  # bound of its rate, in both directions


class State(NamedTuple):
    """State of the torque filter, and the last instantaneous correction."""

    torque: NewtonMetre
    torque_rate: float  # N*m/s
    angle: Radian


def start() -> State:
    """Return the state at switch-on: zero torque, zero correction."""
    return State(0.0, 0.0, 0.0)


def envelope(span: EnvelopeTimes, clock: float) -> tuple[float, float]:
    """Return the envelope (1) and its rate (1/s): half a cosine up, and half a cosine down."""
    rise, until = span
    if not finite(clock):
        return clock, clock
    if clock < 0.0:
        return 0.0, 0.0
    before, sign = clock, 1.0
    if clock > until:
        before, sign = until + rise - clock, -1.0
    if before >= rise:
        return 1.0, 0.0
    if before <= 0.0:
        return 0.0, 0.0
    turn = PI / rise
    return 0.5 - 0.5 * cos(turn * before), sign * 0.5 * turn * sin(turn * before)


def reference(components: Components, periodic: PeriodicReference, clock: float) -> Turning:
    """Return value and rate of the plain reference at ``clock`` (s); 0 before the clock starts."""
    first, length, span = periodic
    share, rate = envelope(span, clock)
    if not finite(share) or share == 0.0:
        return Turning(share, share)
    angle = velocity = 0.0
    for k in range(first, first + length):
        omega = components.omega[k]
        at = omega * clock + components.phase[k]
        angle, velocity = _add_cosine(angle, velocity, components.amplitude[k], omega, at)
    return Turning(share * angle, share * velocity + rate * angle)


def corrected_reference(
    components: Components, periodic: PeriodicReference, clock: float
) -> Turning:
    """Return the reference amplified and advanced component by component."""
    first, length, span = periodic
    share, rate = envelope(span, clock)
    if not finite(share) or share == 0.0:
        return Turning(share, share)
    angle = velocity = 0.0
    for k in range(first, first + length):
        omega = components.omega[k]
        amplitude = components.gain[k] * components.amplitude[k]
        at = omega * (clock + components.advance[k]) + components.phase[k]
        angle, velocity = _add_cosine(angle, velocity, amplitude, omega, at)
    return Turning(share * angle, share * velocity + rate * angle)


def step(
    params: Params,
    state: State,
    components: Components,
    periodic: PeriodicReference,
    clock: Second,
    torque: NewtonMetre,
    dt: float,
) -> tuple[State, tuple[Turning, Turning]]:
    """Return the plain reference and the sum of its corrections; ``torque``: measured, tared."""
    plain = reference(components, periodic, clock)
    ahead = corrected_reference(components, periodic, clock)
    angle, velocity = ahead.angle - plain.angle, ahead.velocity - plain.velocity
    if len(params.torques) == 0:
        return state, (plain, Turning(angle, velocity))
    before = state.angle
    state = _step_deflection(params, state, clock, torque, dt)
    moved = state.angle - before
    return state, (plain, Turning(angle + state.angle, velocity + moved / dt))


def _step_deflection(params: Params, state: State, clock: float, torque: float, dt: float) -> State:
    """Return the torque filter and the correction one tick later, the correction within bounds."""
    filtered, rate, angle = state
    omega = params.filter_omega
    rate = rate + dt * (omega * omega * (torque - filtered) - 2.0 * omega * rate)
    filtered = filtered + dt * rate
    deflection = 0.0
    if clock >= 0.0:  # before the row's motion begins, return to no correction
        deflection = _deflection(params.torques, params.deflections, filtered)
    deflection = clamp(deflection, -params.max_angle, params.max_angle)
    max_step = params.max_velocity * dt
    return State(filtered, rate, clamp(deflection, angle - max_step, angle + max_step))


def _deflection(torques: tuple[float, ...], deflections: tuple[float, ...], torque: float) -> float:
    """Return D(T) in rad: not finite for a torque that is not, 0 without a map."""
    if len(torques) == 0:
        return 0.0
    if not finite(torque):
        return torque
    return interpolate(torque, torques, deflections)


def _add_cosine(
    value: float, rate: float, amplitude: float, omega: float, at: float
) -> tuple[float, float]:
    """Return a sum of cosines and its rate with one cosine more; not finite if ``at`` is not."""
    if not finite(at):
        return at, at
    return value + amplitude * cos(at), rate - amplitude * omega * sin(at)
