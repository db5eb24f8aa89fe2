"""The state machine inside a CiA 402 drive: what controlwords, faults and lost masters do to it."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class State(IntEnum):
    """The states; the value is the state's own bits of statusword 0x6041."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(IntEnum):
    """What a controlword asks for."""

    DISABLE_VOLTAGE = 0
    QUICK_STOP = 1
    SHUTDOWN = 2
    SWITCH_ON = 3  # in ENABLED: disable operation
    ENABLE_OPERATION = 4


class Action(IntEnum):
    """What the power stage does."""

    OFF = 0
    FOLLOW = 1  # the set-point of the mode
    SLOW_DOWN = 2  # ramp of 6084, torque ramp of 6087
    QUICK_STOP = 3  # ramp of 6085


class Options(NamedTuple):
    """The option codes."""

    quick_stop: int = 2  # 605A: 0 off; 1, 2 ramp, then SWITCH ON DISABLED; 5, 6 ramp and stay
    shutdown: int = 1  # 605B: 0 off, 1 slow down first
    disable: int = 1  # 605C: 0 off, 1 slow down first
    halt: int = 1  # 605D: 1 slow down, 2 quick-stop ramp
    fault_reaction: int = 2  # 605E: 0 off, 1 slow down, 2 quick-stop ramp


FAULT_RESET = 0x80
HALT = 0x100
STAY = 5  # quick stop codes from here on stay in QUICK STOP ACTIVE

# Transition numbers of CiA 402 beside each; 0, 1, 13, 14, 15 are not commanded by these words.
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


def asked(word: int) -> Command | None:
    """Give what a controlword asks for by bits 7, 3, 2, 1, 0; None with bit 7 set."""
    if word & FAULT_RESET:
        return None
    if not word & 0x02:
        return Command.DISABLE_VOLTAGE
    if not word & 0x04:
        return Command.QUICK_STOP
    if not word & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if word & 0x08 else Command.SWITCH_ON


class Machine:
    """One drive's machine.

    It is strict: one transition a word, so 0x0F in READY TO SWITCH ON does nothing. While a ramp
    runs the state stays what it was.
    """

    def __init__(self) -> None:
        self.state = State.NOT_READY
        self.options = Options()
        self.word = 0  # last controlword
        self.blocked = False  # the cause of a fault lasts: no reset
        self.resets = 0  # faults reset so far
        self._after: State | None = None  # where a slow-down ends
        self._off = False  # fault reaction without a ramp

    @property
    def action(self) -> Action:
        """What the power stage does now."""
        options = self.options
        if self.state is State.ENABLED:
            if self._after is not None:
                return Action.SLOW_DOWN
            if self.word & HALT:
                return Action.QUICK_STOP if options.halt == 2 else Action.SLOW_DOWN
            return Action.FOLLOW
        if self.state is State.QUICK_STOP:
            slow = options.quick_stop in (1, STAY)
            return Action.SLOW_DOWN if slow else Action.QUICK_STOP
        if self.state is State.FAULT_REACTION and not self._off:
            return Action.SLOW_DOWN if options.fault_reaction == 1 else Action.QUICK_STOP
        return Action.OFF

    def ready(self) -> None:
        """Finish the self-test: transition 1."""
        if self.state is State.NOT_READY:
            self.state = State.SWITCH_ON_DISABLED

    def control(self, word: int) -> None:
        """Take a controlword. A fault is reset by a rising bit 7 alone, if its cause is gone."""
        rising = word & ~self.word & FAULT_RESET
        self.word = word
        if self.state is State.FAULT:
            if rising and not self.blocked:
                self.state = State.SWITCH_ON_DISABLED
                self.resets += 1
            return
        command = asked(word)
        if command is not None:
            self._perform(command)

    def fault(self, *, coast: bool = False) -> None:
        """Go to the fault reaction; `coast` cuts the power stage whatever 605E says."""
        if self.state in (State.FAULT, State.FAULT_REACTION):
            return
        powered = self.action is not Action.OFF
        self._off = coast or not powered or self.options.fault_reaction == 0
        self._after = None
        self.state = State.FAULT_REACTION

    def abort_connection(self, option: int) -> bool:
        """React to the loss of the master by option code 6007; say whether it is a fault.

        0 nothing, 1 fault, 2 disable voltage, 3 quick stop.
        """
        if option == 2:
            self._perform(Command.DISABLE_VOLTAGE)
        elif option == 3:
            self._perform(Command.QUICK_STOP)
        return option == 1

    def step(self, at_rest: bool) -> None:
        """Let ramps end: `at_rest` says that nothing moves or pulls any more."""
        if self.state is State.FAULT_REACTION:
            if self._off or at_rest:
                self.state = State.FAULT
        elif self.state is State.QUICK_STOP:
            if at_rest and self.options.quick_stop < STAY:
                self.state = State.SWITCH_ON_DISABLED
        elif self._after is not None and at_rest:
            self.state, self._after = self._after, None

    def _perform(self, command: Command) -> None:
        """Do a transition of the table, at once or at the end of a slow-down."""
        state, options = self.state, self.options
        self._after = None
        target = TRANSITIONS.get((state, command))
        if target is None:
            return
        if state is State.QUICK_STOP and target is State.ENABLED and options.quick_stop < STAY:
            return
        if target is State.QUICK_STOP and options.quick_stop == 0:
            target = State.SWITCH_ON_DISABLED
        ramp = {Command.SHUTDOWN: options.shutdown, Command.SWITCH_ON: options.disable}
        if state is State.ENABLED and ramp.get(command) == 1:
            self._after = target
        else:
            self.state = target
