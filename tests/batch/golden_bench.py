"""The golden runs of the bench: each loop of its drive, as the loop decided them when stored.

Made anew, where a change is meant, by this program from the root of the tree:

    PYTHONPATH=.:tests:tests/rehearsal python tests/batch/golden_bench.py
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

from rig_command import rig_here

GOLDEN = Path(__file__).resolve().parent / "golden"
LOOPS = ("bench_velocity", "bench_torque")


def record(loop: str) -> Path:
    return GOLDEN / f"{loop}.mcap"


def rehearsed(session: Path, runs: Path) -> Path:
    """The record of a session that was just run."""
    code, said, err = rig_here("bench", session, "--runs", runs, "--json")
    assert code == 0, err or said
    return Path(json.loads(said)["folder"]) / "run.mcap"


if __name__ == "__main__":
    for each in LOOPS:
        with tempfile.TemporaryDirectory() as scratch:
            session = GOLDEN.relative_to(Path.cwd()) / f"{each}.yaml"  # paths that mean something
            shutil.copy(rehearsed(session, Path(scratch)), record(each))
        print(record(each), record(each).stat().st_size, "bytes")
