"""A WaveBot's real devices behind the loop's device interface.

The tick exchanges process data itself; slow lines go through mailboxes. This module alone
translates between the messages of the drivers and the signals of the loop.
"""

import math
from collections.abc import Mapping
from typing import Any

from rig.kinds.wavebot.tick import Command, Sense
from rig.processes.mailbox import Mailbox
from rig.wires import bus_axes
from rig.wires.bus_axes import BusDevices
from rig.wires.drive_axes import DriveAxes
from rig.wires.messages import open_mailboxes

_NO_DUMP = 0
_POLLED = ("analyser", "cells", "probes", "inputs")
_NEVER_AGE_S = 1e9  # s, age of a value that never came


class WaveBotDevices(BusDevices):
    """All devices of a WaveBot on their wires."""

    def __init__(
        self, drives: DriveAxes, slots: Mapping[str, Mailbox], trigger_divider: int
    ) -> None:
        """``trigger_divider``: ticks between two posts of the outputs."""
        polled = {name: slots[name] for name in _POLLED}
        self._analyser, self._cells, self._probes, self._panel = polled.values()
        super().__init__(drives, polled, slots["outputs"], trigger_divider, Sense, Command)

    def attach(self, sense: Any, command: Any) -> None:
        self._sense, self._command = sense, command
        sense.wave(math.nan)  # only a simulated basin knows the undisturbed elevation

    def read_in_place(self, now: float) -> None:
        drives, sense = self._drives, self._sense
        drives.receive()  # before the mailboxes: those of terminals have its values
        analyser, cells = self._analyser.read(), self._cells.read()
        probes, panel = self._probes.read(), self._panel.read()
        # After the mailboxes, or a value posted meanwhile would have a negative age.
        time_now = drives.take_time()
        heave, surge = drives.read("heave"), drives.read("surge")
        stator = drives.read_actuator("stator")
        lcb, trs = heave.analog
        string_pot, rotor_angle = surge.analog
        load_age = max(time_now - cells.stamp, heave.analog_age, surge.analog_age)
        sense.heave(*drives.sense("heave", heave))
        sense.surge(*drives.sense("surge", surge))
        sense.load(
            lcb, trs, cells.slew, cells.stator_a, cells.stator_b, string_pot, rotor_angle, load_age
        )
        # A failed move counts as not arrived: the plan's own time-out names it.
        sense.spring(stator.position, stator.arrived, _NEVER_AGE_S if stator.fault else stator.age)
        sense.power(analyser.ac, analyser.dc, analyser.bus_voltage, time_now - analyser.stamp)
        sense.drive(heave.acting, 1 if drives.limit_flags("heave") else 0, _NO_DUMP)
        sense.probes(probes.probe_1, probes.probe_2, probes.probe_3, time_now - probes.stamp)
        sense.panel(panel.e_stop, panel.limit_switch, time_now - panel.stamp)

    def write_in_place(self) -> None:
        command = self._command
        _, heave_current, heave_enable, _ = command.heave()
        _, surge_current, surge_enable, _ = command.surge()
        _, target, move = command.spring()
        self._drives.send(
            ((heave_current, heave_enable), (surge_current, surge_enable)), ((target, move),)
        )
        self._send_waves(command.wave_trigger)


def connect(config: dict[str, Any], dt: float) -> WaveBotDevices:
    """Return the devices for a configuration of `rig.kinds.wavebot.hardware.job`.

    LinkError if the bus cannot be opened.
    """
    drives, slots = bus_axes.connect(config, open_mailboxes(config["mailboxes"]))
    return WaveBotDevices(drives, slots, config["trigger_divider"])
