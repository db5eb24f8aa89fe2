"""The flap on its driveline as one pure step, and its sensor readings.

The driveline is the bench's up to the load cell; the flap replaces the brake. Between coupling and
cell the shaft passes a bearing and a seal, so the cell reads less than the motor torque; behind the
flap is another bearing and seal, whose friction the cell does not measure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.bench import dynamometer, gearbox, load_cell, losses, transmission
from sim_plant.bench.dynamometer import CLAMP_TORQUE, BenchParams, BenchState
from sim_plant.bench.losses import DragParams
from sim_plant.bench.motor import ShaftLoad
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.flap import body
from sim_plant.flap.body import FlapBodyParams, FlapBodyState
from sim_plant.units import Flag, NewtonMetre, Radian, RadianPerSecond, Second


class FlapParams(NamedTuple):
    """Parameters of the step, as floats; the brake of the bench is unused."""

    driveline: BenchParams
    body: FlapBodyParams
    far_side: DragParams  # bearing and seal behind the flap
    coupled: Flag  # 0: the rigid coupling is removed; bearing, seal and cell stay on the flap


class FlapState(NamedTuple):
    """State of the step."""

    driveline: BenchState  # its shaft is the flap's
    body: FlapBodyState
    coupling_torque: (
        NewtonMetre  # through the coupling; `driveline.shaft_torque` is behind the seal
    )


def initial(params: FlapParams, angle: Radian) -> FlapState:
    """Return the flap at rest at an angle, the driveline unwound and switched off."""
    rest = dynamometer.initial(params.driveline)
    driveline = BenchState(
        rest.drive, rest.servo, rest.gearbox, rest.brake,
        angle, 0.0, angle, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    return FlapState(driveline, FlapBodyState(angle, 0.0, 0.0, 0.0), 0.0)


def turn_to(state: FlapState, angle: Radian) -> FlapState:
    """Return the flap held at rest at an angle; its driveline, uncoupled, is unaffected."""
    driveline = state.driveline
    turned = BenchState(
        driveline.drive, driveline.servo, driveline.gearbox, driveline.brake,
        driveline.motor_angle, driveline.motor_velocity, angle, 0.0, 0.0, driveline.friction,
        driveline.power, driveline.drift,
    )  # fmt: skip
    return FlapState(turned, FlapBodyState(angle, 0.0, 0.0, 0.0), state.coupling_torque)


def step(
    params: FlapParams,
    state: FlapState,
    actuation: Actuation,
    fresh: Flag,
    stopped: Flag,
    excitation: NewtonMetre,
    normals: Sequence[float],
    dt: Second,
) -> FlapState:
    """Advance flap and driveline by dt; `excitation` is the moment at the new tick.

    With `locked` the flap is clamped. `fresh`, `stopped` and `normals` are as on the bench.
    """
    driveline, body_state, coupling_torque = state
    driveline_params = params.driveline
    angle = (
        body_state.angle if actuation.locked == 1 else body_state.angle + body_state.velocity * dt
    )
    shaft_load = ShaftLoad(driveline.motor_angle - angle, CLAMP_TORQUE, CLAMP_TORQUE)
    if params.coupled == 0:
        shaft_load = ShaftLoad(0.0, 0.0, 0.0)
    loaded_driveline = _with_shaft_torque(driveline, coupling_torque)
    motor_step = dynamometer.move_motor(
        driveline_params, loaded_driveline, shaft_load, actuation, fresh, stopped, normals, dt
    )
    load = transmission.torque(driveline_params.transmission, motor_step.angle - angle)
    if params.coupled == 0:
        load = 0.0
    near_friction, far_friction = _dry_friction(params, body_state.velocity)
    flap_step = body.velocity_step(
        params.body, body_state, angle, excitation + load, near_friction + far_friction, dt
    )
    next_body = flap_step.state
    if actuation.locked == 1:
        next_body = FlapBodyState(angle, 0.0, 0.0, 0.0)
        near_torque = 0.0
    else:
        near_torque = (
            flap_step.friction * near_friction / (near_friction + far_friction)
            if near_friction + far_friction > 0.0
            else 0.0
        )
    cell_torque = load - near_torque
    motor_travel = motor_step.angle - driveline.motor_angle
    mean_velocity = 0.5 * (body_state.velocity + next_body.velocity)
    next_driveline = BenchState(
        motor_step.drive, motor_step.servo,
        gearbox.step(driveline_params.gearbox, driveline.gearbox, load, motor_travel, normals),
        driveline.brake, motor_step.angle, motor_step.velocity, angle, mean_velocity, cell_torque,
        motor_step.friction, cell_torque * mean_velocity,
        load_cell.drift_step(driveline_params.load_cell, driveline.drift, dt),
    )  # fmt: skip
    return FlapState(next_driveline, next_body, load)


def sample(
    params: FlapParams, state: FlapState, e_stop: Flag, tick: int, normals: Sequence[float]
) -> BenchReading:
    """Return the sensor readings at a state; `tick` is the index of the noise table."""
    return dynamometer.sample(params.driveline, state.driveline, e_stop, tick, normals)


def _with_shaft_torque(driveline: BenchState, coupling_torque: NewtonMetre) -> BenchState:
    """Return the driveline's state with the torque that the gearbox transmits."""
    return BenchState(
        driveline.drive, driveline.servo, driveline.gearbox, driveline.brake,
        driveline.motor_angle, driveline.motor_velocity,
        driveline.shaft_angle, driveline.shaft_velocity, coupling_torque, driveline.friction,
        driveline.power, driveline.drift,
    )  # fmt: skip


def _dry_friction(params: FlapParams, velocity: RadianPerSecond) -> tuple[NewtonMetre, NewtonMetre]:
    """Return the friction of bearings and seals before the load cell and behind the flap."""
    driveline_params = params.driveline
    if velocity < 0.0:
        near_friction = losses.backward_torque(
            driveline_params.bearing, velocity
        ) + losses.backward_torque(driveline_params.seal, velocity)
        far_friction = losses.backward_torque(params.far_side, velocity)
    else:
        near_friction = losses.forward_torque(
            driveline_params.bearing, velocity
        ) + losses.forward_torque(driveline_params.seal, velocity)
        far_friction = losses.forward_torque(params.far_side, velocity)
    return near_friction, far_friction
