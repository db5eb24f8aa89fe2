"""What goes out to a line: the loop's newest word, even one that comes while it is fetched."""

from __future__ import annotations

import time
from typing import Any

from drivers.modbus.registers import Block, Value
from rig.hardware.poller import Polled, _Task
from rig.hardware.words import Outputs

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
