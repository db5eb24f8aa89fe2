"""The velocity constant of the unloaded driveline: velocity per volt as it slows down.

Section 3.2 of the OSWEC thesis: without load the drive starts late and lags while it accelerates,
so lines of velocity over command are fitted during deceleration. The thesis uses the whole
deceleration; its beginning, where the motor still waits for the command to come down to its
velocity, bends the line at small amplitudes. The constant proper is fitted after that wait, over
all set points together, to the command V delayed by a lag and smoothed by the same window as the
velocity:

    velocity = K V - (droop - share T) tanh(V / scale) + offset

A drive whose loop has no integral lags by an amount due to friction, which saturates with speed.
This droop would otherwise appear as a smaller constant at small amplitudes. It shrinks as the
motor's load grows (the thesis finds none of it under load, 3.2.2). T (N m) is the load cell's mean
torque along the motion of each set point: that of the bearing, which grows with speed, so a single
droop for all set points would appear as a larger constant, by 0.1 %. The offset, that of the
drive's input, is common to all set points. The drift of a set point is not: it contains where the
motor happened to start, so velocities here keep it.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rig.kinds.oswec_bench.products import periods
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknife, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.quarters import FitDomain, fit_domain, split_quarters
from rig.kinds.oswec_bench.products.separable_fit import (
    NormalEquations,
    normal_equations,
    search_grid,
)

DECELERATION = (0.03, 1.0)
"""Shares of the largest command between which the thesis's line is fitted."""
FOLLOWING = (0.10, 0.94)
"""Shares of the largest velocity between which the motor follows its command."""
SCALES = np.geomspace(0.02, 0.6, 60)
"""V, range in which a droop may saturate."""
ITERATIONS = 5
"""Number of fits, each with the command delayed by the lag of the previous one.

The last fit changes the lag by less than 1 us.
"""
UNIT = "rad/s/V"


class Deceleration(NamedTuple):
    """One set point."""

    velocity: Floats  # rad/s, of the motor, drift removed
    drift: float  # rad/s
    volts: Floats  # V
    torque: float  # N*m, mean torque of the load cell along the motion
    dt: float  # s
    window: float  # s, of the differentiator
    thesis_fits: list[FitDomain]  # lines as in the thesis
    following: list[slice]  # samples at which the motor follows its command
    rms_velocity: float  # rad/s
    voltage_amplitude: float  # V

    def slopes(self, sign: int) -> Floats:
        """Return the constants of one direction by the thesis's lines, rad/s/V."""
        return np.array([d.line.slope for d in self.thesis_fits if d.quarter.sign == sign])


def fit_decelerations(
    angle: Floats, volts: Floats, torque: Floats, cut: PeriodCut, window: float = 0.02
) -> Deceleration:
    """Return the domains of a set point; ``angle``, ``volts``, ``torque`` (samples,) are as
    measured.

    ``window`` (s) is that of the moving-window differentiator.
    """
    trimmed = slice(cut.edges[0], cut.edges[-1])
    velocity = periods.velocity(periods.detrend(angle, cut), cut.dt, window)
    command = volts[trimmed]
    # Over whole periods both directions last equally long, so an error of the cell's zero cancels.
    mean_torque = float(np.mean(torque[trimmed] * np.sign(velocity)))
    mean_command = command.mean()
    thesis_fits, following = [], []
    for each in split_quarters(command - mean_command, cut):
        if each.growing:
            continue
        low, high = DECELERATION
        fitted_domain = fit_domain(
            each, command, velocity, criterion=command - mean_command, low=low, high=high
        )
        if fitted_domain is not None:
            thesis_fits.append(fitted_domain)
        low, high = FOLLOWING
        following_domain = fit_domain(
            each, command, velocity, criterion=velocity, low=low, high=high
        )
        if following_domain is not None:
            following.append(following_domain.samples)
    amplitude = float(0.5 * np.ptp(command))
    drift = periods.drift(angle, cut)
    rms = periods.rms(velocity)
    return Deceleration(
        velocity,
        drift,
        command,
        mean_torque,
        cut.dt,
        window,
        thesis_fits,
        following,
        rms,
        amplitude,
    )


class VelocityConstants(NamedTuple):
    """Results of the session."""

    constant: Estimate  # of the motor following its command, without droop and lag
    lag: Estimate  # s
    droop: Estimate  # rad/s
    thesis: Estimate  # by the thesis's lines, all set points
    fastest: Estimate  # by the thesis's lines, three fastest set points
    spread: float  # (largest - smallest) / mean of single lines of the three fastest
    smallest: float  # rad/s/V, of all lines
    largest: float


def velocity_constants(points: list[Deceleration]) -> VelocityConstants:
    """Return means over set points, each with the interval by the scatter between set points."""
    ordered = sorted(points, key=lambda each: each.rms_velocity)
    slopes_by_point = [np.array([d.line.slope for d in each.thesis_fits]) for each in ordered]
    fastest_slopes = np.concatenate(slopes_by_point[-3:])
    method = f"lines of deceleration, mean of {len(points)} set points, by their scatter"
    all_slopes = np.concatenate(slopes_by_point)
    return VelocityConstants(
        *_fit_constant_lag_droop(points),
        mean([each.mean() for each in slopes_by_point], UNIT, method),
        mean(
            [each.mean() for each in slopes_by_point[-3:]],
            UNIT,
            method.replace(str(len(points)), "the 3"),
        ),
        float(np.ptp(fastest_slopes) / fastest_slopes.mean()),
        float(all_slopes.min()),
        float(all_slopes.max()),
    )


def _fit_constant_lag_droop(points: list[Deceleration]) -> tuple[Estimate, Estimate, Estimate]:
    """Return constant, lag and droop of all set points at which the motor follows its command."""
    following_points = [each for each in points if each.following]
    count = len(following_points)
    method = f"motor following its command, {count} set points together, jackknife over them"
    units = (UNIT, "s", "rad/s")
    if len(following_points) < 3:
        unknown = (Estimate(float("nan"), float("nan"), unit, method) for unit in units)
        return tuple(unknown)  # type: ignore[return-value]
    command_delay = lag = 0.0
    for _ in range(ITERATIONS):
        command_delay = lag
        searched = search_grid(
            [_normal_equations(each, command_delay) for each in following_points], SCALES
        )
        lag = float(_fit_parameters(searched.parameters, command_delay)[1])
    values = _fit_parameters(searched.parameters, command_delay)
    half_widths = jackknife(
        values, np.array([_fit_parameters(each, command_delay) for each in searched.leave_one_out])
    )
    constant, lag_estimate, droop = (
        Estimate(float(value), float(width), unit, method)
        for value, width, unit in zip(values, half_widths, units, strict=True)
    )
    return constant, lag_estimate, droop


def _normal_equations(point: Deceleration, lag: float) -> NormalEquations:
    """Return a set point's contribution, with its command delayed by ``lag`` (s)."""
    t = point.dt * np.arange(len(point.volts))
    delayed = np.interp(t - lag, t, point.volts)
    integrated = cumulative_trapezoid(delayed, dx=point.dt, initial=0.0)
    # Neighbours share most of their window: four samples per window carry all the information.
    stride = max(1, round(0.25 * point.window / point.dt))
    samples = np.concatenate([np.arange(each.start, each.stop, stride) for each in point.following])
    volts = periods.velocity(integrated, point.dt, point.window)[samples]
    command_rate = periods.velocity(delayed, point.dt, point.window)[samples]
    ones = np.ones((len(SCALES), len(samples)))
    saturated = np.tanh(volts[None, :] / SCALES[:, None])
    columns = [volts * ones, command_rate * ones, saturated, point.torque * saturated, ones]
    return normal_equations(np.stack(columns, axis=2), point.velocity[samples] + point.drift)


def _fit_parameters(parameters: Floats, command_delay: float) -> Floats:
    """Return constant, lag and droop without load; ``command_delay`` (s) is part of the lag."""
    constant, rate, droop, *_ = parameters
    return np.array([constant, command_delay - rate / constant, -droop])
