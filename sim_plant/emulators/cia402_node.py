"""An emulated drive: a CANopen node with the CiA 402 machine, modes, option codes and faults."""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

from sim_plant.emulators import node_errors, node_objects
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import CanopenNode, NodeParams
from sim_plant.emulators.cia402 import Action, Machine, Options, State
from sim_plant.emulators.node_faults import Fault
from sim_plant.emulators.node_objects import Key, Refused
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.units import Second, Volt

PROFILE_POSITION, HOMING, CYCLIC_TORQUE = 1, 6, 10
# Bit of 0x6502 by mode of operation.
SUPPORTED = {1: 0x1, 2: 0x2, 3: 0x4, 4: 0x8, 6: 0x20, 7: 0x40, 8: 0x80, 9: 0x100, 10: 0x200}

VOLTAGE, NO_QUICK_STOP, WARNING, REMOTE = 0x10, 0x20, 0x80, 0x200
REACHED, LIMITED, MODE_12, MODE_13 = 0x400, 0x800, 0x1000, 0x2000


class DriveParams(NamedTuple):
    """What every emulated drive is told."""

    self_test: Second = 0.02  # NOT READY after power-on
    mode_delay: Second = 0.005  # from 6060 to 6061
    temperature: float = 35.0  # degC
    warm: float = 70.0  # degC: warning
    hot: float = 90.0  # degC: fault
    lowest: Volt = 10.0  # DC link or supply: below, undervoltage
    highest: Volt = 400.0


DRIVE_FAULTS = (
    Fault("drive_fault", "a fault of the drive; it can be reset", "EMCY code", 0xFF00, once=True),
    Fault("over_temperature", "it is hot: fault 4310 above the limit", "degC", 120.0),
    Fault("bus_undervoltage", "its DC link or supply sags: fault 3220 below the limit", "V", 0.0),
    Fault("bus_overvoltage", "its DC link or supply rises: fault 3210 above the limit", "V", 450.0),
    Fault("stuck_statusword", "6041 stays what it is now"),
    Fault("mode_stuck", "6061 does not follow 6060"),
    Fault("will_not_enable", "the machine hears no controlword but fault resets"),
    Fault("encoder_frozen", "6064 stays what it is now"),
    Fault("encoder_wrapped", "6064 is shifted to just below its overflow", "counts below", 100.0),
)


class Cia402Node(CanopenNode):
    """A drive; subclasses say what it measures and what its power stage does."""

    def __init__(
        self,
        params: NodeParams,
        drive: DriveParams,
        hub: CanHub,
        schedule: Schedule,
        world: SharedWorld,
    ) -> None:
        self.machine = Machine()
        self.drive = drive
        super().__init__(params, hub, schedule, world)
        self.fault_list.add(*DRIVE_FAULTS)
        self._tested_at = schedule.time() + drive.self_test
        self._mode_at: Second | None = None
        self._resets = 0
        self._ticks = 0  # of the world at the last measurement
        self._cause = 0  # EMCY code of voltage or temperature
        self._lasting = REMOTE  # bits of the statusword that change slowly
        self._frozen: dict[str, int] = {}  # values of faults that hold or shift one
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
        """Whether the power stage gives current."""
        return self.machine.action is not Action.OFF

    # ---- what a drive is made of ----------------------------------------------------------------

    @abstractmethod
    def measure(self, elapsed: Second) -> None:
        """Put what the sensors read into the objects; `elapsed` of simulated time, often 0."""

    @abstractmethod
    def act(self, elapsed: Second) -> None:
        """Write what the power stage does to the world; at once after a command with 0 s."""

    @abstractmethod
    def at_rest(self) -> bool:
        """Say whether a ramp is over."""

    @abstractmethod
    def voltage(self) -> Volt:
        """Give the DC link or supply voltage without faults."""

    def mode_bits(self) -> int:
        """Give bits 10 to 13 of the statusword."""
        return 0

    def cause(self) -> int:
        """Give the EMCY code of what of the device's own is wrong now, 0 if all is well."""
        return 0

    def warned(self) -> bool:
        """Say whether bit 7 is set for a reason of the device's own."""
        return False

    # ---- a node's part --------------------------------------------------------------------------

    def step(self, now: Second, elapsed: Second) -> None:
        """Measure, look for faults, let ramps end, act, tell."""
        if self.machine.state is State.NOT_READY and now >= self._tested_at:
            self.machine.ready()
        if self._mode_at is not None and now >= self._mode_at and "mode_stuck" not in self.active:
            self._mode_at = None
            self.objects.put(0x6061, self.objects.get(0x6060))
        ticks = self.world.ticks
        self.measure((ticks - self._ticks) * self.world.dt)
        self._ticks = ticks
        cause = self.cause() or self._cause
        if cause:
            self.fail(cause)
        self.machine.blocked = cause != 0
        self.machine.step(self.at_rest())
        self.act(elapsed)
        self._tell()

    def outputs(self) -> None:
        """Let a controlword or set-point act at once."""
        if self.machine.resets != self._resets:
            self._resets = self.machine.resets
            self.objects.put(0x603F, 0)
            self.errors.gone()
        self.act(0.0)
        self._tell()

    def master_lost(self, code: int) -> None:
        """React by option code 6007."""
        self._read_options()
        if self.machine.abort_connection(self.objects.get(0x6007)):
            self.fail(code or node_errors.COMMUNICATION)
        self.outputs()

    def in_fault(self) -> bool:
        """Errors of a faulted drive wait for the fault reset."""
        return self.machine.state in (State.FAULT, State.FAULT_REACTION)

    def restarted(self) -> None:
        """Power-on: NOT READY, mode 0, no current."""
        self.machine = Machine()
        self._resets = 0
        self._mode_at = None
        self._tested_at = self._schedule.time() + self.params.boot + self.drive.self_test
        self.objects.put(0x6061, 0)
        self.act(0.0)

    def fail(self, code: int, *, coast: bool = False) -> None:
        """Enter a fault: EMCY, 0x603F, fault reaction."""
        if not self.in_fault():
            self.objects.put(0x603F, code)
            self._read_options()
            self.machine.fault(coast=coast)
        self.errors.occur(code)

    def fault_began(self, fault: Fault) -> None:
        """Remember what a fault holds."""
        if fault.name == "drive_fault":
            self.fail(int(fault.default))
        elif fault.name == "stuck_statusword":
            self._frozen[fault.name] = self.objects.get(0x6041)
        elif fault.name in ("encoder_frozen", "encoder_wrapped"):
            self._frozen[fault.name] = self.objects.get(0x6064)

    def inject(self, name: str, value: float | None = None) -> None:
        """Give it a fault, `drive_fault` with its own EMCY code."""
        if name == "drive_fault" and value is not None:
            self.fail(int(value))
        else:
            super().inject(name, value)

    # ---- shared by drives -----------------------------------------------------------------------

    def seen_voltage(self) -> Volt:
        """Give the voltage that the drive reads."""
        active = self.active
        for name in ("bus_undervoltage", "bus_overvoltage"):
            if name in active:
                return active[name]
        return self.voltage()

    def seen_temperature(self) -> float:
        """Give the temperature that the drive reads, degC."""
        return self.active.get("over_temperature", self.drive.temperature)

    def put_position(self, position: int) -> None:
        """Put 0x6064, wrapped to 32 bits, as the encoder's faults have it."""
        active = self.active
        if "encoder_frozen" in active:
            position = self._frozen["encoder_frozen"]
        elif "encoder_wrapped" in active:
            edge = 0x7FFFFFFF - int(active["encoder_wrapped"])
            position += edge - self._frozen["encoder_wrapped"]
        self.objects.put(0x6064, position)

    def look_round(self) -> None:
        """Look at voltage and temperature: bits 4 and 7, and faults for the next step."""
        drive = self.drive
        volts, temperature = self.seen_voltage(), self.seen_temperature()
        self._cause = 0
        if volts < drive.lowest:
            self._cause = node_errors.DC_LINK_UNDER_VOLTAGE
        elif volts > drive.highest:
            self._cause = node_errors.DC_LINK_OVER_VOLTAGE
        elif temperature > drive.hot:
            self._cause = node_errors.OVER_TEMPERATURE
        self._lasting = REMOTE | (VOLTAGE if volts >= drive.lowest else 0)
        if self.warned() or temperature > drive.warm:
            self._lasting |= WARNING

    def _tell(self) -> None:
        """Put the statusword."""
        state = self.machine.state
        word = self._lasting
        if state is not State.NOT_READY:
            word |= state | self.mode_bits()
            if state is not State.QUICK_STOP:
                word |= NO_QUICK_STOP
        if "stuck_statusword" in self.active:
            word = self._frozen["stuck_statusword"]
        self.objects.put(0x6041, word)

    def _read_options(self) -> None:
        get = self.objects.get
        self.machine.options = Options(
            get(0x605A), get(0x605B), get(0x605C), get(0x605D), get(0x605E)
        )

    def _on_controlword(self, word: int) -> None:
        if "will_not_enable" in self.active and not self.in_fault():
            return
        self._read_options()
        self.machine.control(word)

    def _on_mode(self, mode: int) -> None:
        self._mode_at = self._schedule.time() + self.drive.mode_delay

    def _guard_mode(self, key: Key, value: int) -> None:
        if value != 0 and not self.objects.get(0x6502) & SUPPORTED.get(value, 0):
            raise Refused(node_objects.BAD_VALUE)
