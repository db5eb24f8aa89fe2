"""The flap on its driveline as one pure step, and what its sensors read.

The chain is the bench's up to the load cell; behind it stands the flap instead of a brake. Between
coupling and cell the shaft passes its own bearing and seal, so the cell reads less than the motor
gives; behind the flap is another bearing and seal, which the cell does not see.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.bench import dynamometer, gearbox, load_cell, losses, transmission
from sim_plant.bench.dynamometer import UNMOVED, BenchParams, BenchState
from sim_plant.bench.losses import DragParams
from sim_plant.bench.motor import Held
from sim_plant.bench.signals import Actuation, Reading
from sim_plant.flap import body
from sim_plant.flap.body import FlapBodyParams, FlapBodyState
from sim_plant.units import Flag, NewtonMetre, Radian, RadianPerSecond, Second


class FlapParams(NamedTuple):
    """Everything the step needs, real floats; of the bench its brake is not used."""

    driveline: BenchParams
    body: FlapBodyParams
    far_side: DragParams  # bearing and seal behind the flap
    coupled: Flag  # 0: the rigid coupling is taken out; bearing, seal and cell stay on the flap


class FlapState(NamedTuple):
    """Everything the step remembers."""

    driveline: BenchState  # its shaft is the flap's
    body: FlapBodyState
    coupling: NewtonMetre  # through the coupling; `driveline.shaft_torque` is behind the seal


def initial(params: FlapParams, angle: Radian) -> FlapState:
    """Give the flap at rest at an angle, the driveline unwound, all switched off."""
    still = dynamometer.initial(params.driveline)
    start = BenchState(
        still.drive, still.servo, still.gearbox, still.brake,
        angle, 0.0, angle, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    return FlapState(start, FlapBodyState(angle, 0.0, 0.0, 0.0), 0.0)


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
    """Advance flap and driveline by dt; `excitation` is that of the tick reached.

    With `locked` the flap is clamped. `fresh`, `stopped` and `normals` as on the bench.
    """
    line, flap, through = state
    chain = params.driveline
    angle = flap.angle if actuation.locked == 1 else flap.angle + flap.velocity * dt
    held = Held(line.motor_angle - angle, UNMOVED, UNMOVED)
    if params.coupled == 0:
        held = Held(0.0, 0.0, 0.0)
    known = _loaded(line, through)
    moved = dynamometer.move_motor(chain, known, held, actuation, fresh, stopped, normals, dt)
    load = transmission.torque(chain.transmission, moved.angle - angle)
    if params.coupled == 0:
        load = 0.0
    near, far = _dry(params, flap.velocity)
    swung = body.swing(params.body, flap, angle, excitation + load, near + far, dt)
    after = swung.state
    if actuation.locked == 1:
        after = FlapBodyState(angle, 0.0, 0.0, 0.0)
        taken = 0.0
    else:
        taken = swung.friction * near / (near + far) if near + far > 0.0 else 0.0
    cell = load - taken
    way = moved.angle - line.motor_angle
    mean = 0.5 * (flap.velocity + after.velocity)
    reached = BenchState(
        moved.drive, moved.servo, gearbox.step(chain.gearbox, line.gearbox, load, way, normals),
        line.brake, moved.angle, moved.velocity, angle, mean, cell, moved.friction, cell * mean,
        load_cell.drifted(chain.load_cell, line.drift, dt),
    )  # fmt: skip
    return FlapState(reached, after, load)


def sample(
    params: FlapParams, state: FlapState, e_stop: Flag, tick: int, normals: Sequence[float]
) -> Reading:
    """Give what the sensors read at a state; `tick` is the clock of the noise table."""
    return dynamometer.sample(params.driveline, state.driveline, e_stop, tick, normals)


def _loaded(line: BenchState, through: NewtonMetre) -> BenchState:
    """Give the driveline's state with the torque that its gearbox carries."""
    return BenchState(
        line.drive, line.servo, line.gearbox, line.brake, line.motor_angle, line.motor_velocity,
        line.shaft_angle, line.shaft_velocity, through, line.friction, line.power, line.drift,
    )  # fmt: skip


def _dry(params: FlapParams, velocity: RadianPerSecond) -> tuple[NewtonMetre, NewtonMetre]:
    """Give what bearings and seals hold before the load cell and behind the flap."""
    chain = params.driveline
    if velocity < 0.0:
        near = losses.back(chain.bearing, velocity) + losses.back(chain.seal, velocity)
        far = losses.back(params.far_side, velocity)
    else:
        near = losses.forward(chain.bearing, velocity) + losses.forward(chain.seal, velocity)
        far = losses.forward(params.far_side, velocity)
    return near, far
