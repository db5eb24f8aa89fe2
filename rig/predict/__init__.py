"""What a campaign will do, before it does it: motion, power, margins, stability of every row.

Frequency domain, in the sea that the campaign names, on the simulated plant's own parameters;
`rig.predict.steady` tells the method. Only what repeats with the sea is predicted: what happens
while waves build up, gains change or the stator moves comes on top.
"""

from __future__ import annotations

from rig.predict.foreseen import Foreseen
from rig.predict.margins import Margin, tightest
from rig.predict.rows import predict
from rig.predict.travel import Travel
from rig.predict.words import Prediction, RowPrediction

__all__ = [
    "Foreseen",
    "Margin",
    "Prediction",
    "RowPrediction",
    "Travel",
    "predict",
    "tightest",
]
