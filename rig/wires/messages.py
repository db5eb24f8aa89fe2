"""The messages between I/O processes and the loop in mailboxes; each has a time stamp.

`stamp` is on the monotonic clock (s), which all processes of a host share. The stamp of a value is
the time of the request for it, so that its age is never too small.
"""

from collections.abc import Mapping
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
from rig.processes.mailbox import Mailbox


class AnalyserMessage(NamedTuple):
    """Values of the power analyser."""

    ac: Watt
    dc: Watt
    bus_voltage: Volt
    stamp: Second


class LoadCellsMessage(NamedTuple):
    """Values of the load cells behind strain-gauge amplifiers."""

    slew: Newton
    stator_a: Newton
    stator_b: Newton
    stamp: Second


class ProbesMessage(NamedTuple):
    """Values of the wave probes."""

    probe_1: Metre
    probe_2: Metre
    probe_3: Metre
    stamp: Second


class InputsMessage(NamedTuple):
    """Digital inputs, for monitoring."""

    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: hit
    stamp: Second


class OutputsMessage(NamedTuple):
    """Digital outputs commanded by the loop."""

    wave_trigger: Flag
    stamp: Second


class NodeHealth(NamedTuple):
    """The state of one CANopen node, as the CAN service process knows it."""

    nmt: Index  # NMT state in its last heartbeat
    heartbeat_time: Second  # when its last heartbeat came
    restarts: Index  # since it was set up
    emergency_code: Index  # of its last emergency, 0: none
    emergency_count: Index  # number of its emergencies
    stamp: Second  # time of this message


class EncodersMessage(NamedTuple):
    """Counts of the encoders at motor and shaft, latched by one edge."""

    motor: Count  # turns included, positive as the gearbox output's angle
    shaft: Count
    stamp: Second


class ServoMessage(NamedTuple):
    """The last reported state of the servo drive."""

    current: Ampere
    acting: Flag  # 1: powered by our request, and it follows set-points
    error: Index  # its error number while it is in error, -1: not read yet, else 0
    stamp: Second


class SetPointMessage(NamedTuple):
    """Set-point of the servo drive, at the motor; that of the control loop not in use is 0."""

    velocity: RadianPerSecond
    torque: NewtonMetre
    enable: Flag
    stamp: Second


class WrenchMessage(NamedTuple):
    """Values of the six-axis load cell, z along the shaft, with the rig's signs."""

    fx: Newton
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre
    stamp: Second


class BrakeCurrentMessage(NamedTuple):
    """Measured current of the brake."""

    current: Ampere
    stamp: Second


class AnalogOutputsMessage(NamedTuple):
    """Analog outputs to servo drive and brake, commanded by the loop."""

    servo: Volt
    brake: Ampere
    stamp: Second


class WriteAcknowledgement(NamedTuple):
    """Acknowledgement that the device has received the outputs of the loop."""

    stamp: Second  # send time of the newest acknowledged write


# Ends the name of the mailbox in which the writing of another is acknowledged.
ACKNOWLEDGEMENT_SUFFIX = "_done"
HEALTH_SUFFIX = "_health"  # ends the name of the mailbox of a CANopen node's health
MESSAGE_TYPES: dict[str, type] = {
    "analyser": AnalyserMessage,
    "cells": LoadCellsMessage,
    "probes": ProbesMessage,
    "inputs": InputsMessage,
    "outputs": OutputsMessage,
    "servo": ServoMessage,
    "set_point": SetPointMessage,
    "load_cell": WrenchMessage,
    "brake": BrakeCurrentMessage,
    "analog": AnalogOutputsMessage,
    "analog_done": WriteAcknowledgement,
}
"""The message type of each mailbox, except those of the nodes' health."""


def open_mailboxes(fds: Mapping[str, int]) -> dict[str, Mailbox]:
    """Return the mailboxes behind file descriptors, each with its message type by its name."""
    return {
        name: Mailbox(fd, NodeHealth if name.endswith(HEALTH_SUFFIX) else MESSAGE_TYPES[name])
        for name, fd in fds.items()
    }
