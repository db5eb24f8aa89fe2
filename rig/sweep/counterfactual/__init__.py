"""What other gains, another law, spring or drive would have given in the waves of a run."""

from rig.sweep.counterfactual.rows import (
    CounterfactualRow,
    Measured,
    Row,
    Span,
    counterfactual_rows,
    foretell,
)
from rig.sweep.counterfactual.waves import ELEVATION, FORCES, Waves

__all__ = [
    "ELEVATION",
    "FORCES",
    "CounterfactualRow",
    "Measured",
    "Row",
    "Span",
    "Waves",
    "counterfactual_rows",
    "foretell",
]
