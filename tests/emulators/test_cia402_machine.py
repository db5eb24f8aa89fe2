"""The machine in a drive: every state and command, resets by edge, option codes."""

from __future__ import annotations

import pytest

from sim_plant.emulators.cia402 import Action, Command, Machine, Options, State, asked

WORDS = {
    Command.DISABLE_VOLTAGE: 0x00,
    Command.QUICK_STOP: 0x02,
    Command.SHUTDOWN: 0x06,
    Command.SWITCH_ON: 0x07,
    Command.ENABLE_OPERATION: 0x0F,
}
SOD, READY, ON, RUN = State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED
# Where each word leads from each state, with option codes that ramp nothing and stay nowhere.
LEADS = {
    SOD: {0x06: READY},
    READY: {0x00: SOD, 0x02: SOD, 0x07: ON},
    ON: {0x00: SOD, 0x02: SOD, 0x06: READY, 0x0F: RUN},
    RUN: {0x00: SOD, 0x02: State.QUICK_STOP, 0x06: READY, 0x07: ON},
    State.QUICK_STOP: {0x00: SOD},
    State.NOT_READY: {},
    State.FAULT_REACTION: {},
    State.FAULT: {},
}


def at(state: State, **options: int) -> Machine:
    machine = Machine()
    machine.state = state
    machine.options = Options(**{"quick_stop": 2, "shutdown": 0, "disable": 0, **options})
    return machine


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("word", WORDS.values())
def test_every_word_in_every_state(state: State, word: int) -> None:
    machine = at(state)
    machine.control(word)
    assert machine.state is LEADS[state].get(word, state)


def test_words_are_read_by_five_bits() -> None:
    for command, word in WORDS.items():
        for other in (0x10, 0x40, 0x100, 0xF000):
            assert asked(word | other) is command
        assert asked(word | 0x80) is None
    assert asked(0x05) is Command.DISABLE_VOLTAGE
    assert asked(0x0A) is Command.QUICK_STOP
    assert asked(0x0E) is Command.SHUTDOWN


def test_a_fault_is_reset_by_a_rising_edge_alone() -> None:
    machine = at(RUN)
    machine.control(0x8F)
    machine.fault(coast=True)
    machine.step(at_rest=False)
    assert machine.state is State.FAULT
    machine.control(0x80)  # bit 7 was set before
    assert machine.state is State.FAULT
    for word in (0x00, 0x06, 0x0F):
        machine.control(word)
    assert machine.state is State.FAULT
    machine.blocked = True
    machine.control(0x80)
    assert machine.state is State.FAULT
    machine.blocked = False
    machine.control(0x80)
    assert machine.state is State.FAULT
    machine.control(0x00)
    machine.control(0x80)
    assert machine.state is SOD
    assert machine.resets == 1


@pytest.mark.parametrize(
    ("option", "action", "ends"),
    [
        (1, Action.SLOW_DOWN, SOD),
        (2, Action.QUICK_STOP, SOD),
        (5, Action.SLOW_DOWN, State.QUICK_STOP),
        (6, Action.QUICK_STOP, State.QUICK_STOP),
    ],
)
def test_quick_stop_by_605a(option: int, action: Action, ends: State) -> None:
    machine = at(RUN, quick_stop=option)
    machine.control(0x02)
    assert machine.state is State.QUICK_STOP
    machine.step(at_rest=False)
    assert machine.state is State.QUICK_STOP
    assert machine.action is action
    machine.step(at_rest=True)
    assert machine.state is ends
    machine.control(0x0F)
    assert machine.state is (RUN if ends is State.QUICK_STOP else SOD)


def test_quick_stop_0_disables_at_once() -> None:
    machine = at(RUN, quick_stop=0)
    machine.control(0x02)
    assert machine.state is SOD


@pytest.mark.parametrize(
    ("word", "option", "ends"), [(0x06, "shutdown", READY), (0x07, "disable", ON)]
)
def test_ramps_of_605b_and_605c(word: int, option: str, ends: State) -> None:
    machine = at(RUN, **{option: 1})
    machine.control(word)
    assert (machine.state, machine.action) == (RUN, Action.SLOW_DOWN)
    machine.control(0x0F)  # taken back
    assert machine.action is Action.FOLLOW
    machine.control(word)
    machine.step(at_rest=False)
    assert machine.state is RUN
    machine.step(at_rest=True)
    assert (machine.state, machine.action) == (ends, Action.OFF)


@pytest.mark.parametrize(("option", "action"), [(1, Action.SLOW_DOWN), (2, Action.QUICK_STOP)])
def test_halt_by_605d(option: int, action: Action) -> None:
    machine = at(RUN, halt=option)
    machine.control(0x10F)
    assert (machine.state, machine.action) == (RUN, action)
    machine.control(0x00F)
    assert machine.action is Action.FOLLOW


@pytest.mark.parametrize(
    ("option", "action"), [(0, Action.OFF), (1, Action.SLOW_DOWN), (2, Action.QUICK_STOP)]
)
def test_fault_reaction_by_605e(option: int, action: Action) -> None:
    machine = at(RUN, fault_reaction=option)
    machine.fault()
    assert (machine.state, machine.action) == (State.FAULT_REACTION, action)
    machine.step(at_rest=False)
    assert machine.state is (State.FAULT if option == 0 else State.FAULT_REACTION)
    machine.step(at_rest=True)
    assert machine.state is State.FAULT


def test_a_fault_without_power_needs_no_ramp() -> None:
    machine = at(READY)
    machine.fault()
    machine.step(at_rest=False)
    assert machine.state is State.FAULT
    machine.fault()
    assert machine.state is State.FAULT


@pytest.mark.parametrize(
    ("option", "state", "fault"),
    [(0, RUN, False), (1, RUN, True), (2, SOD, False), (3, State.QUICK_STOP, False)],
)
def test_a_lost_master_by_6007(option: int, state: State, fault: bool) -> None:
    machine = at(RUN)
    assert machine.abort_connection(option) is fault
    assert machine.state is state


def test_self_test_ends_once() -> None:
    machine = Machine()
    machine.control(0x06)
    assert machine.state is State.NOT_READY
    machine.ready()
    assert machine.state is SOD
    machine.control(0x06)
    machine.ready()
    assert machine.state is READY
