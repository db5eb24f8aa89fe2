"""The velocity constant of the unloaded driveline: velocity per volt as it slows down.

Section 3.2 of the OSWEC thesis: without load the drive cuts in late and keeps behind while it
speeds up, so lines of velocity over command are fitted where it slows down. The thesis takes the
whole deceleration; its begin, where the motor still waits for the command to come down to it,
bends the line at small amplitudes. The constant proper is fitted to what is behind the wait, of all
set points together, to the command V as it was a lag before and seen through the same window:

    velocity = K V - (droop - share T) tanh(V / scale) + offset

A drive whose loop has no integral keeps behind by what friction takes, which saturates with speed:
the droop, that would else be taken for a smaller constant at small amplitudes. It is the less the
more load the motor turns (the thesis sees none of it under load, 3.2.2). T (N m) is the load cell's
mean torque along the motion of each set point: the bearing's, which grows with speed, so that one
droop for all set points would be taken for a larger constant, by 0.1 %. The offset, that of the
drive's input, is one for all. A set point's own drift is not: it takes in where the motor happened
to cut in, so velocities here keep it.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rig.analysis.session import periods
from rig.analysis.session.estimate import Estimate, Floats, jackknife, mean
from rig.analysis.session.periods import Cut
from rig.analysis.session.quarters import Domain, domain, quarters
from rig.analysis.session.separable_fit import Sums, search, sums

DECELERATION = (0.03, 1.0)
"""Share of the largest command between which the thesis's line is fitted."""
FOLLOWING = (0.10, 0.94)
"""Share of the largest velocity between which the motor goes as told."""
SCALES = np.geomspace(0.02, 0.6, 60)
"""V, within which a droop may saturate."""
ROUNDS = 5
"""Fits, each with the command delayed by the lag that was found before: less than 1 us changes in
the last."""
UNIT = "rad/s/V"


class Slowing(NamedTuple):
    """One set point."""

    velocity: Floats  # rad/s, of the motor, drift taken out
    drift: float  # rad/s
    volts: Floats  # V
    torque: float  # N*m, of the load cell along the motion, mean
    dt: float  # s
    window: float  # s, of the differentiator
    down: list[Domain]  # the thesis's lines
    following: list[slice]  # where it goes as told
    rms_velocity: float  # rad/s
    volts_amplitude: float  # V

    def slopes(self, sign: int) -> Floats:
        """Constants of one direction by the thesis's lines, rad/s/V."""
        return np.array([d.fitted.slope for d in self.down if d.quarter.sign == sign])


def slowing(angle: Floats, volts: Floats, torque: Floats, of: Cut, window: float = 0.02) -> Slowing:
    """Domains of a set point; ``angle``, ``volts``, ``torque`` (samples,) as measured.

    ``window`` (s) of the moving-window differentiator.
    """
    here = slice(of.edges[0], of.edges[-1])
    speed = periods.velocity(periods.detrended(angle, of), of.dt, window)
    command = volts[here]
    # Over whole periods either direction lasts as long, so an error of the cell's zero falls out.
    load = float(np.mean(torque[here] * np.sign(speed)))
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
    drift = periods.drift(angle, of)
    rms = periods.rms(speed)
    return Slowing(speed, drift, command, load, of.dt, window, down, following, rms, amplitude)


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
    told = [each for each in points if each.following]
    how = f"motor going as told, {len(told)} set points together, jackknife over them"
    units = (UNIT, "s", "rad/s")
    if len(told) < 3:
        none = (Estimate(float("nan"), float("nan"), unit, how) for unit in units)
        return tuple(none)  # type: ignore[return-value]
    before = lag = 0.0
    for _ in range(ROUNDS):
        before = lag
        found = search([_group(each, before) for each in told], SCALES)
        lag = float(_named(found.whole, before)[1])
    whole = _named(found.whole, before)
    half = jackknife(whole, np.array([_named(each, before) for each in found.left_out]))
    constant, late, droop = (
        Estimate(float(value), float(width), unit, how)
        for value, width, unit in zip(whole, half, units, strict=True)
    )
    return constant, late, droop


def _group(point: Slowing, lag: float) -> Sums:
    """What a set point adds, its command delayed by ``lag`` (s)."""
    t = point.dt * np.arange(len(point.volts))
    late = np.interp(t - lag, t, point.volts)
    turned = cumulative_trapezoid(late, dx=point.dt, initial=0.0)
    # Neighbours share most of their window: four samples in each tell as much as all.
    every = max(1, round(0.25 * point.window / point.dt))
    at = np.concatenate([np.arange(each.start, each.stop, every) for each in point.following])
    volts = periods.velocity(turned, point.dt, point.window)[at]
    rate = periods.velocity(late, point.dt, point.window)[at]
    one = np.ones((len(SCALES), len(at)))
    saturated = np.tanh(volts[None, :] / SCALES[:, None])
    columns = [volts * one, rate * one, saturated, point.torque * saturated, one]
    return sums(np.stack(columns, axis=2), point.velocity[at] + point.drift)


def _named(found: Floats, delayed: float) -> Floats:
    """Constant, lag, droop without load; ``delayed`` (s) is the lag taken out before."""
    constant, rate, droop, *_ = found
    return np.array([constant, delayed - rate / constant, -droop])
