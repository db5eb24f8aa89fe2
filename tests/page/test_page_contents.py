"""Labels, limits and traces of the page follow from a run's folder, for every kind of rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rig.page import contents
from rig.page.alarms import _ADVICE, Alarms
from rig.page.recorded import RecordedTap
from rig.realtime.reasons import Reason, reason_table
from rig.recording.journal import Entry
from rig.recording.row_layout import Leaf
from rig.recording.runs import run_info


def leaf(name: str, unit: str, code: str = "d") -> Leaf:
    return Leaf(tuple(name.split(".")), code, unit)


AXIS: tuple[Leaf, ...] = (
    leaf("heave.estimate.position", "m"),
    leaf("heave.estimate.velocity", "m/s"),
    leaf("heave.command.current", "A"),
    leaf("heave.sense.encoder_age", "s"),
    leaf("motor.angle", "rad"),
    leaf("command.current", "A"),
    leaf("encoders.age", "s"),
    leaf("panel.age", "s"),
    leaf("tank.value", "Pa"),
    leaf("tank.age", "s"),
)


def limits_of(limits: dict[str, Any], **rig: Any) -> dict[str, contents.Limit]:
    found = contents.find_limits(AXIS, {"limits": limits, "rig": rig})
    return {each.field: each for each in found}


def test_limits_bound_the_field_of_their_section() -> None:
    axis = {"position_stop_m": 0.4, "position_warn_m": 0.3, "current_peak_a": 9.0}
    for limits in ({"heave": axis}, {"axes": {"heave": axis}}):
        found = limits_of(limits)
        assert found["heave.estimate.position"] == contents.Limit(
            "heave.estimate.position", "m", -0.4, 0.4, 0.3
        )
        assert found["heave.command.current"].high == 9.0


def test_limits_in_degrees_become_radians() -> None:
    found = limits_of({"motor": {"angle_stop_deg": 180.0, "current_peak_a": 5.0}})
    assert found["motor.angle"].high == pytest.approx(3.14159, abs=1e-4)
    assert found["command.current"].high == 5.0


def test_limits_without_a_field_are_left_out() -> None:
    limits = {
        "heave": {
            "encoder_jump_stop_m": 0.01,
            "force_slew_n_per_s": 1.0,
            "position_stop_rad": 1.0,  # another unit than the field
            "current_difference_stop_a": 2.0,
            "velocity_stop_m_per_s": None,
        },
        "tail": {"position_stop_m": 1.0},
    }
    assert limits_of(limits) == {}


def test_sensors_with_a_range_are_limits() -> None:
    found = limits_of({}, sensors={"tank": {"range": [-5.0, 100.0], "age_limit_s": 0.5}})
    assert (found["tank.value"].low, found["tank.value"].high) == (-5.0, 100.0)


def test_ages_have_the_limit_of_their_device() -> None:
    config = {
        "limits": {
            "heave": {"encoder_age_stop_s": 0.02},
            "motor": {"encoder_age_stop_s": 0.03},
            "loop": {"panel_age_stop_s": 1.0},
        },
        "rig": {"sensors": {"tank": {"age_limit_s": 0.5}}},
    }
    found = {each.field: each.limit for each in contents.find_ages(AXIS, config)}
    assert found["heave.sense.encoder_age"] == 0.02
    assert found["encoders.age"] in (0.02, 0.03)
    assert found["panel.age"] == 1.0
    assert found["tank.age"] == 0.5


def test_contents_of_a_recorded_run(recorded: Path) -> None:
    info = run_info(recorded)
    found = contents.describe(RecordedTap(recorded).leaves, info.config, info.plan)
    assert [each["unit"] for each in found["traces"]] == ["m / rad", "m/s", "N", "W", "A", "V"]
    assert found["traces"][0]["first"][0] == "heave.estimate.position"
    assert [each["heading"] for each in found["stations"]] == ["mech 1", "mech 2", "AC", "DC"]
    assert [each["label"] for each in found["columns"]] == ["spring", "Kp", "Ki"]
    assert found["rows"][2] == [-2763.0, -2000.0, 4000.0]
    limits = {each["field"]: each for each in found["limits"]}
    assert limits["power_sense.bus_voltage"]["high"] == 200.0
    assert limits["heave.estimate.position"]["label"] == "heave position"
    assert found["sea"].startswith("regular")


def test_every_reason_of_the_core_has_advice() -> None:
    assert set(Reason) - {Reason.NONE} == set(_ADVICE)


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
    entry = Entry("", 1, "Ada", "page", "acknowledge", {"alarm": "POSITION"})
    alarms.acknowledge([entry._replace(accepted=False, person="Eve"), entry])
    assert [each["acknowledged"] for each in alarms.listed()] == ["Ada", "", ""]
