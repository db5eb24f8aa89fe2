"""A fieldbus coupler with analog outputs, digital inputs and digital outputs, after WAGO 750-352.

Source: WAGO 750 manuals, section MODBUS functions. Outputs are written from 0x0000 and read back
from 0x0200, inputs are read from 0x0000; words and bits have their own address spaces; functions
1 and 2, and 3 and 4, read the same. One word a channel: 7FFF is full scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from sim_plant.emulators import module_watchdog
from sim_plant.emulators.modbus_pdu import RefusalError, Refused, Table
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.module_watchdog import ModuleWatchdog, Status
from sim_plant.units import Flag, Second

READ_BACK = 0x0200
ERROR_LED = (0x1020, 0x1021)
SIZES = (0x1022, 0x1023)  # bits of analog outputs and inputs in the process image
FULL_SCALE = 0x7FFF

FAULTS = {
    "watchdog_off": "the watchdog does not start: its status stays 0",
    "watchdog_dead": "the watchdog never exhausts, whatever its status says",
    "outputs_stuck": "outputs stay as they are; what is read back is what was written",
    "outputs_dead": "outputs are 0; what is read back is what was written",
}


class AnalogOutput(NamedTuple):
    """One analog output."""

    channel: str
    full_scale: float  # at code 7FFF, in the channel's unit (A or V)
    bipolar: Flag = 0  # 1: codes 8000 to FFFF are negative; 0: they are refused


class DigitalInput(NamedTuple):
    """One digital input and the fault that holds it."""

    channel: str
    fault: str  # name, as `estop_pressed`
    level: Flag  # what the input reads while the fault is on (a stop circuit is 0 when open)


class CouplerSettings(NamedTuple):
    """What is plugged into a coupler, in the order of its addresses."""

    analog: tuple[AnalogOutput, ...] = ()
    inputs: tuple[DigitalInput, ...] = ()
    outputs: tuple[str, ...] = ()
    watchdog_unit: Second = 0.1  # of register 0x1000; not confirmed


class IoCoupler(ModbusUnit):
    """Brings written outputs to the plant, and takes them back to 0 when its watchdog exhausts."""

    def __init__(
        self,
        settings: CouplerSettings,
        *,
        read: Callable[[], Mapping[str, int]] | None = None,
        write: Callable[[str, float], None] | None = None,
        reply_delay: Second = 0.0,
    ) -> None:
        """`read` gives levels by input channel; `write(channel, value)` gets every new output."""
        held = {
            entry.fault: f"input {entry.channel} reads {entry.level}" for entry in settings.inputs
        }
        super().__init__(faults={**FAULTS, **held}, reply_delay=reply_delay)
        self.settings = settings
        self.watchdog = ModuleWatchdog(settings.watchdog_unit)
        self._read = read or dict
        self._write = write or (lambda channel, value: None)
        self._hang_up = False
        for place in range(len(settings.analog)):
            self.writable.add((Table.HOLDING, place))
        for place in range(len(settings.outputs)):
            self.writable.add((Table.COILS, place))
        for address in range(module_watchdog.FIRST, module_watchdog.LAST + 1):
            self.writable.add((Table.HOLDING, address))
        self._write_both(Table.HOLDING, SIZES[0], 16 * len(settings.analog))
        for address in (*ERROR_LED, SIZES[1]):
            self._write_both(Table.HOLDING, address, 0)
        self._zero()
        self._show_watchdog()

    def run(self, now: Second) -> None:
        """Watch the time since the host was last heard."""
        if self.faults.on("watchdog_dead"):
            return
        if self.watchdog.run_out(now):
            self._zero()
            self._hang_up = self.watchdog.closes_sockets()
            self._show_watchdog()

    def hangs_up(self) -> bool:
        """Say, once, that connections end because the watchdog exhausted and is set so."""
        ended, self._hang_up = self._hang_up, False
        return ended

    def measure(self, now: Second) -> None:
        """Read the inputs."""
        levels = self._read()
        for place, (channel, fault, held) in enumerate(self.settings.inputs):
            level = held if self.faults.on(fault) else int(levels.get(channel, 0))
            self._write_both(Table.COILS, place, level)

    def heard(self, function: int) -> None:
        """Renew the watchdog where it is set so."""
        if not self.faults.on("watchdog_off"):
            self.watchdog.heard(function, self.now)
        self._show_watchdog()

    def accept(self, table: Table, address: int, value: int) -> None:
        """Take an output or a watchdog register."""
        if table is Table.HOLDING and address >= module_watchdog.FIRST:
            if not (address == module_watchdog.TRIGGER and self.faults.on("watchdog_off")):
                self.watchdog.write(address, value, self.now)
            self._show_watchdog()
            return
        if self.watchdog.status is Status.EXHAUSTED:
            raise RefusalError(Refused.DEVICE_FAILURE)
        if table is Table.COILS:
            self._bring(self.settings.outputs[address], float(value))
        else:
            output = self.settings.analog[address]
            if value > FULL_SCALE and output.bipolar == 0:
                raise RefusalError(Refused.ILLEGAL_VALUE)
            signed = value - 0x10000 if value > FULL_SCALE else value
            self._bring(output.channel, output.full_scale * signed / FULL_SCALE)
        self._write_both(table, READ_BACK + address, value)

    def _bring(self, channel: str, value: float) -> None:
        if not self.faults.on("outputs_stuck"):
            self._write(channel, 0.0 if self.faults.on("outputs_dead") else value)

    def _zero(self) -> None:
        """Take all outputs back; no fault but a stuck output keeps them."""
        for place, output in enumerate(self.settings.analog):
            self._bring(output.channel, 0.0)
            self._write_both(Table.HOLDING, READ_BACK + place, 0)
        for place, channel in enumerate(self.settings.outputs):
            self._bring(channel, 0.0)
            self._write_both(Table.COILS, READ_BACK + place, 0)

    def _show_watchdog(self) -> None:
        for address in range(module_watchdog.FIRST, module_watchdog.LAST + 1):
            self._write_both(Table.HOLDING, address, self.watchdog.read(address))

    def _write_both(self, table: Table, address: int, value: int) -> None:
        other = Table.DISCRETE_INPUTS if table is Table.COILS else Table.INPUT
        self.put(table, address, value)
        self.put(other, address, value)
