"""What the loop runs of a bench: its signals, its checks, its reasons, its part of the cycle."""

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
