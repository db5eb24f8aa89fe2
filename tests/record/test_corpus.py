"""Runs and files of version 1.0, one of each kind of rig: today's program reads and uses them.

`tests/corpus` is extended, never written anew: its files are what a laboratory has on its disk.
"""

from __future__ import annotations

import csv
import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest
from rig_command import rig_here
from test_resumed_run import cut

from rig.analysis.rows import COMPLETE, row_table
from rig.execution.replay import replay
from rig.recording.runs import open_run, run_info

CORPUS = Path(__file__).parents[1] / "corpus"
RUNS = sorted((CORPUS / "runs").iterdir())
TASKS = sorted(
    path for end in ("campaign", "session") for path in CORPUS.glob(f"files/*_{end}.yaml")
)
HOST = {"code", "python", "host", "duration_s", "timing"}  # of a summary: not of the run's data


@pytest.fixture
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of a stored run, which tests may change."""
    stored: Path = request.param
    return Path(shutil.copytree(stored, tmp_path / "runs" / stored.name))


each_run = pytest.mark.parametrize("run", RUNS, ids=lambda path: path.name, indirect=True)


def assert_same(found: Any, stored: Any, where: str = "") -> None:
    """Every stored value is there, numbers to nine digits; further keys may have been added."""
    if isinstance(stored, dict):
        for key, value in stored.items():
            if key not in HOST:
                assert key in found, f"{where}.{key}"
                assert_same(found[key], value, f"{where}.{key}")
    elif isinstance(stored, list):
        assert len(found) == len(stored), where
        for number, (one, other) in enumerate(zip(found, stored, strict=True)):
            assert_same(one, other, f"{where}[{number}]")
    elif isinstance(stored, float) and not isinstance(found, str):
        assert found == pytest.approx(stored, rel=1e-9, abs=1e-12), where
    else:
        assert found == stored, where


def test_the_corpus_has_each_kind_of_rig() -> None:
    kinds = {run_info(run).kind for run in RUNS}
    assert kinds == {"wavebot", "modular", "oswec bench"}
    assert {"hil", "ethercat", "law"} | kinds & {"wavebot", "modular"} <= {
        path.stem.partition("_")[0] for path in TASKS
    }


@each_run
def test_every_tick_is_read(run: Path) -> None:
    ticks = json.loads((run / "run.json").read_text())["ticks"]
    data = open_run(run)
    assert data.sizes["time"] == ticks
    assert all(len(each.attrs.get("units", "1")) > 0 for each in data.data_vars.values())


@each_run
def test_the_summary_is_the_stored_one(run: Path) -> None:
    stored = json.loads((run / "shown.json").read_text())
    code, out, error = rig_here("show", run, "--json")
    found = json.loads(out)
    if "message" in stored:  # a session too short for its analysis: how it ended, and that
        assert code == 2
        ended, reason = (
            text["message"].partition(f"{run.name}: ")[::2] for text in (found, stored)
        )
        assert ended[1] == reason[1]
        assert found["message"].splitlines()[:2] == stored["message"].splitlines()[:2]
        return
    assert code == 0, error
    assert_same(found, stored)


@each_run
def test_the_row_table_is_the_stored_one(run: Path) -> None:
    if not (run / "rows.csv").exists():
        pytest.skip("a session of the bench has results in place of a row table")
    with (run / "rows.csv").open() as file:
        stored = list(csv.DictReader(file))
    (run / "rows.csv").unlink()
    assert rig_here("plot", run)[0] == 0
    with (run / "rows.csv").open() as file:
        found = list(csv.DictReader(file))
    assert len(found) == len(stored)
    for one, other in zip(found, stored, strict=True):
        for heading, text in other.items():
            try:
                number = float(text)
            except ValueError:
                assert one[heading] == text, heading
            else:
                same = float(one[heading])
                assert same == pytest.approx(number, rel=1e-6, abs=1e-9) or math.isnan(number)


@each_run
@pytest.mark.parametrize("form", ["csv", "netcdf"])
def test_it_is_exported(run: Path, form: str, tmp_path: Path) -> None:
    out = tmp_path / f"out.{'nc' if form == 'netcdf' else form}"
    code, _, error = rig_here("export", run, "--as", form, "-o", out)
    assert code == 0, error
    assert out.stat().st_size > 10_000


@each_run
def test_its_replay_is_the_same_to_the_bit(run: Path) -> None:
    report = replay(run, interpreted=True)
    assert report.identical, report.differences[:3]
    assert report.ticks > 1000


@pytest.mark.parametrize("run", [RUNS[0], RUNS[1]], ids=lambda path: path.name, indirect=True)
def test_a_killed_run_is_resumed(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = run.name.partition("_")[2]
    files = shutil.copytree(CORPUS / "files", tmp_path / "files")
    monkeypatch.chdir(files)  # the records name their files relative to it
    status = json.loads((run / "run.json").read_text())
    cut(run, 0.5e-3 * status["ticks"])
    options = ("--resume", run, "--accept-changes", "--interpreted", "--runs", run.parent)
    code, out, error = rig_here("run", files / f"{name}_campaign.yaml", *options)
    assert code == 0, out + error
    table = row_table(run)
    assert table["state"].values.tolist() == [COMPLETE, COMPLETE]


@pytest.mark.parametrize("task", TASKS, ids=lambda path: path.stem)
def test_its_files_are_sound(task: Path) -> None:
    code, out, error = rig_here("check", task)
    assert code == 0, out + error


def test_its_table_of_faults_is_sound() -> None:
    code, out, error = rig_here(
        "faults", CORPUS / "files" / "wired" / "faults" / "wavebot.yaml", "--list"
    )
    assert code == 0, out + error
