"""Golden runs of the bench: each loop of its drive, each correction of position, a brake current,
and the flap, with the decisions of the loop when they were stored.

After an intended change, this program stores them again, from the root of the tree:

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
MIN_MOTION = {  # fields and their least maximum (V, A, rad)
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


def rehearse_session(session: Path, runs: Path) -> Path:
    """Rehearse a session and return its log; its rows may be too few for results."""
    _, out, err = rig_here("bench", session, "--runs", runs, "--json")
    report = json.loads(out)
    assert report["status"] == "complete", err or out
    return Path(report["folder"]) / "run.mcap"


if __name__ == "__main__":
    for kind in sys.argv[1:] or MIN_MOTION:
        with tempfile.TemporaryDirectory() as scratch:
            session = (
                GOLDEN.relative_to(Path.cwd()) / f"{kind}.yaml"
            )  # relative paths, valid on any host
            shutil.copy(rehearse_session(session, Path(scratch)), record(kind))
        print(record(kind), record(kind).stat().st_size, "bytes")
