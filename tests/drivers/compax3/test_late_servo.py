"""Late answers of a drive are never accepted as answers in time."""

from __future__ import annotations

import pytest

from drivers.compax3.codec import NO_ADDRESS
from drivers.compax3.requests import Requests, Timing

NAME = b"C3S063V2F12I20T30M11\r"
ANSWER, STEP = 0.1, 0.001  # s


def requests_after(seconds: float, late: float, lost: frozenset[int] = frozenset()) -> Requests:
    """A line on which every `_?` is answered ``late`` s later, but for those that are lost."""
    line = Requests("servo", NO_ADDRESS, "C3", Timing(ANSWER, 0.02))
    line.on_open(0.0)
    due: list[float] = []
    answered = 0
    for tick in range(round(seconds / STEP)):
        now = tick * STEP
        come = NAME if due and due[0] <= now else b""
        del due[: 1 if come else 0]
        line.receive(come, now)
        if line.is_identified:
            break
        if line.recovery_message(now, b""):
            if answered not in lost:
                due.append(now + late)
            answered += 1
    return line


@pytest.mark.parametrize("late", [0.102, 0.115, 0.125, 0.24, 0.5, 0.99, 1.5, 3.0])
def test_late_identification_is_rejected(late: float) -> None:
    line = requests_after(10.0, late)
    assert not line.is_identified
    assert line.name == ""
    assert line.problem == "answers, but later than 0.1 s"


@pytest.mark.parametrize("late", [0.0, 0.01, 0.09])
def test_identification_in_time_is_accepted(late: float) -> None:
    assert requests_after(0.05 + late, late).is_identified


def test_a_lost_request_expires() -> None:
    """A silence of ten times `answer`, and one question more."""
    assert requests_after(16 * ANSWER, 0.01, frozenset({0, 1, 2})).is_identified
