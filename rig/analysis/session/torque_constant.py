"""The torque constant of a locked driveline: torque per current as it ramps up, by direction.

Section 3.1 of the OSWEC thesis: lines of measured torque over current command where the torque
grows, per oscillation and direction.

The motor's own constant is hidden in them by gearbox friction, but not in the hysteresis. At its
peak the torque T stands while the current falls from I1, where friction F held against the motor,
to I2, where it gives way the other way: K I1 = T + F and K I2 = T - F. Nothing has moved between,
so F is one and the same, whatever it depends on: K = 2 T / (I1 + I2).
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.estimate import CELL, Estimate, Floats, mean, with_floor
from rig.analysis.session.periods import Cut, rms
from rig.analysis.session.quarters import Domain, domain, quarters

RAMP = (0.10, 0.97)
"""Share of a quarter's largest torque between which a ramp is fitted."""
BACK_OFF = (0.15, 0.85)
"""The same for the way back: not its plateau, where stiction holds the torque."""
RELEASE = (0.70, 0.95)
"""Where the way back has just begun: its line is followed back to the peak's torque."""
PEAK = 0.1
"""Share of the way back in which stiction surely holds the torque."""
UNIT = "N*m/A"


class Ramps(NamedTuple):
    """One set point."""

    up: list[Domain]  # torque grows
    back: list[Domain]  # torque falls
    motor: Floats  # N*m/A, the motor's own constant by half wave
    current_amplitude: float  # A
    rms_torque: float  # N*m
    hysteresis: float  # N*m, torque at half the current, falling less growing, mean

    def slopes(self, sign: int) -> Floats:
        """Constants of one direction (1: positive torque), N*m/A."""
        return np.array([d.fitted.slope for d in self.up if d.quarter.sign == sign])


def ramps(current: Floats, torque: Floats, of: Cut) -> Ramps:
    """Domains of a set point, found in signals cut to their whole periods."""
    up: list[Domain] = []
    own = []
    back: list[Domain] = []
    gaps = []
    for each in quarters(current, of):
        low, high = RAMP if each.growing else BACK_OFF
        found = domain(each, current, torque, by=torque, low=low, high=high)
        if found is not None and found.fitted.slope > 0.0:
            (up if each.growing else back).append(found)
        if not each.growing:
            low, high = RELEASE
            begun = domain(each, current, torque, by=torque, low=low, high=high)
            if begun is not None and begun.fitted.slope > 0.0:
                own.append(_own(begun, current, torque))
        half = np.abs(np.abs(current[each.where]) - 0.5 * np.abs(current).max())
        sign = -1.0 if each.growing else 1.0
        gaps.append(sign * each.sign * torque[each.where][int(np.argmin(half))])
    return Ramps(
        up,
        back,
        np.array(own),
        float(0.5 * np.ptp(current)),
        rms(torque),
        2.0 * float(np.mean(gaps)) if gaps else float("nan"),
    )


def _own(back: Domain, current: Floats, torque: Floats) -> float:
    """The motor's constant of one peak; I2 is where the way back meets the peak's torque."""
    at = back.quarter.where
    few = slice(at.start, at.start + max(1, round(PEAK * (at.stop - at.start))))
    peak = float(np.median(torque[few]))
    release = (peak - back.fitted.intercept) / back.fitted.slope
    return 2.0 * peak / (float(current[at.start]) + release)


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
        return with_floor(mean([s.mean() for s in every[sign] if len(s)], UNIT, how), CELL)

    def spread(sign: int) -> float:
        values = np.concatenate(every[sign])
        return float(np.ptp(values) / values.mean())

    together = [np.concatenate(pair) for pair in zip(every[1], every[-1], strict=True)]
    single = np.concatenate(together)
    peaks = "at the peaks, where friction holds either way: without it; mean of "
    peaks += f"{len(points)} set points, by their scatter"
    own = mean([each.motor.mean() for each in points if len(each.motor)], UNIT, peaks)
    return Constants(
        with_floor(mean([s.mean() for s in together if len(s)], UNIT, how), CELL),
        of(1),
        of(-1),
        with_floor(own, CELL),
        spread(1),
        spread(-1),
        float(single.min()),
        float(single.max()),
    )
