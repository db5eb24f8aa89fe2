"""State machine of a drive: every state and command, resets by edge, option codes."""

from __future__ import annotations

import pytest

from sim_plant.emulators.cia402 import (
    Action,
    Command,
    OptionCodes,
    State,
    StateMachine,
    decode_command,
)

WORDS = {
    Command.DISABLE_VOLTAGE: 0x00,
    Command.QUICK_STOP: 0x02,
    Command.SHUTDOWN: 0x06,
    Command.SWITCH_ON: 0x07,
    Command.ENABLE_OPERATION: 0x0F,
}
SOD, READY, ON, RUN = State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED
# Next state by controlword, with option codes that neither ramp nor stay.
NEXT_STATE = {
    SOD: {0x06: READY},
    READY: {0x00: SOD, 0x02: SOD, 0x07: ON},
    ON: {0x00: SOD, 0x02: SOD, 0x06: READY, 0x0F: RUN},
    RUN: {0x00: SOD, 0x02: State.QUICK_STOP, 0x06: READY, 0x07: ON},
    State.QUICK_STOP: {0x00: SOD},
    State.NOT_READY: {},
    State.FAULT_REACTION: {},
    State.FAULT: {},
}


def machine_in(state: State, **options: int) -> StateMachine:
    machine = StateMachine()
    machine.state = state
    machine.options = OptionCodes(**{"quick_stop": 2, "shutdown": 0, "disable": 0, **options})
    return machine


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("word", WORDS.values())
def test_every_controlword_in_every_state(state: State, word: int) -> None:
    machine = machine_in(state)
    machine.apply_controlword(word)
    assert machine.state is NEXT_STATE[state].get(word, state)


def test_controlwords_are_decoded_by_five_bits() -> None:
    for command, word in WORDS.items():
        for other in (0x10, 0x40, 0x100, 0xF000):
            assert decode_command(word | other) is command
        assert decode_command(word | 0x80) is None
    assert decode_command(0x05) is Command.DISABLE_VOLTAGE
    assert decode_command(0x0A) is Command.QUICK_STOP
    assert decode_command(0x0E) is Command.SHUTDOWN


def test_a_fault_is_reset_by_a_rising_edge_alone() -> None:
    machine = machine_in(RUN)
    machine.apply_controlword(0x8F)
    machine.enter_fault(coast=True)
    machine.step(at_rest=False)
    assert machine.state is State.FAULT
    machine.apply_controlword(0x80)  # bit 7 was set before
    assert machine.state is State.FAULT
    for word in (0x00, 0x06, 0x0F):
        machine.apply_controlword(word)
    assert machine.state is State.FAULT
    machine.fault_persists = True
    machine.apply_controlword(0x80)
    assert machine.state is State.FAULT
    machine.fault_persists = False
    machine.apply_controlword(0x80)
    assert machine.state is State.FAULT
    machine.apply_controlword(0x00)
    machine.apply_controlword(0x80)
    assert machine.state is SOD
    assert machine.reset_count == 1


@pytest.mark.parametrize(
    ("option", "action", "end_state"),
    [
        (1, Action.SLOW_DOWN, SOD),
        (2, Action.QUICK_STOP, SOD),
        (5, Action.SLOW_DOWN, State.QUICK_STOP),
        (6, Action.QUICK_STOP, State.QUICK_STOP),
    ],
)
def test_quick_stop_by_605a(option: int, action: Action, end_state: State) -> None:
    machine = machine_in(RUN, quick_stop=option)
    machine.apply_controlword(0x02)
    assert machine.state is State.QUICK_STOP
    machine.step(at_rest=False)
    assert machine.state is State.QUICK_STOP
    assert machine.action is action
    machine.step(at_rest=True)
    assert machine.state is end_state
    machine.apply_controlword(0x0F)
    assert machine.state is (RUN if end_state is State.QUICK_STOP else SOD)


def test_quick_stop_0_disables_at_once() -> None:
    machine = machine_in(RUN, quick_stop=0)
    machine.apply_controlword(0x02)
    assert machine.state is SOD


@pytest.mark.parametrize(
    ("word", "option", "end_state"), [(0x06, "shutdown", READY), (0x07, "disable", ON)]
)
def test_ramps_of_605b_and_605c(word: int, option: str, end_state: State) -> None:
    machine = machine_in(RUN, **{option: 1})
    machine.apply_controlword(word)
    assert (machine.state, machine.action) == (RUN, Action.SLOW_DOWN)
    machine.apply_controlword(0x0F)  # taken back
    assert machine.action is Action.FOLLOW
    machine.apply_controlword(word)
    machine.step(at_rest=False)
    assert machine.state is RUN
    machine.step(at_rest=True)
    assert (machine.state, machine.action) == (end_state, Action.OFF)


@pytest.mark.parametrize(("option", "action"), [(1, Action.SLOW_DOWN), (2, Action.QUICK_STOP)])
def test_halt_by_605d(option: int, action: Action) -> None:
    machine = machine_in(RUN, halt=option)
    machine.apply_controlword(0x10F)
    assert (machine.state, machine.action) == (RUN, action)
    machine.apply_controlword(0x00F)
    assert machine.action is Action.FOLLOW


@pytest.mark.parametrize(
    ("option", "action"), [(0, Action.OFF), (1, Action.SLOW_DOWN), (2, Action.QUICK_STOP)]
)
def test_fault_reaction_by_605e(option: int, action: Action) -> None:
    machine = machine_in(RUN, fault_reaction=option)
    machine.enter_fault()
    assert (machine.state, machine.action) == (State.FAULT_REACTION, action)
    machine.step(at_rest=False)
    assert machine.state is (State.FAULT if option == 0 else State.FAULT_REACTION)
    machine.step(at_rest=True)
    assert machine.state is State.FAULT


def test_a_fault_without_power_needs_no_ramp() -> None:
    machine = machine_in(READY)
    machine.enter_fault()
    machine.step(at_rest=False)
    assert machine.state is State.FAULT
    machine.enter_fault()
    assert machine.state is State.FAULT


@pytest.mark.parametrize(
    ("option", "state", "fault"),
    [(0, RUN, False), (1, RUN, True), (2, SOD, False), (3, State.QUICK_STOP, False)],
)
def test_a_lost_master_by_6007(option: int, state: State, fault: bool) -> None:
    machine = machine_in(RUN)
    assert machine.abort_connection(option) is fault
    assert machine.state is state


def test_self_test_ends_once() -> None:
    machine = StateMachine()
    machine.apply_controlword(0x06)
    assert machine.state is State.NOT_READY
    machine.finish_self_test()
    assert machine.state is SOD
    machine.apply_controlword(0x06)
    machine.finish_self_test()
    assert machine.state is READY
