"""`rig check FILE`."""

import json
from pathlib import Path

from rig.campaign import Report, check
from rig.cli import BAD_INPUT, OK
from rig.rehearsal.job import problems


def examine(path: Path) -> Report:
    """Check a campaign with all it stands on, the simulated plant included."""
    return check(path, also=problems)


def main(path: Path, *, as_json: bool) -> int:
    """Print the report; 0 if the campaign can be run."""
    report = examine(path)
    print(report.to_json() if as_json else report.text())
    return OK if report.ok else BAD_INPUT


def complain(report: Report, *, as_json: bool) -> int:
    """Say why a campaign cannot be run."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return BAD_INPUT
