"""Poles and gain margin of the sampled closed loop.

The plant is linearised about rest: spring at its small-displacement rate, five-state radiation,
linear damping, current loop. Quadratic drag has no slope at rest. Coulomb friction stops small
motions whatever the loop does; the model omits it. Both make the real rig more stable than this
result. The discretisation is exact for a command held over a tick. Sensor delay, estimator and law
are those of the loop (controllers/estimator.py, controllers/impedance.py).

The gain margin is the factor by which all gains together (Kp, Ki, Km, Z_c) may be multiplied before
a pole leaves the unit circle; it is below 1 for an unstable loop.
"""

import math
from typing import NamedTuple

import numpy as np

from controllers.biquads import Biquad
from rig.design.axis import Body, Law, Timing
from rig.design.estimator import correction, transition
from rig.design.grid import Flags, Floats

MAX_DECAY_TIME = 1e9  # s, reported instead of infinity
MAX_GAIN = 32.0  # factor at which the search for the margin stops
_RATIO = 2.0**0.25  # between successive trial factors
_HALVINGS = 5  # of the last ratio: resolution 0.5 %


class Poles(NamedTuple):
    """Pole properties of the closed loop, one entry per row."""

    radius: Floats  # of the largest pole; stable below 1
    decay_time: Floats  # s, time constant of the slowest mode; MAX_DECAY_TIME if it does not decay
    frequency: Floats  # Hz of that mode
    gain_margin: Floats  # 1, factor on all gains; MAX_GAIN: that or more, 0: unstable at any gain


def poles(body: Body, timing: Timing, law: Law, stiffness: Floats) -> Poles:
    """Return the poles of each row; ``stiffness`` (N/m) is the spring's, one value per row."""
    open_loop, feedback = _matrices(body, timing, law, stiffness)
    radius, decay_time, frequency = _slowest_mode(open_loop + feedback, timing.dt)
    return Poles(radius, decay_time, frequency, _gain_margin(open_loop, feedback))


def decay_times(body: Body, timing: Timing, law: Law, stiffness: Floats) -> Floats:
    """Return the time constant of the slowest mode of each row, s, as of `poles`."""
    open_loop, feedback = _matrices(body, timing, law, stiffness)
    return _slowest_mode(open_loop + feedback, timing.dt)[1]


def _matrices(body: Body, timing: Timing, law: Law, stiffness: Floats) -> tuple[Floats, Floats]:
    """Return the matrices of `closed_loop_matrices` of all rows."""
    plants: dict[float, tuple[Floats, Floats]] = {}
    loops = []
    for kp, ki, km, spring in zip(law.kp, law.ki, law.km, stiffness, strict=True):
        if spring not in plants:
            stiff = body._replace(stiffness=body.stiffness + float(spring))
            plants[spring] = discretise(stiff, timing)
        gains = (float(kp), float(ki), float(km))
        loops.append(closed_loop_matrices(*plants[spring], timing, law.sections, gains))
    return np.stack([one for one, _ in loops]), np.stack([two for _, two in loops])


def _slowest_mode(transition_matrices: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """Return radius, decay time (s) and frequency (Hz) of the slowest mode of each row."""
    values = np.linalg.eigvals(transition_matrices)
    worst = np.argmax(np.abs(values), axis=1)
    largest = np.take_along_axis(values, worst[:, None], axis=1)[:, 0]
    radius = np.abs(largest)
    rate = -np.log(np.maximum(radius, 1e-300)) / dt
    decay_time = np.where(
        rate > 1.0 / MAX_DECAY_TIME, 1.0 / np.maximum(rate, 1.0 / MAX_DECAY_TIME), MAX_DECAY_TIME
    )
    return radius, decay_time, np.abs(np.angle(largest)) / (2.0 * math.pi * dt)


def is_stable_at(open_loop: Floats, feedback: Floats, gain: Floats) -> Flags:
    """Return True for each row whose poles lie inside the unit circle at factor ``gain``."""
    values = np.linalg.eigvals(open_loop + gain[:, None, None] * feedback)
    inside: Flags = np.abs(values).max(axis=1) < 1.0
    return inside


def _gain_margin(open_loop: Floats, feedback: Floats) -> Floats:
    """Return the largest stable factor of each row, by stepping and then by bisection."""
    rows = len(open_loop)
    stable = is_stable_at(open_loop, feedback, np.ones(rows))
    low, high = np.where(stable, 1.0, 0.0), np.where(stable, MAX_GAIN, 1.0)
    # Step upwards from 1 for stable rows, downwards for unstable ones, until stability changes.
    searching, factor = np.ones(rows, dtype=bool), np.ones(rows)
    while np.any(searching):
        factor = np.where(searching, np.where(stable, factor * _RATIO, factor / _RATIO), factor)
        stable_now = np.zeros(rows, dtype=bool)
        stable_now[searching] = is_stable_at(
            open_loop[searching], feedback[searching], factor[searching]
        )
        low = np.where(searching & stable_now, factor, low)
        high = np.where(searching & ~stable_now, factor, high)
        searching &= (stable_now == stable) & (factor < MAX_GAIN) & (factor > 1.0 / MAX_GAIN)
    unbracketed = (low == 0.0) | (low >= MAX_GAIN)
    for _ in range(_HALVINGS):
        middle = np.where(unbracketed, 1.0, np.sqrt(np.maximum(low, 1e-9) * high))
        stable_now = is_stable_at(open_loop, feedback, middle)
        low, high = (
            np.where(stable_now & ~unbracketed, middle, low),
            np.where(stable_now | unbracketed, high, middle),
        )
    return np.minimum(low, MAX_GAIN)


def continuous_matrices(body: Body, lag: float) -> tuple[Floats, Floats]:
    """Return state and input matrix of the plant.

    States: x, v, five radiation states, motor force. Input: commanded force.
    """
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


def discretise(body: Body, timing: Timing) -> tuple[Floats, Floats]:
    """Return state and input matrix over one tick with the command held, exact."""
    from scipy import linalg  # noqa: PLC0415 - the import takes 0.25 s, which no other check needs

    a, b = continuous_matrices(body, timing.lag)
    augmented = np.zeros((9, 9))
    augmented[:8, :8], augmented[:8, 8:] = a, b
    transition_matrix = linalg.expm(augmented * timing.dt)
    return transition_matrix[:8, :8], transition_matrix[:8, 8]


def closed_loop_matrices(
    plant: Floats,
    plant_input: Floats,
    timing: Timing,
    sections: tuple[Biquad, ...],
    gains: tuple[float, float, float],
) -> tuple[Floats, Floats]:
    """Return the transition matrix over one tick without the control force, and the force's part.

    States: eight of the plant, the delayed positions, three of the estimator, two per Z_c section.
    """
    kp, ki, km = gains
    delay = timing.delay_ticks
    size = 8 + delay + 3 + 2 * len(sections)
    delay_start, estimate_start, section_start = 8, 8 + delay, 8 + delay + 3

    # The loop reads the current position, or the oldest one in the delay line.
    measurement = np.zeros(size)
    measurement[delay_start + delay - 1 if delay else 0] = 1.0
    gain, correction_matrix = correction(timing.estimator)
    estimate = np.zeros((3, size))
    estimate[:, estimate_start : estimate_start + 3] = correction_matrix @ transition(timing.dt)
    estimate += np.outer(gain, measurement)

    open_loop = np.zeros((size, size))
    signal = estimate[1]
    for i, section in enumerate(sections):
        first, second = section_start + 2 * i, section_start + 2 * i + 1
        output = section.b0 * signal
        output[first] += 1.0
        open_loop[first] = section.b1 * signal - section.a1 * output
        open_loop[first, second] += 1.0
        open_loop[second] = section.b2 * signal - section.a2 * output
        signal = output
    force = kp * estimate[1] + ki * estimate[0] + km * estimate[2]
    if sections:
        force = force + signal
    open_loop[:8, :8] = plant
    if delay:
        open_loop[delay_start, 0] = 1.0
        for i in range(1, delay):
            open_loop[delay_start + i, delay_start + i - 1] = 1.0
    open_loop[estimate_start : estimate_start + 3] = estimate
    feedback = np.zeros((size, size))
    feedback[:8] = np.outer(plant_input, force)
    return open_loop, feedback
