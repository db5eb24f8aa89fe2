"""The OSWEC bench as a kind of rig: its signals, its trip checks and its part of the cycle."""

from rig.kinds.oswec_bench.tick.cycle import KIND, find_kind
from rig.kinds.oswec_bench.tick.signals import (
    SENSE_IN_ROW,
    BenchRow,
    BrakeSense,
    Command,
    EncoderSense,
    Flume,
    Sense,
    ServoSense,
    Setpoints,
    WrenchSense,
)
from rig.kinds.oswec_bench.tick.state import Limits, LoadLimits, Params

__all__ = [
    "KIND",
    "SENSE_IN_ROW",
    "BenchRow",
    "BrakeSense",
    "Command",
    "EncoderSense",
    "Flume",
    "Limits",
    "LoadLimits",
    "Params",
    "Sense",
    "ServoSense",
    "Setpoints",
    "WrenchSense",
    "find_kind",
]
