"""The impedance law: force on the body from its motion, plus a reference force.

    F = Kp v + Ki x + Km a + Z_c v + reference        (N, force on the body, up positive)

Signs: Kp < 0 is damping and absorbs power, Ki > 0 acts as a negative spring, Km > 0 as a negative
mass (MASK4 report, section 4.3: F = Kp v + Ki x). Z_c(s) is force per velocity, rational, stable
and proper, given as sections in cascade (rig/design/impedance.py); Re Z_c(j omega) < 0 absorbs.
Ki multiplies the measured position, not an integral, so it does not wind up; an encoder offset b
gives Ki b newtons, which is why a campaign tares first.

Changes are bumpless: gains are ramped, and so is the share of Z_c v in the force, from zero at the
start.

Limits and the memory of Z_c. If the limits granted less than was demanded (``saturation_deficit`` =
granted - demanded, of the previous tick) and the force w of the filter's memory points the same way
as the excess, the whole memory is scaled down, never past zero:

    s <- lambda s,    lambda = max(0, 1 + (dt / TRACKING) deficit / w)    if deficit w < 0, else 1

This is back-calculation (Astrom and Hagglund, Advanced PID Control, section 3.5) acting on the
memory alone. It is harmless whatever the limits do: (1) the memories that velocities of at most V
can reach are a convex set around zero, so a scaled-down memory is still one of them: no force
arises that the filter alone could not give for velocities of that size. (2) If Z_c never gives
the body energy (in this sign: if -Z_c is passive), it has a quadratic storage function, which falls
with the square of lambda: Z_c stays passive. (3) While the demand is granted in full, the law does
not touch the memory: the result is the same to the bit.

Bad input: NaN or infinity in motion, gains or reference give a force that is not finite, which the
limits turn into a stop; such a value stays in Z_c's memory until the law starts afresh. A
``saturation_deficit`` of NaN has no effect, an infinite one at most empties the memory.
"""

from typing import NamedTuple

from controllers import biquads
from controllers.biquads import Biquad, SectionState
from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate, Gains, Newton, Second

COLUMNS = (
    Column("kp_n_s_per_m", "kp", "N*s/m", "Kp", -20_000.0, 0.0,
           "Velocity gain; Kp < 0 absorbs.",
           "F = Kp v on the body: Kp > 0 would drive it, Kp < 0 absorbs"),
    Column("ki_n_per_m", "ki", "N/m", "Ki", -30_000.0, 30_000.0,
           "Position gain; Ki > 0 acts as a negative spring."),
    Column("km_kg", "km", "kg", "Km", -500.0, 500.0,
           "Acceleration gain; Km > 0 acts as a negative mass.", default=0.0),
)  # fmt: skip

PARAMETERS: tuple[Parameter, ...] = ()
"""The law's only constant, Z_c(s), is a transfer function and not a number: ``law: {zc: ...}``."""

SetPoint = Gains
"""The set point of a row."""

# A tenth of the shortest wave period (0.5 s), so that the memory follows a clipped peak; many times
# the few ticks of a slew limit, which thus hardly affects the memory.
TRACKING = 0.05  # s


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # duration of a change of gains
    sections: tuple[Biquad, ...] = ()  # Z_c, N*s/m, for one tick period; none: Z_c = 0
    period: Second = 0.0  # of a tick, for which the sections hold


class State(NamedTuple):
    """The active gains, ramped towards the set gains, and the memory of Z_c."""

    kp: Ramp
    ki: Ramp
    km: Ramp
    zc_share: Ramp  # of Z_c v in the force, 0 to 1
    sections: tuple[SectionState, ...]
    active_gains: Gains  # values of the first three ramps: one comparison in a usual tick


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants without Z_c, which `rig.design.impedance` designs."""
    return Params(ramp, (), dt)


def start(params: Params) -> State:
    """Return the state at switch-on: all gains zero, so the first force is at most a ramp step."""
    none = ramp_start(0.0)
    return State(none, none, none, none, biquads.start(params.sections), Gains(0.0, 0.0, 0.0))


def step(
    params: Params,
    state: State,
    gains: Gains,
    estimate: Estimate,
    reference: Newton,
    saturation_deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Return the force on the body (N) for the measured motion, gains ramped towards ``gains``.

    ``reference`` (N on the body) is added unchanged; ``saturation_deficit`` is granted - demanded
    force of the previous tick, exactly 0.0 if the demand was granted in full.
    """
    if state.active_gains != gains:
        state = _ramp_gains(params, state, gains, dt)
        gains = state.active_gains
    kp, ki, km = gains
    position, velocity, acceleration = estimate
    force = kp * velocity + ki * position + km * acceleration + reference
    if len(params.sections) == 0:
        return state, Demand(kp, ki, km, force)
    ramp_kp, ramp_ki, ramp_km, share, memory, _ = state
    if saturation_deficit != 0.0:
        memory = _back_calculate(params.sections, memory, saturation_deficit, dt)
    memory, zc_force = biquads.step(params.sections, memory, velocity)
    if share.value != 1.0:
        share = ramp_step(share, 1.0, params.ramp, dt)
    force = force + share.value * zc_force
    after = State(ramp_kp, ramp_ki, ramp_km, share, memory, gains)
    return after, Demand(kp, ki, km, force)


def linear(params: Params, setpoint: Gains, omega: float) -> complex:
    """Return force per velocity (N*s/m) at ``omega`` > 0 (rad/s), with the gains fully ramped."""
    response = complex(setpoint.kp, setpoint.km * omega - setpoint.ki / omega)
    return response + biquads.response(params.sections, omega * params.period)


def _ramp_gains(params: Params, state: State, gains: Gains, dt: float) -> State:
    """Return the state with its gains moved one tick towards ``gains``."""
    kp = ramp_step(state.kp, gains.kp, params.ramp, dt)
    ki = ramp_step(state.ki, gains.ki, params.ramp, dt)
    km = ramp_step(state.km, gains.km, params.ramp, dt)
    active_gains = Gains(kp.value, ki.value, km.value)
    return State(kp, ki, km, state.zc_share, state.sections, active_gains)


def _back_calculate(
    sections: tuple[Biquad, ...], memory: tuple[SectionState, ...], deficit: float, dt: float
) -> tuple[SectionState, ...]:
    """Return the memory reduced by back-calculation if it drives the demand beyond the limits."""
    memory_force = biquads.output(sections, memory, 0.0)
    if not memory_force * deficit < 0.0:
        return memory
    factor = 1.0 + dt / TRACKING * (deficit / memory_force)
    return biquads.scale_states(memory, factor if factor > 0.0 else 0.0)
