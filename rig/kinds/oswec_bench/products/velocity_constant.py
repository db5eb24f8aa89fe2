"""The velocity constant session: velocity per volt of the unloaded driveline as it slows down.

Section 3.2, Table 3.2 and Figures 2.6 and 3.5 to 3.8 of the OSWEC thesis: without load the drive
starts late and lags while it accelerates, so lines of velocity over command are fitted during
deceleration. The thesis uses the whole deceleration; its beginning, where the motor still waits for
the command to come down to its velocity, bends the line at small amplitudes. The constant proper is
fitted after that wait, over all set points together, to the command V delayed by a lag and smoothed
by the same window as the velocity:

    velocity = K V - (droop - share T) tanh(V / scale) + offset

A drive whose loop has no integral lags by an amount due to friction, which saturates with speed.
This droop would otherwise appear as a smaller constant at small amplitudes. It shrinks as the
motor's load grows (the thesis finds none of it under load, 3.2.2). T (N m) is the load cell's mean
torque along the motion of each set point: that of the bearing, which grows with speed, so a single
droop for all set points would appear as a larger constant, by 0.1 %. The offset, that of the
drive's input, is common to all set points. The drift of a set point is not: it contains where the
motor happened to start, so velocities here keep it.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from rig.kinds.oswec_bench.products import estimate, figures, periods, quarters
from rig.kinds.oswec_bench.products.deflection import DEGREE, Motion, ShaftLag, shaft_lag
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, Line, jackknifed, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.quarters import FitDomain
from rig.kinds.oswec_bench.products.result import Columns, Comparison, Result, compare, table

NOMINAL = 37.5 * 2.0 * np.pi / 10.0 / 15.0  # rad/s/V, equation 3.2
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
WINDOW = 0.02  # s, of the moving-window differentiator

# Values of the OSWEC thesis (University of Washington).
VOLTS = (0.23, 0.35, 0.47, 0.58, 0.70, 0.81, 0.93)
SPEEDS = (0.37, 0.55, 0.73, 0.92, 1.10, 1.28, 1.46)
"""Table 3.2, V and rad/s: voltage amplitudes and nominal velocities."""
THESIS_CONSTANT = 1.46  # rad/s/V, mean of all
THESIS_FASTEST = 1.49  # rad/s/V, mean of the three fastest
THESIS_RANGE = (1.22, 1.52)  # rad/s/V, smallest and largest
THESIS_SPREAD = 0.028  # of the three fastest
UNLOADED_DIFFERENCE = (0.025, 0.015)  # deg, amplitude difference and its half width


class Deceleration(NamedTuple):
    """One set point."""

    velocity: Floats  # rad/s, of the motor, drift removed
    drift: float  # rad/s
    volts: Floats  # V
    torque: float  # N*m, mean torque of the load cell along the motion
    dt: float  # s
    thesis_fits: list[FitDomain]  # lines as in the thesis
    following: list[slice]  # samples at which the motor follows its command
    rms_velocity: float  # rad/s
    voltage_amplitude: float  # V

    @property
    def slopes(self) -> list[float]:
        """Slopes of the thesis's lines, rad/s/V."""
        return [each.line.slope for each in self.thesis_fits]


def fit_decelerations(angle: Floats, volts: Floats, torque: Floats, cut: PeriodCut) -> Deceleration:
    """Return the domains of a set point; ``angle``, ``volts``, ``torque`` (samples,) are as
    measured.
    """
    velocity = periods.velocity(periods.detrend(angle, cut), cut.dt, WINDOW)
    command = cut.trim(volts)
    # Over whole periods both directions last equally long, so an error of the cell's zero cancels.
    mean_torque = float(np.mean(cut.trim(torque) * np.sign(velocity)))
    swing = command - command.mean()
    falling = [each for each in quarters.split_quarters(swing, cut) if not each.growing]
    thesis_fits, following = (
        quarters.fit_domains(falling, command, velocity, criterion=criterion, shares=shares)
        for criterion, shares in ((swing, DECELERATION), (velocity, FOLLOWING))
    )
    return Deceleration(
        velocity,
        periods.drift(angle, cut),
        command,
        mean_torque,
        cut.dt,
        thesis_fits,
        [each.samples for each in following],
        periods.rms(velocity),
        float(0.5 * np.ptp(command)),
    )


def velocity_constants(points: list[Deceleration]) -> dict[str, Estimate]:
    """Return means over set points, each with the interval by the scatter between set points.

    The constant proper, lag and droop are those of the motor following its command; `deceleration`
    and `fastest` are the means of the thesis's lines, of all and of the three fastest set points.
    """
    ordered = sorted(points, key=lambda each: each.rms_velocity)
    means = [np.mean(each.slopes) for each in ordered]
    method = "lines of deceleration, mean of {} set points, by their scatter"
    constant, lag, droop = _fit_constant_lag_droop(points)
    return {
        "velocity_constant": constant,
        "velocity_constant_deceleration": mean(means, UNIT, method.format(len(points))),
        "velocity_constant_fastest": mean(means[-3:], UNIT, method.format("the 3")),
        "velocity_lag": lag,
        "velocity_droop": droop,
    }


def _fit_constant_lag_droop(points: list[Deceleration]) -> list[Estimate]:
    """Return constant, lag and droop of all set points at which the motor follows its command."""
    following_points = [each for each in points if each.following]
    count = len(following_points)
    method = f"motor following its command, {count} set points together, jackknife over them"
    units = (UNIT, "s", "rad/s")
    if count < 3:
        return [mean([], unit, method) for unit in units]
    command_delay = lag = 0.0
    for _ in range(ITERATIONS):
        command_delay = lag
        searched = estimate.search_grid(
            [_normal_equations(each, command_delay) for each in following_points], SCALES
        )
        values = _fit_parameters(searched.parameters, command_delay)
        lag = float(values[1])
    left_out = [_fit_parameters(each, command_delay) for each in searched.leave_one_out]
    return jackknifed(values, left_out, units, method)


def _normal_equations(point: Deceleration, lag: float) -> estimate.NormalEquations:
    """Return a set point's contribution, with its command delayed by ``lag`` (s)."""
    t = point.dt * np.arange(len(point.volts))
    delayed = np.interp(t - lag, t, point.volts)
    integrated = cumulative_trapezoid(delayed, dx=point.dt, initial=0.0)
    # Neighbours share most of their window: four samples per window carry all the information.
    stride = max(1, round(0.25 * WINDOW / point.dt))
    samples = np.concatenate([np.arange(each.start, each.stop, stride) for each in point.following])
    volts = periods.velocity(integrated, point.dt, WINDOW)[samples]
    command_rate = periods.velocity(delayed, point.dt, WINDOW)[samples]
    ones = np.ones((len(SCALES), len(samples)))
    saturated = np.tanh(volts[None, :] / SCALES[:, None])
    columns = [volts * ones, command_rate * ones, saturated, point.torque * saturated, ones]
    return estimate.normal_equations(
        np.stack(columns, axis=2), point.velocity[samples] + point.drift
    )


def _fit_parameters(parameters: Floats, command_delay: float) -> Floats:
    """Return constant, lag and droop without load; ``command_delay`` (s) is part of the lag."""
    constant, rate, droop, *_ = parameters
    return np.array([constant, command_delay - rate / constant, -droop])


class UnloadedPoint(NamedTuple):
    """A set point of the unloaded shaft."""

    point: SetpointData
    cut: PeriodCut
    deceleration: Deceleration
    motion: Motion
    lag: ShaftLag

    @property
    def fits(self) -> list[FitDomain]:
        """Lines as in the thesis."""
        return self.deceleration.thesis_fits


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = [_unloaded_point(point) for point in session.complete_points]
    points = sorted((p for p in points if p.fits), key=lambda p: p.deceleration.rms_velocity)
    if not points:
        raise ValueError("no set point has a deceleration")
    fitted = velocity_constants([each.deceleration for each in points])
    method = "half strokes of motor minus shaft, unloaded; by scatter of set points"
    amplitude_loss = mean(
        [p.lag.amplitude_difference.mean() / DEGREE for p in points], "deg", method
    )
    title = "Table 3.2: velocity constants of decelerations by set point"
    return Result(
        (table("velocity_constants", title, points, COLUMNS),),
        tuple(_comparisons(fitted, amplitude_loss, points)),
        fitted | {"amplitude_difference_unloaded": amplitude_loss},
        (
            fig_2_6(points),
            fig_3_5((points[0], points[-1]), fitted["velocity_constant"].value),
            fig_3_6(points[-1]),
            fig_3_7(points, fitted["velocity_constant"].value),
            fig_3_8(points),
        ),
        (
            "velocity_constant holds while the motor follows its command, after the wait at the "
            "start of each deceleration, without lag and droop of the drive; the thesis's lines "
            "include them. velocity_droop is the value without load; the load of the bearing "
            "reduces it.",
        ),
    )


def _unloaded_point(point: SetpointData) -> UnloadedPoint:
    cut = point.aligned_periods(point.volts)
    motion = point.motion()
    deceleration = fit_decelerations(point.motor, point.volts, point.torque, cut)
    return UnloadedPoint(point, cut, deceleration, motion, shaft_lag(motion))


COLUMNS: Columns[UnloadedPoint] = {
    "row": lambda p: p.point.row,
    "voltage amplitude [V]": lambda p: p.deceleration.voltage_amplitude,
    "velocity, nominal (eq. 3.2) [rad/s]": lambda p: NOMINAL * p.deceleration.voltage_amplitude,
    "velocity, thesis nominal [rad/s]": lambda p: quarters.thesis_value(
        p.deceleration.voltage_amplitude, VOLTS, SPEEDS
    ),
    "rms velocity [rad/s]": lambda p: p.deceleration.rms_velocity,
    **quarters.direction_columns(UNIT, lambda p: p.fits),
    "amplitude difference [deg]": lambda p: float(p.lag.amplitude_difference.mean()) / DEGREE,
}


def _comparisons(
    fitted: dict[str, Estimate], amplitude_loss: Estimate, points: list[UnloadedPoint]
) -> Iterator[Comparison]:
    lines, fastest = fitted["velocity_constant_deceleration"], fitted["velocity_constant_fastest"]
    yield Comparison.of_constant("velocity constant, mean", lines, THESIS_CONSTANT)
    yield Comparison.of_constant("mean of the three fastest", fastest, THESIS_FASTEST)
    slopes = [each.deceleration.slopes for each in points]
    fast = np.concatenate(slopes[-3:])
    spread = np.ptp(fast) / fast.mean()
    measured, thesis = (f"{100 * each:.1f} %" for each in (spread, THESIS_SPREAD))
    yield compare("spread of the three fastest", measured, thesis)
    low, high = THESIS_RANGE
    text = f"{min(map(min, slopes)):.2f} to {max(map(max, slopes)):.2f} rad/s/V"
    yield compare("single lines", text, f"{low} to {high} rad/s/V")
    slowest = float(np.mean(slopes[0]))
    biased, target = slowest < 0.99 * fastest.value, "low-amplitude bias visible"
    yield compare("slowest set point", f"{slowest:.3f} rad/s/V", "lower", target, biased)
    constant = fitted["velocity_constant"]
    yield compare("motor following its command", constant, "trends towards 1.5 rad/s/V")
    mid, half_width = UNLOADED_DIFFERENCE
    thesis, met = f"{mid} ± {half_width} deg", abs(amplitude_loss.value - mid) <= half_width
    yield compare("amplitude difference, unloaded", amplitude_loss, thesis, "within", met)
    torque = max(float(np.abs(p.motion.torque).max()) for p in points)
    yield compare("largest torque of the bearing", f"{torque:.2f} N·m", "under 0.4 N·m")


@figures.figure(
    "Fig. 2.6: amplitude difference, unloaded",
    "Mean of the periods with 5th and 95th percentile; red: thesis 0.025 ± 0.015°.",
    axes=("rms motor velocity, rad/s", "amplitude difference, deg"),
    size=(7.2, 4.2),
)
def fig_2_6(axes: Axes, points: list[UnloadedPoint]) -> None:
    mid, half_width = UNLOADED_DIFFERENCE
    axes.axhspan(mid - half_width, mid + half_width, color=figures.RED, alpha=0.1, lw=0)
    axes.axhline(mid, color=figures.RED, lw=0.9, ls="--")
    for each in points:
        values = each.lag.amplitude_difference / DEGREE
        figures.draw_percentiles(
            axes, each.lag.rms_velocity, values, ms=5, color=figures.BLUE, capsize=3
        )
    axes.set_ylim(0.0, None)


@figures.figure(
    "Fig. 3.5: commanded and measured velocity",
    "Slowest set point above, fastest below; "
    "boxes: domains of the fits, black clockwise, grey counter-clockwise.",
    axes=("time, s", "velocity, rad/s", "velocity, rad/s"),
    size=(7.6, 5.8),
)
def fig_3_5(panels: list[Axes], pair: tuple[UnloadedPoint, UnloadedPoint], constant: float) -> None:
    for each, axes in zip(pair, panels, strict=True):
        dt, velocity = each.cut.dt, each.deceleration.velocity
        count = min(len(velocity), round(2.0 * each.cut.period / dt))
        t = dt * np.arange(count)
        expected = constant * each.deceleration.volts[:count]
        axes.plot(t, expected, "--", color=figures.RED, lw=1.1, label="command × constant")
        axes.plot(t, velocity[:count], color=figures.BLUE, lw=1.2, label="measured")
        quarters.draw_domain_boxes(
            axes, [d for d in each.fits if d.samples.stop <= count], dt, velocity
        )
        axes.margins(x=0.0)
    figures.legend(panels[0], "lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


@figures.figure(
    "Fig. 3.6: fits of the fastest set point",
    "One deceleration per direction.",
    axes=("voltage command, V", "velocity, rad/s", "velocity, rad/s"),
    size=(7.2, 5.8),
    share_x=False,
)
def fig_3_6(panels: list[Axes], point: UnloadedPoint) -> None:
    def text(line: Line) -> str:
        return f"{line.slope:.3f} rad/s/V, R² {line.r_squared:.5f}"

    quarters.draw_fits(
        panels, point.fits, (point.deceleration.volts, point.deceleration.velocity), text
    )


@figures.figure(
    "Fig. 3.7: velocity constants over velocity",
    "Mean, smallest and largest of the decelerations of each set point.",
    axes=("rms motor velocity, rad/s", "velocity constant, rad/s/V", "R²"),
    size=(7.2, 5.8),
    height_ratios=(1.6, 1.0),
)
def fig_3_7(panels: list[Axes], points: list[UnloadedPoint], constant: float) -> None:
    velocities = [each.deceleration.rms_velocity for each in points]
    quarters.draw_line_ranges(panels, velocities, [each.fits for each in points], 0.004)
    upper, fastest = panels[0], THESIS_FASTEST
    upper.axhline(constant, color=figures.BLUE, lw=0.9, label="following its command")
    upper.axhline(fastest, color=figures.RED, lw=0.9, ls="--", label="thesis, three fastest")
    figures.legend(upper, "lower right")


@figures.figure(
    "Fig. 3.8: torque of the bearing over the phase",
    "Means over periods and 15 ms; darker: faster.",
    axes=("phase of the oscillation, share of a period", "torque, N·m"),
)
def fig_3_8(axes: Axes, points: list[UnloadedPoint]) -> None:
    for each, colour in figures.shaded(points):
        torque = periods.mean_period(each.motion.torque, each.motion.cut)
        share = np.arange(len(torque)) / len(torque)
        axes.plot(share, uniform_filter1d(torque, 15, mode="wrap"), color=colour, lw=1.0)
    axes.axhline(0.0, color=figures.COUNTER, lw=0.6)
    for limit in (0.4, -0.4):
        axes.axhline(limit, color=figures.CLOCKWISE, lw=0.6, ls=":")
    axes.margins(x=0.0)
