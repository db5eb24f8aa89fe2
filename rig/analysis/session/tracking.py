"""How well torque follows its command: rms error, open loop against closed."""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.estimate import Estimate, Floats, mean
from rig.analysis.session.periods import Cut, pieces, rms


class Tracked(NamedTuple):
    """One set point."""

    error: Estimate  # N*m, rms of wanted less measured, by scatter of the periods
    wanted: float  # N*m, rms
    error_by_period: Floats  # N*m

    @property
    def share(self) -> float:
        """Error over what was wanted."""
        return self.error.value / self.wanted if self.wanted else float("nan")


def tracked(wanted: Floats, measured: Floats, of: Cut) -> Tracked:
    """Signals cut to their whole periods, N*m."""
    by_period = np.array([rms(piece) for piece in pieces(wanted - measured, of)])
    whole = mean(by_period, "N*m", f"rms by period, scatter of {of.whole} periods")
    return Tracked(whole._replace(value=rms(wanted - measured)), rms(wanted), by_period)


def improvement(open_loop: list[Tracked], closed: list[Tracked]) -> Estimate:
    """Closed over open loop rms error, mean of pairs of set points by their scatter."""
    ratios = [c.error.value / o.error.value for o, c in zip(open_loop, closed, strict=True)]
    return mean(ratios, "1", f"closed over open loop, {len(ratios)} pairs by their scatter")
