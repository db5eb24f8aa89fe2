"""A poller: the loop's newest word goes out; what comes in is believed when it has looked right."""

from __future__ import annotations

import struct
import time
from typing import Any, cast

import pytest

from drivers.modbus.line import SilentError
from drivers.modbus.registers import Block, Value
from rig.config.wiring import RegisterSetup
from rig.execution.hardware.messages import Outputs
from rig.execution.hardware.modbus_poller import AFTER, TRUST, Given, Polled, _Task, next_turn

BLOCK = Block(1, "coil", 0, 1, (Value("wave_trigger", 0, "bit", 1.0, 0.0, 1.0),))


class Slot:
    """A mailbox into which the loop posts in the moment of the reading."""

    def __init__(self, age: float) -> None:
        self._age = age

    def read(self) -> Outputs:
        time.sleep(0.002)
        return Outputs(1, time.monotonic() - self._age)


class Line:
    opened = 1

    def __init__(self) -> None:
        self.written: list[Any] = []

    def write(self, block: Block, registers: Any) -> None:
        self.written.append(list(registers))


def told(age: float) -> list[Any]:
    polled = Polled("outputs", BLOCK, True, 0.02, (), True)
    slot: Any = Slot(age)
    line: Any = Line()
    _Task(polled, slot, 0.3).turn(line)
    written: list[Any] = line.written
    return written


def test_a_word_that_came_just_now_goes_out() -> None:
    assert told(0.0) == [[1]]


def test_a_word_the_loop_has_not_said_again_is_let_go() -> None:
    assert told(0.4) == [[0]]


# --- what comes in

VOLTS = Value("bus_voltage", 4, "f32", 1.0, 0.0, 1000.0)
WATTS = tuple(Value(name, at, "f32", 1.0, -1e5, 1e5) for name, at in (("ac", 0), ("dc", 2)))
ANALYSER = Polled("analyser", Block(1, "input", 0, 6, (*WATTS, VOLTS)), True, 0.01, (), False)
GOOD = (12.3, -4.5, 151.2)


class Meter:
    """A line whose unit answers with these words in turn; None: not at all."""

    opened = 0

    def __init__(self, answers: list[Any]) -> None:
        self._answers = iter(answers)

    def read(self, block: Block) -> list[int]:
        self.opened = 1
        answer = next(self._answers)
        if answer is None:
            raise SilentError("unit 1: silent")
        return list(answer)


class Posted(list[Any]):
    def post(self, word: Any) -> None:
        self.append(word)


def words(*values: float, swapped: bool = False) -> list[int]:
    found: list[int] = []
    for value in values:
        high, low = struct.unpack(">HH", struct.pack(">f", value))
        found += [low, high] if swapped else [high, low]
    return found


WELL, ODD = words(*GOOD), words(*GOOD, swapped=True)
LUCKY = words(0.0, 0.0, 150.0, swapped=True)  # 2.4e-41 V: a number that can be


def heard(answers: list[Any]) -> tuple[list[int], list[str]]:
    """How many words had been handed on after each answer, and the trouble that was told."""
    posted: Any = Posted()
    line: Any = Meter(answers)
    task, counts, told = _Task(ANALYSER, posted, 0.3), [], []
    for _ in answers:
        task.turn(line)
        counts.append(len(posted))
        told.append(task.trouble)
    return counts, told


def test_a_unit_is_believed_after_three_answers_that_look_right() -> None:
    assert TRUST == 3
    assert heard([WELL] * 5)[0] == [0, 0, 1, 2, 3]


def test_swapped_words_that_can_be_are_not_handed_on() -> None:
    """Among absurd values now and then one or two that are none: the unit is not believed again."""
    counts, told = heard([WELL] * 4 + [ODD, LUCKY, LUCKY, ODD, LUCKY, LUCKY, ODD])
    assert counts == [0, 0, 1] + [2] * 8
    assert all("swapped words?" in text for text in told[4:])


def test_a_unit_that_was_odd_is_believed_again_after_three() -> None:
    counts, told = heard([WELL] * 3 + [ODD, WELL, WELL, WELL, WELL])
    assert counts == [0, 0, 1, 1, 1, 1, 2, 3]
    assert told[-3] != ""
    assert told[-2:] == ["", ""]


def test_a_unit_that_was_silent_is_believed_at_once() -> None:
    assert heard([WELL] * 3 + [None, None, WELL])[0] == [0, 0, 1, 1, 1, 2]


@pytest.mark.parametrize("odd", range(3))
def test_right_answers_count_only_in_a_row(odd: int) -> None:
    assert heard([*[WELL] * odd, ODD, WELL, WELL, WELL])[0] == [0] * (odd + 3) + [1]


@pytest.mark.parametrize("period", [0.002, 0.01, 0.25])
def test_turns_come_half_a_tick_after_the_grid_whatever_the_last_one_took(period: float) -> None:
    now = 12_345.6789
    for took in (0.0, 0.3 * period, 0.99 * period, 3.7 * period):
        turn = next_turn(now + took, period)
        assert (turn - AFTER) / period == pytest.approx(round((turn - AFTER) / period), abs=1e-6)
        assert now + took < turn <= now + took + period + 1e-9


def test_values_that_the_unit_has_not_counted_grow_old() -> None:
    """Count, values, count, values, ...: what was shown before is not handed on again."""
    answers: list[Any] = []
    for count in (7, 7, 7, 8, 8, 9, 9, 65535, 0, 0):
        answers += [[count], WELL]
    posted: Any = Posted()
    line: Any = Meter(answers)
    task, counts = _Task(ANALYSER._replace(counter=1), posted, 0.3), []
    for _ in range(10):
        task.turn(line)
        counts.append(len(posted))
    assert counts == [0, 0, 1, 2, 2, 3, 3, 4, 5, 5]
    assert task.trouble == ""  # it answers


# --- registers that a unit is given first

STATUS = (Given(0x1000, 5, True, True), Given(0x1006, 1, True, False))  # a watchdog's time, status


class Coupler(Line):
    """A line whose unit counts down, or does not."""

    def __init__(self, running: int) -> None:
        super().__init__()
        self.registers = {0x1006: running}

    def write(self, block: Block, registers: Any) -> None:
        super().write(block, (block.first, *registers))
        self.registers[block.first] = registers[0]

    def read(self, block: Block) -> list[int]:
        return [self.registers[block.first]]


@pytest.mark.parametrize("running", [1, 0])
def test_what_must_read_so_by_itself_is_not_written(running: int) -> None:
    polled = Polled("outputs", BLOCK, True, 0.02, STATUS, True)
    line, slot = Coupler(running), Slot(0.0)
    task = _Task(polled, cast(Any, slot), 0.3)
    task.turn(cast(Any, line))
    assert line.written[0] == [0x1000, 5]
    assert (0x1006 in [first for first, _ in line.written]) is False
    assert task.answered is (running == 1)
    assert len(line.written) == 1 + running  # without it nothing is put out
    assert ("register 4102" in task.trouble) is (running == 0)


def test_a_register_that_is_neither_written_nor_read_is_refused() -> None:
    with pytest.raises(ValueError, match="neither written nor read"):
        RegisterSetup(first=0, value=0, read_back=False, write=False)
