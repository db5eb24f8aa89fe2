"""A fieldbus coupler with analog outputs, digital inputs and digital outputs, after WAGO 750-352.

Source: WAGO 750 manuals, section MODBUS functions. Outputs are written from 0x0000 and read back
from 0x0200, inputs are read from 0x0000; words and bits have their own address spaces; functions
1 and 2, and 3 and 4, read the same. Each channel has one word: 7FFF is full scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from sim_plant.emulators import module_watchdog
from sim_plant.emulators.modbus_pdu import ExceptionCode, ModbusRefusalError, Table
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.module_watchdog import ModuleWatchdog, Status
from sim_plant.units import Flag, Second

READ_BACK = 0x0200
ERROR_LED = (0x1020, 0x1021)
SIZES = (0x1022, 0x1023)  # bits of analog outputs and inputs in the process image
FULL_SCALE = 0x7FFF

FAULTS = {
    "watchdog_off": "the watchdog does not start: its status stays 0",
    "watchdog_dead": "the watchdog never expires, whatever its status",
    "outputs_stuck": "outputs keep their values; the read-back shows the written values",
    "outputs_dead": "outputs are 0; the read-back shows the written values",
}


class AnalogOutput(NamedTuple):
    """One analog output."""

    channel: str
    full_scale: float  # at code 7FFF, in the channel's unit (A or V)
    bipolar: Flag = 0  # 1: codes 8000 to FFFF are negative; 0: they are refused


class DigitalInput(NamedTuple):
    """One digital input and the fault that forces it."""

    channel: str
    fault: str  # name, as `estop_pressed`
    level: Flag  # what the input reads while the fault is on (a stop circuit is 0 when open)


class CouplerSettings(NamedTuple):
    """Modules of a coupler, in the order of their addresses."""

    analog: tuple[AnalogOutput, ...] = ()
    inputs: tuple[DigitalInput, ...] = ()
    outputs: tuple[str, ...] = ()
    watchdog_unit: Second = 0.1  # of register 0x1000; not confirmed


class IoCoupler(ModbusUnit):
    """Applies written outputs to the plant, and sets them to 0 when its watchdog expires."""

    def __init__(
        self,
        settings: CouplerSettings,
        *,
        read: Callable[[], Mapping[str, int]] | None = None,
        write: Callable[[str, float], None] | None = None,
        reply_delay: Second = 0.0,
    ) -> None:
        """`read` returns levels by input channel; `write(channel, value)` receives new outputs."""
        input_faults = {
            entry.fault: f"input {entry.channel} reads {entry.level}" for entry in settings.inputs
        }
        super().__init__(faults={**FAULTS, **input_faults}, reply_delay=reply_delay)
        self.settings = settings
        self.watchdog = ModuleWatchdog(settings.watchdog_unit)
        self._read = read or dict
        self._write = write or (lambda channel, value: None)
        self._disconnect_pending = False
        for channel_index in range(len(settings.analog)):
            self.writable.add((Table.HOLDING, channel_index))
        for channel_index in range(len(settings.outputs)):
            self.writable.add((Table.COILS, channel_index))
        for address in range(module_watchdog.FIRST, module_watchdog.LAST + 1):
            self.writable.add((Table.HOLDING, address))
        self._write_both(Table.HOLDING, SIZES[0], 16 * len(settings.analog))
        for address in (*ERROR_LED, SIZES[1]):
            self._write_both(Table.HOLDING, address, 0)
        self._zero_outputs()
        self._update_watchdog_registers()

    def run_timers(self, now: Second) -> None:
        """Check the time since the last request of the host."""
        if self.faults.is_on("watchdog_dead"):
            return
        if self.watchdog.check_expired(now):
            self._zero_outputs()
            self._disconnect_pending = self.watchdog.closes_sockets()
            self._update_watchdog_registers()

    def should_disconnect(self) -> bool:
        """Return True once if connections must end because the watchdog expired and is set so."""
        disconnect, self._disconnect_pending = self._disconnect_pending, False
        return disconnect

    def measure(self, now: Second) -> None:
        """Read the inputs."""
        levels = self._read()
        for index, (channel, fault, fault_level) in enumerate(self.settings.inputs):
            level = fault_level if self.faults.is_on(fault) else int(levels.get(channel, 0))
            self._write_both(Table.COILS, index, level)

    def on_request(self, function: int) -> None:
        """Renew the watchdog if it is configured to be renewed by this function."""
        if not self.faults.is_on("watchdog_off"):
            self.watchdog.on_request(function, self.now)
        self._update_watchdog_registers()

    def accept_write(self, table: Table, address: int, value: int) -> None:
        """Write an output or a watchdog register."""
        if table is Table.HOLDING and address >= module_watchdog.FIRST:
            if not (address == module_watchdog.TRIGGER and self.faults.is_on("watchdog_off")):
                self.watchdog.write(address, value, self.now)
            self._update_watchdog_registers()
            return
        if self.watchdog.status is Status.EXHAUSTED:
            raise ModbusRefusalError(ExceptionCode.DEVICE_FAILURE)
        if table is Table.COILS:
            self._set_output(self.settings.outputs[address], float(value))
        else:
            output = self.settings.analog[address]
            if value > FULL_SCALE and output.bipolar == 0:
                raise ModbusRefusalError(ExceptionCode.ILLEGAL_VALUE)
            signed = value - 0x10000 if value > FULL_SCALE else value
            self._set_output(output.channel, output.full_scale * signed / FULL_SCALE)
        self._write_both(table, READ_BACK + address, value)

    def _set_output(self, channel: str, value: float) -> None:
        if not self.faults.is_on("outputs_stuck"):
            self._write(channel, 0.0 if self.faults.is_on("outputs_dead") else value)

    def _zero_outputs(self) -> None:
        """Set all outputs to 0; only the fault `outputs_stuck` prevents it."""
        for index, output in enumerate(self.settings.analog):
            self._set_output(output.channel, 0.0)
            self._write_both(Table.HOLDING, READ_BACK + index, 0)
        for index, channel in enumerate(self.settings.outputs):
            self._set_output(channel, 0.0)
            self._write_both(Table.COILS, READ_BACK + index, 0)

    def _update_watchdog_registers(self) -> None:
        for address in range(module_watchdog.FIRST, module_watchdog.LAST + 1):
            self._write_both(Table.HOLDING, address, self.watchdog.read(address))

    def _write_both(self, table: Table, address: int, value: int) -> None:
        mirror = Table.DISCRETE_INPUTS if table is Table.COILS else Table.INPUT
        self.put(table, address, value)
        self.put(mirror, address, value)
