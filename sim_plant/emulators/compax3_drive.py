"""What a Compax3 is, apart from its bytes: power stage, set-points, errors. Pure but for its plant.

Source: Parker manuals 192-1201xx: control word 1 (o1100.3), status word 1 (o1000.3), o550.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.compax3_objects import CONTROL, OBJECTS, Compax3Settings, Number
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
    "silent": "nothing is answered",
    "late_answers": "every answer comes `late_by` later",
    "frozen_values": "measured objects stand still",
    "wrong_crc": "the check sum of every record is wrong",
    "refuses": "every record and line gets a negative answer",
    "does_not_enable": "commands are acknowledged, the power stage stays off",
    "inverted_motor": "set-points act with the other sign",
    "ignores_set_points": "set-points are acknowledged and not followed",
    "does_not_stop": "the power stage stays on whatever is commanded, errors excepted",
}


class DriveInput(NamedTuple):
    """What the drive measures: motor side, and its ±10 V input."""

    position: Radian = 0.0
    velocity: float = 0.0  # rad/s
    current: Ampere = 0.0
    bus_voltage: Volt = 325.0
    device_temperature: float = 30.0  # degC
    motor_temperature: float = 30.0
    analog: Volt = 0.0


class RefusedError(Exception):
    """A negative answer."""

    def __init__(self, code: int) -> None:
        """`code`: 16 bits."""
        super().__init__(f"{code:04X}")
        self.code = code


class Drive:
    """The drive behind the port. Writes `enabled` (0, 1), `velocity` (rad/s), `torque` (N m)."""

    def __init__(
        self,
        settings: Compax3Settings,
        read: Callable[[], DriveInput],
        write: Callable[[str, float], None],
    ) -> None:
        """The power stage is off, all set-points are 0."""
        self.settings = settings
        self.faults = DeviceFaults(FAULTS)
        self.error = settings.errors.none
        self.powered = False
        self._read = read
        self._write = write
        self._values: dict[Number, float] = {
            number: 0.0 for number, entry in OBJECTS.items() if entry.writable
        }
        self._values[170, 2] = self._values[171, 2] = 1.0
        self._mode = settings.velocity
        self._input = self._shown = read()  # what is, and what measured objects say
        self._heard: Second | None = None

    def heard(self, now: Second) -> None:
        """The host has sent something whole."""
        self._heard = now

    def get(self, number: Number) -> float:
        """Give an object; RefusedError where there is none."""
        if number not in OBJECTS:
            raise RefusedError(self.settings.refusals.no_such_object)
        if number in self._values:
            return self._values[number]
        return self._measured(OBJECTS[number].name)

    def set(self, number: Number, value: float) -> None:
        """Take an object; RefusedError where it may not be written so."""
        refusals = self.settings.refusals
        if number not in OBJECTS:
            raise RefusedError(refusals.no_such_object)
        if not OBJECTS[number].writable:
            raise RefusedError(refusals.read_only)
        limits = {
            self.settings.velocity: self.settings.full_speed,
            self.settings.torque: self.settings.full_torque,
        }
        if not math.isfinite(value) or abs(value) > limits.get(number, math.inf):
            raise RefusedError(refusals.bad_value)
        if number == CONTROL:
            self._control(int(value))
        self._values[number] = value
        if number in limits:
            self._mode = number

    def advance(self, now: Second) -> None:
        """Read the plant, look for errors, and command the plant."""
        self._input = self._read()
        if not self.faults.on("frozen_values"):
            self._shown = self._input
        for fault, code in ERRORS.items():
            if self.faults.on(fault):
                self._trip(getattr(self.settings.errors, code))
        self._heard = now if self._heard is None else self._heard
        timeout = self.settings.host_timeout
        if self.powered and 0.0 < timeout < now - self._heard:
            self._trip(self.settings.errors.host_silent)
        self._command()

    def _control(self, word: int) -> None:
        before = int(self._values[CONTROL])
        if word & MOTOR_ON and not before & MOTOR_ON:
            if self.error != self.settings.errors.none:
                self.error = self.settings.errors.none  # quit; if its cause lasts, it trips anew
            elif not self.faults.on("does_not_enable"):
                self.powered = True
        if not word & MOTOR_ON and not self.faults.on("does_not_stop"):
            self.powered = False
        if not self.powered:
            self._values[self.settings.velocity] = self._values[self.settings.torque] = 0.0

    def _trip(self, code: int) -> None:
        self.error = code
        self.powered = False
        self._values[self.settings.velocity] = self._values[self.settings.torque] = 0.0

    def _stopped(self) -> bool:
        bits = int(self._values[CONTROL]) & (STOP | STOP_2)
        if self.faults.on("does_not_stop"):
            return False
        return bits != STOP | STOP_2 if self.settings.stop_bits_active_low else bits != 0

    def _command(self) -> None:
        if not self.faults.on("ignores_set_points"):
            live = self.powered and not self._stopped()
            torque = self._mode == self.settings.torque and self.settings.source == "serial"
            sign = -1.0 if self.faults.on("inverted_motor") else 1.0
            speed, pull = sign * TURN * self._speed(), sign * self._values[self.settings.torque]
            self._write("velocity", speed if live and not torque else 0.0)
            self._write("torque", pull if live and torque else 0.0)
        self._write("enabled", float(self.powered))

    def _speed(self) -> float:
        """Commanded speed, rev/s."""
        full = self.settings.full_speed
        if self.settings.source == "serial":
            return self._values[self.settings.velocity]
        return max(-full, min(self._analog(self._input) / 10.0 * full, full))

    def _analog(self, seen: DriveInput) -> Volt:
        held = max(-10.0, min(seen.analog, 10.0))
        return held * self._values[170, 2] + self._values[170, 4]

    def _measured(self, name: str) -> float:
        seen = self._shown
        errors = self.settings.errors
        standstill = self.powered and abs(seen.velocity) < 0.01
        status = (
            (NO_ERROR if self.error == errors.none else 0)
            | (0 if self.powered else POWERLESS)
            | (STANDSTILL if standstill else 0)
        )
        live = self.powered and not self._stopped()
        return {
            "position": seen.position / TURN,
            "speed": seen.velocity / TURN,
            "speed_filtered": seen.velocity / TURN,
            "speed_demand": self._speed() if live else 0.0,
            "current": seen.current,
            "device_temperature": seen.device_temperature,
            "motor_temperature": seen.motor_temperature,
            "bus_voltage": seen.bus_voltage,
            "analog_0": self._analog(seen),
            "last_error": float(self.error),
            "status": float(status),
            "serial_number": float(self.settings.serial_number),
        }.get(name, 0.0)
