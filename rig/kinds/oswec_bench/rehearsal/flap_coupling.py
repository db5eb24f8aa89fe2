"""The simulated flap between two ticks of the loop, with wave maker and hand, as pure functions.

They run interpreted and compiled, with the bits of `FlapDevices`. The signals are those of the
bench (`bench_coupling`).
"""

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

from controllers.blocks import clamp
from rig.kinds.oswec_bench.rehearsal.bench_coupling import actuation_of
from rig.kinds.oswec_bench.tick.signals import Command
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.flap import oswec
from sim_plant.flap.oswec import FlapParams, FlapState
from sim_plant.flap.world import FlapWorld
from sim_plant.sea_states import WaveTables
from sim_plant.wave_maker import value_at

HAND_SPEED = 0.3  # rad/s, with which a person turns the flap to its release angle


class Seas(NamedTuple):
    """The seas of a session, one after another in one table."""

    excitation: tuple[float, ...]  # N*m, one repeat period of each sea, one entry a tick
    first: tuple[int, ...]  # index of each sea's first entry
    length: tuple[int, ...]  # number of its entries


class Hand(NamedTuple):
    """The hand of a person at the flap."""

    holds: int  # 1: it holds the flap
    angle: float  # rad, at which it holds


FREE = Hand(0, 0.0)
"""No hand holds the flap."""


class Plant(NamedTuple):
    """Constants of the flap in its flume."""

    constants: FlapParams
    normals: tuple[float, ...]  # noise table
    age: float  # s, of the readings
    seas: Seas
    onset: float  # s, of every sea
    steps: int  # of the flap in a tick


class Device(NamedTuple):
    """State of flap, wave maker and hand, and the signals between flap and loop."""

    state: FlapState
    in_transit: tuple[BenchReading, ...]  # delayed readings for the loop, oldest first
    actuation: Actuation  # last command
    fresh: int  # 1: ``actuation`` arrived after the plant's last step
    sea: int  # index of the running sea; -1: still water
    wave_tick: int  # since the waves were started; -1 in still water
    moment: float  # N*m, of the waves on the flap
    hand: Hand


def couple(
    world: FlapWorld, tables: Sequence[WaveTables], sea: int = -1, hand: Hand = FREE
) -> tuple[Plant, Device]:
    """Return a flap between two ticks; the world itself then no longer takes part.

    ``sea``: index of the running sea, -1 for still water.
    """
    now = world.conditions()
    length = tuple(len(table.excitation) for table in tables)
    seas = Seas(
        tuple(value for table in tables for value in table.excitation.tolist()),
        tuple(accumulate(length, initial=0))[:-1],
        length,
    )
    device = Device(
        now.state,
        now.delay_line,
        now.actuation,
        now.fresh,
        sea,
        world.wave_tick,
        world.moment,
        hand,
    )
    return Plant(now.params, tuple(now.normals), now.delay, seas, world.onset, world.steps), device


def advance_plant(plant: Plant, device: Device, tick: int, dt: float) -> Device:
    """Return the device one tick later, with the readings of ``tick`` in transit."""
    state, in_transit, actuation, fresh, sea, wave_tick, last_moment, hand = device
    excitation, first, length = plant.seas
    steps, normals, moment = plant.steps, plant.normals, 0.0
    if wave_tick >= 0:
        wave_tick += 1
        moment = value_at(excitation, first[sea], length[sea], wave_tick, plant.onset, dt)
    for step in range(1, steps + 1):
        present = moment
        if step < steps:
            present = last_moment + (moment - last_moment) * step / steps
        state = oswec.step(
            plant.constants, state, actuation, fresh, 0, present, normals, dt / steps
        )
        fresh = 0
    reading = oswec.sample(plant.constants, state, 0, tick, normals)
    line = in_transit[1:] + (reading,)  # noqa: RUF005 - what numba compiles
    return Device(state, line, actuation, 0, sea, wave_tick, moment, hand)


def actuate(plant: Plant, device: Device, command: Command, dt: float) -> tuple[Device, bool]:
    """Return the device with a command of the loop, and False: nothing interrupts a simulation.

    A change of the sea starts its waves anew. The hand turns a locked flap to the command's angle;
    a flap that is coupled to its motor stays where it was clamped.
    """
    state, in_transit, _, _, sea, wave_tick, moment, hand = device
    if command.sea != sea:
        sea = command.sea
        wave_tick = 0 if sea >= 0 else -1
    if command.locked == 0:
        hand = FREE
    elif plant.constants.coupled == 0 and (hand.holds == 0 or hand.angle != command.clamp):
        angle = hand.angle if hand.holds == 1 else state.driveline.shaft_angle
        hand = Hand(1, turned(angle, command.clamp, dt))
        state = oswec.turn_to(state, hand.angle)
    return Device(state, in_transit, actuation_of(command), 1, sea, wave_tick, moment, hand), False


def turned(angle: float, target: float, dt: float) -> float:
    """Return the angle (rad) of a flap that a hand turns to a target for one tick."""
    step = HAND_SPEED * dt
    return angle + clamp(target - angle, -step, step)
