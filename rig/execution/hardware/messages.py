"""What slow lines and the loop tell each other through mailboxes; every word has its moment.

`stamp` is on the monotonic clock (s), which all processes of a host share: of a value the moment at
which it was asked for, so that its age is never told too small.
"""

from typing import NamedTuple

from controllers.signals import (
    Ampere,
    Count,
    Flag,
    Index,
    Metre,
    Newton,
    NewtonMetre,
    RadianPerSecond,
    Second,
    Volt,
    Watt,
)


class Analyser(NamedTuple):
    """Power analyser."""

    ac: Watt
    dc: Watt
    bus_voltage: Volt
    stamp: Second


class Cells(NamedTuple):
    """Load cells behind strain-gauge amplifiers."""

    slew: Newton
    stator_a: Newton
    stator_b: Newton
    stamp: Second


class Probes(NamedTuple):
    """Wave probes."""

    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    stamp: Second


class Inputs(NamedTuple):
    """Digital inputs, for monitoring."""

    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: hit
    stamp: Second


class Outputs(NamedTuple):
    """Digital outputs, as the loop wants them."""

    wave_trigger: Flag
    stamp: Second


class NodeHealth(NamedTuple):
    """One CANopen node, as the service beside the loop knows it."""

    nmt: Index  # NMT state as it said last
    heard: Second  # when its last heartbeat came
    boots: Index  # how often it restarted since it was set up
    code: Index  # its last emergency, 0: none
    emergencies: Index  # how many it sent
    stamp: Second  # when this was written


class Encoders(NamedTuple):
    """Both encoders of a bench, latched by one edge."""

    motor: Count  # turns included, positive as the gearbox output's angle
    shaft: Count
    stamp: Second


class Servo(NamedTuple):
    """Servo drive, as it said last."""

    current: Ampere
    acting: Flag  # 1: powered by our request, and set-points go out
    error: Index  # its error number while it is in error, -1: not read yet, else 0
    stamp: Second


class SetPoint(NamedTuple):
    """What the loop wants of the servo drive, at the motor; that of the loop not in use is 0."""

    velocity: RadianPerSecond
    torque: NewtonMetre
    enable: Flag
    stamp: Second


class Load(NamedTuple):
    """Six-axis load cell, z along the shaft, signs as the bench has them."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre
    stamp: Second


class BrakeCurrent(NamedTuple):
    """What the brake's amplifier gives."""

    current: Ampere
    stamp: Second


class Analog(NamedTuple):
    """Analog outputs of a bench, as the loop wants them."""

    servo: Volt
    brake: Ampere
    stamp: Second


class Done(NamedTuple):
    """What the loop wanted has been written, and the device has said so."""

    stamp: Second  # when the newest that was acknowledged had been sent


DONE = "_done"  # ends the name of the mailbox in which the writing of another is acknowledged
SLOTS: dict[str, type] = {
    "analyser": Analyser,
    "cells": Cells,
    "probes": Probes,
    "inputs": Inputs,
    "outputs": Outputs,
    "heave_health": NodeHealth,
    "surge_health": NodeHealth,
    "stator_health": NodeHealth,
    "servo": Servo,
    "set_point": SetPoint,
    "load_cell": Load,
    "brake": BrakeCurrent,
    "analog": Analog,
    "analog_done": Done,
}
"""The word of each mailbox."""
