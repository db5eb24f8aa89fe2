"""The velocity constant of the unloaded driveline: velocity per volt as it slows down.

Section 3.2 of the OSWEC thesis: without load the drive cuts in late and keeps behind while it
speeds up, so lines of velocity over command are fitted where it slows down. The thesis takes the
whole deceleration; its begin, where the motor still waits for the command to come down to it,
bends the line at small amplitudes. The constant proper is that of the part behind the wait, with
the drive's lag beside it: velocity = K V - K lag dV/dt + offset.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session import periods
from rig.analysis.session.estimate import Estimate, Floats, mean
from rig.analysis.session.periods import Cut
from rig.analysis.session.quarters import Domain, Quarter, domain, quarters

DECELERATION = (0.03, 1.0)
"""Share of the largest command between which the thesis's line is fitted."""
FOLLOWING = (0.10, 0.94)
"""Share of the largest velocity between which the motor goes as told."""
UNIT = "rad/s/V"


class Following(NamedTuple):
    """The motor going as told, in one deceleration."""

    where: slice
    constant: float  # rad/s/V
    lag: float  # s


class Slowing(NamedTuple):
    """One set point."""

    velocity: Floats  # rad/s, of the motor, drift taken out
    volts: Floats  # V
    down: list[Domain]  # the thesis's lines
    following: list[Following]
    rms_velocity: float  # rad/s
    volts_amplitude: float  # V

    def slopes(self, sign: int) -> Floats:
        """Constants of one direction by the thesis's lines, rad/s/V."""
        return np.array([d.fitted.slope for d in self.down if d.quarter.sign == sign])


def slowing(angle: Floats, volts: Floats, of: Cut, window: float = 0.02) -> Slowing:
    """Domains of a set point; ``angle`` and ``volts`` (samples,) as measured.

    ``window`` (s) of the moving-window differentiator.
    """
    speed = periods.velocity(periods.detrended(angle, of), of.dt, window)
    command = volts[of.edges[0] : of.edges[-1]]
    rate = periods.velocity(command, of.dt, window)
    level = command.mean()
    down, following = [], []
    for each in quarters(command - level, of):
        if each.growing:
            continue
        low, high = DECELERATION
        found = domain(each, command, speed, by=command - level, low=low, high=high)
        if found is not None:
            down.append(found)
        told = _following(each, command, rate, speed)
        if told is not None:
            following.append(told)
    return Slowing(
        speed, command, down, following, periods.rms(speed), float(0.5 * np.ptp(command))
    )


def _following(quarter: Quarter, command: Floats, rate: Floats, speed: Floats) -> Following | None:
    low, high = FOLLOWING
    part = domain(quarter, command, speed, by=speed, low=low, high=high)
    if part is None:
        return None
    at = part.where
    design = np.stack([command[at], rate[at], np.ones(at.stop - at.start)], axis=1)
    found = np.linalg.lstsq(design, speed[at], rcond=None)[0]
    return Following(at, float(found[0]), float(-found[1] / found[0]))


class Constants(NamedTuple):
    """What the session gives."""

    constant: Estimate  # of the motor going as told
    lag: Estimate  # s
    thesis: Estimate  # by the thesis's lines, over all set points
    fastest: Estimate  # the same over the three fastest
    spread: float  # (largest - smallest) / mean of single lines of the three fastest
    least: float  # rad/s/V, of all lines
    most: float


def constants(points: list[Slowing]) -> Constants:
    """Means over set points, each with the interval by the scatter between set points."""
    ordered = sorted(points, key=lambda each: each.rms_velocity)
    lines = [np.array([d.fitted.slope for d in each.down]) for each in ordered]
    top = np.concatenate(lines[-3:])
    how = f"lines of deceleration, mean of {len(points)} set points, by their scatter"
    own = [np.mean([f.constant for f in each.following]) for each in ordered if each.following]
    lags = [np.mean([f.lag for f in each.following]) for each in ordered if each.following]
    told = f"motor going as told, lag apart; mean of {len(own)} set points, by their scatter"
    every = np.concatenate(lines)
    return Constants(
        mean(own, UNIT, told),
        mean(lags, "s", told),
        mean([each.mean() for each in lines], UNIT, how),
        mean([each.mean() for each in lines[-3:]], UNIT, how.replace(str(len(points)), "the 3")),
        float(np.ptp(top) / top.mean()),
        float(every.min()),
        float(every.max()),
    )
