"""An emulated drive without its bus: CiA 402 state machine, modes, option codes and faults."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from sim_plant.emulators import device_errors, device_objects
from sim_plant.emulators.cia402 import Action, OptionCodes, State, StateMachine
from sim_plant.emulators.device_objects import Key, ObjectEntry, SdoRefusedError
from sim_plant.emulators.fault_list import EITHER, Fault
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.units import Second, Volt

PROFILE_POSITION, HOMING, CYCLIC_TORQUE = 1, 6, 10
# Bit of 0x6502 by mode of operation.
SUPPORTED = {1: 0x1, 2: 0x2, 3: 0x4, 4: 0x8, 6: 0x20, 7: 0x40, 8: 0x80, 9: 0x100, 10: 0x200}

VOLTAGE, NO_QUICK_STOP, WARNING, REMOTE = 0x10, 0x20, 0x80, 0x200
REACHED, LIMITED, MODE_12, MODE_13 = 0x400, 0x800, 0x1000, 0x2000


class Cia402Params(NamedTuple):
    """Parameters of every emulated drive."""

    self_test: Second = 0.02  # NOT READY after power-on
    mode_delay: Second = 0.005  # from 6060 to 6061
    temperature: float = 35.0  # degC
    warning_temperature: float = 70.0  # degC: warning
    fault_temperature: float = 90.0  # degC: fault
    min_voltage: Volt = 10.0  # DC link or supply: below, undervoltage
    max_voltage: Volt = 400.0


LIMIT_SWITCH = Fault(
    "limit_switch",
    "60FD: a limit switch is closed",
    "bit: 0 negative, 1 positive",
    limits=EITHER,
)
DRIVE_FAULTS = (
    Fault("drive_fault", "a fault of the drive; it can be reset", "EMCY code", 0xFF00, once=True),
    Fault("over_temperature", "the drive is hot: fault 4310 above the limit", "degC", 120.0),
    Fault("bus_undervoltage", "DC link or supply sags: fault 3220 below the limit", "V", 0.0),
    Fault("bus_overvoltage", "DC link or supply rises: fault 3210 above the limit", "V", 450.0),
    Fault("stuck_statusword", "6041 keeps its present value"),
    Fault("mode_stuck", "6061 does not follow 6060"),
    Fault("will_not_enable", "the state machine ignores controlwords except fault resets"),
    Fault("encoder_frozen", "6064 keeps its present value"),
    Fault("encoder_wrapped", "6064 is shifted to just below its overflow", "counts below", 100.0),
)


class Cia402Drive(ObjectDevice):
    """A drive; subclasses define its measurements and its power stage."""

    def __init__(
        self,
        entries: Iterable[ObjectEntry],
        drive: Cia402Params,
        world: SharedSimulation[Any, Any],
        clock: Callable[[], Second],
    ) -> None:
        super().__init__(entries, world, clock)
        self.machine = StateMachine()
        self.drive = drive
        self.fault_list.add(*DRIVE_FAULTS)
        self._self_test_end = clock() + drive.self_test
        self._mode_change_at: Second | None = None
        self._requested_mode = 0  # 6060 as last written
        self._seen_resets = 0
        self._last_ticks = 0  # of the world at the last measurement
        self._slow_fault_code = 0  # EMCY code of voltage or temperature
        self._slow_bits = REMOTE  # slowly changing bits of the statusword
        self._fault_values: dict[
            str, int
        ] = {}  # values at the start of faults that freeze or shift one
        objects = self.objects
        objects.hooks[0x6040, 0] = self._on_controlword
        objects.hooks[0x6060, 0] = self._on_mode
        objects.guards[0x6060] = self._guard_mode

    @property
    def mode(self) -> int:
        """The mode in force, 0x6061."""
        return self.objects.values[0x6061, 0]

    @property
    def powered(self) -> bool:
        """Whether the power stage is on."""
        return self.machine.action is not Action.OFF

    # ---- methods that drives override ------------------------------------------------------------

    @abstractmethod
    def measure(self, elapsed: Second) -> None:
        """Write the sensor readings to the objects; `elapsed` is simulated time, often 0."""

    @abstractmethod
    def act(self, elapsed: Second) -> None:
        """Write the action of the power stage to the world; after a command `elapsed` is 0 s."""

    @abstractmethod
    def at_rest(self) -> bool:
        """Return whether a ramp is over."""

    @abstractmethod
    def voltage(self) -> Volt:
        """Return the DC link or supply voltage without faults."""

    def mode_bits(self) -> int:
        """Return bits 10 to 13 of the statusword."""
        return 0

    def fault_code(self) -> int:
        """Return the EMCY code of the device's present fault, 0 if there is none."""
        return 0

    def has_warning(self) -> bool:
        """Return whether the device itself has a reason to set bit 7 (warning)."""
        return False

    # ---- overridden methods of the device --------------------------------------------------------

    def step(self, now: Second, elapsed: Second) -> None:
        """Measure, check for faults, end ramps, act, update the statusword."""
        if self.machine.state is State.NOT_READY and now >= self._self_test_end:
            self.machine.finish_self_test()
        if (
            self._mode_change_at is not None
            and now >= self._mode_change_at
            and "mode_stuck" not in self.active
        ):
            self._mode_change_at = None
            self.objects.put(0x6061, self.objects.get(0x6060))
        ticks = self.world.ticks
        self.measure((ticks - self._last_ticks) * self.world.dt)
        self._last_ticks = ticks
        code = self.fault_code() or self._slow_fault_code
        if code:
            self.enter_fault(code)
        self.machine.fault_persists = code != 0
        self.machine.step(self.at_rest())
        self.act(elapsed)
        self._update_statusword()

    def apply_outputs(self) -> None:
        """Apply a controlword or set-point at once."""
        if self.machine.reset_count != self._seen_resets:
            self._seen_resets = self.machine.reset_count
            self.objects.put(0x603F, 0)
            self.errors.clear_all()
        self.act(0.0)
        self._update_statusword()

    def on_master_lost(self, code: int) -> None:
        """React by option code 6007."""
        self._read_options()
        if self.machine.abort_connection(self.objects.get(0x6007)):
            self.enter_fault(code or device_errors.COMMUNICATION)
        self.apply_outputs()

    def in_fault(self) -> bool:
        """Return True while a fault is present: its errors stay until the fault reset."""
        return self.machine.state in (State.FAULT, State.FAULT_REACTION)

    def on_restart(self, ready_at: Second) -> None:
        """Reset to power-on: NOT READY, mode 0, no current."""
        self.machine = StateMachine()
        self._seen_resets = 0
        self._mode_change_at = None
        self._requested_mode = 0
        self._self_test_end = ready_at + self.drive.self_test
        self.objects.put(0x6061, 0)
        self.act(0.0)

    def enter_fault(self, code: int, *, coast: bool = False) -> None:
        """Enter a fault: EMCY, 0x603F, fault reaction."""
        if not self.in_fault():
            self.objects.put(0x603F, code)
            self._read_options()
            self.machine.enter_fault(coast=coast)
        self.errors.raise_error(code)

    def on_fault(self, fault: Fault, value: float) -> None:
        """Enter `drive_fault`, whose value is the EMCY code, or store what a fault freezes."""
        if fault.name == "drive_fault":
            self.enter_fault(int(value))
        elif fault.name == "stuck_statusword":
            self._fault_values[fault.name] = self.objects.get(0x6041)
        elif fault.name in ("encoder_frozen", "encoder_wrapped"):
            self._fault_values[fault.name] = self.objects.get(0x6064)

    # ---- shared by drives -----------------------------------------------------------------------

    def sensed_voltage(self) -> Volt:
        """Return the voltage that the drive measures."""
        active = self.active
        for name in ("bus_undervoltage", "bus_overvoltage"):
            if name in active:
                return active[name]
        return self.voltage()

    def sensed_temperature(self) -> float:
        """Return the temperature that the drive measures, degC."""
        return self.active.get("over_temperature", self.drive.temperature)

    def put_position(self, position: int) -> None:
        """Set 0x6064, wrapped to 32 bits, with the encoder's faults applied."""
        active = self.active
        if "encoder_frozen" in active:
            position = self._fault_values["encoder_frozen"]
        elif "encoder_wrapped" in active:
            overflow = 0x7FFFFFFF - int(active["encoder_wrapped"])
            position += overflow - self._fault_values["encoder_wrapped"]
        self.objects.put(0x6064, position)

    def measure_slow(self) -> None:
        """Measure voltage and temperature: bits 4 and 7, and faults for the next step."""
        drive = self.drive
        volts, temperature = self.sensed_voltage(), self.sensed_temperature()
        self._slow_fault_code = 0
        if volts < drive.min_voltage:
            self._slow_fault_code = device_errors.DC_LINK_UNDER_VOLTAGE
        elif volts > drive.max_voltage:
            self._slow_fault_code = device_errors.DC_LINK_OVER_VOLTAGE
        elif temperature > drive.fault_temperature:
            self._slow_fault_code = device_errors.OVER_TEMPERATURE
        self._slow_bits = REMOTE | (VOLTAGE if volts >= drive.min_voltage else 0)
        if self.has_warning() or temperature > drive.warning_temperature:
            self._slow_bits |= WARNING

    def _update_statusword(self) -> None:
        """Set the statusword."""
        state = self.machine.state
        statusword = self._slow_bits
        if state is not State.NOT_READY:
            statusword |= state | self.mode_bits()
            if state is not State.QUICK_STOP:
                statusword |= NO_QUICK_STOP
        if "stuck_statusword" in self.active:
            statusword = self._fault_values["stuck_statusword"]
        self.objects.put(0x6041, statusword)

    def _read_options(self) -> None:
        get = self.objects.get
        self.machine.options = OptionCodes(
            get(0x605A), get(0x605B), get(0x605C), get(0x605D), get(0x605E)
        )

    def _on_controlword(self, controlword: int) -> None:
        if "will_not_enable" in self.active and not self.in_fault():
            return
        self._read_options()
        self.machine.apply_controlword(controlword)

    def _on_mode(self, mode: int) -> None:
        if mode != self._requested_mode:  # in process data the same one comes every cycle
            self._requested_mode = mode
            self._mode_change_at = self.clock() + self.drive.mode_delay

    def _guard_mode(self, key: Key, value: int) -> None:
        if value != 0 and not self.objects.get(0x6502) & SUPPORTED.get(value, 0):
            raise SdoRefusedError(device_objects.BAD_VALUE)
