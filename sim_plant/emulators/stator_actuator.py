"""The emulated actuator of the magnetic spring's stator: profile position and homing.

Its objects follow Nanotec's controllers. Position 0 is the position at power-on, until homing. The
world's stator moves through the true gear and lead; the objects are scaled by 608F, 6091 and 6092
as they were written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from sim_plant.emulators import device_errors, homing, profile_motion
from sim_plant.emulators.actuator_units import ActuatorParams, ActuatorUnits
from sim_plant.emulators.cia402 import Action
from sim_plant.emulators.cia402_drive import (
    HOMING,
    LIMIT_SWITCH,
    LIMITED,
    MODE_12,
    MODE_13,
    PROFILE_POSITION,
    REACHED,
    Cia402Drive,
)
from sim_plant.emulators.device_objects import ObjectEntry, round_or_zero
from sim_plant.emulators.fault_list import Fault
from sim_plant.emulators.homing import Homing, HomingInputs, Phase
from sim_plant.emulators.profile_motion import Motion, MotionLimits
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.units import Flag, Percent, Second, Volt

NEW_SET_POINT, AT_ONCE, RELATIVE, START_HOMING = 0x10, 0x20, 0x40, 0x10
MAX_STEP: Second = 0.01  # longest step of the demand: time lost by a stalled host is not made up
NO_WINDOW = 0xFFFFFFFF


ACTUATOR_FAULTS = (
    Fault("wrong_gear", "6091 has another gear's value and ignores writes", "factor on it", 0.769),
    Fault("blocked", "the stator does not move: following error"),
    Fault("homing_fails", "homing ends with an error"),
    LIMIT_SWITCH,
)


class Carriage(NamedTuple):
    """The part of the world that the actuator moves."""

    read: Callable[[], Percent]  # true position
    actuate: Callable[[Percent, Flag], None]  # demanded position, power


class StatorActuator(Cia402Drive):
    """The emulated stator actuator."""

    def __init__(
        self,
        entries: Iterable[ObjectEntry],
        actuator: ActuatorParams,
        world: SharedSimulation[Any, Any],
        clock: Callable[[], Second],
        carriage: Carriage,
    ) -> None:
        self.actuator = actuator
        self._origin = 0.0  # increments at position 0
        self._motion = Motion(0.0, 0.0)  # demand, user units
        self._target = 0.0
        self._next_target: float | None = None
        self._acknowledged = False
        self._homing = Homing()
        self._position = 0.0  # user units
        self._is_moving = False
        self._following_error_time: Second = 0.0  # time with the following error outside its window
        self._in_window_time: Second = 0.0  # time with the position inside the target window
        self._limited = False
        self._last_command: tuple[Percent, int] = (0.0, 0)
        self._controlword = 0
        self._carriage = carriage
        super().__init__(entries, actuator.drive, world, clock)
        self._units = ActuatorUnits(actuator, self.objects)
        self.fault_list.add(*ACTUATOR_FAULTS)

    # ---- overridden methods of the drive ---------------------------------------------------------

    def measure(self, elapsed: Second) -> None:
        """Write position, following error and switches to the objects."""
        put = self.objects.put
        unit = self._units.user_units_per_increment()
        percent = self._carriage.read()
        position = (round(self._units.increments(percent)) - self._origin) * unit
        if elapsed > 0.0:
            self._is_moving = position != self._position
            put(0x606C, round_or_zero((position - self._position) / elapsed))
        self._position = position
        self.put_position(round_or_zero(position))
        put(0x60FD, self._switches(percent))
        self._monitor_following(elapsed)

    def measure_slow(self) -> None:
        """Write supply voltage and temperature to the objects."""
        super().measure_slow()
        self.objects.put(0x4014, round_or_zero(1000.0 * self.sensed_voltage()), 1)
        self.objects.put(0x4014, round_or_zero(10.0 * self.sensed_temperature()), 3)

    def act(self, elapsed: Second) -> None:
        """Advance the demand and command the world's stator to it."""
        action, elapsed = self.machine.action, min(elapsed, MAX_STEP)
        if action is Action.OFF:
            self._hold_position()
            if homing.direction(self._homing):
                self._homing = Homing()
        elif action is Action.FOLLOW and self.mode == PROFILE_POSITION:
            self._position_step(elapsed)
        elif action is Action.FOLLOW and self.mode == HOMING:
            self._homing_step(elapsed)
        else:
            ramp = self._units.speed(0x6085 if action is Action.QUICK_STOP else 0x6084)
            self._motion = profile_motion.step_to_stop(self._motion, ramp, elapsed)
        self.objects.put(0x6062, round_or_zero(self._motion.position))
        percent = self._units.percent(self._motion.position, self._origin)
        driven = action is not Action.OFF and "blocked" not in self.active
        command = (percent if driven else self._last_command[0], int(driven))
        if command != self._last_command:
            self._last_command = command
            self._carriage.actuate(*command)

    def at_rest(self) -> bool:
        """Return whether the demand is at rest."""
        return self._motion.velocity == 0.0

    def voltage(self) -> Volt:
        """Return the supply voltage."""
        return self.actuator.supply

    def has_warning(self) -> bool:
        """Return whether the supply is beyond the warning levels 2034 and 2035 (mV)."""
        millivolts = 1000.0 * self.sensed_voltage()
        get = self.objects.get
        return not get(0x2035) <= millivolts <= get(0x2034)

    def mode_bits(self) -> int:
        """Return bits 10 to 13: reached, limited, acknowledged or homed, error."""
        if self.mode == HOMING:
            return homing.status_bits(self._homing)
        bits = LIMITED if self._limited else 0
        if self.mode == PROFILE_POSITION:
            window_time = 1.0e-3 * self.objects.get(0x6068)
            halted = self.machine.action is Action.SLOW_DOWN and self.at_rest()
            bits |= REACHED if self._in_window_time >= window_time or halted else 0
            bits |= MODE_12 if self._acknowledged else 0
            bits |= MODE_13 if self._following_error_time > 0.0 else 0
        return bits

    def on_restart(self, ready_at: Second) -> None:
        """Reset to power-on: the present position is 0, not homed."""
        self._origin = round(self._units.increments(self._carriage.read()))
        self._position = 0.0
        self._homing = Homing()
        self._acknowledged = False
        self._controlword = 0
        self._hold_position()
        super().on_restart(ready_at)

    def ignored_objects(self) -> set[int]:
        """Return the ignored objects; with the fault `wrong_gear` also 6091."""
        deaf = super().ignored_objects()
        return deaf | {0x6091} if "wrong_gear" in self.active else deaf

    def apply_faults(self) -> None:
        super().apply_faults()
        if "wrong_gear" in self.active:
            turns = 1000.0 * self.actuator.gear_ratio * self.active["wrong_gear"]
            self.objects.put(0x6091, round(turns), 1)
            self.objects.put(0x6091, 1000, 2)

    # ---- motion ---------------------------------------------------------------------------------

    def _on_controlword(self, controlword: int) -> None:
        super()._on_controlword(controlword)
        rising, falling = controlword & ~self._controlword, self._controlword & ~controlword
        self._controlword = controlword
        following = self.machine.action is Action.FOLLOW
        if self.mode == HOMING:
            if rising & START_HOMING and following:
                self._begin_homing()
            elif falling & START_HOMING and homing.direction(self._homing):
                self._homing = Homing()
        elif self.mode == PROFILE_POSITION:
            if rising & NEW_SET_POINT and following:
                self._take_set_point(controlword)
            elif falling & NEW_SET_POINT:
                self._acknowledged = False

    def _take_set_point(self, controlword: int) -> None:
        """Accept 607A at once or after the present move; a third set-point is rejected."""
        target = float(self.objects.get(0x607A)) + (self._target if controlword & RELATIVE else 0.0)
        low, high = self.objects.get(0x607D, 1), self.objects.get(0x607D, 2)
        self._limited = (low, high) != (0, 0) and not low <= target <= high
        if self._limited:
            target = min(max(target, float(low)), float(high))
        if controlword & AT_ONCE or self._motion == Motion(self._target, 0.0):
            self._target, self._next_target = target, None
        elif self._next_target is None:
            self._next_target = target
        else:
            return
        self._in_window_time = 0.0
        self._acknowledged = True

    def _position_step(self, elapsed: Second) -> None:
        if self._motion == Motion(self._target, 0.0) and self._next_target is not None:
            self._target, self._next_target = self._next_target, None
        fastest = min(self._units.speed(0x6081), self._units.speed(0x607F))
        limits = MotionLimits(fastest, self._units.speed(0x6083), self._units.speed(0x6084))
        self._motion = profile_motion.step_towards(self._motion, self._target, limits, elapsed)

    def _begin_homing(self) -> None:
        fails = "homing_fails" in self.active
        self._homing = Homing(Phase.FAILED) if fails else homing.start(self.objects.get(0x6098))
        if self._homing.phase is Phase.DONE:
            self._set_home()

    def _homing_step(self, elapsed: Second) -> None:
        before = self._homing.phase
        switches = self.objects.get(0x60FD)
        block_timeout = 1.0e-3 * self.objects.get(0x203A, 2)
        inputs = HomingInputs(
            bool(switches & 1), bool(switches & 2), self._is_moving, block_timeout
        )
        self._homing = homing.step(self._homing, inputs, elapsed)
        if self._homing.phase is Phase.DONE and before is not Phase.DONE:
            self._set_home()
        direction = homing.direction(self._homing)
        speed = self._units.speed(0x6099, 2 if self._homing.phase is Phase.LEAVING else 1)
        if direction:
            position = self._motion.position + direction * speed * elapsed
            self._motion = Motion(position, direction * speed)
        else:
            self._motion = Motion(self._motion.position, 0.0)

    def _set_home(self) -> None:
        """Make the present position the home: it becomes home_sign times 607C."""
        home = float(self.actuator.home_sign * self.objects.get(0x607C))
        self._origin += (self._position - home) / self._units.user_units_per_increment()
        self._position = home
        self._hold_position()

    def _hold_position(self) -> None:
        self._motion = Motion(self._position, 0.0)
        self._target, self._next_target = self._position, None
        self._following_error_time = 0.0

    def _monitor_following(self, elapsed: Second) -> None:
        """Update the following error, 60F4, and the time in the target window."""
        get = self.objects.get
        error = self._motion.position - self._position
        self.objects.put(0x60F4, round_or_zero(error))
        following = self.powered and self.mode == PROFILE_POSITION
        window = get(0x6065)
        outside = following and window != NO_WINDOW and abs(error) > window
        self._following_error_time = self._following_error_time + elapsed if outside else 0.0
        if self._following_error_time > 1.0e-3 * get(0x6066) and outside:
            self.enter_fault(device_errors.FOLLOWING_ERROR)
        at_target = self._motion == Motion(self._target, 0.0)
        in_window = at_target and abs(self._target - self._position) <= get(0x6067)
        self._in_window_time = self._in_window_time + elapsed if in_window else 0.0

    def _switches(self, percent: Percent) -> int:
        params = self.actuator
        bits = (
            int(percent <= params.min_position + params.switch_margin)
            | int(percent >= params.max_position - params.switch_margin) << 1
        )
        if "limit_switch" in self.active:
            bits |= 1 << int(self.active["limit_switch"])
        return bits
