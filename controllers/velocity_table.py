"""Force from a table over velocity, as generators with a programmed load curve have it.

    F = scale f(v) + reference,    scale times retract where v < 0       (N, force on the body)

``f`` is piecewise linear over velocity and constant beyond its ends. The heave take-off of the
MBARI wave energy converter works this way: winding current over motor speed from a table, times a
scale factor, and times a retract factor where the piston retracts (MBARI WEC documentation, power
conversion controller).

The table must absorb: v f(v) <= 0 at every velocity, which holds if it holds at every point and the
force at zero velocity is zero. Then every scale and retract factor >= 0 absorbs, too.

Changes are bumpless: the scale is ramped, from zero at the start.

Bad input: a velocity that is not finite gives a force that is not finite, which the limits turn
into a stop.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, finite, interpolate, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate, Newton, Ratio, Second

COLUMNS = (
    Column("table_scale", "table_scale", "1", "table scale", 0.0, 10.0,
           "Factor on the force of the table."),
    Column("retract_factor", "retract_factor", "1", "retract factor", 0.0, 10.0,
           "Further factor on the force while the velocity is negative."),
)  # fmt: skip

PARAMETERS = (
    Parameter("velocity_m_per_s", "m/s", -20.0, 20.0, "Velocities of the table, rising.", (), True),
    Parameter("force_n", "N", -1e6, 1e6, "Force on the body at each velocity.", (), True),
)


class SetPoint(NamedTuple):
    """The set point of a row."""

    table_scale: Ratio
    retract_factor: Ratio


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time that a change of the scale takes
    velocities: tuple[float, ...]  # m/s, rising
    forces: tuple[float, ...]  # N on the body, as many


class State(NamedTuple):
    """The factors in use, on their way to those of the set point."""

    scale: Ramp
    retract: Ramp


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants; ValueError for a table that is not monotone or that drives the body."""
    velocities, forces = settings["velocity_m_per_s"], settings["force_n"]
    if len(velocities) != len(forces) or len(velocities) < 2:
        raise ValueError(
            f"velocity_m_per_s has {len(velocities)} values and force_n {len(forces)}; "
            "a table needs two or more of each, as many of one as of the other"
        )
    for i in range(1, len(velocities)):
        left, right = velocities[i - 1], velocities[i]
        if not left < right:
            raise ValueError(f"velocity_m_per_s must rise, but {right:g} follows {left:g}")
    for velocity, force in zip(velocities, forces, strict=True):
        if velocity * force > 0.0:
            raise ValueError(
                f"force_n is {force:g} where velocity_m_per_s is {velocity:g}: force "
                "and velocity of one sign drive the body; a table over velocity may only absorb"
            )
    at_rest = interpolate(0.0, velocities, forces)
    if at_rest != 0.0:
        raise ValueError(
            f"force_n is {at_rest:g} at rest and would drive the body on one side of it; "
            "add the point 0 of velocity_m_per_s and force_n"
        )
    return Params(ramp, velocities, forces)


def start(params: Params) -> State:
    """State at switch-on: both factors zero, so the first force is zero but for a ramp."""
    return State(ramp_start(0.0), ramp_start(0.0))


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: Newton,
    deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Return the state and the force on the body (N) for the measured velocity."""
    scale = ramp_step(state.scale, setpoint.table_scale, params.ramp, dt)
    retract = ramp_step(state.retract, setpoint.retract_factor, params.ramp, dt)
    velocity = motion.velocity
    if not finite(velocity):
        return State(scale, retract), Demand(0.0, 0.0, 0.0, velocity)
    force = scale.value * interpolate(velocity, params.velocities, params.forces)
    if velocity < 0.0:
        force = retract.value * force
    return State(scale, retract), Demand(0.0, 0.0, 0.0, force + reference)
