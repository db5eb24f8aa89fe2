"""The page and the terminal's panel show the same labels for the same things."""

from __future__ import annotations

from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rig_command import rig

from rig.kinds.modular import display as modular
from rig.kinds.oswec_bench import display as bench
from rig.kinds.wavebot import display as wavebot
from rig.log_fields import LogFields, label_of
from rig.page import contents
from rig.page.recorded import RecordedTap
from rig.presentation.campaign_text import row_text
from rig.presentation.phrases import phase_text, state_text
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording.runs import run_info
from rig.row_contents import columns_from_records


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded session of the bench."""
    folder = tmp_path_factory.mktemp("session")
    result = rig("run", "driveline_short", "--runs", folder)
    assert result.returncode == 0, result.stderr
    (run,) = folder.iterdir()
    return run


def described(run: Path) -> dict[str, Any]:
    info = run_info(run)
    return contents.describe(RecordedTap(run).leaves, info.config, info.plan)


def last_row(run: Path) -> dict[str, float]:
    tap = RecordedTap(run)
    tap.set_speed(50.0)
    rows = tap.poll()
    return {leaf.name: float(value) for leaf, value in zip(tap.leaves, rows[-1], strict=True)}


def test_motion_and_powers_of_a_campaign(recorded: Path) -> None:
    found, row = described(recorded), last_row(recorded)
    lines = dict(wavebot.detail_lines(SimpleNamespace(rows=[1]), row, row))  # type: ignore[arg-type]
    for field in wavebot._MOTION:
        label = found["fields"][field.field]["label"]
        axis, _, quantity = label.partition(" ")
        assert quantity in lines[axis], label
    measured = row | {"power.samples": 1.0}
    text = wavebot.short_text(SimpleNamespace(rows=[1]), measured, measured)  # type: ignore[arg-type]
    for station in found["stations"]:
        assert (f"W {station['label']}" in text) is station["mean"]


def test_set_points_of_a_campaign(recorded: Path) -> None:
    found, plan = described(recorded), run_info(recorded).plan
    columns = [c for c in columns_from_records(plan["columns"]) if c.role in ("panel", "x", "y")]
    setting = namedtuple("Setting", plan["rows"][0])(**plan["rows"][0])
    task = SimpleNamespace(rows=[SimpleNamespace(setting=setting)])
    row = {"plan.row": 0, "plan.phase": int(Phase.MEASURE), "safety.reason": 0}
    text = row_text(task, row, columns)
    for column, value in zip(found["columns"], found["rows"][0], strict=True):
        assert f"{column['label']} {value:g} {column['unit']}" in text
    assert found["phases"][Phase.MEASURE] in text


def test_set_points_and_motion_of_a_session(session: Path) -> None:
    found, row, plan = described(session), last_row(session), run_info(session).plan
    rows = [SimpleNamespace(values={k: plan["rows"][0][k] for k in found_keys(found)})]
    row |= {"plan.row": 0, "plan.phase": float(Phase.LEAD_IN)}
    _, text = bench.plan_position(SimpleNamespace(rows=rows), row)  # type: ignore[arg-type]
    for column, value in zip(found["columns"], found["rows"][0], strict=True):
        assert f"{column['label']} {value:g} {column['unit']}" in text
    assert f"   {found['phases'][Phase.LEAD_IN]}   " in text
    lines = "".join(text for _, text in bench.detail_lines(None, row, {}))  # type: ignore[arg-type]
    for field in (*bench._MOTION, *bench._DRIVE):
        assert f"{found['fields'][field.field]['label']} " in lines


def found_keys(found: dict[str, Any]) -> list[str]:
    return [each["name"] for each in found["columns"]]


def test_axes_of_a_modular_rig() -> None:
    axes = {
        "tail": SimpleNamespace(motion="rotation"),
        "float": SimpleNamespace(motion="translation"),
    }
    sensors = {"oil_1": SimpleNamespace(label=""), "deck": SimpleNamespace(label="wave at the rig")}
    plan = SimpleNamespace(rig=SimpleNamespace(axes=axes, sensors=sensors, power_stations=()))
    labels = modular.log_fields(plan.rig).labels
    assert label_of("oil_1.value", labels) == "oil 1"
    assert label_of("deck.age", labels) == "wave at the rig age"
    row = {
        f"{axis}.{part}": 1.0
        for axis in axes
        for part in ("estimate.position", "estimate.velocity", "command.force", "command.current")
    }
    lines = dict(modular.detail_lines(plan, row | {"power.samples": 0}, {}))
    assert "torque" in lines["tail"]
    assert "N·m" in lines["tail"]
    for field in row:
        axis, _, quantity = label_of(field, labels).partition(" ")
        assert quantity in lines[axis]


def test_states_and_phases_have_one_name_each(recorded: Path) -> None:
    assert [state_text(mode) for mode in Mode] == [
        "OFF", "ENABLING", "RUNNING", "HOLD", "STOPPING", "OFF",
    ]  # fmt: skip
    assert described(recorded)["phases"] == [phase_text(phase) for phase in Phase]


def test_an_earlier_record_has_labels_of_its_field_names(recorded: Path) -> None:
    info = run_info(recorded)
    plan = {key: value for key, value in info.plan.items() if key != "log_fields"}
    found = contents.describe(RecordedTap(recorded).leaves, info.config, plan)
    assert found["fields"]["power_sense.bus_voltage"]["label"] == "power sense bus voltage"
    assert found["fields"]["heave.estimate.position"]["label"] == "heave position"
    assert "heave.position_stop_m" in {each["key"] for each in found["limits"]}


def test_a_label_is_that_of_the_longest_beginning() -> None:
    labels = LogFields({"load": "load cell", "load.a": "left", "load.a.b.c": "inner"}).labels
    fields = ("load.x_y", "load.a", "load.a.age", "load.a.b.c", "other.sense.age")
    assert [label_of(each, labels) for each in fields] == [
        "load cell x y",
        "left",
        "left age",
        "inner",
        "other age",
    ]
