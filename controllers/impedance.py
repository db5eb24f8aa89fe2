"""The impedance law: force on the body from its motion, and a reference beside it.

    F = Kp v + Ki x + Km a + Z_c v + reference        (N, force on the body, up positive)

Signs: Kp < 0 is damping and absorbs power, Ki > 0 acts as a negative spring, Km > 0 as a negative
mass (MASK4 report, section 4.3: F = Kp v + Ki x). Z_c(s) is force per velocity, rational, stable
and proper, given as sections in cascade (rig/design/impedance.py); Re Z_c(j omega) < 0 absorbs.
Ki multiplies the measured position, not an integral, so it does not wind up; an encoder offset b
gives Ki b newtons, which is why a campaign tares first.

Changes are bumpless: gains are ramped, and the share of Z_c v in the force is ramped too, from
nothing at the start.

Limits and the memory of Z_c. When the limits granted less than was demanded (``short`` = granted -
demanded, of the tick before) and the force held in the filter's memory, w, points the same way as
the excess, the whole memory is scaled down, never past zero:

    s <- lambda s,    lambda = max(0, 1 + (dt / TRACKING) short / w)    if short w < 0, else 1

This is back-calculation (Astrom and Hagglund, Advanced PID Control, section 3.5) acting on the
memory alone. It can do no harm whatever the limits do: (1) the memories that velocities of at most
V can reach are a convex set around zero, so a memory scaled down is still one of them: no force
arises that the filter alone could not give for velocities of that size. (2) If Z_c never gives
the body energy (in this sign: if -Z_c is passive), it has a quadratic storage function, which falls
with the square of lambda: it stays so. (3) While all is granted, nothing is done: the same bits.

Bad input: NaN or infinity in motion, gains or reference give a force that is not finite, which the
limits turn into a stop; in Z_c's memory it stays until the law starts afresh. A ``short`` that is
NaN does nothing, an infinite one at most empties the memory.
"""

from typing import NamedTuple

from controllers import biquads
from controllers.biquads import Biquad, SectionState
from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Demand, Estimate, Gains, Newton, Second

# A tenth of the shortest wave period of 0.5 s, so a clipped peak is followed; many times the few
# ticks of a slew limit, so that hardly touches the memory.
TRACKING = 0.05  # s


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time a change of gains takes
    sections: tuple[Biquad, ...] = ()  # Z_c, N*s/m, for one tick period; none: Z_c = 0


class State(NamedTuple):
    """The gains in use, on their way to the set ones, and the memory of Z_c."""

    kp: Ramp
    ki: Ramp
    km: Ramp
    share: Ramp  # of Z_c v in the force, 0 to 1
    sections: tuple[SectionState, ...]
    used: Gains  # what the first three ramps are at: one comparison in the usual tick


def start(sections: tuple[Biquad, ...] = ()) -> State:
    """State at switch-on for a Z_c: all gains zero, so the first force is zero but for a ramp."""
    none = ramp_start(0.0)
    return State(none, none, none, none, biquads.start(sections), Gains(0.0, 0.0, 0.0))


def step(
    params: Params,
    state: State,
    gains: Gains,
    estimate: Estimate,
    reference: Newton,
    saturation_deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Force on the body (N) for the measured motion, gains ramped towards ``gains``.

    ``reference`` is added as it is (N on the body); ``short`` is granted - demanded of the tick
    before, exactly 0.0 if it was granted in full.
    """
    if state.used != gains:
        state = _ramped(params, state, gains, dt)
        gains = state.used
    kp, ki, km = gains
    position, velocity, acceleration = estimate
    force = kp * velocity + ki * position + km * acceleration + reference
    if len(params.sections) == 0:
        return state, Demand(kp, ki, km, force)
    ramp_kp, ramp_ki, ramp_km, share, memory, _ = state
    if saturation_deficit != 0.0:
        memory = _unwound(params.sections, memory, saturation_deficit, dt)
    memory, reply = biquads.step(params.sections, memory, velocity)
    if share.value != 1.0:
        share = ramp_step(share, 1.0, params.ramp, dt)
    force = force + share.value * reply
    after = State(ramp_kp, ramp_ki, ramp_km, share, memory, gains)
    return after, Demand(kp, ki, km, force)


def _ramped(params: Params, state: State, gains: Gains, dt: float) -> State:
    """The state with its gains moved one tick towards ``gains``."""
    kp = ramp_step(state.kp, gains.kp, params.ramp, dt)
    ki = ramp_step(state.ki, gains.ki, params.ramp, dt)
    km = ramp_step(state.km, gains.km, params.ramp, dt)
    used = Gains(kp.value, ki.value, km.value)
    return State(kp, ki, km, state.share, state.sections, used)


def _unwound(
    sections: tuple[Biquad, ...], memory: tuple[SectionState, ...], short: float, dt: float
) -> tuple[SectionState, ...]:
    """The memory less what the limits left out, as far as it pushes beyond them."""
    held = biquads.held(sections, memory, 0.0)
    if not held * short < 0.0:
        return memory
    factor = 1.0 + dt / TRACKING * (short / held)
    return biquads.scaled(memory, factor if factor > 0.0 else 0.0)
