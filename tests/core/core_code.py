"""The compiled ticks of the kinds of rig in the tests of the core."""

from __future__ import annotations

from pathlib import Path

import core_kinds
from core_runs import DT

from rig.compilation.tick_code import compile_tick
from rig.compilation.tick_source import tick_source
from rig.kinds.oswec_bench import tick as bench
from rig.kinds.wavebot import tick as wavebot
from rig.realtime import cycle

PACKAGES = {
    core_kinds.BENCH: core_kinds.__name__,
    bench.find_kind(""): bench.__name__,
    wavebot.find_kind(""): wavebot.__name__,
}


def code_of(kind: cycle.Kind, params: cycle.Params) -> Path:
    """Return the folder of a kind's code; KeyError for a kind that a test has changed."""
    return compile_tick(tick_source(PACKAGES[kind], "", params, DT))
