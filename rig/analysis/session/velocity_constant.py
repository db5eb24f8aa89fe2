"""The velocity constant of the unloaded driveline: velocity per volt as it slows down.

Section 3.2 of the OSWEC thesis: without load the drive cuts in late and keeps behind while it
speeds up, so lines of velocity over command are fitted where it slows down. The thesis takes the
whole deceleration; its begin, where the motor still waits for the command to come down to it,
bends the line at small amplitudes. The constant proper is fitted to what is behind the wait, of all
set points together:

    velocity = K (V - lag dV/dt) - droop tanh(V / scale) + offset

A drive whose loop has no integral keeps behind by what friction takes, which saturates with speed:
the droop, that would else be taken for a smaller constant at small amplitudes.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session import periods
from rig.analysis.session.estimate import Estimate, Floats, jackknife, mean, with_floor
from rig.analysis.session.periods import Cut
from rig.analysis.session.quarters import Domain, domain, quarters
from rig.analysis.session.searched import Sums, search, sums

DECELERATION = (0.03, 1.0)
"""Share of the largest command between which the thesis's line is fitted."""
FOLLOWING = (0.10, 0.94)
"""Share of the largest velocity between which the motor goes as told."""
MODEL = 0.001
"""Share of the constant that wait, lag and droop, simplified as they are, leave unknown: blind
benches are some 0.1 % off, and one in five further (benchmarks/coverage.py)."""

SCALES = np.geomspace(0.02, 0.6, 25)
"""V, within which a droop may saturate."""
UNIT = "rad/s/V"


class Slowing(NamedTuple):
    """One set point."""

    velocity: Floats  # rad/s, of the motor, drift taken out
    volts: Floats  # V
    rate: Floats  # V/s
    down: list[Domain]  # the thesis's lines
    following: list[slice]  # where it goes as told
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
        low, high = FOLLOWING
        told = domain(each, command, speed, by=speed, low=low, high=high)
        if told is not None:
            following.append(told.where)
    amplitude = float(0.5 * np.ptp(command))
    return Slowing(speed, command, rate, down, following, periods.rms(speed), amplitude)


class Constants(NamedTuple):
    """What the session gives."""

    constant: Estimate  # of the motor going as told, droop and lag apart
    lag: Estimate  # s
    droop: Estimate  # rad/s
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
    every = np.concatenate(lines)
    return Constants(
        *_proper(points),
        mean([each.mean() for each in lines], UNIT, how),
        mean([each.mean() for each in lines[-3:]], UNIT, how.replace(str(len(points)), "the 3")),
        float(np.ptp(top) / top.mean()),
        float(every.min()),
        float(every.max()),
    )


def _proper(points: list[Slowing]) -> tuple[Estimate, Estimate, Estimate]:
    """Constant, lag and droop of all set points that go as told somewhere."""
    groups = [_group(each) for each in points if each.following]
    how = f"motor going as told, {len(groups)} set points together, jackknife over them"
    if len(groups) < 3:
        none = (Estimate(float("nan"), float("nan"), unit, how) for unit in (UNIT, "s", "rad/s"))
        return tuple(none)  # type: ignore[return-value]
    found = search(groups, SCALES)
    whole = _named(found.whole)
    half = jackknife(whole, np.array([_named(each) for each in found.left_out]))
    constant, lag, droop = (
        Estimate(float(value), float(width), unit, how)
        for value, width, unit in zip(whole, half, (UNIT, "s", "rad/s"), strict=True)
    )
    return with_floor(constant, MODEL), lag, droop


def _group(point: Slowing) -> Sums:
    at = np.concatenate([np.arange(each.start, each.stop) for each in point.following])
    volts, rate = point.volts[at], point.rate[at]
    one = np.ones((len(SCALES), len(at)))
    saturated = np.tanh(volts[None, :] / SCALES[:, None])
    design = np.stack([volts * one, rate * one, saturated, one], axis=2)
    return sums(design, point.velocity[at])


def _named(found: Floats) -> Floats:
    constant, rate, droop, _, _ = found
    return np.array([constant, -rate / constant, -droop])
