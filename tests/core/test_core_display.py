"""The drawing thread: no caller waits for it, it draws the last value, its errors are raised."""

from __future__ import annotations

import threading
import time

import pytest

from rig.processes import supervisor
from rig.processes.supervisor import drawing_thread


def test_the_last_value_is_drawn_before_the_end() -> None:
    drawn = list[int]()
    with drawing_thread(drawn.append) as show:
        for value in range(100):
            show(value)
    assert drawn[-1] == 99
    assert drawn == sorted(set(drawn))


def test_a_blocked_terminal_delays_no_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(supervisor, "_FINAL_DRAW_TIMEOUT_S", 0.2)
    goes_on, drawn = threading.Event(), list[int]()

    def draw(value: int) -> None:
        goes_on.wait(30.0)
        drawn.append(value)

    began = time.monotonic()
    with drawing_thread(draw) as show:
        for value in range(1000):
            show(value)
    assert time.monotonic() - began < 5.0
    assert drawn == []
    goes_on.set()


def test_an_exception_of_drawing_reaches_the_caller() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    def supervise() -> None:
        with drawing_thread(draw) as show:
            for value in range(1000):
                show(value)
                time.sleep(0.01)

    began = time.monotonic()
    with pytest.raises(ZeroDivisionError):
        supervise()
    assert time.monotonic() - began < 5.0


def test_an_exception_of_the_last_drawing_is_not_lost() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    with pytest.raises(ZeroDivisionError), drawing_thread(draw) as show:
        show(1)


def test_an_error_of_the_caller_has_priority() -> None:
    def draw(value: int) -> None:
        raise ZeroDivisionError(value)

    def supervise() -> None:
        with drawing_thread(draw) as show:
            show(1)
            raise KeyError

    with pytest.raises(KeyError):
        supervise()
