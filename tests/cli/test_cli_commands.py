"""The commands as a person or a script calls them: text, JSON, exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_here import rig
from made_once import made_once
from rehearsing import write_yaml
from rig_command import rig as process

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
SHORT = {
    "extends": str(CONFIGS / "campaigns" / "quick.yaml"),
    "tare": {"duration_s": 1},
    "start": {"set_point_s": 1, "lead_in_s": 6},
    "timing": {"settle_s": 1, "interval_s": 4},
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one finished run."""
    return made_once(tmp_path_factory, "cli_runs", one_run) / "runs"


def one_run(place: Path) -> None:
    """Run the rows of the quick campaign with one wave each."""
    folder = place / "runs"
    done = process("run", write_yaml(place / "quick.yaml", SHORT), "--runs", folder, "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["status"] == "complete"
    assert Path(report["folder"]).parent == folder
    assert all(Path(product).exists() for product in report["products"])
    last = report["last_row"]
    assert (last["safety.mode"], last["plan.phase"]) == ("STOP_0", "DONE")
    shown = json.loads(rig("show", report["folder"], "--json").stdout)
    assert report["optima"] == shown["optima"]
    assert {o["spring_rate_n_per_m"] for o in report["optima"]} == {490.9, -2763.0}
    for best in report["optima"]:
        (row,) = best["rows"]
        assert best["ki_n_per_m"] == (0.0, 4000.0, 4000.0, 0.0)[row]


def test_check_describes_the_planned_run() -> None:
    done = rig("check", CONFIGS / "campaigns" / "default.yaml")
    assert done.returncode == 0
    assert "66" in done.stdout
    report = json.loads(rig("check", CONFIGS / "campaigns" / "default.yaml", "--json").stdout)
    assert report["ok"]
    assert (report["rows"], report["wave_clock_s"], report["spring_moves"]) == (66, 1460.0, 1)


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_bad_campaign_is_refused_with_all_its_errors(command: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(
        f"name: bad\nrig: {CONFIGS / 'rigs' / 'wavebot.yaml'}\n"
        "sea: {kind: regular, amplitude_m: much, frequency_hz: 0.5}\n"
        "matrix:\n  list:\n    - {spring_n_per_m: 490.9, kp_n_s_per_m: 5, ki_n_per_m: 0}\n"
        "speed: 3\n"
    )
    done = process(command, path, *(["--runs", tmp_path / "runs"] if command == "run" else []))
    assert done.returncode == 2
    for line, key in ((3, "sea.amplitude_m"), (6, "matrix.list[0].kp_n_s_per_m"), (7, "speed")):
        assert f"bad.yaml:{line}: {key}: " in done.stdout
    assert not (tmp_path / "runs").exists()
    report = json.loads(rig(command, path, "--json").stdout)
    assert len(report["problems"]) == 3


def test_plant_file_is_checked_too(tmp_path: Path) -> None:
    (tmp_path / "plant.yaml").write_text(
        f"extends: {CONFIGS / 'plants' / 'wavebot.yaml'}\n"
        "body:\n  mass: {value: -3.0, unit: kg, source: test}\n"
    )
    (tmp_path / "campaign.yaml").write_text(
        f"name: bad\nrig: {CONFIGS / 'rigs' / 'wavebot.yaml'}\nplant: plant.yaml\n"
        "sea: {kind: calm}\n"
        "matrix: {list: [{spring_n_per_m: 490.9, kp_n_s_per_m: -5, ki_n_per_m: 0}]}\n"
    )
    done = rig("check", tmp_path / "campaign.yaml")
    assert done.returncode == 2
    assert "plant.yaml:3: body.mass.value: " in done.stdout


def test_a_wave_without_repeat_period_is_refused(tmp_path: Path) -> None:
    (tmp_path / "campaign.yaml").write_text(
        f"name: bad\nrig: {CONFIGS / 'rigs' / 'wavebot.yaml'}\n"
        "sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.28985507246}\n"
        "matrix: {list: [{spring_n_per_m: 490.9, kp_n_s_per_m: -5, ki_n_per_m: 0}]}\n"
    )
    done = rig("check", tmp_path / "campaign.yaml")
    assert done.returncode == 2
    assert "campaign.yaml:3: sea.frequency_hz: " in done.stdout
    assert "0.2898550724637681 Hz (repeats after 69 s)" in done.stdout


def test_runs_lists_the_run(runs: Path) -> None:
    assert "complete" in rig("runs", "--runs", runs).stdout
    (listed,) = json.loads(rig("runs", "--runs", runs, "--json").stdout)
    assert (listed["status"], listed["rows_done"], listed["rows_planned"]) == ("complete", 4, 4)
    assert json.loads(rig("runs", "--runs", runs / "none", "--json").stdout) == []


def test_show_prints_the_summary(runs: Path) -> None:
    done = process("show", "last", "--runs", runs)
    assert done.returncode == 0
    assert "4 of 4 rows" in done.stdout
    report: dict[str, Any] = json.loads(rig("show", "last", "--runs", runs, "--json").stdout)
    assert report["rows_done"] == 4
    assert json.loads(rig("show", "quick", "--runs", runs, "--json").stdout) == report
    missing = rig("show", "nothing", "--runs", runs)
    assert missing.returncode == 2
    assert "no such run" in missing.stderr


def test_plot_draws_fields_over_time(runs: Path, tmp_path: Path) -> None:
    picture = tmp_path / "x.png"
    command = ["plot", "last", "--runs", runs, "-f", "heave.estimate", "-r", "1", "-o", picture]
    done = rig(*command, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [str(picture)]
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    unknown = rig("plot", "last", "--runs", runs, "-f", "heave.estimat.position")
    assert unknown.returncode == 2
    assert "heave.estimate.position" in unknown.stderr


@pytest.mark.parametrize("fields", [[], ["-f", "time"]])
def test_an_unwritable_picture_is_an_error(runs: Path, fields: list[str]) -> None:
    command = ["plot", "last", "--runs", runs, *fields, "-o", "/nonexistent/x.png"]
    done = rig(*command)
    assert done.returncode == 2
    assert done.stderr.startswith("rig plot: ")
    assert "/nonexistent/x.png" in done.stderr
    as_json = rig(*command, "--json")
    assert as_json.returncode == 2
    report = json.loads(as_json.stdout)
    assert report["status"] == "bad input"
    assert "No such file or directory" in report["message"]


@pytest.mark.parametrize("command", ["show", "plot", "runs"])
def test_a_too_long_name_is_an_error(command: str, tmp_path: Path) -> None:
    name = "x" * 300
    runs = name if command == "runs" else tmp_path
    arguments = [command, *([] if command == "runs" else [name]), "--runs", runs]
    done = rig(*arguments)
    assert done.returncode == 2
    assert "File name too long" in done.stderr
    assert "Traceback" not in done.stderr
    report = json.loads(rig(*arguments, "--json").stdout)
    assert report["status"] == "bad input"


def test_a_folder_without_a_record_is_an_error(tmp_path: Path) -> None:
    for command in ("show", "plot"):
        done = rig(command, tmp_path, "--json")
        assert done.returncode == 2
        assert "no run.mcap" in json.loads(done.stdout)["message"]


def test_help_names_the_exit_codes() -> None:
    report = rig("run", "--help").stdout
    assert "tripped" in report
    assert "refused" in report
