"""The torque constant session: torque per current of a locked driveline as it ramps up.

Section 3.1, Table 3.1 and Figures 3.1 to 3.3 of the OSWEC thesis: lines of measured torque over
current command where the torque grows, per oscillation and direction.

Gearbox friction hides the motor's own constant in these lines, but not in the hysteresis. At its
peak the torque T is constant while the current falls from I1, where friction F opposed the motor,
to I2, where friction opposes the back-off: K I1 = T + F and K I2 = T - F. The shaft has not moved
in between, so F is the same, whatever it depends on: K = 2 T / (I1 + I2).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.kinds.oswec_bench.products import figures, quarters
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, Line, format_number, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut, rms
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.quarters import FitDomain, Quarter
from rig.kinds.oswec_bench.products.result import Columns, Comparison, Result, compare, table

RAMP = (0.10, 0.97)
"""Domain of a ramp fit: shares of a quarter's largest torque."""
PLATEAU_END = (0.70, 0.95)
"""Start of the back-off: its line is extrapolated back to the peak's torque."""
PLATEAU = 0.1
"""Share of the back-off in which stiction certainly holds the torque."""
UNIT = "N*m/A"

# Values of the OSWEC thesis (University of Washington).
CURRENTS = (1.12, 1.40, 1.68, 1.96, 2.23, 2.51, 2.79, 3.35, 3.63, 3.91, 4.19, 4.47)
TORQUES = (17.31, 21.63, 25.97, 30.29, 34.62, 38.95, 43.28, 51.93, 56.26, 60.59, 64.91, 69.24)
"""Table 3.1, A and N*m: current amplitudes and nominal torques."""
THESIS_CONSTANT = 16.72  # N*m/A, mean of all ramps
THESIS_RANGE = (15.56, 18.42)  # N*m/A, smallest and largest
THESIS_SPREADS = (0.17, 0.11)  # clockwise and counter-clockwise, shares of their means
SPECIFIED_CONSTANT = 16.845  # N*m/A, 1.123 * 15


class RampFits(NamedTuple):
    """Fits of one set point."""

    ramp_up: list[FitDomain]  # torque grows
    motor_constants: Floats  # N*m/A, motor constant by half wave
    current_amplitude: float  # A
    rms_torque: float  # N*m
    hysteresis: float  # N*m, torque at half the current, falling less rising, mean

    def slopes(self, sign: int) -> Floats:
        """Return the constants of one direction (1: positive torque), N*m/A."""
        return np.array([d.line.slope for d in quarters.of_direction(self.ramp_up, sign)])


def fit_ramps(current: Floats, torque: Floats, cut: PeriodCut) -> RampFits:
    """Return the fitted domains of a set point; signals are cut to their whole periods."""
    parts = quarters.split_quarters(current, cut)
    growing = [each for each in parts if each.growing]
    falling = [each for each in parts if not each.growing]

    def fit(parts: list[Quarter], shares: tuple[float, float]) -> list[FitDomain]:
        domains = quarters.fit_domains(parts, current, torque, criterion=torque, shares=shares)
        return [each for each in domains if each.line.slope > 0.0]

    motor_constants = [_motor_constant(each, current, torque) for each in fit(falling, PLATEAU_END)]
    half_current_torques = []
    for each in parts:
        distance = np.abs(np.abs(current[each.samples]) - 0.5 * np.abs(current).max())
        sign = -each.sign if each.growing else each.sign
        half_current_torques.append(sign * torque[each.samples][int(np.argmin(distance))])
    return RampFits(
        fit(growing, RAMP),
        np.array(motor_constants),
        float(0.5 * np.ptp(current)),
        rms(torque),
        2.0 * float(np.mean(half_current_torques)) if half_current_torques else float("nan"),
    )


def _motor_constant(back_off: FitDomain, current: Floats, torque: Floats) -> float:
    """Return the motor's constant of one peak.

    The back-off line reaches the peak's torque at I2.
    """
    start, stop = back_off.quarter.samples.start, back_off.quarter.samples.stop
    peak = float(np.median(torque[start : start + max(1, round(PLATEAU * (stop - start)))]))
    release_current = (peak - back_off.line.intercept) / back_off.line.slope
    return 2.0 * peak / (float(current[start]) + release_current)


def torque_constants(points: list[RampFits]) -> dict[str, Estimate]:
    """Return means over set points (N*m/A), each with the interval by the scatter between them."""
    positive, negative = ([each.slopes(sign) for each in points] for sign in (1, -1))
    both = [np.concatenate(pair) for pair in zip(positive, negative, strict=True)]
    peaks = [each.motor_constants for each in points]
    ramp_up, peak = "lines of ramp-up", "at the peaks, where friction cancels"
    constants = {}
    for name, slopes_by_point, basis in (
        ("torque_constant", both, f"{ramp_up},"),
        ("torque_constant_positive", positive, f"{ramp_up},"),
        ("torque_constant_negative", negative, f"{ramp_up},"),
        ("torque_constant_motor", peaks, f"{peak};"),
    ):
        means = [slopes.mean() for slopes in slopes_by_point if len(slopes)]
        method = f"{basis} mean of {len(points)} set points, by their scatter"
        constants[name] = mean(means, UNIT, method).with_cell_error()
    return constants


class LockedPoint(NamedTuple):
    """A set point of the locked shaft."""

    point: SetpointData
    cut: PeriodCut
    current: Floats  # A, commanded
    torque: Floats  # N*m
    ramps: RampFits


def analyse_session(session: SessionRun) -> Result:
    """Analyse a run of the session."""
    points = [_locked_point(point) for point in session.complete_points]
    points = sorted((p for p in points if p.ramps.ramp_up), key=lambda each: each.ramps.rms_torque)
    if not points:
        raise ValueError("no set point has a ramp of torque")
    fitted = torque_constants([each.ramps for each in points])
    method = "torque at half the current, falling less rising; by scatter of set points"
    loop_width = mean([each.ramps.hysteresis for each in points], "N*m", method)
    title = "Table 3.1: torque constants of ramps by set point"
    return Result(
        (table("torque_constants", title, points, _columns(session.torque_constant)),),
        tuple(_comparisons(points, fitted, loop_width.value)),
        fitted | {"torque_hysteresis": loop_width},
        (
            fig_3_1(points[len(points) // 2]),
            fig_3_2(points[-1]),
            fig_3_3(points),
            hysteresis(points),
        ),
        (
            "Clockwise is positive torque. torque_constant is the thesis's, from ramps, and "
            "includes gearbox friction. torque_constant_motor excludes it, by the hysteresis.",
        ),
    )


def _locked_point(point: SetpointData) -> LockedPoint:
    cut = point.whole_periods()
    current, torque = cut.trim(point.current_command), cut.trim(point.torque)
    return LockedPoint(point, cut, current, torque, fit_ramps(current, torque, cut))


def _columns(constant_in_use: float) -> Columns[LockedPoint]:
    def thesis_nominal(each: LockedPoint) -> float:
        amplitude = each.ramps.current_amplitude
        return quarters.thesis_value(amplitude, CURRENTS, TORQUES)

    return {
        "row": lambda p: p.point.row,
        "current amplitude [A]": lambda p: p.ramps.current_amplitude,
        "torque, nominal (eq. 3.1) [N*m]": lambda p: (
            11.54 / 11.173 * 15.0 * p.ramps.current_amplitude
        ),
        "torque, thesis nominal [N*m]": thesis_nominal,
        "torque by constant in use [N*m]": lambda p: constant_in_use * p.ramps.current_amplitude,
        "rms torque [N*m]": lambda p: p.ramps.rms_torque,
        **quarters.direction_columns(UNIT, lambda p: p.ramps.ramp_up),
        "hysteresis [N*m]": lambda p: p.ramps.hysteresis,
    }


def _comparisons(
    points: list[LockedPoint], fitted: dict[str, Estimate], loop_width: float
) -> Iterator[Comparison]:
    mean_constant = fitted["torque_constant"]
    yield Comparison.of_constant("torque constant, mean of ramps", mean_constant, THESIS_CONSTANT)
    slopes = [np.concatenate([p.ramps.slopes(sign) for p in points]) for sign in (1, -1)]
    smallest, largest = min(map(min, slopes)), max(map(max, slopes))
    low, high = THESIS_RANGE
    spread = (largest - smallest) / mean_constant.value
    similar = bool(0.5 <= spread / ((high - low) / THESIS_CONSTANT) <= 2.0)
    ramps = f"{smallest:.2f} to {largest:.2f} N·m/A"
    thesis, target = f"{low} to {high} N·m/A", "spread of the same order"
    yield compare("single ramps", ramps, thesis, target, similar)
    yield compare("clockwise", fitted["torque_constant_positive"], "trends higher")
    yield compare("counter-clockwise", fitted["torque_constant_negative"])
    spreads = [np.ptp(each) / each.mean() for each in slopes]
    measured, thesis = (f"{100 * a:.0f} and {100 * b:.0f} %" for a, b in (spreads, THESIS_SPREADS))
    yield compare("spread, clockwise and counter-clockwise", measured, thesis)
    motor, specified = fitted["torque_constant_motor"], f"specified {SPECIFIED_CONSTANT} N·m/A"
    yield compare("motor's own constant, without friction", motor, specified)
    name = "torque on back-off minus torque on ramp, at half current"
    text = f"{format_number(loop_width, 3)} N·m"
    yield compare(name, text, "hysteresis", "visible", loop_width > 0.5)


@figures.figure(
    "Fig. 3.1: commanded and measured torque over time",
    lambda point: (
        f"Current amplitude {point.ramps.current_amplitude:.2f} A; "
        "boxes: domains of the fits, black clockwise, grey counter-clockwise."
    ),
    axes=("time, s", "torque, N·m"),
    size=(7.6, 4.4),
)
def fig_3_1(axes: Axes, point: LockedPoint) -> None:
    slope = np.mean([d.line.slope for d in point.ramps.ramp_up])
    t = point.cut.dt * np.arange(len(point.torque))
    axes.plot(
        t, slope * point.current, "--", color=figures.RED, lw=1.1, label="command × mean constant"
    )
    axes.plot(t, point.torque, color=figures.BLUE, lw=1.1, label="measured")
    quarters.draw_domain_boxes(axes, point.ramps.ramp_up, point.cut.dt, point.torque)
    axes.margins(x=0.0)
    figures.legend(axes, "lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


@figures.figure(
    "Fig. 3.2: fits of the largest set point",
    "One domain per direction, every fifth sample.",
    axes=("current command, A", "torque, N·m", "torque, N·m"),
    size=(7.2, 5.8),
    share_x=False,
)
def fig_3_2(panels: list[Axes], point: LockedPoint) -> None:
    def text(line: Line) -> str:
        return f"{line.slope:.2f} N·m/A, R² {line.r_squared:.4f}"

    signals = (point.current, point.torque)
    quarters.draw_fits(panels, point.ramps.ramp_up, signals, text, stride=5, ms=2.5, lw=1.6)


@figures.figure(
    "Fig. 3.3: torque constants over torque",
    "Mean, smallest and largest of the ramps of each set point.",
    axes=("rms torque, N·m", "torque constant, N·m/A", "R²"),
    size=(7.2, 5.8),
    height_ratios=(1.6, 1.0),
)
def fig_3_3(panels: list[Axes], points: list[LockedPoint]) -> None:
    torques = [each.ramps.rms_torque for each in points]
    quarters.draw_line_ranges(panels, torques, [each.ramps.ramp_up for each in points], 0.15)
    upper = panels[0]
    upper.axhline(THESIS_CONSTANT, color=figures.RED, lw=0.9, ls="--")
    upper.axhspan(*THESIS_RANGE, color=figures.RED, alpha=0.07, lw=0)
    figures.annotate_corner(upper, "red: thesis, mean and range", "lower right")
    figures.legend(upper, "upper right")


@figures.figure(
    "Torque over current: ramp and back-off",
    "All set points; darker: larger amplitude.",
    axes=("current command, A", "torque, N·m"),
    size=(7.2, 5.0),
)
def hysteresis(axes: Axes, points: list[LockedPoint]) -> None:
    for each, colour in figures.shaded(points):
        last = slice(each.cut.edges[-2] - each.cut.edges[0], None)
        axes.plot(each.current[last], each.torque[last], color=colour, lw=0.9)
