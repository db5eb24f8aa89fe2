"""The emulated actuator of the magnetic spring's stator: profile position and homing.

Its objects are laid out as Nanotec's controllers have them. Position 0 is where it stood at
power-on, until it is homed. What moves is the world's own stator, through the true gear and lead;
what the objects say comes through 608F, 6091 and 6092 as they were written.
"""

from __future__ import annotations

from sim_plant.emulators import homing, node_errors, profile_motion
from sim_plant.emulators.actuator_units import ActuatorParams, ActuatorUnits
from sim_plant.emulators.can_hub import CanHub
from sim_plant.emulators.canopen_node import NodeParams
from sim_plant.emulators.cia402 import Action
from sim_plant.emulators.cia402_node import (
    HOMING,
    LIMITED,
    MODE_12,
    MODE_13,
    PROFILE_POSITION,
    REACHED,
    Cia402Node,
)
from sim_plant.emulators.homing import Homing, Phase, Sight
from sim_plant.emulators.node_faults import Fault
from sim_plant.emulators.node_objects import rounded
from sim_plant.emulators.profile_motion import Motion, Profile
from sim_plant.emulators.schedule import Schedule
from sim_plant.emulators.shared_world import SharedWorld
from sim_plant.units import Percent, Second, Volt

NEW_SET_POINT, AT_ONCE, RELATIVE, START_HOMING = 0x10, 0x20, 0x40, 0x10
LONGEST: Second = 0.01  # of one step of the demand: time lost by a stalled host is not made up
NO_WINDOW = 0xFFFFFFFF


ACTUATOR_FAULTS = (
    Fault("wrong_gear", "6091 is another gear's and takes no writes", "factor on it", 0.769),
    Fault("blocked", "the stator does not move: following error"),
    Fault("homing_fails", "homing ends with an error"),
    Fault("limit_switch", "60FD: a limit switch is closed", "bit: 0 negative, 1 positive", 0.0),
)


class StatorActuator(Cia402Node):
    """The actuator."""

    def __init__(
        self,
        params: NodeParams,
        actuator: ActuatorParams,
        hub: CanHub,
        schedule: Schedule,
        world: SharedWorld,
    ) -> None:
        self.actuator = actuator
        self._origin = 0.0  # increments at position 0
        self._motion = Motion(0.0, 0.0)  # demand, user units
        self._target = 0.0
        self._next_target: float | None = None
        self._acknowledged = False
        self._homing = Homing()
        self._position = 0.0  # user units
        self._moved = False
        self._far: Second = 0.0  # how long the following error was out of its window
        self._near: Second = 0.0  # how long the target has been within its window
        self._limited = False
        self._written: tuple[Percent, int] = (0.0, 0)
        self._word = 0
        super().__init__(params, actuator.drive, hub, schedule, world)
        self._units = ActuatorUnits(actuator, self.objects)
        self.fault_list.add(*ACTUATOR_FAULTS)

    # ---- a drive's part -------------------------------------------------------------------------

    def measure(self, elapsed: Second) -> None:
        """Put position, following error, switches, supply and temperature."""
        put = self.objects.put
        unit = self._units.unit()
        percent = self.world.readings().stator_position
        position = (round(self._units.increments(percent)) - self._origin) * unit
        if elapsed > 0.0:
            self._moved = position != self._position
            put(0x606C, rounded((position - self._position) / elapsed))
        self._position = position
        self.put_position(rounded(position))
        put(0x60FD, self._switches(percent))
        self._watch(elapsed)

    def look_round(self) -> None:
        """Put supply and temperature."""
        super().look_round()
        self.objects.put(0x4014, rounded(1000.0 * self.seen_voltage()), 1)
        self.objects.put(0x4014, rounded(10.0 * self.seen_temperature()), 3)

    def act(self, elapsed: Second) -> None:
        """Lead the demand and let the world's stator follow it."""
        action, elapsed = self.machine.action, min(elapsed, LONGEST)
        if action is Action.OFF:
            self._stand()
            if homing.direction(self._homing):
                self._homing = Homing()
        elif action is Action.FOLLOW and self.mode == PROFILE_POSITION:
            self._position_step(elapsed)
        elif action is Action.FOLLOW and self.mode == HOMING:
            self._homing_step(elapsed)
        else:
            ramp = self._units.speed(0x6085 if action is Action.QUICK_STOP else 0x6084)
            self._motion = profile_motion.stopping(self._motion, ramp, elapsed)
        self.objects.put(0x6062, rounded(self._motion.position))
        percent = self._units.percent(self._motion.position, self._origin)
        led = action is not Action.OFF and "blocked" not in self.active
        written = (percent if led else self._written[0], int(led))
        if written != self._written:
            self._written = written
            self.world.actuate(stator_target=written[0], stator_enable=written[1])

    def at_rest(self) -> bool:
        """The demand stands."""
        return self._motion.velocity == 0.0

    def voltage(self) -> Volt:
        """The supply."""
        return self.actuator.supply

    def warned(self) -> bool:
        """Supply beyond the warning levels 2034 and 2035 (mV)."""
        millivolts = 1000.0 * self.seen_voltage()
        get = self.objects.get
        return not get(0x2035) <= millivolts <= get(0x2034)

    def mode_bits(self) -> int:
        """Give bits 10 to 13: reached, limited, acknowledged or homed, error."""
        if self.mode == HOMING:
            return homing.bits(self._homing)
        word = LIMITED if self._limited else 0
        if self.mode == PROFILE_POSITION:
            patience = 1.0e-3 * self.objects.get(0x6068)
            halted = self.machine.action is Action.SLOW_DOWN and self.at_rest()
            word |= REACHED if self._near >= patience or halted else 0
            word |= MODE_12 if self._acknowledged else 0
            word |= MODE_13 if self._far > 0.0 else 0
        return word

    def restarted(self) -> None:
        """Power-on: position 0 is here, nothing homed."""
        self._origin = round(self._units.increments(self.world.readings().stator_position))
        self._position = 0.0
        self._homing = Homing()
        self._acknowledged = False
        self._word = 0
        self._stand()
        super().restarted()

    def deaf_objects(self) -> set[int]:
        """A wrong gear takes no writes."""
        deaf = super().deaf_objects()
        return deaf | {0x6091} if "wrong_gear" in self.active else deaf

    def _apply_faults(self) -> None:
        super()._apply_faults()
        if "wrong_gear" in self.active:
            turns = 1000.0 * self.actuator.gear * self.active["wrong_gear"]
            self.objects.put(0x6091, round(turns), 1)
            self.objects.put(0x6091, 1000, 2)

    # ---- motion ---------------------------------------------------------------------------------

    def _on_controlword(self, word: int) -> None:
        super()._on_controlword(word)
        rising, falling = word & ~self._word, self._word & ~word
        self._word = word
        following = self.machine.action is Action.FOLLOW
        if self.mode == HOMING:
            if rising & START_HOMING and following:
                self._begin_homing()
            elif falling & START_HOMING and homing.direction(self._homing):
                self._homing = Homing()
        elif self.mode == PROFILE_POSITION:
            if rising & NEW_SET_POINT and following:
                self._take_set_point(word)
            elif falling & NEW_SET_POINT:
                self._acknowledged = False

    def _take_set_point(self, word: int) -> None:
        """Take 607A at once, or after the present move; a third one is not taken."""
        target = float(self.objects.get(0x607A)) + (self._target if word & RELATIVE else 0.0)
        low, high = self.objects.get(0x607D, 1), self.objects.get(0x607D, 2)
        self._limited = (low, high) != (0, 0) and not low <= target <= high
        if self._limited:
            target = min(max(target, float(low)), float(high))
        if word & AT_ONCE or self._motion == Motion(self._target, 0.0):
            self._target, self._next_target = target, None
        elif self._next_target is None:
            self._next_target = target
        else:
            return
        self._near = 0.0
        self._acknowledged = True

    def _position_step(self, elapsed: Second) -> None:
        if self._motion == Motion(self._target, 0.0) and self._next_target is not None:
            self._target, self._next_target = self._next_target, None
        fastest = min(self._units.speed(0x6081), self._units.speed(0x607F))
        profile = Profile(fastest, self._units.speed(0x6083), self._units.speed(0x6084))
        self._motion = profile_motion.towards(self._motion, self._target, profile, elapsed)

    def _begin_homing(self) -> None:
        fails = "homing_fails" in self.active
        self._homing = Homing(Phase.FAILED) if fails else homing.started(self.objects.get(0x6098))
        if self._homing.phase is Phase.DONE:
            self._set_home()

    def _homing_step(self, elapsed: Second) -> None:
        before = self._homing.phase
        closed = self.objects.get(0x60FD)
        patience = 1.0e-3 * self.objects.get(0x203A, 2)
        sight = Sight(bool(closed & 1), bool(closed & 2), self._moved, patience)
        self._homing = homing.look(self._homing, sight, elapsed)
        if self._homing.phase is Phase.DONE and before is not Phase.DONE:
            self._set_home()
        way = homing.direction(self._homing)
        speed = self._units.speed(0x6099, 2 if self._homing.phase is Phase.LEAVING else 1)
        if way:
            position = self._motion.position + way * speed * elapsed
            self._motion = Motion(position, way * speed)
        else:
            self._motion = Motion(self._motion.position, 0.0)

    def _set_home(self) -> None:
        """Make the present place the home: position becomes home_sign times 607C."""
        home = float(self.actuator.home_sign * self.objects.get(0x607C))
        self._origin += (self._position - home) / self._units.unit()
        self._position = home
        self._stand()

    def _stand(self) -> None:
        self._motion = Motion(self._position, 0.0)
        self._target, self._next_target = self._position, None
        self._far = 0.0

    def _watch(self, elapsed: Second) -> None:
        """Follow the following error, 60F4, and how long the target has been reached."""
        get = self.objects.get
        error = self._motion.position - self._position
        self.objects.put(0x60F4, rounded(error))
        follows = self.powered and self.mode == PROFILE_POSITION
        window = get(0x6065)
        out = follows and window != NO_WINDOW and abs(error) > window
        self._far = self._far + elapsed if out else 0.0
        if self._far > 1.0e-3 * get(0x6066) and out:
            self.fail(node_errors.FOLLOWING_ERROR)
        there = self._motion == Motion(self._target, 0.0)
        near = there and abs(self._target - self._position) <= get(0x6067)
        self._near = self._near + elapsed if near else 0.0

    def _switches(self, percent: Percent) -> int:
        own = self.actuator
        word = int(percent <= own.low + own.switch) | int(percent >= own.high - own.switch) << 1
        if "limit_switch" in self.active:
            word |= 1 << int(self.active["limit_switch"])
        return word
