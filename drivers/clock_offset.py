"""Offset between a device's clock and the host's, estimated from message arrival times.

A message sampled at device time d arrives at host time h = d + offset + delay with delay >= 0, so
the minimum of h - d is the offset plus the smallest delay. The estimate is the minimum over the
last one to two windows, so it follows a drift between the clocks. A device clock that is slow by
the fraction r makes a sample look older than it is by up to 2 r window (50 ppm and 2 s: 0.2 ms); a
clock that is fast causes no error. A sample never looks younger than it is, except by the smallest
delay, which the estimate cannot observe and the caller adds.
"""

from typing import NamedTuple


class State(NamedTuple):
    """Minimum time differences (s) of two windows; `known` is 0 before the first message."""

    known: int
    previous: float  # minimum of the previous window
    current: float  # minimum of this window
    window_start: float  # host time when this window began


def start() -> State:
    """Return the state before the first message, or after the device's clock restarted."""
    return State(0, 0.0, 0.0, 0.0)


def step(state: State, window: float, device: float, host: float) -> State:
    """Return the state after one message with its device and host times (s)."""
    known, before, current, since = state
    difference = host - device
    if not known:
        return State(1, difference, difference, host)
    if host - since >= window:
        # After two windows without a message the previous minimum has expired.
        return State(1, current if host - since < 2.0 * window else difference, difference, host)
    return State(1, before, min(current, difference), since)


def to_host_time(state: State, device: float) -> float:
    """Return the host time (s) of a device time; the smallest delay is not subtracted."""
    return device + min(state.previous, state.current)
