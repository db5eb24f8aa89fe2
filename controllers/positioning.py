"""Positioning: move an axis to a goal and hold it there, such as the stator of a magnetic spring.

    F = -K (x - x_t) - D v + reference                  (N, force on the body)

The target x_t moves from where the axis is found to the goal of the row, with bounded speed and
acceleration (`controllers/position_hold.py`). Spring and damper are ramped up from zero. Under a
steady load F_0 the axis stands F_0 / K from its goal.

Bad input: a motion that is not finite gives a force that is not finite, which the limits turn into
a stop.
"""

from typing import NamedTuple

from controllers import position_hold
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate, Metre, Newton

COLUMNS = (
    Column("goal_m", "goal", "m", "goal", -100.0, 100.0, "Position at which the axis is held."),
)

PARAMETERS = (
    Parameter("hold_stiffness_n_per_m", "N/m", 1.0, 1e7,
              "Stiffness of the hold; as stiff as the loop stays stable."),
    Parameter("hold_damping_n_s_per_m", "N*s/m", 0.0, 1e6, "Damping of the hold."),
    Parameter("speed_m_per_s", "m/s", 1e-5, 10.0, "Greatest speed of the target."),
    Parameter("acceleration_m_per_s2", "m/s^2", 1e-5, 100.0,
              "Greatest acceleration of the target.", (0.1,)),
)  # fmt: skip


class SetPoint(NamedTuple):
    """The set point of a row."""

    goal: Metre


Params = position_hold.Params
State = position_hold.State


def params(settings: Settings, ramp: float, dt: float) -> Params:
    """Return the constants."""
    return Params(
        ramp,
        settings["hold_stiffness_n_per_m"][0],
        settings["hold_damping_n_s_per_m"][0],
        settings["speed_m_per_s"][0],
        settings["acceleration_m_per_s2"][0],
    )


def start(params: Params) -> State:
    """State at switch-on: no force; the target starts where the axis is found."""
    return position_hold.start()


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: Newton,
    deficit: Newton,
    dt: float,
) -> tuple[State, Demand]:
    """Return the state and the force on the body (N), the target moved one tick to the goal."""
    state, hold = position_hold.step(params, state, setpoint.goal, motion, dt)
    return state, Demand(hold.kp, hold.ki, 0.0, hold.force + reference)
