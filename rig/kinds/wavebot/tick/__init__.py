"""The loop's part of a WaveBot: signals, checks, reasons of a stop, its part of the cycle."""

from rig.kinds.wavebot.tick.check import check
from rig.kinds.wavebot.tick.cycle import KIND, find_kind, kind_with_law, observe
from rig.kinds.wavebot.tick.signals import (
    SENSE_IN_ROW,
    Command,
    LoadSense,
    PowerSense,
    Sense,
    Setpoints,
    WaveBotRow,
    WaveSense,
)
from rig.kinds.wavebot.tick.state import Limits, Params, State

__all__ = [
    "KIND",
    "SENSE_IN_ROW",
    "Command",
    "Limits",
    "LoadSense",
    "Params",
    "PowerSense",
    "Sense",
    "Setpoints",
    "State",
    "WaveBotRow",
    "WaveSense",
    "check",
    "find_kind",
    "kind_with_law",
    "observe",
]
