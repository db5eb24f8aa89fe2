"""Runs whose supervisor is gone, made of whole ones."""

from __future__ import annotations

import json
from pathlib import Path


def kill(run: Path, share: float) -> None:
    """Leave of a run what a kill leaves: this share of its record, and a status without an end."""
    record = (run / "run.mcap").read_bytes()
    (run / "run.mcap").unlink()
    (run / "run.mcap.part1").write_bytes(record[: int(len(record) * share)])
    status = json.loads((run / "run.json").read_text())
    kept = ("run", "mode", "kind", "campaign", "rows_planned", "started_utc")
    begun = {key: status[key] for key in kept} | {"status": "running", "pid": 1, "pid_started": 0}
    (run / "run.json").write_text(json.dumps(begun))
