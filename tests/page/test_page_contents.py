"""Labels, limits and traces of the page follow from a run's folder, for every kind of rig."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rig.page import contents
from rig.page.alarms import Alarms
from rig.page.recorded import RecordedTap
from rig.page.subject import replay
from rig.page.watch import RowPower
from rig.realtime.reasons import Reason, reason_table
from rig.realtime.safety import Mode
from rig.recording.journal import JOURNAL, Entry
from rig.recording.runs import run_info


def test_contents_of_a_recorded_run(recorded: Path) -> None:
    info = run_info(recorded)
    found = contents.describe(RecordedTap(recorded).leaves, info.config, info.plan)
    assert [each["unit"] for each in found["traces"]] == ["m / rad", "m/s", "N", "W", "A", "V"]
    assert found["traces"][0]["first"][0] == "heave.estimate.position"
    assert [each["heading"] for each in found["stations"]] == ["mech 1", "mech 2", "AC", "DC"]
    assert [each["label"] for each in found["columns"]] == ["spring rate", "Kp", "Ki"]
    assert found["columns"][0]["heading"] == "spring"
    assert found["surface"] == {"x": 2, "y": 0}, "Kp is the same in all rows"
    assert found["best_station"] == "dc"
    assert found["rows"][2] == [-2763.0, -2000.0, 4000.0]
    limits = {each["field"]: each for each in found["limits"]}
    assert limits["power_sense.bus_voltage"]["high"] == 200.0
    assert limits["heave.estimate.position"]["label"] == "heave position"
    assert found["sea"].startswith("regular")


def test_powers_of_a_hold_are_those_of_no_row(recorded: Path) -> None:
    """The row was measured for a part of its time; on hold the drive damps instead of the law."""
    watch = replay(recorded).watch
    rows = np.zeros((4, len(watch._at)))
    rows[:, watch._at["power.samples"]] = (10, 20, 9000, 9001)
    rows[:, watch._at["power.mean_dc"]] = (-1.0, -2.0, -50.0, -60.0)
    rows[:, watch._at["safety.mode"]] = (Mode.RUN, Mode.RUN, Mode.STOP_2, Mode.STOP_2)
    (powers,) = watch.powers_in(rows).values()
    assert powers.means[-1] == -2.0
    assert not powers.whole


def test_rows_before_the_page_do_not_change_those_that_it_saw(recorded: Path) -> None:
    """They are read in a thread of their own, while the server goes through the rows."""
    subject = replay(recorded)
    shown = subject.watch.powers
    shown[1] = RowPower((1.0,), False)
    subject._read_earlier_rows()
    assert subject.watch.powers is shown
    assert list(shown) == [1]
    rows = subject.state()["rows"]
    assert sorted(rows) == ["0", "1", "2", "3"]
    assert rows["1"] == RowPower((1.0,), False), "newer values count"


def test_the_journal_is_read_on_from_where_it_was(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    subject = replay(recorded)
    monkeypatch.setattr(subject, "folder", tmp_path)
    lines = [json.dumps(Entry("now", k, "Ada", "page", "hold")._asdict()) + "\n" for k in range(4)]
    path = tmp_path / JOURNAL
    assert subject.new_entries() == []
    path.write_text(lines[0] + lines[1][:20])
    assert [each["tick"] for each in subject.new_entries()] == [0]
    assert subject.new_entries() == []
    # What was read is not read again, so that a long journal costs nothing.
    path.write_text(" " * len(lines[0]) + lines[1] + lines[2] + lines[3][:-1])
    assert [each["tick"] for each in subject.new_entries()] == [1, 2]
    with path.open("a") as file:
        file.write("\n")
    assert [each["tick"] for each in subject.new_entries()] == [3]
    assert [each["tick"] for each in subject.journal] == [0, 1, 2, 3]


def test_every_reason_of_the_core_has_advice() -> None:
    assert [each for each in Reason if not each.advice] == [Reason.NONE]


def test_the_first_cause_stays_on_top() -> None:
    alarms = Alarms(reason_table())
    alarms.raise_alarm("skipped", 1.0, "low", "late", "look")
    alarms.stopped(2.0, int(Reason.POSITION))
    alarms.stopped(3.0, int(Reason.DRIVE_DROPPED))
    alarms.stopped(3.5, int(Reason.POSITION))
    alarms.stopped(4.0, int(Reason.PLAN_END))  # no alarm
    listed = alarms.listed()
    assert [each["key"] for each in listed] == ["POSITION", "DRIVE_DROPPED", "skipped"]
    assert listed[0]["times"] == 2
    assert "position limit" in listed[0]["cause"]
    assert listed[0]["action"] == Reason.POSITION.advice
    entry = Entry("", 1, "Ada", "page", "acknowledge", {"alarm": "POSITION"})
    alarms.acknowledge([entry._replace(accepted=False, person="Eve"), entry])
    assert [each["acknowledged"] for each in alarms.listed()] == ["Ada", "", ""]
