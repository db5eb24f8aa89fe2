"""Signals of a modular rig that do not depend on its composition."""

from typing import Annotated, NamedTuple

from controllers.signals import (
    Ampere,
    AxisSense,
    Flag,
    Metre,
    NewtonMetre,
    Radian,
    RadianPerSecond,
    RadianPerSecond2,
)


class WaveSense(NamedTuple):
    """Undisturbed elevation at the device; only a simulated basin knows it (NaN elsewhere)."""

    elevation: Metre


class SensorLimits(NamedTuple):
    """Allowed values of a sensor, and their greatest age."""

    low: float  # in the sensor's unit, not tared
    high: float
    age_stop: float  # s


class RotaryEstimate(NamedTuple):
    """Motion of a rotating axis; `controllers.signals.Estimate` in other units."""

    position: Radian
    velocity: RadianPerSecond
    acceleration: RadianPerSecond2


class RotaryDemand(NamedTuple):
    """Demand of the law of a rotating axis; `controllers.signals.Demand` in other units."""

    kp: Annotated[float, "N*m*s/rad"]
    ki: Annotated[float, "N*m/rad"]
    km: Annotated[float, "kg*m^2"]
    force: NewtonMetre


class RotaryCommand(NamedTuple):
    """Command of a rotating axis; `controllers.signals.AxisCommand` in other units."""

    force: NewtonMetre
    current: Ampere
    enable: Flag
    limited: Flag


class RotaryRecord(NamedTuple):
    """A rotating axis in a log row; `rig.realtime.axis.Record` in other units."""

    sense: AxisSense
    estimate: RotaryEstimate
    demand: RotaryDemand
    command: RotaryCommand
    warned: Flag
