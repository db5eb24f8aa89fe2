"""The WaveBot: its words, what trips it, and its part of the cycle."""

from rig.wavebot.check import check
from rig.wavebot.kind import KIND, control, observe
from rig.wavebot.state import Limits, Params, State, start
from rig.wavebot.words import (
    Command,
    LoadSense,
    PowerSense,
    Sense,
    Setpoints,
    WaveBotRow,
    WaveSense,
)

__all__ = [
    "KIND",
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
    "control",
    "observe",
    "start",
]
