"""Counterfactual rows: power of other gains, laws, springs or drives in the waves of a run."""

from rig.sweep.counterfactual.rows import (
    AmplitudeRange,
    CounterfactualResult,
    MeasuredRun,
    RowPrediction,
    counterfactual_for_run,
    counterfactual_rows,
)
from rig.sweep.counterfactual.waves import ELEVATION, FORCES, RecoveredWaves

__all__ = [
    "ELEVATION",
    "FORCES",
    "AmplitudeRange",
    "CounterfactualResult",
    "MeasuredRun",
    "RecoveredWaves",
    "RowPrediction",
    "counterfactual_for_run",
    "counterfactual_rows",
]
