"""The drawing thread: nobody waits for it, the last value is drawn, its errors are not lost."""

from __future__ import annotations

import threading
import time

import pytest

from rig.processes import display
from rig.processes.display import Display


def test_the_last_value_is_drawn_before_the_end() -> None:
    drawn = list[int]()
    with Display(drawn.append) as made:
        for value in range(100):
            made.show(value)
    assert drawn[-1] == 99
    assert drawn == sorted(set(drawn))


def test_a_terminal_that_stands_still_keeps_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(display, "_LAST", 0.2)
    goes_on, drawn = threading.Event(), list[int]()

    def draw(value: int) -> None:
        goes_on.wait(30.0)
        drawn.append(value)

    began = time.monotonic()
    with Display(draw) as made:
        for value in range(1000):
            made.show(value)
    assert time.monotonic() - began < 5.0
    assert drawn == []
    goes_on.set()


def test_what_a_drawing_raises_is_raised_where_the_values_come_from() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    def supervise() -> None:
        with Display(draw) as made:
            for value in range(1000):
                made.show(value)
                time.sleep(0.01)

    began = time.monotonic()
    with pytest.raises(ZeroDivisionError):
        supervise()
    assert time.monotonic() - began < 5.0


def test_what_the_last_drawing_raises_is_not_lost() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    with pytest.raises(ZeroDivisionError), Display(draw) as made:
        made.show(1)


def test_an_error_of_the_caller_goes_before_one_of_the_drawing() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    def supervise() -> None:
        with Display(draw) as made:
            made.show(1)
            raise KeyError

    with pytest.raises(KeyError):
        supervise()
