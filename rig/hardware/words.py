"""What slow lines and the loop tell each other through mailboxes; every word has its moment.

`stamp` is on the monotonic clock (s), which all processes of a host share: of a value the moment at
which it was asked for, so that its age is never told too small.
"""

from typing import NamedTuple

from controllers.signals import Flag, Index, Metre, Newton, Second, Volt, Watt


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


SLOTS: dict[str, type] = {
    "analyser": Analyser,
    "cells": Cells,
    "probes": Probes,
    "inputs": Inputs,
    "outputs": Outputs,
    "heave_health": NodeHealth,
    "surge_health": NodeHealth,
    "stator_health": NodeHealth,
}
"""The word of each mailbox."""
