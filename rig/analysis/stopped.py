"""Where in its plan a run began to stop."""

from pathlib import Path

import numpy as np

from rig.runs import reader
from rig.safety import Reason
from rig.sequence import NO_ROW, Phase


def where_it_stopped(run: Path) -> str:
    """Time, row and phase of the first tick with a stop reason, in words.

    Empty where the record has none, and where the plan was walked to its end.
    """
    for block in reader.blocks(reader.source(run)):
        stopping = np.flatnonzero(block["safety.reason"] != Reason.NONE)
        if stopping.size == 0:
            continue
        tick = block[stopping[0]]
        if tick["safety.reason"] == Reason.PLAN_END:
            return ""
        phase = Phase(int(tick["plan.phase"])).name.lower().replace("_", "-")
        row = "before the first row" if tick["plan.row"] == NO_ROW else f"row {tick['plan.row']}"
        return f"stopped {tick['time']:.3f} s after its start, {row} ({phase})"
    return ""
