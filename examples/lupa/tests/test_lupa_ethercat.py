"""LUPA on its emulated EtherCAT segment: powers are those of the rehearsal."""

import csv
import json
import os
from pathlib import Path
from typing import Any

import pytest
from rig.emulation.cable import cable_problem
from test_lupa_numbers import LUPA
from test_lupa_runs import write_campaign

pytestmark = [pytest.mark.realtime, pytest.mark.long]
# A command arrives a tick later than in the rehearsal, and the host loses ticks now and then.
SHARE, LEAST_W = 0.02, 0.02


def wired(folder: Path, bodies: str) -> Path:
    """Write the rig with an interface of its own."""
    path, base = folder / "wired.yaml", LUPA / "rigs" / f"{bodies}_ethercat.yaml"
    path.write_text(f"extends: {base}\nwiring: {{ethercat: {{interface: lup{os.getpid()}}}}}\n")
    return path


def powers(runs: Path) -> list[dict[str, float]]:
    (file,) = runs.glob("*/rows.csv")
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    names = ("power_belt", "power_shaft")
    return [{name: float(row[f"{name} [W]"]) for name in names} for row in rows]


@pytest.mark.parametrize("bodies", ["one_body", "two_body"])
def test_powers_are_those_of_the_rehearsal(rig: Any, tmp_path: Path, bodies: str) -> None:
    pytest.importorskip("pysoem")
    if problem := cable_problem("luptest"):
        pytest.skip(problem)
    timing = {"settle_s": 5, "interval_s": 10}
    path = write_campaign(tmp_path, bodies, start={"lead_in_s": 15}, timing=timing)
    done = rig("run", path, "--rig", wired(tmp_path, bodies), "--runs", tmp_path / "wired", "--sim")
    assert done.returncode == 0, done.stdout + done.stderr
    rehearsed = rig("run", path, "--runs", tmp_path / "rehearsed")
    assert rehearsed.returncode == 0, rehearsed.stdout + rehearsed.stderr
    pairs = zip(powers(tmp_path / "wired"), powers(tmp_path / "rehearsed"), strict=True)
    for row, (ours, expected) in enumerate(pairs):
        for name in expected:
            allowed = max(SHARE * abs(expected[name]), LEAST_W)
            print(f"row {row} {name}: {expected[name]:.3f} W rehearsed, {ours[name]:.3f} W")
            assert abs(ours[name] - expected[name]) <= allowed, (row, name)
    (report,) = (tmp_path / "wired").glob("*/wires.json")
    frames = json.loads(report.read_text())["ethercat"]
    assert frames["wrong_working_counter"] == frames["foreign"] == 0
