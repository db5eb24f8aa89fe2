"""An independent model of the driveline: a play operator whose width grows with torque.

The model uses the equations alone (quasi-static, no inertia): the motor drags the shaft once half
the play w = gap + soft min(T/T1, 1) + T/k is used up; the brake responds to the shaft's speed of 15
ms ago, between 2 and 95 N*m. Seeds and set points are computed together as arrays.
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


def draw_truth(count: int, seed: int) -> Truth:
    """Return random constants of ``count`` benches, around the thesis's."""
    random = np.random.default_rng(seed)
    factors = [random.uniform(low, high, (count, 1)) for low, high in ((0.6, 1.8), (0.5, 1.5))]
    knee = random.uniform(6.0, 15.0, (count, 1))
    return Truth(
        THESIS.gap * factors[0],
        THESIS.soft * factors[1],
        knee,
        random.uniform(20e3, 40e3, (count, 1)),
    )


class Signals(NamedTuple):
    """Measured signals, arrays (samples, benches, set points)."""

    motor: Any  # rad
    shaft: Any  # rad
    torque: Any  # N*m


def _driveline_torque(truth: Truth, gap: Any, deflection: Any) -> Any:
    """Return the torque at a deflection of the driveline, for a shaft without inertia."""
    past_gap = np.maximum(np.abs(deflection) - gap, 0.0)
    soft_compliance = truth.soft / truth.knee + 1.0 / truth.stiffness  # rad/(N*m), up to the knee
    knee_deflection = truth.knee * soft_compliance
    magnitude = np.where(
        past_gap < knee_deflection,
        past_gap / soft_compliance,
        truth.knee + (past_gap - knee_deflection) * truth.stiffness,
    )
    return np.sign(deflection) * magnitude


def simulate(
    truth: Truth,
    table: list[tuple[float, float]] = TABLE_2_1,
    *,
    periods: int = 3,
    dt: float = 0.002,
    seed: int = 0,
    noise: float = 0.1,
    gap_scatter: float = 0.0,
    loaded: bool = True,
) -> Signals:
    """Return whole periods of 1.5 s of every set point on every bench, after one transient period.

    ``noise`` (N*m) is that of each torque sample; ``gap_scatter`` is the relative standard
    deviation of the gap between set points, which no average within a set point removes.
    """
    random = np.random.default_rng(seed)
    amplitude = DEGREE * np.array([a for a, _ in table])[None, :]
    damping = np.array([r for _, r in table])[None, :]
    count = round(1.5 / dt)
    delay_samples = round(0.015 / dt)
    shape = (len(truth.gap), len(table))
    gap = truth.gap * (1.0 + gap_scatter * random.normal(size=shape))
    motor = amplitude * np.cos(2 * np.pi * np.arange((periods + 1) * count) / count)[:, None, None]
    shaft = np.empty((len(motor), *shape))
    torque = np.empty_like(shaft)
    shaft_angle = np.broadcast_to(motor[0], shape)
    for i, angle in enumerate(motor):
        speed = (
            (shaft_angle - shaft[i - delay_samples]) / (delay_samples * dt)
            if i > delay_samples
            else np.zeros(shape)
        )
        brake_magnitude = (
            np.clip(damping * np.abs(speed), 2.0, 95.0) if loaded else 0.15 + 0.0 * speed
        )
        width = (
            gap
            + truth.soft * np.minimum(brake_magnitude / truth.knee, 1.0)
            + brake_magnitude / truth.stiffness
        )
        shaft_angle = np.clip(shaft_angle, angle - width, angle + width)
        shaft[i] = shaft_angle
        torque[i] = _driveline_torque(truth, gap, angle - shaft_angle)
    measured = slice(count, None)
    drift = (
        2e-3 * np.arange(len(motor) - count)[:, None, None] * dt
    )  # rad, like that of a velocity loop
    return Signals(
        MOTOR_COUNT
        * np.rint((np.broadcast_to(motor, shaft.shape)[measured] + drift) / MOTOR_COUNT),
        SHAFT_COUNT * np.rint((shaft[measured] + drift) / SHAFT_COUNT),
        torque[measured] + noise * random.normal(size=shaft[measured].shape),
    )
