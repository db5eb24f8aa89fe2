"""A kind of rig in a distribution of its own: the package that `rig new kind` writes.

Its own tests, which a laboratory gets with it, check, rehearse, show and replay it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from lab_package import in_lab, rig, write_project

from benchmarks.support.free_port import free_port


@pytest.fixture(name="lab")
def of_lab(tmp_path: Path) -> Path:
    """Return a folder with the package of a new kind, and its distribution."""
    write_project(tmp_path)
    return tmp_path


def test_a_kind_is_one_package_outside_the_tree(lab: Path) -> None:
    code, out, _ = rig(lab, "kinds", "--json")
    listed = {each["name"]: each for each in json.loads(out)["kinds"]}
    assert code == 0
    assert listed["lift"] == {
        "name": "lift",
        "origin": "wec-lift 1.2",
        "package": "wec_lift",
        "summary": "The rig lift: a motor keeps a float at one height after the other.",
    }
    assert {"wavebot", "oswec bench"} <= set(listed)


@pytest.mark.long
def test_its_own_tests_pass(lab: Path) -> None:
    """They check, run, show and replay it, against a closed form and with mistakes."""
    done = in_lab(lab, "pytest", lab / "wec_lift", "-c", lab / "wec_lift" / "pyproject.toml")
    assert done.returncode == 0, done.stdout
    assert "winch" not in done.stdout


def test_its_rig_file_with_an_unknown_kind_is_refused(lab: Path) -> None:
    file = lab / "wec_lift" / "configs" / "rig.yaml"
    file.write_text(file.read_text().replace("kind: lift", "kind: lifft"))
    problem = "kind: 'lifft' is not known; allowed wavebot, oswec bench, modular, lift"
    for arguments in (("devices", file), ("check", file.parent / "holds.yaml")):
        code, out, err = rig(lab, *arguments)
        assert (code, out) == (2, "")
        assert problem in err


def test_its_task_is_not_swept(lab: Path) -> None:
    """The kind has neither the room `campaign` nor `simulation`; the command names the first."""
    code, _, err = rig(lab, "sweep", lab / "wec_lift" / "configs" / "holds.yaml")
    assert code == 2
    assert "campaigns of kind lift cannot be swept" in err
    assert "wec_lift has no module wec_lift.campaign" in err


def write_kind(lab: Path, name: str, package: str, source: str = "") -> None:
    """Add a distribution with a kind."""
    info = lab / "site" / f"{package}-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Name: {package}\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(f"[wec_rig.kinds]\n{name} = {package}\n")
    (lab / "site" / package).mkdir()
    (lab / "site" / package / "__init__.py").write_text('"""A kind."""\n')
    if source:
        (lab / "site" / package / "tick.py").write_text(source)


def listed_problems(lab: Path) -> dict[str, str]:
    code, out, _ = rig(lab, "kinds", "--json")
    assert code == 0
    return {each["package"]: each.get("problem", "") for each in json.loads(out)["kinds"]}


def test_unusable_kinds_are_listed_with_the_reason(lab: Path) -> None:
    write_kind(lab, "bare", "bare_kind")
    write_kind(lab, "broken", "broken_kind", "import nothing_of_this_name\n")
    write_kind(lab, "lift", "another_lift")
    text = (lab / "wec_lift" / "wec_lift" / "tick.py").read_text().replace("= 100", "= 60")
    write_kind(lab, "low", "low_numbers", text)
    problems = listed_problems(lab)
    rooms = ("tick", "config", "recorded", "hardware", "rehearsal", "tasks", "display", "products")
    assert problems["bare_kind"] == "; ".join(
        f"the kind of rig bare_kind has no module bare_kind.{room}" for room in rooms
    )
    assert "broken_kind/tick.py:1: ModuleNotFoundError" in problems["broken_kind"]
    assert "low_numbers has no module low_numbers.config; " in problems["low_numbers"]
    assert "low_numbers.tick: reason 60 LINE_SLACK has a number" in problems["low_numbers"]
    for package in ("wec_lift", "another_lift"):
        assert "two distributions register the kind of rig 'lift'" in problems[package]
        assert "wec-lift 1.2 (wec_lift)" in problems[package]
    assert (problems["rig.kinds.wavebot"], problems["rig.kinds.oswec_bench"]) == ("", "")
    code, out, err = rig(lab, "check", "wec_lift/configs/holds.yaml", "--json")
    assert (code, err) == (2, "")
    assert "two distributions register the kind of rig 'lift'" in out


def edit_tick(lab: Path, old: str, new: str) -> None:
    """Replace a text in the room `tick` of the kind."""
    file = lab / "wec_lift" / "wec_lift" / "tick.py"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))


def test_number_of_a_reason_below_100_is_refused(lab: Path) -> None:
    edit_tick(lab, "LINE_SLACK = 100", "LINE_SLACK = 60")
    assert listed_problems(lab)["wec_lift"] == (
        "wec_lift.tick: reason 60 LINE_SLACK has a number of this distribution; allowed 100 .. 255"
    )


def test_kind_that_raises_while_it_is_composed_breaks_no_other(lab: Path) -> None:
    edit_tick(lab, "    return KIND\n", "    return 1 / 0\n")
    problem = listed_problems(lab)["wec_lift"]
    assert problem.startswith("wec_lift.tick: ")
    assert problem.endswith("ZeroDivisionError: division by zero")


def test_size_of_log_rows_needs_no_room_but_the_tick() -> None:
    """Every run asks for it before it starts."""
    program = (
        "import sys; from rig.kinds.registry import row_types; assert len(row_types()) >= 2; "
        "print([name for name in ('numpy', 'pydantic', 'matplotlib') if name in sys.modules])"
    )
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "[]\n"


@pytest.mark.realtime
def test_it_runs_on_its_wires_with_emulated_devices(lab: Path) -> None:
    """One drive on an emulated CAN bus; the float rests where spring and law balance."""
    configs = lab / "wec_lift" / "configs"
    wired = configs / "rig_wired.yaml"
    wired.write_text(wired.read_text().replace("29551", str(free_port())))
    task = configs / "one.yaml"
    task.write_text("name: hold\nrig: rig.yaml\nholds_m: [0.02]\nhold_s: 3\n")
    code, out, err = rig(lab, "run", task, "--rig", wired, "--sim", "--json")
    assert code == 0, out + err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    assert json.loads((lab / report["folder"] / "run.json").read_text())["mode"] == "hil"
    (hold,) = report["holds"]
    assert hold["position_m"] == pytest.approx(0.02 * 4000.0 / (4000.0 + 1500.0), rel=0.02)
    code, out, err = rig(lab, "replay", report["folder"], "--json")
    assert json.loads(out)["same"] is True, err
