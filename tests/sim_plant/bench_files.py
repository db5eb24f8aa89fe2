"""Bench plants, worlds and runs over a session's set points for the tests of the bench."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from plant_files import mapping

from sim_plant.bench.parameters import BenchPlant
from sim_plant.bench.stepper import Stepper
from sim_plant.bench.world import OFF, Actuation, BenchWorld

DT = 0.001
PERIOD = 1.5  # s, OSWEC thesis, 2.1
NOMINAL_GAIN = 1.5708  # rad/s/V, OSWEC thesis, eq. 3.2
Floats = NDArray[np.float64]


def changed(name: str = "oswec_bench", **values: Any) -> BenchPlant:
    """Return a plant with some values replaced: changed(brake__fitted=0)."""
    text = mapping(f"{name}.yaml")
    for path, value in values.items():
        section, field = path.split("__")
        text[section][field] = {**text[section][field], "value": value}
    return BenchPlant.model_validate(text)


def bench(
    name: str = "oswec_bench", seed: int = 1, *, stepper: type[Stepper] = Stepper, **values: Any
) -> BenchWorld:
    """Return a bench at 1 kHz, interpreted by default."""
    return BenchWorld(changed(name, **values), dt=DT, seed=seed, stepper=stepper)


class Run(NamedTuple):
    """Records of a run, tick by tick, in time order."""

    motor: Floats  # rad, from the counts, relative to the start
    shaft: Floats
    torque: Floats  # N m, reading minus the reading at rest
    command: Floats  # as sent


def record(
    world: BenchWorld,
    ticks: int,
    command: Callable[[int, BenchWorld], tuple[Actuation, float]],
) -> Run:
    """Drive the world by a command law; return the encoder and load cell readings."""
    scale = world.params.sensors
    reading = world.sense()
    start, rows = (reading.motor_counts, reading.shaft_counts), []
    for k in range(ticks):
        actuation, sent = command(k, world)
        world.actuate(actuation)
        world.advance(DT)
        reading = world.sense()
        rows.append((reading.motor_counts, reading.shaft_counts, reading.tz, sent))
    motor, shaft, torque, sent_all = np.array(rows, dtype=float).T
    return Run(
        (motor - start[0]) / scale.motor_counts,
        (shaft - start[1]) / scale.shaft_counts,
        torque - float(world.params.load_cell.channels[5].bias),
        sent_all,
    )


def brake_current(world: BenchWorld, torque: float) -> float:
    """Return the current for a holding torque midway between the brake's branches, A."""
    brake = world.params.brake
    return float(np.interp(torque, brake.torques, brake.currents))


def oscillate(
    world: BenchWorld, amplitude_deg: float, damping: float, periods: int, settle: int = 2
) -> Run:
    """One set point of Table 2.1: velocity command A w sin, brake T = R theta_dot.

    theta_dot is the difference of the shaft encoder over 15 ticks. Returns whole periods.
    """
    omega = 2.0 * math.pi / PERIOD
    peak = math.radians(amplitude_deg) * omega / world.params.servo.gain
    counts = [world.sense().shaft_counts] * 15
    scale = world.params.sensors.shaft_counts

    def command(k: int, rig: BenchWorld) -> tuple[Actuation, float]:
        counts.append(rig.sense().shaft_counts)
        velocity = (counts[-1] - counts.pop(0)) / (15 * DT * scale)
        ramp = min(1.0, k * DT / PERIOD)
        volts = -peak * ramp * math.sin(omega * k * DT)
        current = brake_current(rig, damping * abs(velocity))
        return Actuation(1, 0, volts, 0.0, current, 0), volts

    ticks = round((periods + settle) * PERIOD / DT)
    channels = record(world, ticks, command)
    begin = round(settle * PERIOD / DT)
    return Run(*(channel[begin:] for channel in channels))


def detrended(angle: Floats) -> Floats:
    """Return an angle over whole periods minus its drift, the line through the periods' means.

    A line fitted to the samples would also take up some of the sine, and with it of the phase.
    """
    length = round(PERIOD / DT)
    means = angle.reshape(-1, length).mean(axis=1)
    centres = (np.arange(len(means)) + 0.5) * length
    slope, level = np.polyfit(centres, means, 1)
    return np.asarray(angle - level - slope * (np.arange(len(angle)) + 0.5))


class Deflection(NamedTuple):
    """Results of one driveline run as in the OSWEC thesis."""

    phase: float  # shift, % of the period
    amplitude: float  # difference, deg, half of peak to peak
    rms_torque: float  # N m
    rms_velocity: float  # rad/s, motor
    p95: float  # deg, 95th percentile of |motor - shaft|
    peak_torque: float  # N m


def deflection(run: Run) -> Deflection:
    """Phase shift by the fundamental, amplitude difference by the extremes, means over periods."""
    length = round(PERIOD / DT)
    motor, shaft = detrended(run.motor), detrended(run.shaft)
    turn = np.exp(-2j * np.pi * np.arange(length) / length)
    periods = list(zip(motor.reshape(-1, length), shaft.reshape(-1, length), strict=True))
    shifts = [np.angle((m @ turn) / (s @ turn)) / (2 * np.pi) for m, s in periods]
    lost = [np.degrees(np.ptp(m) - np.ptp(s)) / 2 for m, s in periods]
    fundamental = np.sqrt(2) / length * abs(motor[:length] @ turn) * 2 * np.pi / PERIOD
    return Deflection(
        100 * float(np.mean(shifts)),
        float(np.mean(lost)),
        float(np.sqrt(np.mean(run.torque**2))),
        float(fundamental),
        float(np.percentile(np.degrees(np.abs(motor - shaft)), 95)),
        float(np.max(np.abs(run.torque))),
    )


def idle(world: BenchWorld, ticks: int) -> None:
    """Advance the world with everything switched off."""
    for _ in range(ticks):
        world.actuate(OFF)
        world.advance(DT)
