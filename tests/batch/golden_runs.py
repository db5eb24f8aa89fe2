"""Golden runs of the WaveBot: a few seconds of each kind, with the loop's decisions when stored.

Replaying them detects an unintended change of the cycle's bits. After an intended change, this
program stores them again, from the root of the tree:

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

from rig.recording.runs import RunInfo, run_info

GOLDEN = Path(__file__).resolve().parent / "golden"
IN_WAVES = ("cots", "custom")  # by the gain matrix, with both drives
KINDS = (*IN_WAVES, "open_loop", "hoist", "calibration")
MOST_BYTES = 810_000  # of one record; sensor readings in motion hardly compress


def record(kind: str) -> Path:
    return GOLDEN / f"{kind}.mcap"


def facts_without_limits(*removed: str) -> Callable[..., RunInfo]:
    """Return `rig.recording.runs.facts` for records without limits of these name prefixes."""

    def facts_found(*given: Any) -> RunInfo:
        run_facts = run_info(*given)
        limits = {
            section: {k: v for k, v in values.items() if not f"{section}.{k}".startswith(removed)}
            for section, values in run_facts.config["limits"].items()
        }
        assert limits != run_facts.config["limits"]
        remaining = {section: values for section, values in limits.items() if values}
        return run_facts._replace(config=run_facts.config | {"limits": remaining})

    return facts_found


def store_run(kind: str) -> None:
    """Rehearse the campaign of a kind and store its log."""
    with tempfile.TemporaryDirectory() as scratch:
        campaign = (
            GOLDEN.relative_to(Path.cwd()) / f"{kind}.yaml"
        )  # relative paths, valid on any host
        ended = rehearse(campaign, Path(scratch))
        assert ended.outcome.status == "complete", ended.outcome
        shutil.copy(ended.folder / "run.mcap", record(kind))


if __name__ == "__main__":
    for kind in sys.argv[1:] or KINDS:
        store_run(kind)
        print(record(kind), record(kind).stat().st_size, "bytes")
