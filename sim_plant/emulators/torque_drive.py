"""The emulated drive of a motor of the world: cyclic synchronous torque.

Two scalings of current: the manufacturer's (AMC: 6071 in DC2, 6077 in DC1, Kp in 20D8:0C) and per
mille of rated torque (CiA 402: 6071, 6077 over 6076; rated torque corresponds to rated current
6075).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import Enum
from typing import Any, NamedTuple

from sim_plant.emulators import device_errors
from sim_plant.emulators.cia402 import Action
from sim_plant.emulators.cia402_drive import (
    CYCLIC_TORQUE,
    LIMIT_SWITCH,
    LIMITED,
    MODE_12,
    Cia402Drive,
    Cia402Params,
)
from sim_plant.emulators.device_objects import ObjectEntry, round_or_zero
from sim_plant.emulators.fault_list import SIGNED, Fault
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.units import Ampere, Code, Count, Flag, Second, Volt

PER_VOLT = 819.2  # raw per volt of an analog input
FULL_SCALE = 8191  # raw: 10 V
PLANT_FAULTS = {
    1: device_errors.VENDOR,
    2: device_errors.DC_LINK_UNDER_VOLTAGE,
    3: device_errors.DC_LINK_OVER_VOLTAGE,
}
NO_STATUS_BITS = (0, 0, 0, 0, 0, 0, 0)


class MotorReading(NamedTuple):
    """A motor of the world as its drive measures it."""

    counts: Count  # encoder
    current: Ampere
    enabled: Flag
    fault: Code = 0  # 0 none, 1 general, 2 undervoltage, 3 overvoltage
    saturated: Flag = 0  # 1: it gives less current than commanded
    bus_voltage: Volt = 150.0


class Motor(NamedTuple):
    """A motor of the world: what its drive reads and actuates."""

    read: Callable[[], MotorReading]
    actuate: Callable[[Ampere, Flag], None]  # current, enable


class Scaling(Enum):
    """Meaning of the raw current values."""

    AMC = "DC1 and DC2 of Kp"
    RATED = "per mille of rated torque"


class AnalogInput(NamedTuple):
    """Sensor on one analog input."""

    read: Callable[[], float]
    per_volt: float  # of its unit


class TorqueDriveParams(NamedTuple):
    """Parameters of a torque drive besides its object dictionary."""

    scaling: Scaling
    drive: Cia402Params = Cia402Params()
    analog: tuple[AnalogInput, ...] = ()  # in the order of 201A:01, :02
    encoder_increments: Count = 0  # 608F:01; 0: that of the object dictionary


TORQUE_FAULTS = (
    Fault(
        "wrong_kp", "20D8:0C and the scaling by it are those of another drive", "factor on Kp", 0.5
    ),
    Fault("no_torque", "enabled, but no current flows"),
    Fault("inverted_motor", "two phases are swapped: current and force have the opposite sign"),
    Fault("encoder_reversed", "6064 counts in the opposite direction from its present value"),
    Fault("encoder_step", "6064 is shifted at once", "counts", 4000.0, limits=SIGNED),
    Fault("encoder_creep", "6064 drifts away", "counts/s", 400.0, limits=SIGNED),
    Fault("load_cell_saturated", "analog input 1 reads its positive limit"),
    Fault("load_cell_dead", "both analog inputs read 0 V"),
    Fault("load_cell_inverted", "analog input 1 has the opposite sign"),
    LIMIT_SWITCH,
)


class TorqueDrive(Cia402Drive):
    """A drive of one motor."""

    def __init__(
        self,
        entries: Iterable[ObjectEntry],
        torque: TorqueDriveParams,
        world: SharedSimulation[Any, Any],
        clock: Callable[[], Second],
        motor: Motor,
    ) -> None:
        self.torque = torque
        self._motor = motor
        self.current: Ampere = 0.0  # commanded to the world
        self._last_command: tuple[Ampere, int] = (0.0, 0)
        self._is_limited = False
        self._last_counts: int | None = None
        self._reversal_counts = 0  # counts at which the encoder was reversed
        self._creep_start: Second = 0.0
        super().__init__(entries, torque.drive, world, clock)
        if torque.encoder_increments:
            self.storage.defaults[0x608F, 1] = torque.encoder_increments
            self.objects.put(0x608F, torque.encoder_increments, 1)
        self.fault_list.add(*TORQUE_FAULTS)

    # ---- scaling --------------------------------------------------------------------------------

    @property
    def kp(self) -> Ampere:
        """Peak current of the drive (AMC: 20D8:0C in 0.1 A)."""
        return 0.1 * self.objects.get(0x20D8, 0xC)

    def raw_target(self, current: Ampere) -> int:
        """Return the value of 6071 for a current."""
        if self.torque.scaling is Scaling.AMC:
            return round_or_zero(current * 32768.0 / self.kp)
        return self.raw_current(current)

    def commanded_current(self) -> Ampere:
        """Return the current that 6071 (and 60B2) command, within the drive's own limits."""
        get = self.objects.get
        if self.torque.scaling is Scaling.AMC:
            return get(0x6071) * self.kp / 32768.0
        limit = min(get(0x6072), get(0x6073))
        target = get(0x6071) + get(0x60B2)
        permille = max(-limit, min(limit, target))
        self._is_limited = permille != target
        return permille * get(0x6075) * 1.0e-6

    def raw_current(self, current: Ampere) -> int:
        """Return the value of 6077 for a current."""
        if self.torque.scaling is Scaling.AMC:
            return round_or_zero(current * 8192.0 / self.kp)
        return round_or_zero(current * 1.0e6 / max(1, self.objects.get(0x6075)))

    # ---- overridden methods of the drive ---------------------------------------------------------

    def measure(self, elapsed: Second) -> None:
        """Write encoder, current and analog inputs to the objects."""
        put, active = self.objects.put, self.active
        true_counts, current, *_ = self._motor.read()
        counts = self._apply_encoder_faults(true_counts)
        self.put_position(counts)
        if elapsed > 0.0:
            if self._last_counts is not None:
                self._put_velocity((counts - self._last_counts) / elapsed)
            self._last_counts = counts
        put(0x6077, self.raw_current(current))
        for sub, (read, per_volt) in enumerate(self.torque.analog, start=1):
            put(0x201A, analog(read(), per_volt), sub)
        if "load_cell_saturated" in active:
            put(0x201A, FULL_SCALE, 1)
        elif "load_cell_dead" in active:
            put(0x201A, 0, 1)
            put(0x201A, 0, 2)
        elif "load_cell_inverted" in active:
            read, per_volt = self.torque.analog[0]
            put(0x201A, analog(-read(), per_volt), 1)
        put(0x6078, self.objects.values[0x6077, 0])
        put(0x60FD, 1 << int(active["limit_switch"]) if "limit_switch" in active else 0)

    def measure_slow(self) -> None:
        """Write voltage, temperature and the manufacturer's status words to the objects."""
        super().measure_slow()
        self.objects.put(0x2021, round(self.sensed_temperature() * 65536.0), 1)
        volts = self.sensed_voltage()
        if self.torque.scaling is Scaling.AMC:
            self._put_maker_objects(volts)
        else:
            self.objects.put(0x6079, round_or_zero(1000.0 * volts))

    def act(self, elapsed: Second) -> None:
        """Command the world's motor: 0 A and off unless a mode and the machine say otherwise."""
        action = self.machine.action
        if action is Action.FOLLOW and self.mode == CYCLIC_TORQUE:
            self.current = self.commanded_current()
        elif action is Action.SLOW_DOWN:
            self.current = towards_zero(self.current, elapsed * self._torque_slope())
        else:  # a quick stop removes the torque at once [NC]
            self.current = 0.0
        motor_current = 0.0 if "no_torque" in self.active else self.current
        if "inverted_motor" in self.active:
            motor_current = -motor_current
        command = (motor_current, 1 if action is not Action.OFF else 0)
        if command != self._last_command:
            self._last_command = command
            self._motor.actuate(*command)

    def at_rest(self) -> bool:
        """Return whether the commanded current is 0."""
        return self.current == 0.0

    def voltage(self) -> Volt:
        """Return the voltage of the motor's bus."""
        return self._motor.read().bus_voltage

    def mode_bits(self) -> int:
        """Return bit 11, current limited, and bit 12, the drive follows its set-point."""
        if self.machine.action is not Action.FOLLOW or self.mode != CYCLIC_TORQUE:
            return 0
        motor = self._motor.read()
        limited = self._is_limited or motor.saturated
        return (MODE_12 if motor.enabled else 0) | (LIMITED if limited else 0)

    def fault_code(self) -> int:
        """Return the fault of the world's own drive, if any."""
        code = self._motor.read().fault
        return PLANT_FAULTS[code] if code else 0

    def on_fault(self, fault: Fault, value: float) -> None:
        """Store counts or time at the start of an encoder fault."""
        super().on_fault(fault, value)
        if fault.name == "encoder_reversed":
            self._reversal_counts = self._motor.read().counts
        elif fault.name == "encoder_creep":
            self._creep_start = self.world.time

    def on_restart(self, ready_at: Second) -> None:
        """Reset to power-on: no current."""
        self._last_counts = None
        self._is_limited = False
        super().on_restart(ready_at)

    def apply_faults(self) -> None:
        super().apply_faults()
        nominal = self.storage.defaults.get((0x20D8, 0xC), 0)
        self.objects.put(0x20D8, round(nominal * self.active.get("wrong_kp", 1.0)), 0xC)

    def _apply_encoder_faults(self, counts: int) -> int:
        """Return the encoder's counts with its faults applied."""
        active = self.active
        if "encoder_reversed" in active:
            counts = 2 * self._reversal_counts - counts
        counts += int(active.get("encoder_step", 0.0))
        rate = active.get("encoder_creep", 0.0)
        return counts + int(rate * (self.world.time - self._creep_start))

    def _torque_slope(self) -> float:
        """Return the torque slope 6087 (per mille of rated, or of peak, per second) in A/s."""
        amc = self.torque.scaling is Scaling.AMC
        rated = self.kp if amc else 1.0e-3 * self.objects.get(0x6075)
        return 1.0e-3 * rated * self.objects.get(0x6087)

    def _put_velocity(self, speed: float) -> None:
        """Set 606C in counts/s, or in DS1: raw = counts/s 2^17 / (Ki Ks)."""
        if self.torque.scaling is Scaling.AMC:
            scale = self.objects.get(0x2032, 8) * self.objects.get(0x20D8, 0x24)
            speed *= 131072.0 / max(1, scale)
        self.objects.put(0x606C, round_or_zero(speed))

    def _put_maker_objects(self, volts: Volt) -> None:
        """Set the manufacturer's objects: bus voltage DV1 = V 2^14/(1.05 Kov), currents, status."""
        put = self.objects.put
        kov = 0.1 * self.objects.get(0x20D8, 9)
        put(0x200F, round_or_zero(min(65535.0, max(0.0, volts) * 16384.0 / (1.05 * kov))), 1)
        put(0x2010, self.objects.get(0x6077), 1)
        put(0x2010, self.raw_current(self.current), 2)
        status_bits = self._status_words() if self.errors.active else NO_STATUS_BITS
        for sub, word in enumerate(status_bits, start=1):
            put(0x2002, word, sub)
            put(0x2003, self.objects.get(0x2003, sub) | word, sub)

    def _status_words(self) -> tuple[int, ...]:
        """Return 2002:01..07. The words are the manufacturer's, the bits are assumed [NC]."""
        active = self.errors.active
        protection = (
            (device_errors.OVER_CURRENT in active)
            | (device_errors.DC_LINK_UNDER_VOLTAGE in active) << 1
            | (device_errors.DC_LINK_OVER_VOLTAGE in active) << 2
            | (device_errors.OVER_TEMPERATURE in active) << 3
        )
        silent = {device_errors.HEARTBEAT_LOST, device_errors.RPDO_TIMEOUT} & active
        return (0, protection, int(device_errors.SENSOR in active), int(bool(silent)), 0, 0, 0)


def analog(value: float, per_volt: float) -> int:
    """Return the raw value of an amplified sensor, limited to +-10 V."""
    return max(-FULL_SCALE - 1, min(FULL_SCALE, round_or_zero(value * PER_VOLT / per_volt)))


def towards_zero(value: float, reach: float) -> float:
    """Return a value moved towards 0 by at most `reach`, without crossing 0."""
    if abs(value) <= reach:
        return 0.0
    return value - reach if value > 0.0 else value + reach
