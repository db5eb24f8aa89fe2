"""The torque tracking session: rms error between demand and measurement, open and closed loop."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from rig.kinds.oswec_bench.products import figures
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut, rms, split_periods
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData, session_config
from rig.kinds.oswec_bench.products.result import Columns, Comparison, Result, compare, table


class TrackingError(NamedTuple):
    """Results of one set point."""

    error: Estimate  # N*m, rms of demand minus measurement, interval by scatter of the periods
    demand_rms: float  # N*m, rms

    @property
    def relative(self) -> float:
        """Rms error over rms demand."""
        return self.error.value / self.demand_rms if self.demand_rms else float("nan")


def tracking_error(demand: Floats, measured: Floats, cut: PeriodCut) -> TrackingError:
    """Return the rms error of signals that are cut to their whole periods, N*m."""
    by_period = np.array([rms(piece) for piece in split_periods(demand - measured, cut)])
    mean_rms = mean(by_period, "N*m", f"rms by period, scatter of {cut.period_count} periods")
    return TrackingError(mean_rms._replace(value=rms(demand - measured)), rms(demand))


def closed_loop_improvement(
    open_loop: list[TrackingError], closed: list[TrackingError]
) -> Estimate:
    """Return closed over open loop rms error, the mean of pairs of set points by their scatter."""
    ratios = [c.error.value / o.error.value for o, c in zip(open_loop, closed, strict=True)]
    return mean(ratios, "1", f"closed over open loop, {len(ratios)} pairs by their scatter")


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


Pair = tuple[TrackingPoint, TrackingPoint | None]
"""A set point and the one of the same demand in open loop, if there is one."""


def analyse_session(session: SessionRun, baseline: SessionRun | None = None) -> Result:
    """Analyse a run; ``baseline`` is a run of the same rows in open loop."""
    points = [_tracking_point(point) for point in session.complete_points]
    if not points:
        raise ValueError("no set point was measured completely")
    loop = str(session_config(session.metadata).get("control") or "open loop")
    baseline_points = [_tracking_point(p) for p in baseline.complete_points] if baseline else []
    open_loop = {each.setpoint: each for each in baseline_points}
    rows = [(each, open_loop.get(each.setpoint)) for each in points]
    method = f"rms error over rms demand, mean of {len(points)} set points, by their scatter"
    error = mean([each.tracking.relative for each in points], "1", method)
    text = f"{100.0 * error.value:.1f} % of the demand"
    comparisons = [compare(f"rms error, {loop}", text, "not built")]
    constants: dict[str, Estimate] = {}
    if pairs := [(each, other) for each, other in rows if other is not None]:
        improvement = closed_loop_improvement(
            [other.tracking for _, other in pairs], [each.tracking for each, _ in pairs]
        )
        constants["tracking_improvement"] = improvement
        comparisons.append(_compare_loops(pairs, improvement))
    columns = _columns(loop, with_baseline=bool(open_loop))
    return Result(
        (table("torque_tracking", "Torque tracking by set point", rows, columns),),
        tuple(comparisons),
        constants,
        (torque_tracking(max(rows, key=lambda row: row[0].setpoint[0]), loop),),
        (f"Open loop: run {baseline.metadata.run}.",) if baseline is not None else (),
        errors={"torque_error": error},
    )


def _tracking_point(point: SetpointData) -> TrackingPoint:
    cut = point.whole_periods()
    demand, measured = cut.trim(point.reference_torque), cut.trim(point.torque)
    return TrackingPoint(point, cut, demand, measured, tracking_error(demand, measured, cut))


def _columns(loop: str, *, with_baseline: bool) -> Columns[Pair]:
    columns: dict[str, Callable[[Pair], Any]] = {
        "row": lambda r: r[0].point.row,
        "torque amplitude [N*m]": lambda r: r[0].setpoint[0],
        "period [s]": lambda r: r[0].setpoint[1],
        f"rms error, {loop} [N*m]": lambda r: r[0].tracking.error,
        "error / demand": lambda r: r[0].tracking.relative,
    }
    if with_baseline:

        def open_loop_error(row: Pair) -> float:
            return row[1].tracking.error.value if row[1] is not None else float("nan")

        columns |= {
            "rms error, open loop [N*m]": open_loop_error,
            "closed / open": lambda r: r[0].tracking.error.value / open_loop_error(r),
        }
    return columns


def _compare_loops(
    pairs: list[tuple[TrackingPoint, TrackingPoint]], improvement: Estimate
) -> Comparison:
    closed_error, open_error = (
        np.sqrt(np.mean([np.mean((e.demand - e.measured) ** 2) for e in side]))
        for side in zip(*pairs, strict=True)
    )
    ratio = float(closed_error / open_error)
    measured = f"{ratio:.3f} pooled; {improvement} by set points"
    name = "rms error, closed over open loop"
    return compare(name, measured, "not built", "≤ 1/3", ratio <= 1.0 / 3.0)


@figures.figure(
    "Torque: demand and measurement",
    lambda row, loop: f"Torque amplitude {row[0].setpoint[0]:g} N·m, one period; below: the error.",
    axes=("time, s", "torque, N·m", "error, N·m"),
    size=(7.2, 5.6),
)
def torque_tracking(panels: list[Axes], row: Pair, loop: str) -> None:
    upper, lower = panels
    point, open_loop_point = row
    count = round(point.cut.period / point.cut.dt)
    t = point.cut.dt * np.arange(count)
    upper.plot(t, point.demand[:count], "k--", lw=1.0, label="demand")
    curves = [(point, figures.BLUE, loop)]
    if open_loop_point is not None and len(open_loop_point.measured) >= count:
        curves.insert(0, (open_loop_point, figures.RED, "open loop"))
    for each, colour, name in curves:
        upper.plot(t, each.measured[:count], color=colour, lw=1.2, label=name)
        lower.plot(t, (each.demand - each.measured)[:count], color=colour, lw=1.0)
    figures.legend(upper)
    lower.margins(x=0.0)
