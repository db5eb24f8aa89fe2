"""The losses session: bearing and seal behind the load cell, motor and gearbox before it."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import losses, periods
from rig.kinds.oswec_bench.products.drawing import (
    BLUE,
    RED,
    annotate_corner,
    prepare_axes,
    shade,
)
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats
from rig.kinds.oswec_bench.products.losses import (
    LossesBeforeCell,
    LossesBehindCell,
    MovingSamples,
)
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)

WINDOW = 0.03  # s, of the differentiator
_MAX_BEARING_TORQUE = 1.0  # N*m: a larger torque comes from a brake, not a bearing


class LossPoint(NamedTuple):
    """A set point with its samples at speed, by period."""

    point: SetpointData
    cut: PeriodCut
    groups: list[MovingSamples]

    @property
    def all_samples(self) -> MovingSamples:
        """All periods in one group."""
        return MovingSamples(*(np.concatenate(column) for column in zip(*self.groups, strict=True)))

    @property
    def is_unbraked(self) -> bool:
        """Whether only bearing and seal load the shaft."""
        return (
            float(np.median(np.abs(self.all_samples.torque))) < _MAX_BEARING_TORQUE
            or not self.has_brake_command
        )

    @property
    def has_brake_command(self) -> bool:
        """Whether the row commands the brake."""
        point = self.point
        return (
            point.plan_value("brake_current_a", 0.0)
            + point.plan_value("damping_n_m_s_per_rad", 0.0)
            > 0
        )


def analyse_session(session: SessionRun, torque_constant: Estimate | None = None) -> Result:
    """Analyse a run; ``torque_constant`` is the motor's own (N*m/A), from a torque constant
    session.

    By default the constant in use in the run is taken, and its error is not in the intervals.
    """
    points = [each for p in session.complete_points if (each := _loss_point(p)).groups]
    if not points:
        raise ValueError("no set point has a moving shaft")
    constant_in_use = torque_constant or Estimate(
        session.torque_constant, 0.0, "N*m/A", "in use in the run"
    )
    unbraked = [each for each in points if each.is_unbraked]
    behind = losses.losses_behind_cell(*_group_samples(unbraked)) if unbraked else None
    if behind is not None:
        zero_half_width = _zero_half_width(unbraked)
        behind = behind._replace(
            positive=_widen(behind.positive, zero_half_width),
            negative=_widen(behind.negative, zero_half_width),
        )
    before = losses.losses_before_cell(*_before_cell_inputs(points, constant_in_use))
    constants: dict[str, Estimate] = {}
    if behind is not None:
        constants |= {
            f"bearing_{name}": each
            for name, each in behind._asdict().items()
            if name != "drift_curvature"
        }
    constants |= {
        f"gearbox_{name}": each
        for name, each in before._asdict().items()
        if np.isfinite(each.value)
    }
    caption = (
        f"Current times {constant_in_use.value:.2f} N·m/A minus cell torque and inertia; "
        "red: the fit."
    )
    figures = [
        FigureSpec("losses_before", "Losses before the load cell over velocity",
                caption, (7.2, 4.6), partial(_draw_before, points, constant_in_use.value, before)),
    ]  # fmt: skip
    if behind is not None:
        behind_caption = "Some of the samples at speed, drift of the cell removed; red: the fit."
        title = "Losses behind the load cell over velocity"
        draw = partial(_draw_behind, unbraked, behind)
        figures.insert(0, FigureSpec("losses_behind", title, behind_caption, (7.2, 4.6), draw))
    return Result(
        (_table(points, constant_in_use.value),),
        _comparisons(behind, before),
        constants,
        tuple(figures),
        (
            "Losses before the cell use the torque constant "
            f"{format_estimate(constant_in_use)}, {constant_in_use.method}"
            + ("." if torque_constant else "; its error is not in their intervals."),
            "A difference between directions is separated from a drift of the cell's zero: it is "
            "constant over the run, and the zero is correct at the tare.",
        ),
    )


def _zero_half_width(points: list[LossPoint]) -> float:
    """Return the 95 % half width of the cell's zero, by its noise over the ticks of the tare."""
    noise = float(np.mean([np.std(np.diff(each.point.torque)) for each in points])) / np.sqrt(2.0)
    samples = max(1, min(each.point.tare_samples for each in points))
    return float(1.96 * noise / np.sqrt(samples))


def _widen(estimate: Estimate, half_width: float) -> Estimate:
    return estimate._replace(uncertainty=float(np.hypot(estimate.uncertainty, half_width)))


def _loss_point(point: SetpointData) -> LossPoint:
    cut = point.whole_periods()
    velocity = periods.velocity(periods.detrend(point.motor, cut), cut.dt, WINDOW)
    acceleration = periods.velocity(velocity, cut.dt, WINDOW)
    moving = losses.moving_samples(velocity, round(WINDOW / cut.dt))
    time = point.start_time + cut.dt * np.arange(len(velocity))
    torque, current = point.trim(point.torque, cut), point.trim(point.current, cut)
    columns: list[Floats] = [
        velocity,
        acceleration,
        torque,
        current,
        np.asarray(time, np.float64),
        moving,
    ]
    periods_by_signal = [periods.split_periods(each, cut) for each in columns]
    groups = [
        MovingSamples(*(each[moving] for each in signals))
        for *signals, moving in zip(*periods_by_signal, strict=True)
    ]
    return LossPoint(point, cut, [each for each in groups if len(each.velocity) > 20])


def _group_samples(points: list[LossPoint]) -> tuple[list[MovingSamples], str]:
    if len(points) >= losses.MIN_GROUPS:
        return [each.all_samples for each in points], "set points"
    return [group for each in points for group in each.groups], "periods"


def _before_cell_inputs(
    points: list[LossPoint], constant: Estimate
) -> tuple[list[MovingSamples], Estimate, str]:
    groups, kind = _group_samples(points)
    return groups, constant, kind


def _table(points: list[LossPoint], constant: float) -> Table:
    samples = [each.all_samples for each in points]
    motor_side_losses = [np.sign(w.velocity) * (constant * w.current - w.torque) for w in samples]
    return Table(
        "losses_points",
        "Losses by set point, mean at speed",
        (
            Column("row", "", tuple(each.point.row for each in points)),
            Column("amplitude", "deg", tuple(p.point.plan_value("amplitude_deg") for p in points)),
            Column(
                "brake current",
                "A",
                tuple(p.point.plan_value("brake_current_a", 0.0) for p in points),
            ),
            Column("rms velocity", "rad/s", tuple(periods.rms(w.velocity) for w in samples)),
            Column(
                "behind the cell, positive",
                "N*m",
                tuple(float(w.torque[w.velocity > 0.0].mean()) for w in samples),
            ),
            Column(
                "behind the cell, negative",
                "N*m",
                tuple(float(-w.torque[w.velocity < 0.0].mean()) for w in samples),
            ),
            Column(
                "before the cell", "N*m", tuple(float(each.mean()) for each in motor_side_losses)
            ),
        ),
    )


def _comparisons(
    behind: LossesBehindCell | None, before: LossesBeforeCell
) -> tuple[Comparison, ...]:
    comparisons = []
    if behind is not None:
        comparisons += [
            Comparison("behind the cell, clockwise (dry)", "mostly below 0.15 N·m", "",
                     format_estimate(behind.positive), None),
            Comparison("behind the cell, counter-clockwise (dry)", "larger than clockwise", "",
                     format_estimate(behind.negative), None),
            Comparison("behind the cell, viscous", "grows with speed", "",
                     format_estimate(behind.viscous), None),
            Comparison("drift of the cell's zero", "", "", format_estimate(behind.drift), None),
            Comparison("behind the cell, inertia", "", "", format_estimate(behind.inertia), None),
        ]  # fmt: skip
    share_known = np.isfinite(before.share.value)
    share = (
        format_estimate(before.share)
        if share_known
        else "included in the dry part: the load did not vary"
    )
    return (
        *comparisons,
        Comparison("before the cell, dry", "", "", format_estimate(before.dry), None),
        Comparison("before the cell, share of the load", "", "", share, None),
        Comparison("before the cell, viscous", "", "", format_estimate(before.viscous), None),
        Comparison("before the cell, inertia", "", "", format_estimate(before.inertia), None),
    )


def _draw_behind(points: list[LossPoint], losses_fit: LossesBehindCell, body: SubFigure) -> None:
    axes = prepare_axes(body, "velocity, rad/s", "torque of the load cell, N·m")
    end_time = max(float(each.all_samples.time.max()) for each in points)
    for i, each in enumerate(points):
        samples = each.all_samples
        decimated = slice(None, None, max(1, len(samples.velocity) // 1500))
        colour = shade(i + 1, len(points) + 1)
        torque = samples.torque - losses.zero_drift(losses_fit, samples.time, end_time)
        axes.plot(
            samples.velocity[decimated], torque[decimated], ".", ms=1.5, color=colour, alpha=0.35
        )
    max_velocity = max(float(np.abs(each.all_samples.velocity).max()) for each in points)
    x = np.linspace(0.0, max_velocity, 50)
    slope = losses_fit.viscous.value
    axes.plot(x, losses_fit.positive.value + slope * x, color=RED, lw=1.6)
    axes.plot(-x, -losses_fit.negative.value - slope * x, color=RED, lw=1.6)
    annotate_corner(
        axes,
        f"clockwise {format_estimate(losses_fit.positive)}\n"
        f"counter-clockwise {format_estimate(losses_fit.negative)}\n"
        f"viscous {format_estimate(losses_fit.viscous)}",
        "upper left",
    )


def _draw_before(
    points: list[LossPoint], constant: float, losses_fit: LossesBeforeCell, body: SubFigure
) -> None:
    axes = prepare_axes(
        body, "velocity, rad/s", "motor torque minus cell torque minus inertia, N·m"
    )
    inertia = losses_fit.inertia.value
    for i, each in enumerate(points):
        samples = each.all_samples
        loss = constant * samples.current - samples.torque - inertia * samples.acceleration
        edges = np.linspace(-np.abs(samples.velocity).max(), np.abs(samples.velocity).max(), 41)
        bins = np.digitize(samples.velocity, edges)
        filled_bins = [k for k in range(1, 41) if (bins == k).sum() > 10]
        x = [samples.velocity[bins == k].mean() for k in filled_bins]
        y = [loss[bins == k].mean() for k in filled_bins]
        axes.plot(x, y, ".", ms=4, color=shade(i + 1, len(points) + 1))
    axes.axhline(0.0, color=BLUE, lw=0.5)
    text = f"dry {format_estimate(losses_fit.dry)}\nviscous {format_estimate(losses_fit.viscous)}"
    if np.isfinite(losses_fit.share.value):
        text += f"\nshare of load {format_estimate(losses_fit.share)}"
    else:  # a single load has a single line
        max_velocity = max(float(np.abs(each.all_samples.velocity).max()) for each in points)
        line = losses_fit.dry.value + losses_fit.viscous.value * np.array([0.0, max_velocity])
        axes.plot([0.0, max_velocity], line, color=RED, lw=1.2)
        axes.plot([0.0, -max_velocity], -line, color=RED, lw=1.2)
    annotate_corner(axes, text, "upper left")
