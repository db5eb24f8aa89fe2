"""A WaveBot's real devices behind the loop's device interface.

The tick exchanges CAN process data itself; slow lines go through mailboxes. This module alone
translates between the messages of the drivers and the signals of the loop.
"""

import math
import time
from typing import Any, NamedTuple

from controllers.signals import (
    AxisSense,
    DriveFault,
    DriveSense,
    PanelSense,
    ProbeSense,
    SpringSense,
)
from drivers.canopen import scaling
from drivers.canopen.bus_cycle import BusCycle, FrameLink
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import Link
from drivers.canopen.position_actuator import ActuatorSettings, PositionActuator
from drivers.canopen.torque_axis import TorqueAxis, TorqueAxisReading, TorqueAxisSettings
from rig.kinds.wavebot.tick import Command, LoadSense, PowerSense, Sense, WaveSense
from rig.processes import handover
from rig.processes.mailbox import Mailbox
from rig.wires.messages import NodeHealth, OutputsMessage, open_mailboxes

# Codes of EMCY and 0x603F: a person must be able to distinguish these two from all others.
_FAULTS = {0x3210: DriveFault.OVERVOLTAGE.value, 0x3220: DriveFault.UNDERVOLTAGE.value}
_GENERAL_FAULT = DriveFault.GENERAL.value
_UNKNOWN_ELEVATION = WaveSense(math.nan)  # only a simulated basin knows the undisturbed elevation
_NO_DUMP = 0
WARM_UP_TIMEOUT_S = 3.0  # s in which every drive must answer every SYNC
_MAX_WARM_UP_AGE_TICKS = 5.0  # of every value of a drive at the end of the warm-up
_NEVER_AGE_S = 1e9  # s, age of a value that never came


class WaveBotDeviceSettings(NamedTuple):
    """Constants of the devices; the current scales are read from the drives later."""

    own_node: int
    heartbeat: float  # s between the loop's own heartbeats
    health_age: float  # s, age of the health messages from which the service process counts as lost
    heartbeat_lost: float  # s without a node's heartbeat until it counts as lost
    actuator_divider: int
    trigger_divider: int  # ticks between two posts of the outputs
    heave: TorqueAxisSettings
    surge: TorqueAxisSettings
    stator: ActuatorSettings


class WaveBotDevices:
    """All devices of a WaveBot on their wires."""

    def __init__(
        self, config: WaveBotDeviceSettings, line: FrameLink, slots: dict[str, Mailbox]
    ) -> None:
        self._config = config
        self._slots = slots
        self._heave = TorqueAxis(config.heave)
        self._surge = TorqueAxis(config.surge)
        self._stator = PositionActuator(config.stator)
        nodes = (self._heave, self._surge, self._stator)
        self._bus = BusCycle(line, nodes, config.own_node, config.heartbeat)
        self._last_read = 0.0  # s on the monotonic clock
        self._writes = 0

    def warm_up(self, dt: float) -> None:
        """Run bus cycles until every node answers each SYNC; OSError names those that do not.

        The last action is a SYNC: the first tick finds the answers to it.
        """
        until = time.monotonic() + WARM_UP_TIMEOUT_S
        while True:
            time_now = self._last_read = self._bus.receive()
            silent = self._silent(time_now, _MAX_WARM_UP_AGE_TICKS * dt)
            self._bus.send(
                [
                    self._heave.command(0.0, 0, time_now),
                    self._surge.command(0.0, 0, time_now),
                    *self._stator.command(0.0, 0, time_now),
                ]
            )
            if not silent:
                return
            if time.monotonic() > until:
                raise OSError(
                    f"no process data from {', '.join(silent)} in {WARM_UP_TIMEOUT_S:g} s"
                )
            time.sleep(dt)

    def _silent(self, time_now: float, age: float) -> list[str]:
        """Return the nodes with values older than ``age`` (s); the stator's limit is a multiple."""
        axes = {"heave": self._heave.read(time_now), "surge": self._surge.read(time_now)}
        silent = [n for n, axis in axes.items() if max(axis.age, axis.analog_age) > age]
        stator_age = self._config.actuator_divider * age
        return silent if self._stator.read(time_now).age <= stator_age else [*silent, "stator"]

    def read(self, now: float) -> Sense:
        # Mailboxes before the time, or a value posted later would have a negative age.
        analyser = self._slots["analyser"].read()
        cells, probes = self._slots["cells"].read(), self._slots["probes"].read()
        panel = self._slots["inputs"].read()
        time_now = self._last_read = self._bus.receive()
        heave, surge, stator = (
            self._heave.read(time_now), self._surge.read(time_now), self._stator.read(time_now),
        )  # fmt: skip
        lcb, trs = heave.analog
        string_pot, rotor_angle = surge.analog
        load_age = max(time_now - cells.stamp, heave.analog_age, surge.analog_age)
        return Sense(
            self._axis_sense(heave, "heave"),
            self._axis_sense(surge, "surge"),
            LoadSense(
                lcb, trs, cells.slew, cells.stator_a, cells.stator_b, string_pot, rotor_angle,
                load_age,
            ),
            # A failed move counts as not arrived: the plan's own time-out names it.
            SpringSense(
                stator.position, stator.arrived, _NEVER_AGE_S if stator.fault else stator.age
            ),
            PowerSense(
                analyser.ac, analyser.dc, analyser.bus_voltage, time_now - analyser.stamp
            ),
            DriveSense(heave.acting, 1 if self._heave.limit_flags else 0, _NO_DUMP),
            ProbeSense(probes.probe_1, probes.probe_2, probes.probe_3, time_now - probes.stamp),
            _UNKNOWN_ELEVATION,
            PanelSense(panel.e_stop, panel.limit_switch, time_now - panel.stamp),
        )  # fmt: skip

    def write(self, command: Command) -> None:
        heave, surge, spring, _, trigger = command
        time_now = self._last_read
        frames = [
            self._heave.command(heave.current, heave.enable, time_now),
            self._surge.command(surge.current, surge.enable, time_now),
        ]
        if self._writes % self._config.actuator_divider == 0:
            frames += self._stator.command(spring.target, spring.enable, time_now)
        self._bus.send(frames)
        if self._writes % self._config.trigger_divider == 0:
            self._slots["outputs"].post(OutputsMessage(trigger, time_now))
        self._writes += 1

    def stop(self, reason: int) -> None:
        time_now = self._last_read
        self._bus.send(
            [
                self._heave.command(0.0, 0, time_now),
                self._surge.command(0.0, 0, time_now),
                *self._stator.release(time_now),
            ]
        )
        self._slots["outputs"].post(OutputsMessage(0, time_now))

    def close(self) -> None:
        self._bus.close()

    def _axis_sense(self, reading: TorqueAxisReading, name: str) -> AxisSense:
        fault = _FAULTS.get(reading.error, _GENERAL_FAULT) if reading.error else 0
        health: NodeHealth | None = self._slots[f"{name}_health"].read()
        if fault == 0 and health is not None:
            silent = self._last_read - health.heartbeat_time > self._config.heartbeat_lost
            unmonitored = self._last_read - health.stamp > self._config.health_age
            # A restarted node has lost its set-up, and only a living service process can report it.
            fault = _GENERAL_FAULT if silent or unmonitored or health.restarts > 0 else 0
        age = reading.age
        return AxisSense(reading.counts, age, reading.current, reading.acting, fault, age)


def connect(config: dict[str, Any], dt: float) -> WaveBotDevices:
    """Return the devices for a configuration of `rig.kinds.wavebot.hardware.job`.

    LinkError if the bus cannot be opened.
    """
    settings: WaveBotDeviceSettings = handover.loads(WaveBotDeviceSettings, config["devices"])
    scales, facts = config["scales"], config["facts"]["can"]
    settings = settings._replace(
        heave=settings.heave._replace(scale=_current_scale(scales["heave"], facts["heave"])),
        surge=settings.surge._replace(scale=_current_scale(scales["surge"], facts["surge"])),
    )
    slots = open_mailboxes(config["mailboxes"])
    nodes = (
        TorqueAxis(settings.heave),
        TorqueAxis(settings.surge),
        PositionActuator(settings.stator),
    )
    sync_frames = frozenset[int]().union(*(node.sync_dividers for node in nodes))
    bus = BusSettings.from_json(config["bus"])
    return WaveBotDevices(settings, Link(bus, sync_frames), slots)


def _current_scale(settings: dict[str, Any], facts: dict[str, int]) -> scaling.CurrentScale:
    """Return the current scale from values read from the drive, not from the rig file."""
    limit = settings["limit"]
    if settings["kind"] == "amc":
        return scaling.amc_current(facts["amc_peak_current"], limit)
    if settings["kind"] == "rated_torque":
        return scaling.rated_torque_current(facts["rated_torque"], settings["kt"], limit)
    return scaling.rated_current(facts["rated_current"], limit)
