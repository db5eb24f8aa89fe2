"""The torque tracking session: measured torque and demand, in open and closed loop."""

from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products import tracking
from rig.kinds.oswec_bench.products.drawing import BLUE, RED, prepare_axes
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData, session_config
from rig.kinds.oswec_bench.products.result import (
    Column,
    Comparison,
    FigureSpec,
    Result,
    Table,
    format_estimate,
)
from rig.kinds.oswec_bench.products.tracking import TrackingError

CLOSED_LOOP = "closed loop"


class TrackingPoint(NamedTuple):
    """A set point with its demand and measurement."""

    point: SetpointData
    cut: PeriodCut
    demand: Floats  # N*m
    measured: Floats  # N*m
    tracking: TrackingError

    @property
    def setpoint(self) -> tuple[float, float]:
        """Requested torque amplitude (N*m) and period (s)."""
        return round(self.point.plan_value("torque_amplitude_n_m"), 3), round(self.point.period, 3)


def analyse_session(session: SessionRun, baseline: SessionRun | None = None) -> Result:
    """Analyse a run; ``baseline`` is a run of the same rows in open loop."""
    points = [_tracking_point(point) for point in session.complete_points]
    if not points:
        raise ValueError("no set point was measured completely")
    loop = _loop_name(session)
    baseline_points = (
        [_tracking_point(point) for point in baseline.complete_points]
        if baseline is not None
        else []
    )
    open_loop_points = {each.setpoint: each for each in baseline_points}
    pairs = [
        (each, open_loop_points[each.setpoint])
        for each in points
        if each.setpoint in open_loop_points
    ]
    constants: dict[str, Estimate] = {}
    if pairs:
        constants["tracking_improvement"] = tracking.closed_loop_improvement(
            [other.tracking for _, other in pairs],
            [closed_loop_point.tracking for closed_loop_point, _ in pairs],
        )
    return Result(
        (_table(points, open_loop_points, loop),),
        _comparisons(points, pairs, loop, constants.get("tracking_improvement")),
        constants,
        _figures(points, open_loop_points, loop),
        (f"Open loop: run {baseline.metadata.run}.",) if baseline is not None else (),
    )


def _loop_name(session: SessionRun) -> str:
    return str(session_config(session.metadata).get("control") or "open loop")


def _tracking_point(point: SetpointData) -> TrackingPoint:
    cut = point.whole_periods()
    demand, measured = (point.trim(each, cut) for each in (point.reference_torque, point.torque))
    return TrackingPoint(
        point, cut, demand, measured, tracking.tracking_error(demand, measured, cut)
    )


def _table(
    points: list[TrackingPoint],
    open_loop_points: dict[tuple[float, float], TrackingPoint],
    loop: str,
) -> Table:
    columns = [
        Column("row", "", tuple(each.point.row for each in points)),
        Column("torque amplitude", "N*m", tuple(each.setpoint[0] for each in points)),
        Column("period", "s", tuple(each.setpoint[1] for each in points)),
        Column(f"rms error, {loop}", "N*m", tuple(e.tracking.error.value for e in points)),
        Column(f"rms error, {loop} ±", "N*m", tuple(e.tracking.error.uncertainty for e in points)),
        Column("error / demand", "", tuple(each.tracking.relative for each in points)),
    ]
    if open_loop_points:
        open_loop_errors = [
            open_loop_points[e.setpoint].tracking.error.value
            if e.setpoint in open_loop_points
            else float("nan")
            for e in points
        ]
        ratio = [e.tracking.error.value / o for e, o in zip(points, open_loop_errors, strict=True)]
        columns += [
            Column("rms error, open loop", "N*m", tuple(open_loop_errors)),
            Column("closed / open", "", tuple(ratio)),
        ]
    return Table("torque_tracking", "Torque tracking by set point", tuple(columns))


def _comparisons(
    points: list[TrackingPoint],
    pairs: list[tuple[TrackingPoint, TrackingPoint]],
    loop: str,
    improvement: Estimate | None,
) -> tuple[Comparison, ...]:
    share = 100.0 * float(np.mean([each.tracking.relative for each in points]))
    comparisons = [
        Comparison(f"rms error, {loop}", "not built", "", f"{share:.1f} % of the demand", None)
    ]
    if pairs and improvement is not None:
        pooled_errors = [
            np.sqrt(np.mean([np.mean((e.demand - e.measured) ** 2) for e in side]))
            for side in zip(*pairs, strict=True)
        ]
        ratio = float(pooled_errors[0] / pooled_errors[1])
        comparisons.append(
            Comparison(
                "rms error, closed over open loop",
                "not built",
                "≤ 1/3",
                f"{ratio:.3f} pooled; {format_estimate(improvement)} by set points",
                ratio <= 1.0 / 3.0,
            )
        )
    return tuple(comparisons)


def _figures(
    points: list[TrackingPoint],
    open_loop_points: dict[tuple[float, float], TrackingPoint],
    loop: str,
) -> tuple[FigureSpec, ...]:
    largest = max(points, key=lambda each: each.setpoint[0])
    caption = f"Torque amplitude {largest.setpoint[0]:g} N·m, one period; below: the error."
    return (
        FigureSpec("torque_tracking", "Torque: demand and measurement", caption, (7.2, 5.6),
                partial(_draw_tracking, largest, open_loop_points.get(largest.setpoint), loop)),
    )  # fmt: skip


def _draw_tracking(
    point: TrackingPoint, open_loop_point: TrackingPoint | None, loop: str, body: SubFigure
) -> None:
    upper, lower = body.subplots(2, 1, sharex=True)
    upper = prepare_axes(body, "", "torque, N·m", upper)
    lower = prepare_axes(body, "time, s", "error, N·m", lower)
    count = round(point.cut.period / point.cut.dt)
    t = point.cut.dt * np.arange(count)
    upper.plot(t, point.demand[:count], "k--", lw=1.0, label="demand")
    curves = [(point, BLUE, loop)]
    if open_loop_point is not None and len(open_loop_point.measured) >= count:
        curves.insert(0, (open_loop_point, RED, "open loop"))
    for each, colour, name in curves:
        upper.plot(t, each.measured[:count], color=colour, lw=1.2, label=name)
        lower.plot(t, (each.demand - each.measured)[:count], color=colour, lw=1.0)
    upper.legend(frameon=False, fontsize=8)
    lower.margins(x=0.0)
