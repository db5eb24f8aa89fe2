"""A kind of rig in a distribution of its own: listed, checked, rehearsed, shown and replayed.

Its closed form: held by a spring K_h towards a goal g against the plant's stiffness K, the float
rests at x = g K_h / (K_h + K), and the drive's force is K x.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.support.fault_runs import free_port

PACKAGE = Path(__file__).parent / "plug_in"
ROOT = Path(__file__).parents[2]
HOLD, PLANT = 4000.0, 1500.0  # N/m

RIG = f"""\
name: winch of the lab
kind: winch
rate_hz: 500
realtime: best effort
limits: limits.yaml
plant: plant.yaml
drive_enable_timeout_s: 2
newtons_per_ampere: 40
metres_per_count: 1e-5
stiffness_n_per_m: {HOLD:g}
damping_n_s_per_m: 900
stop: {{duration_s: 1, ramp_s: 0.05, damping_n_s_per_m: 300}}
"""
LIMITS = """\
position_stop_m: 0.2
slack_stop_m: 0.1
velocity_stop_m_per_s: 1
current_peak_a: 20
lost_ticks_stop: 200
"""
FLOAT = f"{{mass_kg: 80, stiffness_n_per_m: {PLANT:g}, damping_n_s_per_m: 200}}\n"
WIRING = """\
extends: rig.yaml
wiring:
  can:
    interface: socketcand
    channel: can0
    bit_rate: 1000000
    options: {{host: 127.0.0.1, port: {port}, tcp_tune: true}}
    own_node: 127
    heartbeat_s: 0.05
    slow_divider: 20
    actuator_divider: 10
  motor:
    node: 6
    scaling: rated_current
    current_limit_a: 20
    command_deadline_ms: 250
    heartbeat_lost_ms: 300
    heartbeat_ms: 100
    follows: true
    mode_first: true
    deadlines: {{transition_s: 1.0, boot_s: 5.0, ramp_s: 2.0, stale_s: 0.2}}
    objects:
      {{abort_connection: 2, communication_error: 0, quick_stop_option: 2, fault_reaction_option: 0,
       encoder_increments: 20000, encoder_motor_revolutions: 1, gear_motor_revolutions: 1,
       gear_shaft_revolutions: 1, feed: 20000, feed_shaft_revolutions: 1, max_torque: 2000,
       max_current: 2000, position_low: null, position_high: null, rated_torque: 123490,
       interpolation_time: 2, interpolation_exponent: -3}}
"""
TASK = "name: holds\nrig: rig.yaml\nholds_m: [0.02, -0.03]\nhold_s: 8\n"


@pytest.fixture(name="lab")
def of_lab(tmp_path: Path) -> Path:
    """Return a folder with the files of a test, and the distribution as an installer leaves it."""
    info = tmp_path / "site" / "wec_winch-1.2.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Name: wec-winch\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[wec_rig.kinds]\nwinch = wec_winch\n")
    files = {"rig": RIG, "limits": LIMITS, "plant": FLOAT, "task": TASK}
    for name, text in files.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


def rig(lab: Path, *arguments: object) -> tuple[int, str, str]:
    """Run the command line in a process that finds the distribution."""
    paths = os.pathsep.join(map(str, (ROOT, lab / "site", PACKAGE)))
    done = subprocess.run(
        [sys.executable, "-P", "-m", "rig", *map(str, arguments)],
        capture_output=True, text=True, check=False, cwd=lab, timeout=120,
        env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def test_a_kind_is_one_package_outside_the_tree(lab: Path) -> None:
    code, out, _ = rig(lab, "kinds", "--json")
    listed: dict[str, Any] = {each["name"]: each for each in json.loads(out)["kinds"]}
    assert code == 0
    assert listed["winch"] == {
        "name": "winch",
        "origin": "wec-winch 1.2",
        "package": "wec_winch",
        "summary": "A winch that holds a float at one height after the other: a kind of rig "
        "outside the tree.",
    }
    assert {"wavebot", "oswec bench"} <= set(listed)

    assert rig(lab, "check", "task.yaml")[:2] == (0, "2 holds in 16.6 s\n")
    code, out, err = rig(lab, "run", "task.yaml", "--runs", "runs", "--json")
    assert code == 0, err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    for hold, goal in zip(report["holds"], (0.02, -0.03), strict=True):
        rest = goal * HOLD / (HOLD + PLANT)
        assert hold["position_m"] == pytest.approx(rest, abs=2e-5)  # two counts
        assert hold["force_n"] == pytest.approx(PLANT * rest, abs=1.0)

    run = report["folder"]
    code, out, _ = rig(lab, "show", run)
    assert (code, out.splitlines()[0][:6]) == (0, "row 0:")
    code, out, err = rig(lab, "replay", run, "--json")
    assert code == 0, err
    assert json.loads(out)["same"] is True
    row = json.loads((lab / run / "plan.json").read_text())
    assert {"number": 100, "name": "LINE_SLACK"}.items() <= row["reasons"][-1].items()


def test_its_own_reason_stops_the_rig_and_is_named(lab: Path) -> None:
    (lab / "limits.yaml").write_text(LIMITS.replace("slack_stop_m: 0.1", "slack_stop_m: 0.01"))
    code, out, err = rig(lab, "run", "task.yaml", "--runs", "runs", "--json")
    assert code == 4, err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("fault", "LINE_SLACK")
    assert report["last_row"]["safety.reason"] == "LINE_SLACK"
    code, out, _ = rig(lab, "runs", "--runs", "runs", "--json")
    assert json.loads((lab / report["folder"] / "run.json").read_text())["reason_text"] == (
        "the line of the winch was slack"
    )


def test_all_problems_of_its_files_are_listed_at_once(lab: Path) -> None:
    (lab / "limits.yaml").write_text(LIMITS.replace("current_peak_a: 20", "current_peak_a: 2000"))
    (lab / "task.yaml").write_text(TASK.replace("hold_s: 8", "hold_s: soon"))
    code, out, _ = rig(lab, "check", "task.yaml", "--json")
    problems = json.loads(out)["problems"]
    assert code == 2
    assert [each["key"] for each in problems] == ["hold_s", "current_peak_a"]
    (lab / "rig.yaml").write_text(RIG.replace("kind: winch", "kind: wintch"))
    code, out, _ = rig(lab, "devices", "rig.yaml")
    assert code == 2


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
    write_kind(lab, "winch", "another_winch")
    text = (PACKAGE / "wec_winch" / "tick.py").read_text().replace("= 100", "= 60")
    write_kind(lab, "low", "low_numbers", text)
    problems = listed_problems(lab)
    assert problems["bare_kind"] == "the kind of rig bare_kind has no module bare_kind.tick"
    assert "broken_kind/tick.py:1: ModuleNotFoundError" in problems["broken_kind"]
    assert "low_numbers has no module low_numbers.config" in problems["low_numbers"]
    for package in ("wec_winch", "another_winch"):
        assert "two distributions register the kind of rig 'winch'" in problems[package]
        assert "wec-winch 1.2 (wec_winch)" in problems[package]
    assert (problems["rig.kinds.wavebot"], problems["rig.kinds.oswec_bench"]) == ("", "")
    code, out, err = rig(lab, "check", "task.yaml", "--json")
    assert (code, err) == (2, "")
    assert "two distributions register the kind of rig 'winch'" in out


def test_number_of_a_reason_below_100_is_refused(lab: Path) -> None:
    """The distribution's own package, with another number, comes first on the path."""
    for file in (PACKAGE / "wec_winch").rglob("*.py"):
        target = lab / "site" / file.relative_to(PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(file.read_text().replace("LINE_SLACK = 100", "LINE_SLACK = 60"))
    assert listed_problems(lab)["wec_winch"] == (
        "wec_winch.tick: reason 60 LINE_SLACK has a number of this distribution; allowed 100 .. 255"
    )


def test_kind_that_raises_while_it_is_composed_breaks_no_other(lab: Path) -> None:
    for file in (PACKAGE / "wec_winch").rglob("*.py"):
        target = lab / "site" / file.relative_to(PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(file.read_text().replace("    return KIND\n", "    return 1 / 0\n"))
    problem = listed_problems(lab)["wec_winch"]
    assert problem.startswith("wec_winch.tick: ")
    assert problem.endswith("ZeroDivisionError: division by zero")


def test_size_of_log_rows_needs_no_room_but_the_tick() -> None:
    """Every run asks for it before it starts."""
    program = (
        "import sys; from rig.kinds import row_types; assert len(row_types()) >= 2; "
        "print([name for name in ('numpy', 'pydantic', 'matplotlib') if name in sys.modules])"
    )
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "[]\n"


@pytest.mark.realtime
def test_it_runs_on_its_wires_with_emulated_devices(lab: Path) -> None:
    """One drive on an emulated CAN bus; the float rests where it rests in the rehearsal."""
    (lab / "wired.yaml").write_text(WIRING.format(port=free_port()))
    (lab / "task.yaml").write_text("name: hold\nrig: rig.yaml\nholds_m: [0.02]\nhold_s: 3\n")
    code, out, err = rig(lab, "run", "task.yaml", "--rig", "wired.yaml", "--sim", "--json")
    assert code == 0, err
    report = json.loads(out)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    assert json.loads((lab / report["folder"] / "run.json").read_text())["mode"] == "hil"
    (hold,) = report["holds"]
    assert hold["position_m"] == pytest.approx(0.02 * HOLD / (HOLD + PLANT), rel=0.02)
    code, out, err = rig(lab, "replay", report["folder"], "--json")
    assert json.loads(out)["same"] is True, err
