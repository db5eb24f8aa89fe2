"""Is the sampled closed loop stable: its poles, tick by tick.

The plant is linearised about rest: spring at its small-displacement rate, five-state radiation,
linear damping, current loop. Quadratic drag has no slope at rest, and Coulomb friction, which
holds small motions whatever the loop does, is left out, so both only make the rig more stable
than told here. The plant is discretised exactly for a command held over a tick; sensor delay,
estimator and law are what the loop computes (controllers/estimator.py, controllers/impedance.py).

The margin is that of the gain: by what factor all gains together (Kp, Ki, Km, Z_c) may be
multiplied before a pole leaves the unit circle; below 1 for a loop that is unstable as it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.biquads import Biquad
from rig.design.predictions.grid import Flags, Floats
from rig.design.predictions.loop import Law, Timing, correction, transition

SLOWEST = 1e9  # s: told instead of infinity
MOST_GAIN = 32.0  # factor at which the search for the margin ends
_RATIO = 2.0**0.25  # between gains tried
_HALVINGS = 5  # of the last ratio: 0.5 %


class Body(NamedTuple):
    """One axis about rest; radiation is (b4 s4 + .. + b1 s)/(s5 + a4 s4 + .. + a0)."""

    inertia: float  # kg, added mass at infinite frequency included
    damping: float  # N*s/m
    stiffness: float  # N/m
    radiation_a: tuple[float, ...]  # a0 .. a4
    radiation_b: tuple[float, ...]  # b1 .. b4


class Poles(NamedTuple):
    """What the poles of each row's closed loop say; one entry a row."""

    radius: Floats  # of the largest; below 1 is stable
    decay: Floats  # s in which the slowest mode falls by e; SLOWEST where it does not
    frequency: Floats  # Hz of that mode
    gain_margin: Floats  # 1, factor on all gains; MOST_GAIN: that or more, 0: unstable without any


def poles(body: Body, timing: Timing, law: Law, stiffness: Floats) -> Poles:
    """Poles of each row; ``stiffness`` (N/m) by row is that of the spring, beside the body's."""
    plants: dict[float, tuple[Floats, Floats]] = {}
    loops = []
    for kp, ki, km, spring in zip(law.kp, law.ki, law.km, stiffness, strict=True):
        if spring not in plants:
            stiff = body._replace(stiffness=body.stiffness + float(spring))
            plants[spring] = discrete(stiff, timing)
        gains = (float(kp), float(ki), float(km))
        loops.append(closed_loop(*plants[spring], timing, law.sections, gains))
    still = np.stack([one for one, _ in loops])
    moved = np.stack([two for _, two in loops])
    values = np.linalg.eigvals(still + moved)
    worst = np.argmax(np.abs(values), axis=1)
    largest = np.take_along_axis(values, worst[:, None], axis=1)[:, 0]
    radius = np.abs(largest)
    rate = -np.log(np.maximum(radius, 1e-300)) / timing.dt
    decay = np.where(rate > 1.0 / SLOWEST, 1.0 / np.maximum(rate, 1.0 / SLOWEST), SLOWEST)
    frequency = np.abs(np.angle(largest)) / (2.0 * math.pi * timing.dt)
    return Poles(radius, decay, frequency, _margin(still, moved))


def stable_at(still: Floats, moved: Floats, gain: Floats) -> Flags:
    """True for each row whose poles lie inside the unit circle at a factor on its gains."""
    values = np.linalg.eigvals(still + gain[:, None, None] * moved)
    inside: Flags = np.abs(values).max(axis=1) < 1.0
    return inside


def _margin(still: Floats, moved: Floats) -> Floats:
    """The factor at which a row's stability ends (from below); by steps, then by halving."""
    rows = len(still)
    stable = stable_at(still, moved, np.ones(rows))
    low, high = np.where(stable, 1.0, 0.0), np.where(stable, MOST_GAIN, 1.0)
    # Upwards from 1 where it is stable, downwards where it is not; both until it changes.
    open_, at = np.ones(rows, dtype=bool), np.ones(rows)
    while np.any(open_):
        at = np.where(open_, np.where(stable, at * _RATIO, at / _RATIO), at)
        now = np.zeros(rows, dtype=bool)
        now[open_] = stable_at(still[open_], moved[open_], at[open_])
        low = np.where(open_ & now, at, low)
        high = np.where(open_ & ~now, at, high)
        open_ &= (now == stable) & (at < MOST_GAIN) & (at > 1.0 / MOST_GAIN)
    none = (low == 0.0) | (low >= MOST_GAIN)
    for _ in range(_HALVINGS):
        middle = np.where(none, 1.0, np.sqrt(np.maximum(low, 1e-9) * high))
        now = stable_at(still, moved, middle)
        low, high = np.where(now & ~none, middle, low), np.where(now | none, high, middle)
    return np.minimum(low, MOST_GAIN)


def continuous(body: Body, lag: float) -> tuple[Floats, Floats]:
    """x, v, five radiation states and motor force; the input is the force commanded."""
    a = np.zeros((8, 8))
    a[0, 1] = 1.0
    a[1, 0] = -body.stiffness / body.inertia
    a[1, 1] = -body.damping / body.inertia
    a[1, 3:7] = [-b / body.inertia for b in body.radiation_b]
    a[1, 7] = 1.0 / body.inertia
    for i in range(4):
        a[2 + i, 3 + i] = 1.0
    a[6, 2:7] = [-coefficient for coefficient in body.radiation_a]
    a[6, 1] = 1.0
    a[7, 7] = -1.0 / lag
    b = np.zeros((8, 1))
    b[7, 0] = 1.0 / lag
    return a, b


def discrete(body: Body, timing: Timing) -> tuple[Floats, Floats]:
    """The same after one tick with the command held: exact."""
    from scipy import linalg  # noqa: PLC0415 - a quarter of a second that no other check pays

    a, b = continuous(body, timing.lag)
    both = np.zeros((9, 9))
    both[:8, :8], both[:8, 8:] = a, b
    tick = linalg.expm(both * timing.dt)
    return tick[:8, :8], tick[:8, 8]


def closed_loop(
    plant: Floats,
    held: Floats,
    timing: Timing,
    sections: tuple[Biquad, ...],
    gains: tuple[float, float, float],
) -> tuple[Floats, Floats]:
    """One tick of the loop without its force, and what the force adds.

    States: the plant's eight, positions on their way, the estimate, the memory of Z_c.
    """
    kp, ki, km = gains
    delay = timing.delay_ticks
    size = 8 + delay + 3 + 2 * len(sections)
    late, seen, memory = 8, 8 + delay, 8 + delay + 3

    # What is read: position now, or the oldest on its way.
    read = np.zeros(size)
    read[late + delay - 1 if delay else 0] = 1.0
    gain, kept = correction(timing.estimator)
    estimate = np.zeros((3, size))
    estimate[:, seen : seen + 3] = kept @ transition(timing.dt)
    estimate += np.outer(gain, read)

    after = np.zeros((size, size))
    signal = estimate[1]
    for i, one in enumerate(sections):
        first, second = memory + 2 * i, memory + 2 * i + 1
        reply = one.b0 * signal
        reply[first] += 1.0
        after[first] = one.b1 * signal - one.a1 * reply
        after[first, second] += 1.0
        after[second] = one.b2 * signal - one.a2 * reply
        signal = reply
    force = kp * estimate[1] + ki * estimate[0] + km * estimate[2]
    if sections:
        force = force + signal
    after[:8, :8] = plant
    if delay:
        after[late, 0] = 1.0
        for i in range(1, delay):
            after[late + i, late + i - 1] = 1.0
    after[seen : seen + 3] = estimate
    driven = np.zeros((size, size))
    driven[:8] = np.outer(held, force)
    return after, driven
