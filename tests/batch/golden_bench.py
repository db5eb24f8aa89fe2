"""The golden runs of the bench: each loop of its drive, each correction of position, a brake
current, and the flap, as the loop decided them when stored.

Made anew, where a change is meant, by this program from the root of the tree:

    PYTHONPATH=.:tests:tests/rehearsal python tests/batch/golden_bench.py [KIND ...]
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from pathlib import Path

from rig_command import rig_here

GOLDEN = Path(__file__).resolve().parent / "golden"
MOVED = {  # what of each must have been used, and how far at least (V, A, rad)
    "bench_velocity": {"command.volts": 0.1, "shaft.angle": 0.1},
    "bench_torque": {"command.current": 0.1},
    "bench_online": {"command.volts": 0.1, "correction.angle": 0.002},
    "bench_instantaneous": {"command.volts": 0.1, "correction.angle": 0.004},
    "bench_brake": {"command.volts": 0.1, "command.brake_current": 0.2},
    "bench_decay": {"shaft.angle": 0.1, "command.clamp": 0.1},
    "bench_flap": {"command.current": 0.1, "shaft.angle": 0.05},
}


def record(kind: str) -> Path:
    return GOLDEN / f"{kind}.mcap"


def rehearsed(session: Path, runs: Path) -> Path:
    """The record of a session that was just run; its rows may be too few for results."""
    _, said, err = rig_here("bench", session, "--runs", runs, "--json")
    told = json.loads(said)
    assert told["status"] == "complete", err or said
    return Path(told["folder"]) / "run.mcap"


if __name__ == "__main__":
    for each in sys.argv[1:] or MOVED:
        with tempfile.TemporaryDirectory() as scratch:
            session = GOLDEN.relative_to(Path.cwd()) / f"{each}.yaml"  # paths that mean something
            shutil.copy(rehearsed(session, Path(scratch)), record(each))
        print(record(each), record(each).stat().st_size, "bytes")
