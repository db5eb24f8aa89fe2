"""Distributed clocks: the correction that lets the loop follow the clock of the segment.

A tick's frame brings back the time of the reference clock when it passed. Modulo the cycle, this
time must stay at one place, the shift; a proportional and integral law on the difference moves the
loop's deadlines, by a limited amount each tick. The gains are the usual ones of open masters: 1/100
of the offset, and an integral that takes up the drift of the two oscillators.
"""

from typing import NamedTuple

_PROPORTIONAL, _INTEGRAL = 0.01, 5e-5  # of the offset, in each tick


class ClockParams(NamedTuple):
    """Constants of one loop."""

    cycle_ns: int
    shift_ns: int  # time of the frame at the reference clock after the start of a cycle
    max_ns: int = 10_000  # largest correction of one tick


class ClockState(NamedTuple):
    """State of the correction."""

    offset_ns: int = 0  # of the last frame, positive: it comes too late
    drift_ns: float = 0.0  # correction of each tick for the drift; its sum is the drift itself
    ticks: int = 0  # with a new time


def start() -> ClockState:
    """Return the state before the first frame."""
    return ClockState()


def offset(params: ClockParams, time_ns: int) -> int:
    """Return how much (ns) later than planned a frame passed, within half a cycle."""
    cycle = params.cycle_ns
    found = (time_ns - params.shift_ns) % cycle
    return found - cycle if found > cycle // 2 else found


def step(params: ClockParams, state: ClockState, time_ns: int) -> tuple[ClockState, int]:
    """Return the state and the correction (ns) of the next deadline after one more frame.

    ``time_ns`` of the reference clock. The first correction brings the loop to the shift at once.
    """
    found = offset(params, time_ns)
    if state.ticks == 0:
        return ClockState(found, 0.0, 1), -found
    drift = state.drift_ns - _INTEGRAL * found
    limit = float(params.max_ns)
    drift = max(-limit, min(limit, drift))
    correction = max(-limit, min(limit, drift - _PROPORTIONAL * found))
    return ClockState(found, drift, state.ticks + 1), round(correction)


class Follower:
    """The corrections of a loop, one for each new frame."""

    def __init__(self, params: ClockParams) -> None:
        self.params, self.state = params, start()
        self._correction = 0

    def take(self, time_ns: int) -> None:
        """Take the time (ns) at which the reference clock saw the newest frame."""
        self.state, self._correction = step(self.params, self.state, time_ns)

    def correction(self) -> int:
        """Return the correction (ns) of the next deadline, 0 without a new frame."""
        correction, self._correction = self._correction, 0
        return correction

    def move_to(self, due_ns: int) -> None:
        """Let the next correction move deadlines from multiples of the cycle to where others were.

        ``due_ns``: one of the deadlines before, on the same clock.
        """
        cycle = self.params.cycle_ns
        phase = due_ns % cycle
        self._correction += phase - cycle if phase > cycle // 2 else phase
