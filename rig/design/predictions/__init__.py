"""What a campaign will do, before it does it: motion, power, margins, stability of every row.

Frequency domain, in the sea that the campaign names, on the simulated plant's own parameters;
`rig.design.predictions.steady` tells the method. Only what repeats with the sea is predicted:
what happens while waves build up, gains change or the stator moves comes on top.
"""

from __future__ import annotations

from rig.design.predictions.margins import Margin, tightest
from rig.design.predictions.prediction import Prediction, RowPrediction
from rig.design.predictions.row_prediction import RowPredictions
from rig.design.predictions.rows import predict
from rig.design.predictions.travel import Travel

__all__ = [
    "Margin",
    "Prediction",
    "RowPrediction",
    "RowPredictions",
    "Travel",
    "predict",
    "tightest",
]
