"""What other gains, another law, spring or drive would have given in the waves of a run."""

from rig.sweep.counterfactual.rows import Foretold, Measured, Row, Span, foretell, foretold
from rig.sweep.counterfactual.waves import ELEVATION, FORCES, Waves

__all__ = [
    "ELEVATION",
    "FORCES",
    "Foretold",
    "Measured",
    "Row",
    "Span",
    "Waves",
    "foretell",
    "foretold",
]
