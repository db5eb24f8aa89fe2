"""A WaveBot's real devices behind the loop's seam: CAN in the tick, slow lines through mailboxes.

Only here are the words of the drivers and those of the loop turned into each other.
"""

import math
import time
from typing import Any

from controllers.signals import (
    AxisSense,
    DriveFault,
    DriveSense,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from drivers.canopen import scaling
from drivers.canopen.bus_cycle import BusCycle, Line
from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import Link
from drivers.canopen.position_actuator import PositionActuator
from drivers.canopen.torque_axis import Reading, TorqueAxis
from rig.execution.hardware.messages import SLOTS, NodeHealth, Outputs
from rig.execution.hardware.settings import Config
from rig.kinds.wavebot import Command, LoadSense, PowerSense, Sense, WaveSense
from rig.processes import handover
from rig.processes.mailbox import Mailbox

# EMCY and 0x603F: the two that a person must be able to tell from all others.
_FAULTS = {0x3210: DriveFault.OVERVOLTAGE.value, 0x3220: DriveFault.UNDERVOLTAGE.value}
_GENERAL = DriveFault.GENERAL.value
_UNKNOWN = WaveSense(math.nan)  # only a simulated basin knows the undisturbed elevation
_NO_DUMP = 0
WARM_UP = 3.0  # s in which every drive must answer SYNCs in the step of the ticks
_SETTLED = 5.0  # ticks: no value of a drive is older when it does
_OLD = 1e9  # s, age of what has never come


class WaveBotDevices:
    """All devices of a WaveBot on their wires."""

    def __init__(self, config: Config, line: Line, slots: dict[str, Mailbox]) -> None:
        self._config = config
        self._slots = slots
        self._heave = TorqueAxis(config.heave)
        self._surge = TorqueAxis(config.surge)
        self._stator = PositionActuator(config.stator)
        nodes = (self._heave, self._surge, self._stator)
        self._bus = BusCycle(line, nodes, config.own_node, config.heartbeat)
        self._now = 0.0  # s on the monotonic clock, of the last look
        self._writes = 0

    def warm_up(self, dt: float) -> None:
        """Cycle until every node answers as it will in the ticks; OSError names those that do not.

        It ends with a SYNC: the first tick finds the answers to it.
        """
        until = time.monotonic() + WARM_UP
        while True:
            here = self._now = self._bus.receive()
            silent = self._silent(here, _SETTLED * dt)
            self._bus.send(
                [
                    self._heave.command(0.0, 0, here),
                    self._surge.command(0.0, 0, here),
                    *self._stator.command(0.0, 0, here),
                ]
            )
            if not silent:
                return
            if time.monotonic() > until:
                raise OSError(f"no process data from {', '.join(silent)} in {WARM_UP:g} s")
            time.sleep(dt)

    def _silent(self, here: float, age: float) -> list[str]:
        """The nodes whose values are older than this (s), or than one more status of a stator."""
        axes = {"heave": self._heave.read(here), "surge": self._surge.read(here)}
        found = [n for n, one in axes.items() if max(one.age, one.analog_age) > age]
        rest = self._config.actuator_divider * age
        return found if self._stator.read(here).age <= rest else [*found, "stator"]

    def read(self, now: float) -> Sense:
        # Slots before the time: what is posted after it would have an age below zero.
        analyser = self._slots["analyser"].read()
        cells, probes = self._slots["cells"].read(), self._slots["probes"].read()
        panel = self._slots["inputs"].read()
        here = self._now = self._bus.receive()
        heave, surge, stator = (
            self._heave.read(here), self._surge.read(here), self._stator.read(here),
        )  # fmt: skip
        lcb, trs = heave.analog
        string_pot, rotor_angle = surge.analog
        load_age = max(here - cells.stamp, heave.analog_age, surge.analog_age)
        return Sense(
            self._axis(heave, "heave"),
            self._axis(surge, "surge"),
            LoadSense(
                lcb, trs, cells.slew, cells.stator_a, cells.stator_b, string_pot, rotor_angle,
                load_age,
            ),
            # A move that failed is not there yet: the plan's own time-out names it.
            SpringSense(stator.position, stator.arrived, _OLD if stator.fault else stator.age),
            PowerSense(
                analyser.ac, analyser.dc, analyser.bus_voltage, here - analyser.stamp
            ),
            DriveSense(heave.acting, 1 if self._heave.held else 0, _NO_DUMP),
            ProbeSense(probes.probe_1, probes.probe_2, probes.probe_3, here - probes.stamp),
            _UNKNOWN,
            PanelSense(panel.e_stop, panel.limit_switch, here - panel.stamp),
        )  # fmt: skip

    def write(self, command: Command) -> None:
        heave, surge, spring, _, trigger = command
        here = self._now
        frames = [
            self._heave.command(heave.current, heave.enable, here),
            self._surge.command(surge.current, surge.enable, here),
        ]
        if self._writes % self._config.actuator_divider == 0:
            frames += self._stator.command(spring.target, spring.enable, here)
        self._bus.send(frames)
        if self._writes % self._config.trigger_every == 0:
            self._slots["outputs"].post(Outputs(trigger, here))
        self._writes += 1

    def stop(self, reason: int) -> None:
        here = self._now
        self._bus.send(
            [
                self._heave.command(0.0, 0, here),
                self._surge.command(0.0, 0, here),
                *self._stator.release(here),
            ]
        )
        self._slots["outputs"].post(Outputs(0, here))

    def close(self) -> None:
        self._bus.close()

    def _axis(self, reading: Reading, name: str) -> AxisSense:
        fault = _FAULTS.get(reading.error, _GENERAL) if reading.error else 0
        health: NodeHealth | None = self._slots[f"{name}_health"].read()
        if fault == 0 and health is not None:
            silent = self._now - health.heard > self._config.heartbeat_lost
            deaf = self._now - health.stamp > self._config.health_age
            # A node that restarted has forgotten what it was told; a service that is gone would
            # hide that.
            fault = _GENERAL if silent or deaf or health.boots > 0 else 0
        age = reading.age
        return AxisSense(reading.counts, age, reading.current, reading.acting, fault, age)


def connect(config: dict[str, Any], dt: float) -> WaveBotDevices:
    """The devices for what `rig.execution.hardware.job` makes.

    LinkError if the bus cannot be opened.
    """
    interface, channel, bit_rate, options = config["bus"]
    made: Config = handover.loads(Config, config["devices"])
    scales, facts = config["scales"], config["facts"]["can"]
    made = made._replace(
        heave=made.heave._replace(scale=_scale(scales["heave"], facts["heave"])),
        surge=made.surge._replace(scale=_scale(scales["surge"], facts["surge"])),
    )
    slots = {name: Mailbox(fd, SLOTS[name]) for name, fd in config["mailboxes"].items()}
    nodes = (TorqueAxis(made.heave), TorqueAxis(made.surge), PositionActuator(made.stator))
    wanted = frozenset[int]().union(*(node.each_sync for node in nodes))
    bus = Bus(interface, channel, bit_rate, tuple((key, value) for key, value in options))
    return WaveBotDevices(made, Link(bus, wanted), slots)


def _scale(said: dict[str, Any], facts: dict[str, int]) -> scaling.CurrentScale:
    """The current scale from what the drive itself said, never from what was typed."""
    limit = said["limit"]
    if said["kind"] == "amc":
        return scaling.amc_current(facts["amc_peak_current"], limit)
    if said["kind"] == "rated_torque":
        return scaling.rated_torque_current(facts["rated_torque"], said["kt"], limit)
    return scaling.rated_current(facts["rated_current"], limit)
