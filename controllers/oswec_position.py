"""Position of the OSWEC's shaft: a periodic reference, and what makes the shaft follow it.

The drive takes velocities; the shaft trails the motor by backlash, friction and torsion of the
driveline (OSWEC thesis (University of Washington), section 2.3.1). The reference is a sum of
cosines of the row's own clock t, grown and faded by an envelope e:

    theta(t) = e(t) sum_k A_k cos(w_k t + phi_k)                       (rad)

Correction of each component, from regressions of earlier runs (thesis, section 2.3.2): amplified
and advanced,

    theta_c(t) = e(t) sum_k g_k A_k cos(w_k (t + tau_k) + phi_k)

One component is the thesis's sinusoid, many are an irregular command.

Correction in the instant, from the piecewise-linear relation D of torque and deflection (thesis,
Fig. 2.9): the motor is put ahead by the deflection that the measured torque T tells,

    T_f'' = w0^2 (T - T_f) - 2 w0 T_f'             theta_c(t) = theta(t) + D(T_f)

The filter is there because D is steep where the gears change flanks, and T answers to the
correction: angle and rate of D(T_f) are bounded for the same reason.

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
    Ratio,
    Second,
    Turning,
)

PI = 3.141592653589793


class Component(NamedTuple):
    """One cosine of a reference, and how it is corrected."""

    amplitude: float  # rad; N*m where the reference is a torque
    omega: RadianPerSecond
    phase: Radian  # at zero of the clock
    gain: Ratio  # g: corrected over plain amplitude, 1 without correction
    advance: Second  # tau, 0 without correction


class Span(NamedTuple):
    """When the envelope grows and fades, on the row's own clock."""

    rise: Second  # in which it grows from 0 to 1, and fades again
    until: Second  # when it begins to fade


class Params(NamedTuple):
    """The correction in the instant; without a map there is none."""

    torques: tuple[float, ...]  # N*m, increasing, two at least; or none
    deflections: tuple[float, ...]  # rad, motor ahead of shaft, at those torques
    filter_omega: RadianPerSecond  # w0 of the torque filter
    most_angle: Radian  # either way
    most_velocity: RadianPerSecond  # either way


class State(NamedTuple):
    """The torque filter, and the correction in the instant as it was last given."""

    torque: NewtonMetre
    torque_rate: float  # N*m/s
    angle: Radian


def start() -> State:
    """State at switch-on: no torque seen, no correction given."""
    return State(0.0, 0.0, 0.0)


def envelope(span: Span, clock: float) -> tuple[float, float]:
    """Share of the reference in use (1) and its rate (1/s): half a cosine up, and down again."""
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


def reference(components: tuple[Component, ...], span: Span, clock: float) -> Turning:
    """The plain reference at ``clock`` (s): its value and its rate, 0 before the clock runs."""
    share, rate = envelope(span, clock)
    if not finite(share) or share == 0.0:
        return Turning(share, share)
    angle = velocity = 0.0
    for amplitude, omega, phase, _, _ in components:
        angle, velocity = _added(angle, velocity, amplitude, omega, omega * clock + phase)
    return Turning(share * angle, share * velocity + rate * angle)


def corrected(components: tuple[Component, ...], span: Span, clock: float) -> Turning:
    """The reference amplified and advanced component by component."""
    share, rate = envelope(span, clock)
    if not finite(share) or share == 0.0:
        return Turning(share, share)
    angle = velocity = 0.0
    for amplitude, omega, phase, gain, advance in components:
        at = omega * (clock + advance) + phase
        angle, velocity = _added(angle, velocity, gain * amplitude, omega, at)
    return Turning(share * angle, share * velocity + rate * angle)


def step(
    params: Params,
    state: State,
    components: tuple[Component, ...],
    span: Span,
    clock: Second,
    torque: NewtonMetre,
    dt: float,
) -> tuple[State, tuple[Turning, Turning]]:
    """Plain reference, and what the corrections add to it; ``torque``: measured, tared."""
    plain = reference(components, span, clock)
    ahead = corrected(components, span, clock)
    angle, velocity = ahead.angle - plain.angle, ahead.velocity - plain.velocity
    if len(params.torques) == 0:
        return state, (plain, Turning(angle, velocity))
    before = state.angle
    state = _told(params, state, clock, torque, dt)
    moved = state.angle - before
    return state, (plain, Turning(angle + state.angle, velocity + moved / dt))


def _told(params: Params, state: State, clock: float, torque: float, dt: float) -> State:
    """The filter one tick further, and the correction it tells, moved there within its bounds."""
    filtered, rate, angle = state
    omega = params.filter_omega
    rate = rate + dt * (omega * omega * (torque - filtered) - 2.0 * omega * rate)
    filtered = filtered + dt * rate
    told = 0.0
    if clock >= 0.0:  # else the row's motion has not begun: back to no correction
        told = _deflection(params.torques, params.deflections, filtered)
    told = clamp(told, -params.most_angle, params.most_angle)
    step_most = params.most_velocity * dt
    return State(filtered, rate, clamp(told, angle - step_most, angle + step_most))


def _deflection(torques: tuple[float, ...], deflections: tuple[float, ...], torque: float) -> float:
    """D(T), rad; not finite for a torque that is not, none without a map."""
    if len(torques) == 0:
        return 0.0
    if not finite(torque):
        return torque
    return interpolate(torque, torques, deflections)


def _added(
    value: float, rate: float, amplitude: float, omega: float, at: float
) -> tuple[float, float]:
    """One more cosine in a sum and in its rate; not finite for a phase that is not."""
    if not finite(at):
        return at, at
    return value + amplitude * cos(at), rate - amplitude * omega * sin(at)
