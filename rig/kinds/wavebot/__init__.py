"""The WaveBot as a kind of rig: its signals, its checks, and its part of the cycle."""

from rig.kinds.wavebot.check import check
from rig.kinds.wavebot.kind import KIND, control, observe
from rig.kinds.wavebot.signals import (
    Command,
    LoadSense,
    PowerSense,
    Sense,
    Setpoints,
    WaveBotRow,
    WaveSense,
)
from rig.kinds.wavebot.state import Limits, Params, State, start

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
