"""State machine of a CiA 402 drive: transitions by controlwords, faults and a lost master."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class State(IntEnum):
    """The states; the value is the state's bits in statusword 0x6041."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(IntEnum):
    """Commands of a controlword."""

    DISABLE_VOLTAGE = 0
    QUICK_STOP = 1
    SHUTDOWN = 2
    SWITCH_ON = 3  # in ENABLED: disable operation
    ENABLE_OPERATION = 4


class Action(IntEnum):
    """Action of the power stage."""

    OFF = 0
    FOLLOW = 1  # follow the set-point of the mode
    SLOW_DOWN = 2  # ramp of 6084, torque ramp of 6087
    QUICK_STOP = 3  # ramp of 6085


class OptionCodes(NamedTuple):
    """The option codes."""

    quick_stop: int = 2  # 605A: 0 off; 1, 2 ramp, then SWITCH ON DISABLED; 5, 6 ramp and stay
    shutdown: int = 1  # 605B: 0 off, 1 slow down first
    disable: int = 1  # 605C: 0 off, 1 slow down first
    halt: int = 1  # 605D: 1 slow down, 2 quick-stop ramp
    fault_reaction: int = 2  # 605E: 0 off, 1 slow down, 2 quick-stop ramp


FAULT_RESET = 0x80
HALT = 0x100
MIN_STAY_CODE = 5  # quick-stop codes from this one on stay in QUICK STOP ACTIVE

# The comments give the transition numbers of CiA 402; 0, 1, 13, 14, 15 have no command here.
TRANSITIONS: dict[tuple[State, Command], State] = {
    (State.SWITCH_ON_DISABLED, Command.SHUTDOWN): State.READY,  # 2
    (State.READY, Command.SWITCH_ON): State.SWITCHED_ON,  # 3
    (State.SWITCHED_ON, Command.ENABLE_OPERATION): State.ENABLED,  # 4
    (State.ENABLED, Command.SWITCH_ON): State.SWITCHED_ON,  # 5
    (State.SWITCHED_ON, Command.SHUTDOWN): State.READY,  # 6
    (State.READY, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 7
    (State.READY, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,  # 7
    (State.ENABLED, Command.SHUTDOWN): State.READY,  # 8
    (State.ENABLED, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 9
    (State.SWITCHED_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 10
    (State.SWITCHED_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,  # 10
    (State.ENABLED, Command.QUICK_STOP): State.QUICK_STOP,  # 11
    (State.QUICK_STOP, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 12
    (State.QUICK_STOP, Command.ENABLE_OPERATION): State.ENABLED,  # 16, if the option code stays
}


def decode_command(controlword: int) -> Command | None:
    """Return the command in bits 7, 3, 2, 1, 0 of a controlword; None with bit 7 set."""
    if controlword & FAULT_RESET:
        return None
    if not controlword & 0x02:
        return Command.DISABLE_VOLTAGE
    if not controlword & 0x04:
        return Command.QUICK_STOP
    if not controlword & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if controlword & 0x08 else Command.SWITCH_ON


class StateMachine:
    """State machine of one drive.

    It is strict: one controlword makes at most one transition, so 0x0F in READY TO SWITCH ON has no
    effect. The state does not change while a ramp runs.
    """

    def __init__(self) -> None:
        self.state = State.NOT_READY
        self.options = OptionCodes()
        self.controlword = 0  # last controlword
        self.fault_persists = False  # the cause of the fault is present: no reset
        self.reset_count = 0  # number of fault resets
        self._state_after_ramp: State | None = None  # state at the end of a slow-down
        self._coasting = False  # fault reaction without a ramp

    @property
    def action(self) -> Action:
        """Present action of the power stage."""
        options = self.options
        if self.state is State.ENABLED:
            if self._state_after_ramp is not None:
                return Action.SLOW_DOWN
            if self.controlword & HALT:
                return Action.QUICK_STOP if options.halt == 2 else Action.SLOW_DOWN
            return Action.FOLLOW
        if self.state is State.QUICK_STOP:
            slow = options.quick_stop in (1, MIN_STAY_CODE)
            return Action.SLOW_DOWN if slow else Action.QUICK_STOP
        if self.state is State.FAULT_REACTION and not self._coasting:
            return Action.SLOW_DOWN if options.fault_reaction == 1 else Action.QUICK_STOP
        return Action.OFF

    def finish_self_test(self) -> None:
        """Finish the self-test: transition 1."""
        if self.state is State.NOT_READY:
            self.state = State.SWITCH_ON_DISABLED

    def apply_controlword(self, word: int) -> None:
        """Apply a controlword. Only a rising bit 7 resets a fault, if its cause is gone."""
        rising = word & ~self.controlword & FAULT_RESET
        self.controlword = word
        if self.state is State.FAULT:
            if rising and not self.fault_persists:
                self.state = State.SWITCH_ON_DISABLED
                self.reset_count += 1
            return
        command = decode_command(word)
        if command is not None:
            self._perform(command)

    def enter_fault(self, *, coast: bool = False) -> None:
        """Enter the fault reaction; `coast` switches the power stage off regardless of 605E."""
        if self.state in (State.FAULT, State.FAULT_REACTION):
            return
        powered = self.action is not Action.OFF
        self._coasting = coast or not powered or self.options.fault_reaction == 0
        self._state_after_ramp = None
        self.state = State.FAULT_REACTION

    def abort_connection(self, option: int) -> bool:
        """React to the loss of the master by option code 6007; return whether it is a fault.

        0 nothing, 1 fault, 2 disable voltage, 3 quick stop.
        """
        if option == 2:
            self._perform(Command.DISABLE_VOLTAGE)
        elif option == 3:
            self._perform(Command.QUICK_STOP)
        return option == 1

    def step(self, at_rest: bool) -> None:
        """End ramps: `at_rest` means that motion and torque have ended."""
        if self.state is State.FAULT_REACTION:
            if self._coasting or at_rest:
                self.state = State.FAULT
        elif self.state is State.QUICK_STOP:
            if at_rest and self.options.quick_stop < MIN_STAY_CODE:
                self.state = State.SWITCH_ON_DISABLED
        elif self._state_after_ramp is not None and at_rest:
            self.state, self._state_after_ramp = self._state_after_ramp, None

    def _perform(self, command: Command) -> None:
        """Perform a transition of the table, at once or at the end of a slow-down."""
        state, options = self.state, self.options
        self._state_after_ramp = None
        target = TRANSITIONS.get((state, command))
        if target is None:
            return
        if (
            state is State.QUICK_STOP
            and target is State.ENABLED
            and options.quick_stop < MIN_STAY_CODE
        ):
            return
        if target is State.QUICK_STOP and options.quick_stop == 0:
            target = State.SWITCH_ON_DISABLED
        ramp = {Command.SHUTDOWN: options.shutdown, Command.SWITCH_ON: options.disable}
        if state is State.ENABLED and ramp.get(command) == 1:
            self._state_after_ramp = target
        else:
            self.state = target
