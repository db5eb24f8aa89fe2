"""Torque tracking: rms error between demand and measurement, in open and closed loop."""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, mean
from rig.kinds.oswec_bench.products.periods import PeriodCut, rms, split_periods


class TrackingError(NamedTuple):
    """Results of one set point."""

    error: Estimate  # N*m, rms of demand minus measurement, interval by scatter of the periods
    demand_rms: float  # N*m, rms
    error_by_period: Floats  # N*m

    @property
    def relative(self) -> float:
        """Rms error over rms demand."""
        return self.error.value / self.demand_rms if self.demand_rms else float("nan")


def tracking_error(demand: Floats, measured: Floats, cut: PeriodCut) -> TrackingError:
    """Return the rms error of signals that are cut to their whole periods, N*m."""
    by_period = np.array([rms(piece) for piece in split_periods(demand - measured, cut)])
    mean_rms = mean(by_period, "N*m", f"rms by period, scatter of {cut.period_count} periods")
    return TrackingError(mean_rms._replace(value=rms(demand - measured)), rms(demand), by_period)


def closed_loop_improvement(
    open_loop: list[TrackingError], closed: list[TrackingError]
) -> Estimate:
    """Return closed over open loop rms error, the mean of pairs of set points by their scatter."""
    ratios = [c.error.value / o.error.value for o, c in zip(open_loop, closed, strict=True)]
    return mean(ratios, "1", f"closed over open loop, {len(ratios)} pairs by their scatter")
