"""Spring and damper to a goal: F = -K (x - goal) - D v + reference, force on the body, up positive.

The goal moves to that of the row in a straight line. ``rig laws`` lists the law with its columns
and parameters; docs/reference/laws.md of wec-rig explains the parts and the rules of the code.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.law import Column, Parameter, Settings
from controllers.signals import Demand, Estimate

COLUMNS = (Column("goal_m", "goal", "m", "goal", -2.0, 2.0, "Position at which the axis rests."),)

PARAMETERS = (
    Parameter("stiffness_n_per_m", "N/m", 0.0, 1e6, "Spring to the goal.", (4000.0,)),
    Parameter("damping_n_s_per_m", "N*s/m", 0.0, 1e6, "Damping of the motion.", (900.0,)),
)


class SetPoint(NamedTuple):
    goal: float  # m


class Params(NamedTuple):
    ramp: float  # s, time that a change of the goal takes
    stiffness: float  # N/m
    damping: float  # N*s/m


class State(NamedTuple):
    goal: Ramp  # m


def params(settings: Settings, ramp: float, dt: float) -> Params:
    return Params(ramp, settings["stiffness_n_per_m"][0], settings["damping_n_s_per_m"][0])


def start(params: Params) -> State:
    return State(ramp_start(0.0))


def step(
    params: Params,
    state: State,
    setpoint: SetPoint,
    motion: Estimate,
    reference: float,
    deficit: float,
    dt: float,
) -> tuple[State, Demand]:
    goal = ramp_step(state.goal, setpoint.goal, params.ramp, dt)
    kp, ki = -params.damping, -params.stiffness
    force = kp * motion.velocity + ki * (motion.position - goal.value) + reference
    return State(goal), Demand(kp, ki, 0.0, force)
