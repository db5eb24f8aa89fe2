"""Station keeping: an axis used as a mooring, passive by construction, with a soft stop.

    F = Kp v + Ki d - sign(d) P,    d = x - x_s       (N, force on the body)
    P = e max(0, K + C e'),         e = |d| - reach where that is positive, else 0

Signs: Kp < 0 damps and Ki < 0 pulls back to the station x_s. The law limits both to values <= 0, so
it takes energy out of the body over any motion that ends where it began, at rest. The default
Kp is the damping found by hand in the MASK4 test, 2500 N s/m, in this sign (MASK4 report, section
3.2.1.2). Kp, Ki and the soft stop are ramped up from zero at the start.

The soft stop is a spring K whose damping C e grows with the depth e, so that nothing jumps at
the edge of the reach (Hunt and Crossley 1975, J. Appl. Mech. 42, p. 440). It pushes inward
or not at all. It is passive: on the way in P is at least K e, on the way out at most K e.

These statements hold for the motion as measured. The caller must check the effects of sampling,
delay and the estimator on the closed loop, as for every law.

Bad input: NaN or infinity in motion or gains gives a force that is not finite, which the limits
turn into a stop. A negative K or C counts as zero.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Demand, Estimate, Gains, Metre, NewtonPerMetre, Second

DEFAULT = Gains(-2500.0, 0.0, 0.0)  # MASK4 report, section 3.2.1.2


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # duration of a change of gains
    station: Metre  # x_s, position at which the axis is kept
    reach: Metre  # >= 0, half width of the travel without soft stop
    soft_stiffness: NewtonPerMetre  # K >= 0 of the soft stop; 0: no soft stop
    soft_damping: float  # C >= 0, N*s/m^2: damping of the soft stop per metre of depth


class State(NamedTuple):
    """The active gains, ramped towards the set gains, and the share of the soft stop."""

    kp: Ramp
    ki: Ramp
    soft_stop_ramp: Ramp  # share of the soft stop, 0 to 1
    active_gains: Gains  # values of the first two ramps: one comparison in a usual tick
    soft_stop_share: float  # value of the third ramp


def start() -> State:
    """Return the state at switch-on: no force, whatever the measured motion."""
    none = ramp_start(0.0)
    return State(none, none, none, Gains(0.0, 0.0, 0.0), 0.0)


def step(
    params: Params, state: State, gains: Gains, estimate: Estimate, dt: float
) -> tuple[State, Demand]:
    """Return the force on the body (N) for the measured motion; Km of ``gains`` is not used.

    The demand carries the active gains: never above zero.
    """
    if state.active_gains != gains or state.soft_stop_share != 1.0:
        state = _ramp_gains(params, state, gains, dt)
    _, _, _, (kp, ki, _), soft_stop_share = state
    position, velocity, _ = estimate
    offset, reach = position - params.station, params.reach
    force = kp * velocity + ki * offset
    if not -reach <= offset <= reach:
        if offset > 0.0:
            force = force - soft_stop_share * _soft_stop_force(params, offset - reach, velocity)
        else:
            force = force + soft_stop_share * _soft_stop_force(params, -reach - offset, -velocity)
    return state, Demand(kp, ki, 0.0, force)


def _ramp_gains(params: Params, state: State, gains: Gains, dt: float) -> State:
    """Return the state moved one tick towards ``gains``, limited to passive values."""
    target_kp = 0.0 if gains.kp > 0.0 else gains.kp  # NaN stays NaN
    target_ki = 0.0 if gains.ki > 0.0 else gains.ki
    kp = ramp_step(state.kp, target_kp, params.ramp, dt)
    ki = ramp_step(state.ki, target_ki, params.ramp, dt)
    soft_stop = ramp_step(state.soft_stop_ramp, 1.0, params.ramp, dt)
    return State(kp, ki, soft_stop, Gains(kp.value, ki.value, 0.0), soft_stop.value)


def _soft_stop_force(params: Params, depth: float, depth_rate: float) -> float:
    """Return the soft stop's force (N, >= 0) at a depth (m, > 0) that grows at ``depth_rate``."""
    stiffness = 0.0 if params.soft_stiffness < 0.0 else params.soft_stiffness
    damping = 0.0 if params.soft_damping < 0.0 else params.soft_damping
    force = depth * (stiffness + damping * depth_rate)
    return 0.0 if force < 0.0 else force
