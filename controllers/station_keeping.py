"""Station keeping: an axis used as a mooring, passive by construction, with a soft stop.

    F = Kp v + Ki d - sign(d) P,    d = x - x_s       (N, force on the body)
    P = e max(0, K + C e'),         e = |d| - reach where that is positive, else 0

Signs: Kp < 0 damps and Ki < 0 pulls back to the station x_s; both are held at or below zero, so
the law takes energy out of the body over any motion that ends where it began, at rest. The default
Kp is the damping found by hand in the MASK4 test, 2500 N s/m, in this sign (MASK4 report, section
3.2.1.2). Kp, Ki and the soft stop are ramped from nothing at the start.

The soft stop is a spring K whose damping C e grows with the depth e, so that nothing jumps at
the edge of the reach (Hunt and Crossley 1975, J. Appl. Mech. 42, p. 440). It pushes inward
or not at all. It is passive: going in, P is at least K e, coming out, at most.

This is said of the motion as it is measured. What sampling, delay and the estimator add is the
caller's check of the closed loop, as for every law.

Bad input: NaN or infinity in motion or gains gives a force that is not finite, which the limits
turn into a stop. A negative K or C counts as zero.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Demand, Estimate, Gains, Metre, NewtonPerMetre, Second

DEFAULT = Gains(-2500.0, 0.0, 0.0)  # MASK4 report, section 3.2.1.2


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time a change of gains takes
    station: Metre  # x_s, where the axis is kept
    reach: Metre  # >= 0, half width of the way without soft stop
    soft_stiffness: NewtonPerMetre  # K >= 0, of the soft stop; 0: none
    soft_damping: float  # C >= 0, N*s/m^2: damping of the soft stop per metre of depth


class State(NamedTuple):
    """The gains in use, on their way to the set ones."""

    kp: Ramp
    ki: Ramp
    share: Ramp  # of the soft stop, 0 to 1
    used: Gains  # what the first two ramps are at: one comparison in the usual tick
    soft: float  # what the third is at


def start() -> State:
    """State at switch-on: no force, whatever is measured."""
    none = ramp_start(0.0)
    return State(none, none, none, Gains(0.0, 0.0, 0.0), 0.0)


def step(
    params: Params, state: State, gains: Gains, estimate: Estimate, dt: float
) -> tuple[State, Demand]:
    """Force on the body (N) for the measured motion; Km of ``gains`` is not used.

    The demand names the gains that were used: never above zero.
    """
    if state.used != gains or state.soft != 1.0:
        state = _ramped(params, state, gains, dt)
    _, _, _, (kp, ki, _), soft = state
    position, velocity, _ = estimate
    off, reach = position - params.station, params.reach
    force = kp * velocity + ki * off
    if not -reach <= off <= reach:
        if off > 0.0:
            force = force - soft * _push(params, off - reach, velocity)
        else:
            force = force + soft * _push(params, -reach - off, -velocity)
    return state, Demand(kp, ki, 0.0, force)


def _ramped(params: Params, state: State, gains: Gains, dt: float) -> State:
    """The state moved one tick towards ``gains``, as far as they are passive."""
    wanted_kp = 0.0 if gains.kp > 0.0 else gains.kp  # NaN stays NaN
    wanted_ki = 0.0 if gains.ki > 0.0 else gains.ki
    kp = ramp_step(state.kp, wanted_kp, params.ramp, dt)
    ki = ramp_step(state.ki, wanted_ki, params.ramp, dt)
    share = ramp_step(state.share, 1.0, params.ramp, dt)
    return State(kp, ki, share, Gains(kp.value, ki.value, 0.0), share.value)


def _push(params: Params, depth: float, deepening: float) -> float:
    """The soft stop's force (N, >= 0) at a depth (m, > 0) that grows by so much (m/s)."""
    stiffness = 0.0 if params.soft_stiffness < 0.0 else params.soft_stiffness
    damping = 0.0 if params.soft_damping < 0.0 else params.soft_damping
    force = depth * (stiffness + damping * deepening)
    return 0.0 if force < 0.0 else force
