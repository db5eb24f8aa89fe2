"""A poller writes the loop's newest message, and posts values after several plausible answers."""

from __future__ import annotations

import math
import struct
import time
from typing import Any, NamedTuple, cast

import pytest

from drivers.modbus.line import NoAnswerError
from drivers.modbus.registers import RegisterBlock, RegisterValue
from rig.config.wiring import RegisterSetup
from rig.wires.modbus_poller import (
    TRUSTED_ANSWERS,
    TURN_OFFSET_S,
    PolledBlock,
    RegisterPreset,
    _BlockTask,
    next_turn_time,
)

BLOCK = RegisterBlock(1, "coil", 0, 1, (RegisterValue("wave_trigger", 0, "bit", 1.0, 0.0, 1.0),))


class WriteCommand(NamedTuple):
    wave_trigger: int
    stamp: float


class Slot:
    """A mailbox into which the loop posts during the read."""

    def __init__(self, age: float) -> None:
        self._age = age

    def read(self) -> Any:
        time.sleep(0.002)
        return WriteCommand(1, time.monotonic() - self._age)


class Line:
    open_count = 1

    def __init__(self) -> None:
        self.written: list[Any] = []

    def write(self, block: RegisterBlock, registers: Any) -> None:
        self.written.append(list(registers))


def written_values(age: float) -> list[Any]:
    polled = PolledBlock("outputs", BLOCK, True, 0.02, (), True)
    slot: Any = Slot(age)
    line: Any = Line()
    _BlockTask(polled, slot, 0.3).turn(line)
    written: list[Any] = line.written
    return written


def test_a_new_message_is_written() -> None:
    assert written_values(0.0) == [[1]]


def test_an_expired_message_is_replaced_by_zeros() -> None:
    assert written_values(0.4) == [[0]]


# --- values read from a unit

VOLTS = RegisterValue("bus_voltage", 4, "f32", 1.0, 0.0, 1000.0)
WATTS = tuple(RegisterValue(name, at, "f32", 1.0, -1e5, 1e5) for name, at in (("ac", 0), ("dc", 2)))
ANALYSER = PolledBlock(
    "analyser",
    RegisterBlock(1, "input", 0, 6, (*WATTS, VOLTS)),
    True,
    0.01,
    (),
    False,
    signals=(("ac", "W"), ("dc", "W"), ("bus_voltage", "V")),
)
GOOD = (12.3, -4.5, 151.2)


class Meter:
    """A line whose unit answers with these registers in turn; None: not at all."""

    open_count = 0

    def __init__(self, answers: list[Any]) -> None:
        self._answers = iter(answers)

    def read(self, block: RegisterBlock) -> list[int]:
        self.open_count = 1
        answer = next(self._answers)
        if answer is None:
            raise NoAnswerError("unit 1: silent")
        return list(answer)


class Posted(list[Any]):
    def post(self, message: Any) -> None:
        self.append(message)


def encode(*values: float, swapped: bool = False) -> list[int]:
    """Return the registers of floats, with swapped words on request."""
    encoded: list[int] = []
    for value in values:
        high, low = struct.unpack(">HH", struct.pack(">f", value))
        encoded += [low, high] if swapped else [high, low]
    return encoded


VALID, SWAPPED = encode(*GOOD), encode(*GOOD, swapped=True)
PLAUSIBLE = encode(0.0, 0.0, 150.0, swapped=True)  # swapped, but 2.4e-41 V is plausible


def poll_answers(answers: list[Any]) -> tuple[list[int], list[str]]:
    """Return the number of posted messages and the reported problem after each answer."""
    posted: Any = Posted()
    line: Any = Meter(answers)
    task, counts, problems = _BlockTask(ANALYSER, posted, 0.3), [], []
    for _ in answers:
        task.turn(line)
        counts.append(len(posted))
        problems.append(task.trouble)
    return counts, problems


def test_a_unit_is_trusted_after_three_plausible_answers() -> None:
    assert TRUSTED_ANSWERS == 3
    assert poll_answers([VALID] * 5)[0] == [0, 0, 1, 2, 3]


def test_plausible_swapped_words_are_not_posted() -> None:
    """One or two plausible answers among implausible ones do not make the unit trusted."""
    counts, problems = poll_answers(
        [VALID] * 4 + [SWAPPED, PLAUSIBLE, PLAUSIBLE, SWAPPED, PLAUSIBLE, PLAUSIBLE, SWAPPED]
    )
    assert counts == [0, 0, 1] + [2] * 8
    assert all("swapped words?" in text for text in problems[4:])


def test_a_value_that_is_no_number_is_no_guess_at_the_order_of_words() -> None:
    nan = encode(math.nan, *GOOD[1:])
    _, problems = poll_answers([VALID] * 3 + [nan, SWAPPED])
    assert problems[3].endswith("got no number")
    assert problems[4].endswith("got swapped words?")


def test_a_unit_with_implausible_values_is_trusted_again_after_three() -> None:
    counts, problems = poll_answers([VALID] * 3 + [SWAPPED, VALID, VALID, VALID, VALID])
    assert counts == [0, 0, 1, 1, 1, 1, 2, 3]
    assert problems[-3] != ""
    assert problems[-2:] == ["", ""]


def test_a_unit_that_was_silent_is_trusted_at_once() -> None:
    assert poll_answers([VALID] * 3 + [None, None, VALID])[0] == [0, 0, 1, 1, 1, 2]


@pytest.mark.parametrize("valid", range(3))
def test_plausible_answers_must_be_consecutive(valid: int) -> None:
    answers = [*[VALID] * valid, SWAPPED, VALID, VALID, VALID]
    assert poll_answers(answers)[0] == [0] * (valid + 3) + [1]


@pytest.mark.parametrize("period", [0.002, 0.01, 0.25])
def test_turns_come_half_a_tick_after_the_grid_however_long_the_last_one_took(
    period: float,
) -> None:
    now = 12_345.6789
    for took in (0.0, 0.3 * period, 0.99 * period, 3.7 * period):
        turn = next_turn_time(now + took, period)
        assert (turn - TURN_OFFSET_S) / period == pytest.approx(
            round((turn - TURN_OFFSET_S) / period), abs=1e-6
        )
        assert now + took < turn <= now + took + period + 1e-9


def test_values_with_the_same_count_are_not_posted_again() -> None:
    """The answers are count, values, count, values, ..."""
    answers: list[Any] = []
    for count in (7, 7, 7, 8, 8, 9, 9, 65535, 0, 0):
        answers += [[count], VALID]
    posted: Any = Posted()
    line: Any = Meter(answers)
    task, counts = _BlockTask(ANALYSER._replace(counter=1), posted, 0.3), []
    for _ in range(10):
        task.turn(line)
        counts.append(len(posted))
    assert counts == [0, 0, 1, 2, 2, 3, 3, 4, 5, 5]
    assert task.trouble == ""  # it answers


# --- registers of a unit's set-up

STATUS = (
    RegisterPreset(0x1000, 5, True, True),
    RegisterPreset(0x1006, 1, True, False),
)  # watchdog time, status


class Coupler(Line):
    """A line whose unit's watchdog runs or does not."""

    def __init__(self, running: int) -> None:
        super().__init__()
        self.registers = {0x1006: running}

    def write(self, block: RegisterBlock, registers: Any) -> None:
        super().write(block, (block.first, *registers))
        self.registers[block.first] = registers[0]

    def read(self, block: RegisterBlock) -> list[int]:
        return [self.registers[block.first]]


@pytest.mark.parametrize("running", [1, 0])
def test_registers_without_write_are_only_read(running: int) -> None:
    polled = PolledBlock("outputs", BLOCK, True, 0.02, STATUS, True)
    line, slot = Coupler(running), Slot(0.0)
    task = _BlockTask(polled, cast(Any, slot), 0.3)
    task.turn(cast(Any, line))
    assert line.written[0] == [0x1000, 5]
    assert (0x1006 in [first for first, _ in line.written]) is False
    assert task.answered is (running == 1)
    assert len(line.written) == 1 + running  # without it nothing is put out
    assert ("register 4102" in task.trouble) is (running == 0)


def test_a_register_that_is_neither_written_nor_read_is_refused() -> None:
    with pytest.raises(ValueError, match="neither written nor read"):
        RegisterSetup(first=0, value=0, read_back=False, write=False)
