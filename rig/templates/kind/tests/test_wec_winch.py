"""The whole kind: listed, checked, rehearsed, shown and replayed; its limits and its mistakes.

The closed form: with the law's spring K_l towards a goal g, against the plant's stiffness K, the
float rests at x = g K_l / (K_l + K), and the motor's force is K x.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from controllers.signals import Estimate

from wec_winch import law

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
LAW, PLANT = 4000.0, 1500.0  # N/m, as in the files


@pytest.fixture(name="lab")
def of_lab(tmp_path: Path) -> Path:
    """Return a folder with copies of the files, to edit."""
    for file in CONFIGS.glob("*.yaml"):
        shutil.copy(file, tmp_path)
    return tmp_path


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def rig(folder: Path, *arguments: object) -> tuple[int, str, str]:
    """Run `rig ARGUMENTS`; return exit code, standard output and error."""
    command = [sys.executable, "-P", "-m", "rig", *map(str, arguments)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=folder, timeout=300
    )
    return done.returncode, done.stdout, done.stderr


def test_law_is_a_spring_and_a_damper_to_the_goal() -> None:
    dt = 0.002
    params = law.params({"stiffness_n_per_m": (LAW,), "damping_n_s_per_m": (900.0,)}, 1.0, dt)
    state, motion = law.start(params), Estimate(0.01, -0.2, 0.0)
    for tick in range(1, 1001):
        state, demand = law.step(params, state, law.SetPoint(0.03), motion, 5.0, 0.0, dt)
        goal = min(0.03 * tick * dt, 0.03)
        expected = -LAW * (0.01 - goal) - 900.0 * -0.2 + 5.0
        assert demand.force == pytest.approx(expected, abs=1e-9)
    assert state.goal.value == 0.03


def test_kind_and_law_are_listed() -> None:
    listed = {
        each["name"]: each for each in json.loads(rig(CONFIGS, "kinds", "--json")[1])["kinds"]
    }
    assert listed["winch"]["package"] == "wec_winch"
    assert "problem" not in listed["winch"]
    laws = {each["name"]: each for each in json.loads(rig(CONFIGS, "laws", "--json")[1])["laws"]}
    assert [column["key"] for column in laws["winch"]["columns"]] == ["goal_m"]


def test_rehearsal_has_the_closed_form_and_its_replay_no_difference(lab: Path) -> None:
    code, text = rig(lab, "check", "holds.yaml")[:2]
    lines = text.splitlines()
    assert (code, lines[0], lines[-1]) == (0, "2 holds in 16.6 s", "the session can be run")
    code, out, err = rig(lab, "run", "holds.yaml", "--runs", "runs", "--json")
    assert code == 0, err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    for hold, goal in zip(report["holds"], (0.02, -0.03), strict=True):
        rest = goal * LAW / (LAW + PLANT)
        assert hold["position_m"] == pytest.approx(rest, abs=2e-5)  # two counts
        assert hold["force_n"] == pytest.approx(PLANT * rest, abs=1.0)

    run = report["folder"]
    code, out, _ = rig(lab, "show", run)
    assert (code, out.splitlines()[0][:6]) == (0, "row 0:")
    code, out, err = rig(lab, "plot", run)
    assert (code, out[:12], err) == (0, "no pictures:", "")
    code, out, err = rig(lab, "replay", run, "--json")
    assert code == 0, err
    assert json.loads(out)["same"] is True
    plan = json.loads((lab / run / "plan.json").read_text())
    assert {"number": 100, "name": "LINE_SLACK"}.items() <= plan["reasons"][-1].items()


def test_own_reason_stops_the_rig_and_is_named(lab: Path) -> None:
    edit(lab / "limits.yaml", "slack_stop_m: 0.1 ", "slack_stop_m: 0.01 ")
    code, out, err = rig(lab, "run", "holds.yaml", "--runs", "runs", "--json")
    assert code == 4, err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("fault", "LINE_SLACK")
    assert report["last_row"]["safety.reason"] == "LINE_SLACK"
    recorded = json.loads((lab / report["folder"] / "run.json").read_text())
    assert recorded["reason_text"] == "the line was slack"


def test_all_mistakes_in_files_are_listed_at_once(lab: Path) -> None:
    edit(lab / "limits.yaml", "current_peak_a: 20", "current_peak_a: 2000")
    edit(lab / "holds.yaml", "hold_s: 8", "hold_s: soon")
    code, out, _ = rig(lab, "check", "holds.yaml", "--json")
    assert code == 2
    assert [each["key"] for each in json.loads(out)["problems"]] == ["hold_s", "current_peak_a"]


def test_rig_without_wiring_is_refused_on_wires(lab: Path) -> None:
    code, _, err = rig(lab, "devices", "rig.yaml")
    assert code == 2
    assert "wiring" in err
