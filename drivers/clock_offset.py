"""Where a device's clock stands against the host's, from messages that are never early.

A message taken at device time d arrives at host time h = d + offset + delay, and no delay is below
zero: the smallest h - d is the offset plus the smallest delay. The smallest of one to two windows
is used, so a drift between the clocks is followed. A device clock that runs slow by r makes a
sample look older than it is by up to 2 r window (50 ppm and 2 s: 0.2 ms), one that runs fast does
not show: never younger, but for the smallest delay itself, which no clock can see and the caller
adds.
"""

from typing import NamedTuple


class State(NamedTuple):
    """The smallest differences of two windows, s; nothing known while `known` is 0."""

    known: int
    before: float  # of the window before
    current: float  # of this window
    since: float  # host time when this window began


def start() -> State:
    """State before the first message, or after the device's clock began anew."""
    return State(0, 0.0, 0.0, 0.0)


def step(state: State, window: float, device: float, host: float) -> State:
    """Take in one message: when the device took it, when the host had it (s each)."""
    known, before, current, since = state
    difference = host - device
    if not known:
        return State(1, difference, difference, host)
    if host - since >= window:
        # After a silence of two windows nothing of the first is left.
        return State(1, current if host - since < 2.0 * window else difference, difference, host)
    return State(1, before, min(current, difference), since)


def on_host(state: State, device: float) -> float:
    """Host time (s) of a device time, the smallest delay not taken off."""
    return device + min(state.before, state.current)
