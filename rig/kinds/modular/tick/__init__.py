"""The loop's part of a modular rig: its composition, and the cycle composed from it."""

from rig.kinds.modular.tick.compose import compose, find_kind
from rig.kinds.modular.tick.composition import AxisPart, Composition, SensorPart
from rig.kinds.modular.tick.signals import SensorLimits, WaveSense

Sense = compose(Composition.default()).Sense
SENSE_IN_ROW: dict[str, str] = {}

__all__ = [
    "SENSE_IN_ROW",
    "AxisPart",
    "Composition",
    "Sense",
    "SensorLimits",
    "SensorPart",
    "WaveSense",
    "compose",
    "find_kind",
]
