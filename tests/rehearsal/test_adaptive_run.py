"""Adaptive campaigns end to end: the choices, their replay, and processes that die or hang."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig
from made_once import made_once
from rehearsing import CONFIGS, sweep_sequentially, write_yaml

from rig.analysis.choices import ChosenRow, choices_of
from rig.analysis.rows import COMPLETE, row_table
from rig.api.campaign_run import open_task
from rig.campaign import CheckReport
from rig.campaign.choosing import adaptive_record
from rig.cli.resume import with_recorded_start
from rig.config.shipped_files import title
from rig.execution.choosing_process import ERRORS
from rig.execution.replay import replay
from rig.realtime.sequence import NO_ROW
from rig.recording.runs import run_info

PRECISION_W, FIRST_ROWS, CANDIDATES = 0.2, 3, 8
DEADLINE_S = 60.0
# `rig` with a timeout of a choice that a test can wait for.
IMPATIENT = (
    "import rig.execution.choosing_process as p; p.TIMEOUT_S = 3.0; "
    "from rig.cli.app import app; app()"
)
WITHOUT_SKLEARN = (
    "import importlib.util as u; find = u.find_spec; "
    "u.find_spec = lambda name, *a: None if name == 'sklearn' else find(name, *a); "
    "from rig.cli.app import app; app()"
)


def test_a_list_without_the_library_keeps_the_title_of_a_campaign() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_SKLEARN, "campaigns"],
        capture_output=True, text=True, check=True, env=os.environ | {"COLUMNS": "300"},
    )  # fmt: skip
    (line,) = (each for each in done.stdout.splitlines() if each.startswith("adaptive "))
    shown = title(CONFIGS / "campaigns" / "adaptive.yaml")
    assert f"{shown} (adaptive: scikit-learn is not installed; " in line
    assert ".yaml:" not in line


def write_campaign(folder: Path, *, adaptive: Any = (), **keys: Any) -> Path:
    """Write a campaign of two springs with four candidates each."""
    gains = {"kp_n_s_per_m": [-1500, -2500], "ki_n_per_m": [0, 2000]}
    options = {"precision_w": PRECISION_W, "first_rows": FIRST_ROWS, "max_rows": CANDIDATES}
    options |= dict(adaptive)
    return write_yaml(
        folder / "chosen.yaml",
        {
            "name": "chosen",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "sea": {"kind": "regular", "amplitude_m": 0.127, "period_s": 2},
            "tare": {"duration_s": 1},
            "start": {"lead_in_s": 20},
            "timing": {"settle_s": 6, "interval_s": 12},
            "matrix": {"grid": [{"spring_n_per_m": each, **gains} for each in (490.9, -5715)]},
            "adaptive": options,
            **keys,
        },
    )


def only_run(folder: Path) -> Path:
    (run,) = (folder / "runs").iterdir()
    return Path(run)


def make_run(folder: Path, *options: str, **keys: Any) -> Path:
    done = rig("run", write_campaign(folder, **keys), "--runs", folder / "runs", *options)
    assert done.returncode == 0, done.stderr
    return only_run(folder)


def chosen_rows(run: Path) -> list[int]:
    return [each.row for each in choices_of(run_info(run)) if each.row != NO_ROW]


def last_choice(run: Path) -> ChosenRow:
    return choices_of(run_info(run))[-1]


def complete_rows(run: Path) -> list[int]:
    table = row_table(run)
    states = table["state"].values.tolist()
    return [r for r, s in zip(table["row"].values.tolist(), states, strict=True) if s == COMPLETE]


@pytest.fixture(scope="module")
def interpreted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = made_once(
        tmp_path_factory, "adaptive", lambda folder: make_run(folder, "--interpreted")
    )
    return only_run(place)


# --- the choices


def test_the_best_row_is_that_of_the_full_campaign(interpreted: Path, tmp_path: Path) -> None:
    full = sweep_sequentially(write_campaign(tmp_path))  # a sweep runs all candidates
    best = int(full["row"].values[np.argmin(full["power_dc"].values)])
    assert last_choice(interpreted).best == best
    assert last_choice(interpreted).regret <= PRECISION_W
    rows = chosen_rows(interpreted)
    assert len(rows) == len({*rows})
    assert FIRST_ROWS <= len(rows) < CANDIDATES
    assert complete_rows(interpreted) == sorted(rows)
    table = row_table(interpreted)
    for row in rows:  # another order, and moves between: the powers are those of the full campaign
        difference = float(table["power_dc"].values[row] - full["power_dc"].values[row])
        assert abs(difference) < 0.05, row


@pytest.mark.long
def test_compiled_and_interpreted_choose_the_same_and_replay_to_the_bit(
    interpreted: Path, tmp_path: Path
) -> None:
    compiled = make_run(tmp_path)
    assert choices_of(run_info(compiled)) == choices_of(run_info(interpreted))
    one, other = row_table(compiled), row_table(interpreted)
    for name in one.variables:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=str(name))
    assert replay(compiled).identical
    assert replay(interpreted).identical


@pytest.mark.long
def test_a_campaign_that_starts_from_nothing_covers_the_matrix_first(tmp_path: Path) -> None:
    run = make_run(tmp_path, adaptive={"start": "nothing"})
    choices = choices_of(run_info(run))
    assert [each.why.startswith("one of the first rows") for each in choices[:4]] == [
        True, True, True, False,
    ]  # fmt: skip
    assert last_choice(run).best in complete_rows(run)


def test_time_ends_a_campaign(tmp_path: Path) -> None:
    """A row takes 12 s, and 12 s more with a move: two rows fit into half a minute."""
    run = make_run(tmp_path, adaptive={"max_minutes": 0.5, "precision_w": 1e-6})
    assert "no time is left for another row" in last_choice(run).why
    assert len(complete_rows(run)) in (1, 2)


@pytest.mark.long
def test_the_most_rows_end_a_campaign(tmp_path: Path) -> None:
    run = make_run(tmp_path, adaptive={"max_rows": 4, "precision_w": 1e-9, "start": "nothing"})
    assert "4 rows, the most that the campaign allows" in last_choice(run).why
    assert len(complete_rows(run)) == 4


@pytest.mark.long
def test_all_candidates_can_be_measured(tmp_path: Path) -> None:
    run = make_run(tmp_path, adaptive={"first_rows": CANDIDATES})
    assert complete_rows(run) == list(range(CANDIDATES))
    assert last_choice(run).row == NO_ROW


# --- refusals before the run


def test_without_scikit_learn_the_run_does_not_start(tmp_path: Path) -> None:
    path, runs = write_campaign(tmp_path), tmp_path / "runs"
    for name in ("check", "run"):
        command = [sys.executable, "-c", WITHOUT_SKLEARN, name, str(path), "--runs", str(runs)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        message = "adaptive: scikit-learn is not installed; `pip install wec-rig[adaptive]` adds it"
        assert message in done.stdout + done.stderr
    assert not runs.exists()


def write_latching(folder: Path, **keys: Any) -> Path:
    """Write a campaign whose law has no linear form, and so no prediction."""
    gains = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
    hold = {"hold_stiffness_n_per_m": 1e6, "hold_damping_n_s_per_m": 1e4}
    rows = [{**gains, "latch_s": 0.1 * i} for i in range(4)]
    law = {"use": "latching", **hold}
    return write_campaign(folder, **{"law": law, "matrix": {"list": rows}} | keys)


def test_a_law_without_prediction_whose_loop_is_not_compiled_does_not_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_latching(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    done = rig("run", path, "--runs", tmp_path / "runs")
    assert done.returncode == 2, done.stdout
    checked = rig("check", path)
    assert checked.returncode == 2
    assert "the campaign cannot be run" in checked.stdout
    for shown in (done.stdout + done.stderr, checked.stdout + checked.stderr):
        assert "adaptive.start: there is no prediction of these rows" in shown
        assert "the law latching has no linear form; its loop with the plant" in shown
        assert "rig check --simulate compiles it" in shown
        assert "allowed nothing" in shown
    assert not (tmp_path / "runs").exists()


def test_a_law_without_prediction_starts_from_simulated_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_latching(tmp_path)
    checked = rig("check", path, "--simulate", "--json")
    assert checked.returncode == 0, checked.stdout
    simulated = [row["power_dc"] for row in json.loads(checked.stdout)["simulated"]]
    done = rig("run", path, "--runs", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    run = only_run(tmp_path)
    record = json.loads((run / "plan.json").read_text())["adaptive"]
    assert record["predicted"]["dc"] == simulated
    # Another host goes on with the run without compiling its loop first.
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    report = open_task(path).report
    assert isinstance(report, CheckReport)
    assert report.unpredicted
    resumed = with_recorded_start(report, run)
    assert resumed.refused == ()
    assert adaptive_record(resumed)["adaptive"]["predicted"] == record["predicted"]


def test_a_simulated_row_that_trips_is_the_reason_of_the_refusal(tmp_path: Path) -> None:
    gains = {"spring_n_per_m": 490.9, "latch_s": 0.1}
    rows = [{**gains, "kp_n_s_per_m": each} for each in (-2000, -1500, -10)]
    sea = {"kind": "regular", "amplitude_m": 0.34, "period_s": 2}
    path = write_latching(tmp_path, matrix={"list": rows}, sea=sea)
    checked = rig("check", path, "--simulate")
    assert checked.returncode == 2
    assert "the law latching has no linear form; simulated, the run stops with" in checked.stdout
    assert "1 of 3 rows not complete: 2" in checked.stdout


# --- processes that die or hang


class Running:
    """A rehearsal in a process of its own, and its choosing process."""

    def __init__(self, folder: Path, code: str = "", *options: str, **keys: Any) -> None:
        self.folder = folder
        path = write_campaign(folder, **keys)
        start = ["-c", code] if code else ["-m", "rig"]
        self.process = subprocess.Popen(
            [sys.executable, *start, "run", str(path), "--runs", str(folder / "runs"),
             "--interpreted", *options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.chooser = self.wait_for(self._find_chooser)

    def wait_for(self, look: Callable[[], Any]) -> Any:
        end = time.monotonic() + DEADLINE_S
        while not (found := look()):
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end
            time.sleep(0.05)
        return found

    def _find_chooser(self) -> int:
        children = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        for child in " ".join(path.read_text() for path in children).split():
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"rig.campaign.choosing" in command:
                return int(child)
        return 0

    def signal(self, number: int) -> None:
        os.kill(self.chooser, number)

    def request(self, *arguments: str) -> Any:
        return rig("request", *arguments, "--runs", self.folder / "runs", "--json")

    def phase(self) -> int | None:
        state = json.loads(self.request("state").stdout or "{}")
        return (state.get("row") or {}).get("plan.phase")

    def wait_for_choice(self) -> None:
        self.wait_for(lambda: self.phase() == 9)

    def end(self) -> tuple[int, str]:
        """Return exit code and standard error."""
        _, errors = self.process.communicate(timeout=120)
        return self.process.returncode, errors


@pytest.mark.long
def test_a_killed_choosing_process_ends_the_run_which_can_be_resumed(tmp_path: Path) -> None:
    """Killed at once, before the run listens."""
    running = Running(tmp_path)
    running.signal(signal.SIGKILL)
    code, errors = running.end()
    run = only_run(tmp_path)
    assert code == 1
    assert "no more rows are chosen: its process ended with -9; the run finishes" in errors
    assert run_info(run).status["status"] == "complete"
    assert last_choice(run).why.startswith("no more rows are chosen")
    done = rig("run", "--resume", run, "--runs", run.parent, "--interpreted")
    assert done.returncode == 0, done.stderr
    assert len(complete_rows(run)) >= FIRST_ROWS
    assert last_choice(run).regret <= PRECISION_W
    done = rig("run", "--resume", run, "--runs", run.parent, "--interpreted")
    assert done.returncode == 2
    assert "its rows were chosen to the end: the expected loss is within 0.2 W" in done.stderr


def test_a_choosing_process_that_hangs_is_ended(tmp_path: Path) -> None:
    running = Running(tmp_path, IMPATIENT)
    running.signal(signal.SIGSTOP)
    code, errors = running.end()
    assert code == 1
    assert "the choice took more than 3 s; the run finishes" in errors


def test_a_stop_during_a_choice_ends_the_run(tmp_path: Path) -> None:
    """The choosing process is stopped, so that the choice lasts; the command ends it, too."""
    running = Running(tmp_path)
    running.signal(signal.SIGSTOP)
    running.wait_for_choice()
    running.process.send_signal(signal.SIGINT)
    code, errors = running.end()
    assert code == 3, errors
    assert "no more rows are chosen" not in errors
    assert not Path(f"/proc/{running.chooser}").exists()


@pytest.mark.long
def test_a_person_chooses_and_the_campaign_goes_on(tmp_path: Path) -> None:
    running = Running(tmp_path)
    running.signal(signal.SIGSTOP)
    running.wait_for_choice()
    assert "row 8; allowed those from 0 to 7" in running.request("next_row", "row=8").stdout
    assert running.request("next_row").returncode == 2
    assert running.request("next_row", "row=2").returncode == 0
    running.signal(signal.SIGCONT)
    code, errors = running.end()
    assert code == 0, errors
    run = only_run(tmp_path)
    choices = choices_of(run_info(run))
    assert choices[0].row == 2
    assert choices[0].why.startswith("chosen by ")
    rows = chosen_rows(run)
    assert len(rows) == len({*rows})
    assert sorted(rows) == complete_rows(run)
    assert replay(run).identical


@pytest.mark.long
def test_a_killed_run_is_resumed_without_measuring_a_row_twice(tmp_path: Path) -> None:
    running = Running(tmp_path, adaptive={"first_rows": 5, "max_rows": 5})

    def two_chosen() -> bool:
        runs = tmp_path / "runs"
        text = next(runs.iterdir()) / "requests.jsonl"
        return text.exists() and text.read_text().count('"next_row"') >= 3

    running.wait_for(two_chosen)
    running.process.kill()
    running.process.communicate()
    end = time.monotonic() + DEADLINE_S
    while Path(f"/proc/{running.chooser}").exists():  # it ends by itself
        assert time.monotonic() < end
        time.sleep(0.1)
    run = only_run(tmp_path)
    before = complete_rows(run)
    assert 2 <= len(before) < 5
    done = rig("run", "--resume", run, "--runs", run.parent, "--interpreted")
    assert done.returncode == 0, done.stderr
    assert len(complete_rows(run)) == 5
    rows = chosen_rows(run)
    assert all(rows.count(row) == 1 for row in before)
    assert {*rows} == {*complete_rows(run)}
    assert (run / ERRORS).exists()
