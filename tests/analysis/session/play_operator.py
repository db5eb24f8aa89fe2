"""An independent model of the driveline: a play operator whose width grows with torque.

Written from the equations alone (quasi-static, no inertia): the shaft is dragged by the motor
once half the play w = gap + soft min(T/T1, 1) + T/k is used up; the brake answers the shaft's
speed, of 15 ms ago, between 2 and 95 N*m. Seeds and set points run side by side as arrays.
"""

from typing import Any, NamedTuple

import numpy as np

DEGREE = np.pi / 180.0
TABLE_2_1 = [(a, r) for a in (5.0, 10.0, 15.0, 20.0) for r in (42.0, 62.5, 83.3, 104.0)]
TABLE_2_1.remove((20.0, 83.3))
SHAFT_COUNT = 2.0 * np.pi / 2**19
MOTOR_COUNT = 2.0 * np.pi / 4096 / 15.0


class Truth(NamedTuple):
    """Constants of benches, arrays (benches, 1); rad, N*m, N*m/rad."""

    gap: Any
    soft: Any
    knee: Any
    stiffness: Any


THESIS = Truth(*(np.array([[x]]) for x in (0.0228 * DEGREE, 0.039 * DEGREE, 9.4, 28483.0)))


def drawn(count: int, seed: int) -> Truth:
    """Constants of so many benches, around the thesis's."""
    random = np.random.default_rng(seed)
    sizes = [random.uniform(low, high, (count, 1)) for low, high in ((0.6, 1.8), (0.5, 1.5))]
    knee = random.uniform(6.0, 15.0, (count, 1))
    return Truth(
        THESIS.gap * sizes[0],
        THESIS.soft * sizes[1],
        knee,
        random.uniform(20e3, 40e3, (count, 1)),
    )


class Signals(NamedTuple):
    """Measured, arrays (samples, benches, set points)."""

    motor: Any  # rad
    shaft: Any  # rad
    torque: Any  # N*m


def _carried(truth: Truth, gap: Any, bent: Any) -> Any:
    """The torque at which the driveline is bent so far: that of a shaft without inertia."""
    beyond = np.maximum(np.abs(bent) - gap, 0.0)
    soft = truth.soft / truth.knee + 1.0 / truth.stiffness  # rad/(N*m), up to the knee
    bend = truth.knee * soft
    size = np.where(beyond < bend, beyond / soft, truth.knee + (beyond - bend) * truth.stiffness)
    return np.sign(bent) * size


def run(
    truth: Truth,
    table: list[tuple[float, float]] = TABLE_2_1,
    *,
    periods: int = 3,
    dt: float = 0.002,
    seed: int = 0,
    noise: float = 0.1,
    wander: float = 0.0,
    loaded: bool = True,
) -> Signals:
    """Whole periods of 1.5 s of every set point on every bench, one period of transient before.

    ``noise`` (N*m) is on each sample of torque; ``wander`` is the relative standard deviation of
    the gap from set point to set point, which no averaging within one removes.
    """
    random = np.random.default_rng(seed)
    amplitude = DEGREE * np.array([a for a, _ in table])[None, :]
    damping = np.array([r for _, r in table])[None, :]
    count = round(1.5 / dt)
    late = round(0.015 / dt)
    shape = (len(truth.gap), len(table))
    gap = truth.gap * (1.0 + wander * random.normal(size=shape))
    motor = amplitude * np.cos(2 * np.pi * np.arange((periods + 1) * count) / count)[:, None, None]
    shaft = np.empty((len(motor), *shape))
    torque = np.empty_like(shaft)
    here = np.broadcast_to(motor[0], shape)
    for i, angle in enumerate(motor):
        speed = (here - shaft[i - late]) / (late * dt) if i > late else np.zeros(shape)
        size = np.clip(damping * np.abs(speed), 2.0, 95.0) if loaded else 0.15 + 0.0 * speed
        width = gap + truth.soft * np.minimum(size / truth.knee, 1.0) + size / truth.stiffness
        here = np.clip(here, angle - width, angle + width)
        shaft[i] = here
        torque[i] = _carried(truth, gap, angle - here)
    keep = slice(count, None)
    drift = 2e-3 * np.arange(len(motor) - count)[:, None, None] * dt  # rad, as a velocity loop's
    return Signals(
        MOTOR_COUNT * np.rint((np.broadcast_to(motor, shaft.shape)[keep] + drift) / MOTOR_COUNT),
        SHAFT_COUNT * np.rint((shaft[keep] + drift) / SHAFT_COUNT),
        torque[keep] + noise * random.normal(size=shaft[keep].shape),
    )
