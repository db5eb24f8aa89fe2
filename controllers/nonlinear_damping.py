"""Velocity-squared and Coulomb damping.

    F = -(f0 sat(v / v_s) + c2 |v| v) + reference                  (N, force on the body)

``c2`` is the quadratic coefficient (as a fluid-power take-off with an orifice has it), ``f0`` the
Coulomb force (a hydraulic take-off at constant pressure; Falcao, Ocean Engineering 34 (2007) 2021).
A force that jumps with the sign of a measured velocity would chatter, so sgn(v) is the saturated
line sat(v / v_s), which reaches one at the smoothing velocity v_s.

Per cycle of a sinusoidal velocity of amplitude V the mean absorbed power is 4/(3 pi) c2 V^3 for the
first and, as v_s goes to zero, 2/pi f0 V for the second.

Changes are bumpless: both coefficients are ramped, from zero at the start.

Bad input: a velocity that is not finite gives a force that is not finite, which the limits turn
into a stop.
"""

from typing import Annotated, NamedTuple

from controllers.blocks import Ramp, clamp, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate, MetrePerSecond, Newton, Second

COLUMNS = (
    Column("quadratic_n_s2_per_m2", "quadratic", "N*s^2/m^2", "quadratic damping", 0.0, 1e6,
           "Force per velocity squared."),
    Column("coulomb_n", "coulomb", "N", "Coulomb force", 0.0, 1e6,
           "Force against the motion, whatever its speed."),
)  # fmt: skip

PARAMETERS = (
    Parameter(
        "smoothing_m_per_s", "m/s", 1e-4, 1.0,
        "Velocity below which the Coulomb force falls linearly to zero.", (0.01,)
    ),
)  # fmt: skip


class SetPoint(NamedTuple):
    """The set point of a row."""

    quadratic: Annotated[float, "N*s^2/m^2"]  # c2
    coulomb: Newton  # f0


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time that a change of a coefficient takes
    smoothing: MetrePerSecond  # v_s > 0


class State(NamedTuple):
    """The coefficients in use, on their way to those of the set point."""

    quadratic: Ramp
    coulomb: Ramp


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants."""
    return Params(ramp, settings["smoothing_m_per_s"][0])


def start(params: Params) -> State:
    """State at switch-on: both coefficients zero, so the first force is zero but for a ramp."""
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
    quadratic = ramp_step(state.quadratic, setpoint.quadratic, params.ramp, dt)
    coulomb = ramp_step(state.coulomb, setpoint.coulomb, params.ramp, dt)
    velocity = motion.velocity
    speed = velocity if velocity > 0.0 else -velocity
    share = clamp(velocity / params.smoothing, -1.0, 1.0)
    force = -(coulomb.value * share + quadratic.value * speed * velocity)
    return State(quadratic, coulomb), Demand(0.0, 0.0, 0.0, force + reference)
