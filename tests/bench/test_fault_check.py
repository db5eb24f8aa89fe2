"""Check of a table of faults before any device starts: `rig faults TABLE --list` and the run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_here import rig

from benchmarks.support.fault_rigs import RIGS
from rig.execution.emulated_rig import check_task
from rig.execution.fault_check import check_faults, known_faults
from rig.execution.fault_table import load_table

TASKS = RIGS["wavebot"].table.parent / "tasks"
BROKEN = f"""\
task: {TASKS}/wavebot.yaml
motion: {{field: heave.velocity, above: 0.1}}
faults:
  heave:
    - {{fault: silent, from: start, must: refused at start}}
    - {{fault: nonsense, from: start, must: refused at start}}
    - {{fault: tpdo_delay, value: -0.5, must: refused at start}}
    - {{fault: silent, value: 1, must: refused at start}}
    - {{fault: tpdo_delay, value: 60, must: refused at start}}
    - {{fault: drive_fault, must: SLEEPY, within_s: 1}}
  can:
    - {{fault: drop, value: 2, must: goes on, why: so}}
    - {{fault: corrupt, must: goes on, why: the check sum rejects the frame}}
  process loop:
    - {{fault: killed, value: 1, must: loop lost, within_s: 1}}
  rudder:
    - {{fault: silent, must: refused at start}}
"""
PROBLEMS = {
    (2, "motion.field"): "the log has no heave.velocity; allowed its fields, for example ",
    (6, "faults.heave[1].fault"): "nonsense is no fault of heave; allowed ",
    (7, "faults.heave[2].value"): "-0.5 is out of range; allowed 0 .. 60 s",
    (8, "faults.heave[3].value"): "1 is refused; this fault has no value",
    (10, "faults.heave[5].must"): "is not a reaction of this kind of rig",
    (12, "faults.can[0].value"): "2 is out of range; allowed 0 .. 1 of 1",
    (13, "faults.can[1].fault"): "corrupt is no fault of can; allowed drop, delay, ",
    (15, "faults.process loop[0].value"): "1 is refused; this fault has no value",
    (16, "faults.rudder"): "rudder is none of the emulated devices of this rig; allowed heave, ",
}


@pytest.mark.parametrize("options", [("--list",), ("--all",)])
def test_all_mistakes_are_listed_before_a_device_starts(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    table = tmp_path / "table.yaml"
    table.write_text(BROKEN)
    done = rig("faults", table, *options, "--runs", tmp_path / "runs", "--json")
    assert done.returncode == 2
    found = {(each["line"], each["key"]): each for each in json.loads(done.stdout)["problems"]}
    assert found.keys() == PROBLEMS.keys()
    for place, message in PROBLEMS.items():
        assert message in found[place]["message"]
        assert Path(found[place]["file"]).name == table.name
    assert not (tmp_path / "runs").exists()


def test_a_run_checks_its_own_rows_only(tmp_path: Path) -> None:
    """A table may serve a rig that lacks some of its devices."""
    path = tmp_path / "table.yaml"
    sound = BROKEN.replace("SLEEPY", "DRIVE_FAULT, category: 0")
    path.write_text(sound.replace("heave.velocity", "heave.estimate.velocity"))
    table = load_table(path)
    task = check_task(table.kind.room("tasks"), table.task)
    faults = known_faults(table, task)
    check_faults(table, task, table.selection(["heave: silent from the start"]), faults)


@pytest.mark.parametrize("name", RIGS)
def test_shipped_tables_pass_without_a_device(name: str) -> None:
    """Each fault of the devices has a row and each row a fault, on CAN, EtherCAT and lines."""
    table = load_table(RIGS[name].table)
    task = check_task(table.kind.room("tasks"), table.task)
    faults = known_faults(table, task)
    assert {row.device for row in table.rows} <= faults.keys()
    check_faults(table, task, table.rows, faults)
