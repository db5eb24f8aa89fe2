"""The torque constant of a locked driveline: torque per current as it ramps up, by direction.

Section 3.1 of the OSWEC thesis: lines of measured torque over current command where the torque
grows, per oscillation and direction. What gearbox friction takes of a growing torque it adds to a
falling one: with the lines of the back-off, the motor's own constant is their harmonic mean.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.estimate import Estimate, Floats, mean
from rig.analysis.session.periods import Cut, rms
from rig.analysis.session.quarters import Domain, domain, quarters

RAMP = (0.10, 0.97)
"""Share of a quarter's largest torque between which a ramp is fitted."""
SETTLED = (0.5, 0.97)
"""Of that, where the teeth have settled: what breaks away at first is behind it."""
BACK_OFF = (0.15, 0.85)
"""The same for the way back: not its plateau, where stiction holds the torque."""
UNIT = "N*m/A"


class Ramps(NamedTuple):
    """One set point."""

    up: list[Domain]  # torque grows
    settled: list[Domain]  # torque grows, its upper half
    back: list[Domain]  # torque falls
    current_amplitude: float  # A
    rms_torque: float  # N*m
    hysteresis: float  # N*m, torque at half the current, falling less growing, mean

    def slopes(self, sign: int) -> Floats:
        """Constants of one direction (1: positive torque), N*m/A."""
        return np.array([d.fitted.slope for d in self.up if d.quarter.sign == sign])

    @property
    def motor(self) -> Floats:
        """The motor's own constant by half oscillation, N*m/A: friction taken out."""
        by = {(d.quarter.oscillation, d.quarter.sign): d.fitted.slope for d in self.back}
        pairs = [(d.fitted.slope, by.get((d.quarter.oscillation, d.quarter.sign))) for d in self.up]
        return np.array([2.0 / (1.0 / up + 1.0 / back) for up, back in pairs if back])


def ramps(current: Floats, torque: Floats, of: Cut) -> Ramps:
    """Domains of a set point, found in signals cut to their whole periods."""
    up: list[Domain] = []
    settled: list[Domain] = []
    back: list[Domain] = []
    gaps = []
    for each in quarters(current, of):
        wanted = ((up, RAMP), (settled, SETTLED)) if each.growing else ((back, BACK_OFF),)
        for into, (low, high) in wanted:
            found = domain(each, current, torque, by=torque, low=low, high=high)
            if found is not None and found.fitted.slope > 0.0:
                into.append(found)
        half = np.abs(np.abs(current[each.where]) - 0.5 * np.abs(current).max())
        sign = -1.0 if each.growing else 1.0
        gaps.append(sign * each.sign * torque[each.where][int(np.argmin(half))])
    return Ramps(
        up,
        settled,
        back,
        float(0.5 * np.ptp(current)),
        rms(torque),
        2.0 * float(np.mean(gaps)) if gaps else float("nan"),
    )


class Constants(NamedTuple):
    """What the session gives."""

    both: Estimate
    positive: Estimate
    negative: Estimate
    motor: Estimate
    spread_positive: float  # (largest - smallest) / mean of single ramps
    spread_negative: float
    least: float  # N*m/A, of all ramps
    most: float


def constants(points: list[Ramps]) -> Constants:
    """Means over set points, each with the interval by the scatter between set points."""
    every = {sign: [each.slopes(sign) for each in points] for sign in (1, -1)}
    how = f"lines of ramp-up, mean of {len(points)} set points, by their scatter"

    def of(sign: int) -> Estimate:
        return mean([s.mean() for s in every[sign] if len(s)], UNIT, how)

    def spread(sign: int) -> float:
        values = np.concatenate(every[sign])
        return float(np.ptp(values) / values.mean())

    together = [np.concatenate(pair) for pair in zip(every[1], every[-1], strict=True)]
    single = np.concatenate(together)
    larger = sorted(points, key=lambda each: each.rms_torque)[len(points) // 2 :]
    own = "harmonic mean of settled ramp and back-off, so without gearbox friction; larger half of "
    own += "the set points, by their scatter"
    return Constants(
        mean([s.mean() for s in together if len(s)], UNIT, how),
        of(1),
        of(-1),
        mean([each.motor.mean() for each in larger if len(each.motor)], UNIT, own),
        spread(1),
        spread(-1),
        float(single.min()),
        float(single.max()),
    )
