"""Model of the Compax3 behind its protocol. Pure except for its plant.

Source: Parker manuals 192-1201xx: control word 1 (o1100.3), status word 1 (o1000.3), o550.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.compax3_objects import CONTROL, OBJECTS, Compax3Settings, ObjectNumber
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.units import Ampere, Radian, Second, Volt

TURN = 2.0 * math.pi
MOTOR_ON, STOP, STOP_2 = 1 << 0, 1 << 1, 1 << 14
NO_ERROR, REACHED, POWERLESS, STANDSTILL, HOMED = 1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12

# Faults of the power part and the field of ErrorCodes each one sets.
ERRORS = {
    "over_temperature": "motor_temperature",
    "following_error": "following_error",
    "limit_low": "limit_low",
    "limit_high": "limit_high",
    "undervoltage": "undervoltage",
}
FAULTS = {
    **{name: f"the power stage goes off, o550.1 reads {code}" for name, code in ERRORS.items()},
    "silent": "no request is answered",
    "late_answers": "every answer comes `late_by` later",
    "frozen_values": "measured objects keep their values",
    "wrong_crc": "the check sum of every record is wrong",
    "refuses": "every record and line gets a negative answer",
    "does_not_enable": "commands are acknowledged, the power stage stays off",
    "inverted_motor": "set-points act with the opposite sign",
    "ignores_set_points": "set-points are acknowledged and not followed",
    "does_not_stop": "the power stage stays on whatever is commanded, except after an error",
}


class DriveInput(NamedTuple):
    """Measurements of the drive: motor side, and its ±10 V input."""

    position: Radian = 0.0
    velocity: float = 0.0  # rad/s
    current: Ampere = 0.0
    bus_voltage: Volt = 325.0
    device_temperature: float = 30.0  # degC
    motor_temperature: float = 30.0
    analog: Volt = 0.0


class Compax3RefusalError(Exception):
    """A negative answer."""

    def __init__(self, code: int) -> None:
        """`code`: 16 bits."""
        super().__init__(f"{code:04X}")
        self.code = code


class Compax3Drive:
    """The drive behind the port; it writes `enabled` (0, 1), `velocity` (rad/s), `torque` (N m)."""

    def __init__(
        self,
        settings: Compax3Settings,
        read: Callable[[], DriveInput],
        write: Callable[[str, float], None],
    ) -> None:
        """Create the drive with the power stage off and all set-points 0."""
        self.settings = settings
        self.faults = DeviceFaults(FAULTS)
        self.error = settings.errors.none
        self.powered = False
        self._read = read
        self._write = write
        self._values: dict[ObjectNumber, float] = {
            number: 0.0 for number, entry in OBJECTS.items() if entry.writable
        }
        self._values[170, 2] = self._values[171, 2] = 1.0
        self._mode = settings.velocity
        self._input = self._displayed_input = (
            read()
        )  # true input, and the input that measured objects show
        self._last_host_time: Second | None = None

    def restart_host_timeout(self, now: Second) -> None:
        """Restart the host timeout after a complete record or line."""
        self._last_host_time = now

    def get(self, number: ObjectNumber) -> float:
        """Return the value of an object. Raises Compax3RefusalError if it does not exist."""
        if number not in OBJECTS:
            raise Compax3RefusalError(self.settings.refusals.no_such_object)
        if number in self._values:
            return self._values[number]
        return self._measured(OBJECTS[number].name)

    def set(self, number: ObjectNumber, value: float) -> None:
        """Write an object. Raises Compax3RefusalError if the value is not allowed."""
        refusals = self.settings.refusals
        if number not in OBJECTS:
            raise Compax3RefusalError(refusals.no_such_object)
        if not OBJECTS[number].writable:
            raise Compax3RefusalError(refusals.read_only)
        limits = {
            self.settings.velocity: self.settings.full_speed,
            self.settings.torque: self.settings.full_torque,
        }
        if not math.isfinite(value) or abs(value) > limits.get(number, math.inf):
            raise Compax3RefusalError(refusals.bad_value)
        if number == CONTROL:
            self._control(int(value))
        self._values[number] = value
        if number in limits:
            self._mode = number

    def advance(self, now: Second) -> None:
        """Read the plant, check for errors, and command the plant."""
        self._input = self._read()
        if not self.faults.is_on("frozen_values"):
            self._displayed_input = self._input
        for fault, code in ERRORS.items():
            if self.faults.is_on(fault):
                self._trip(getattr(self.settings.errors, code))
        self._last_host_time = now if self._last_host_time is None else self._last_host_time
        timeout = self.settings.host_timeout
        if self.powered and 0.0 < timeout < now - self._last_host_time:
            self._trip(self.settings.errors.host_silent)
        self._command()

    def _control(self, controlword: int) -> None:
        previous = int(self._values[CONTROL])
        if controlword & MOTOR_ON and not previous & MOTOR_ON:
            if self.error != self.settings.errors.none:
                self.error = (
                    self.settings.errors.none
                )  # acknowledge; a persistent cause trips again
            elif not self.faults.is_on("does_not_enable"):
                self.powered = True
        if not controlword & MOTOR_ON and not self.faults.is_on("does_not_stop"):
            self.powered = False
        if not self.powered:
            self._values[self.settings.velocity] = self._values[self.settings.torque] = 0.0

    def _trip(self, code: int) -> None:
        self.error = code
        self.powered = False
        self._values[self.settings.velocity] = self._values[self.settings.torque] = 0.0

    def _is_stopped(self) -> bool:
        bits = int(self._values[CONTROL]) & (STOP | STOP_2)
        if self.faults.is_on("does_not_stop"):
            return False
        return bits != STOP | STOP_2 if self.settings.stop_bits_active_low else bits != 0

    def _command(self) -> None:
        if not self.faults.is_on("ignores_set_points"):
            active = self.powered and not self._is_stopped()
            torque = self._mode == self.settings.torque and self.settings.source == "serial"
            sign = -1.0 if self.faults.is_on("inverted_motor") else 1.0
            speed, torque_set_point = (
                sign * TURN * self._commanded_speed(),
                sign * self._values[self.settings.torque],
            )
            self._write("velocity", speed if active and not torque else 0.0)
            self._write("torque", torque_set_point if active and torque else 0.0)
        self._write("enabled", float(self.powered))

    def _commanded_speed(self) -> float:
        """Return the commanded speed, rev/s."""
        full = self.settings.full_speed
        if self.settings.source == "serial":
            return self._values[self.settings.velocity]
        return max(-full, min(self._analog(self._input) / 10.0 * full, full))

    def _analog(self, drive_input: DriveInput) -> Volt:
        clamped = max(-10.0, min(drive_input.analog, 10.0))
        return clamped * self._values[170, 2] + self._values[170, 4]

    def _measured(self, name: str) -> float:
        drive_input = self._displayed_input
        errors = self.settings.errors
        standstill = self.powered and abs(drive_input.velocity) < 0.01
        status = (
            (NO_ERROR if self.error == errors.none else 0)
            | (0 if self.powered else POWERLESS)
            | (STANDSTILL if standstill else 0)
        )
        active = self.powered and not self._is_stopped()
        return {
            "position": drive_input.position / TURN,
            "speed": drive_input.velocity / TURN,
            "speed_filtered": drive_input.velocity / TURN,
            "speed_demand": self._commanded_speed() if active else 0.0,
            "current": drive_input.current,
            "device_temperature": drive_input.device_temperature,
            "motor_temperature": drive_input.motor_temperature,
            "bus_voltage": drive_input.bus_voltage,
            "analog_0": self._analog(drive_input),
            "last_error": float(self.error),
            "status": float(status),
            "serial_number": float(self.settings.serial_number),
        }.get(name, 0.0)
