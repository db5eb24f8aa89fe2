"""Building blocks of laws and limits."""

from typing import NamedTuple


def clamp(value: float, low: float, high: float) -> float:
    """Return ``value`` limited to [low, high]; NaN passes through as NaN, never as a bound.

    ``max(low, min(value, high))`` would turn NaN into ``low``: full negative force.
    """
    if value < low:
        return low
    if value > high:
        return high
    return value


def finite(value: float) -> bool:
    """Return True for a number that is neither NaN nor infinite."""
    return value - value == 0.0


def interpolate(x: float, xs: tuple[float, ...], ys: tuple[float, ...]) -> float:
    """Return piecewise-linear ys(x) over increasing xs (same length >= 2), constant outside."""
    if x <= xs[0]:
        return ys[0]
    n = len(xs)
    if x >= xs[n - 1]:
        return ys[n - 1]
    i = 1
    while xs[i] < x:
        i += 1
    return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1])


def fade_step(share: float, duration: float, dt: float) -> float:
    """Return the share, 1 to 0, of what fades out in ``duration`` (s), one tick later."""
    return clamp(share - dt / duration if duration > dt else 0.0, 0.0, 1.0)


class Ramp(NamedTuple):
    """A value that moves to a target at a constant rate."""

    value: float
    target: float
    rate: float  # magnitude, per second


def ramp_start(value: float) -> Ramp:
    """Return a ramp at rest on ``value``."""
    return Ramp(value, value, 0.0)


def ramp_step(ramp: Ramp, target: float, duration: float, dt: float) -> Ramp:
    """Return the ramp moved one tick towards ``target``; a new target starts at the present value.

    The way takes ``duration`` seconds from the tick in which the target changed; the value never
    jumps by more than rate * dt, whatever the target does.
    """
    if ramp.value == target and ramp.target == target:
        return ramp
    rate = ramp.rate
    if target != ramp.target:
        distance = target - ramp.value
        if distance < 0.0:
            distance = -distance
        rate = distance / duration if duration > 0.0 else distance / dt
    step = rate * dt
    gap = target - ramp.value
    if -step <= gap <= step:
        return Ramp(target, target, rate)
    if gap > 0.0:
        return Ramp(ramp.value + step, target, rate)
    return Ramp(ramp.value - step, target, rate)
