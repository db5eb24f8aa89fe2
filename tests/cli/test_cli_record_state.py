"""A record that lacks ticks never counts as complete, whatever the ending of its run."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
from command_here import CompletedCommand, rig

from rig.analysis.rows import INCOMPLETE
from rig.realtime.sequence import Phase
from rig.recording.runs import mcap_file, open_run
from rig.recording.runs.mcap_file import scan

ROWS = synthetic.default_rows()[:6]
SHAPE = synthetic.Shape(lead_in=20, settle=10, periods=2, tail=5)


def run_of(folder: Path, lost: slice = slice(0)) -> Path:
    """Write a run whose record lacks these ticks of row 2."""
    data = synthetic.run_rows(ROWS, SHAPE)
    inside = np.flatnonzero((data["plan.row"] == 2) & (data["plan.phase"] == Phase.MEASURE))
    plan = synthetic.plan_json(ROWS, SHAPE)
    return synthetic.write_run(folder, np.delete(data, inside[lost]), plan, ticks=len(data))


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    """A complete run whose record lacks 100 of the 400 ticks of row 2."""
    return run_of(tmp_path / "torn", slice(50, 150))


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    return run_of(tmp_path / "sound")


def json_of(done: CompletedCommand) -> Any:
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_show_prints_the_state_of_the_record(torn: Path, sound: Path) -> None:
    text = rig("show", torn).stdout
    assert "Complete: the plan ran to its end" in text
    assert "Record incomplete: 100 of " in text
    assert "5 of 6 rows complete" in text
    assert "row 2 is withheld: 100 of 400 ticks missing from the record" in text
    record = json_of(rig("show", torn, "--json"))["record"]
    assert (record["state"], record["lost"]) == ("incomplete", 100)
    ((first, last),) = record["missing_ticks"]
    assert last == first + 99
    assert "Record complete." in rig("show", sound).stdout
    assert json_of(rig("show", sound, "--json"))["record"]["state"] == "complete"
    assert open_run(torn, "tick").attrs["record"].startswith("incomplete: 100 of ")
    assert open_run(sound, "tick").attrs["record"] == "complete"
    assert open_run(torn, "tick").attrs["status"] == "complete"


def test_a_damaged_chunk_is_named(sound: Path) -> None:
    path = sound / "run.mcap"
    chunk = scan(path).chunks[1]
    with path.open("r+b") as file:
        file.seek(chunk.offset + chunk.length // 2)
        byte = file.read(1)[0]
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte ^ 0x10]))
    rows = sum(len(block) for block in mcap_file.blocks(scan(path)))
    lost = len(synthetic.run_rows(ROWS, SHAPE)) - rows
    done = rig("show", sound)
    assert done.returncode == 0
    assert f"Record damaged: {lost} of " in done.stdout
    assert f"chunk at byte {chunk.offset}" in done.stdout
    assert rig("plot", sound).returncode == 0
    recovered = rig("recover", sound, "--json")
    assert recovered.returncode == 5
    assert json.loads(recovered.stdout)["output"] == str(sound / "run.recovered.mcap")
    assert (
        "recovered" in json.loads(rig("runs", "--runs", sound.parent, "--json").stdout)[0]["record"]
    )


def test_incomplete_rows_have_means_only_with_the_option(torn: Path) -> None:
    assert rig("plot", torn).returncode == 0
    with (torn / "rows.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["state"] == INCOMPLETE for row in table] == [
        False,
        False,
        True,
        False,
        False,
        False,
    ]
    assert (table[2]["power_dc [W]"], table[2]["ticks_missing"]) == ("nan", "100")
    assert (table[2]["samples"], table[2]["ticks_expected"]) == ("300", "400")
    best = json_of(rig("show", torn, "--json"))["optima"]
    assert all(2 not in optimum["rows"] for optimum in best)
    assert rig("plot", torn, "--incomplete-rows").returncode == 0
    with (torn / "rows.csv").open() as file:
        assert float(list(csv.DictReader(file))[2]["power_dc [W]"])
    assert json_of(rig("show", torn, "--incomplete-rows", "--json"))["rows_done"] == 6


def test_a_comparison_leaves_out_an_incomplete_row_and_warns(torn: Path, sound: Path) -> None:
    done = rig("compare", sound, torn)
    assert done.returncode == 0, done.stderr
    assert "torn: row 2 withheld, ticks missing from the record" in done.stderr
    assert len(json_of(rig("compare", sound, torn, "--json"))["pairs"]) == 5
    with_incomplete = rig("compare", sound, torn, "--incomplete-rows", "--json")
    assert len(json_of(with_incomplete)["pairs"]) == 6
