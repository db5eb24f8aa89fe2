"""The golden runs: a few seconds of each kind of drive, as the loop decided them when stored.

A change of the cycle's bits that is not meant is found by replaying them. Where it is meant, they
are made anew by this program, from the root of the tree:

    PYTHONPATH=.:tests:tests/rehearsal python tests/batch/golden_runs.py
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from rehearsing import run

GOLDEN = Path(__file__).resolve().parent / "golden"
KINDS = ("cots", "custom")
MOST_BYTES = 400_000  # of one record: sensed numbers in motion hardly compress


def record(kind: str) -> Path:
    return GOLDEN / f"{kind}.mcap"


def make(kind: str) -> None:
    """Rehearse the campaign of a kind and store its one file."""
    with tempfile.TemporaryDirectory() as scratch:
        campaign = GOLDEN.relative_to(Path.cwd()) / f"{kind}.yaml"  # paths that mean something
        ended = run(campaign, Path(scratch))
        assert ended.outcome.status == "complete", ended.outcome
        shutil.copy(ended.folder / "run.mcap", record(kind))


if __name__ == "__main__":
    for each in KINDS:
        make(each)
        print(record(each), record(each).stat().st_size, "bytes")
