"""The golden runs of the WaveBot: a few seconds of each kind, as the loop decided them when stored.

A change of the cycle's bits that is not meant is found by replaying them. Where it is meant, they
are made anew by this program, from the root of the tree:

    PYTHONPATH=.:tests:tests/rehearsal python tests/batch/golden_runs.py [KIND ...]
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rehearsing import rehearse

from rig.recording.runs import run_info
from rig.recording.runs.folder import RunInfo

GOLDEN = Path(__file__).resolve().parent / "golden"
IN_WAVES = ("cots", "custom")  # by the gain matrix, with either drive
KINDS = (*IN_WAVES, "open_loop", "hoist", "calibration")
MOST_BYTES = 810_000  # of one record: sensed numbers in motion hardly compress


def record(kind: str) -> Path:
    return GOLDEN / f"{kind}.mcap"


def facts_without(*later: str) -> Callable[..., RunInfo]:
    """`rig.recording.runs.facts` of records that lack the limits whose dotted names begin so."""

    def found(*given: Any) -> RunInfo:
        known = run_info(*given)
        limits = {
            section: {k: v for k, v in values.items() if not f"{section}.{k}".startswith(later)}
            for section, values in known.config["limits"].items()
        }
        assert limits != known.config["limits"]
        kept = {section: values for section, values in limits.items() if values}
        return known._replace(config=known.config | {"limits": kept})

    return found


def make(kind: str) -> None:
    """Rehearse the campaign of a kind and store the record of it."""
    with tempfile.TemporaryDirectory() as scratch:
        campaign = GOLDEN.relative_to(Path.cwd()) / f"{kind}.yaml"  # paths that mean something
        ended = rehearse(campaign, Path(scratch))
        assert ended.outcome.status == "complete", ended.outcome
        shutil.copy(ended.folder / "run.mcap", record(kind))


if __name__ == "__main__":
    for each in sys.argv[1:] or KINDS:
        make(each)
        print(record(each), record(each).stat().st_size, "bytes")
