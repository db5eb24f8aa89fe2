"""Each limit of a limits file that log rows show has a bar, with the values that it bounds."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rig as rig_package
from rig import log_fields
from rig.analysis.limits import Bound, BoundedValues, find_bounds, running_mean
from rig.config.law_settings import IMPEDANCE
from rig.config.yaml_source import load_mapping
from rig.kinds.modular.build import composition
from rig.kinds.rig_file import load_rig
from rig.log_fields import CHANGE, RATE, RMS, FieldLimit, LogFields, age_limit, axis_limits
from rig.page.contents import find_ages
from rig.recording.row_layout import Leaf, leaves

CONFIGS = Path(__file__).parents[2] / "configs"
LUPA = Path(__file__).parents[2] / "examples" / "lupa" / "rigs"


def leaf(name: str, unit: str, code: str = "d") -> Leaf:
    return Leaf(tuple(name.split(".")), code, unit)


AXIS: tuple[Leaf, ...] = (
    leaf("tick", "tick", "q"),
    leaf("timing.skipped", "count", "q"),
    leaf("heave.estimate.position", "m"),
    leaf("heave.estimate.velocity", "m/s"),
    leaf("heave.command.force", "N"),
    leaf("heave.command.current", "A"),
    leaf("heave.command.enable", "flag", "q"),
    leaf("heave.sense.current", "A"),
    leaf("heave.sense.encoder_age", "s"),
    leaf("panel.age", "s"),
    leaf("tank.value", "Pa"),
    leaf("tank.age", "s"),
)
HEAVE = {
    "position_warn_m": 0.3,
    "position_stop_m": 0.4,
    "current_peak_a": 9.0,
    "current_rms_a": 4.0,
    "current_rms_time_s": 10.0,
    "current_difference_stop_a": 2.0,
    "force_slew_n_per_s": 500.0,
    "encoder_age_stop_s": 0.02,
}


def bounds_of(
    limits: dict[str, Any], fields: LogFields | None = None, **rig: Any
) -> dict[str, Bound]:
    found = find_bounds(AXIS, {"limits": limits, "rig": rig}, fields or LogFields())
    return {each.limit.key: each for each in found}


def test_limits_of_axes_need_no_declaration() -> None:
    """A plug-in that says nothing of its fields gets the limits of axes, as does an old record."""
    for limits, prefix in (({"heave": HEAVE}, "heave"), ({"axes": {"heave": HEAVE}}, "axes.heave")):
        found = bounds_of(limits)
        position = found[f"{prefix}.position_stop_m"]
        assert (position.low, position.high, position.warn) == (-0.4, 0.4, 0.3)
        assert found[f"{prefix}.current_rms_a"].time == 10.0
        assert found[f"{prefix}.force_slew_n_per_s"].unit == "N/s"
        label = found[f"{prefix}.current_difference_stop_a"].label
        assert label == "heave current less command"


def test_a_limit_without_field_or_number_has_no_bar() -> None:
    limits = {
        "heave": {"position_stop_rad": "a", "velocity_stop_m_per_s": None, "current_peak_a": True},
        "tail": {"position_stop_m": 1.0},
    }
    assert bounds_of(limits) == {}


def test_declared_limits_come_with_scale_and_label() -> None:
    declared = FieldLimit("flap.angle_deg", "heave.estimate.position", both=False, scale=0.5)
    found = bounds_of({"flap": {"angle_deg": 8}}, LogFields({"heave": "flap"}, (declared,)))
    assert found["flap.angle_deg"][1:5] == ("flap position", "m", 0.0, 4.0)


def test_sensors_of_the_rig_file_have_range_and_age() -> None:
    found = bounds_of({}, tank=1, sensors={"tank": {"range": [-5.0, 100.0], "age_limit_s": 0.5}})
    assert found["rig.sensors.tank.range"][3:5] == (-5.0, 100.0)
    ages = find_ages(AXIS, found.values())
    assert ages == {"heave.sense.encoder_age": None, "panel.age": None, "tank.age": 0.5}


def test_the_least_limit_of_an_age_counts() -> None:
    limits = {"heave": {"encoder_age_stop_s": 0.02}, "loop": {"panel_age_stop_s": 1.0, "x": 0.2}}
    fields = LogFields(limits=(age_limit("loop.x", "panel.age"),))
    ages = find_ages(AXIS, bounds_of(limits, fields).values())
    assert ages == {"heave.sense.encoder_age": 0.02, "panel.age": 0.2, "tank.age": None}


def values_of(limit: FieldLimit, rows: list[dict[str, float]], blocks: int = 1) -> list[float]:
    """Return the values that a limit bounds in rows of the given fields, at 1 kHz."""
    names = [each.name for each in AXIS]
    table = np.zeros((len(rows), len(AXIS)))
    for at, row in enumerate(rows):
        for name, value in ({"tick": at} | row).items():
            table[at, names.index(name)] = value
    values = BoundedValues([Bound(limit, "", "", 0, 1, time=10.0)], AXIS, 1e-3)
    parts = [values.columns(part)[:, 0] for part in np.array_split(table, blocks)]
    return [round(float(each), 6) for each in np.concatenate(parts)]


@pytest.mark.parametrize("blocks", [1, 2, 3])
def test_slews_and_differences_are_formed_from_row_to_row(blocks: int) -> None:
    force, current, measured = "heave.command.force", "heave.command.current", "heave.sense.current"
    slew = FieldLimit("x", force, quantity=RATE)
    rows = [{force: each} for each in (1.0, 1.5, 1.5)] + [{force: 3.5, "tick": 6}]
    found = values_of(slew, rows, blocks)
    assert np.isnan(found[0]), "the row before is not known"
    assert found[1:] == [500.0, 0.0, 500.0], "the last row comes four ticks later"
    off = values_of(slew, [{force: 90.0}, {}, {}], blocks)
    assert np.isnan(off).all(), "what is switched off is not slewed"
    difference = FieldLimit("x", measured, commanded=current)
    steps = [{measured: m, current: c} for m, c in ((0.0, 2.0), (2.0, 5.0), (5.1, 5.0))]
    assert values_of(difference, steps, blocks)[1:] == [0.0, 0.1]
    gap = values_of(difference, [*steps, {measured: 1.0, "tick": 9}], blocks)
    assert np.isnan(gap[-1]), "the command that acted is not in the rows"


def test_lost_ticks_are_those_of_one_gap() -> None:
    limit = FieldLimit("x", "timing.skipped", quantity=CHANGE, both=False)
    rows = [{"timing.skipped": each} for each in (3.0, 3.0, 10.0, 11.0)]
    assert values_of(limit, rows)[1:] == [0.0, 7.0, 1.0]


def test_a_limit_counts_where_it_is_judged_alone() -> None:
    limit = FieldLimit("x", "heave.command.current", where=(("timing.skipped", 1),))
    found = values_of(limit, [{"timing.skipped": 1, "heave.command.current": 2.0}, {}])
    assert found[0] == 2.0
    assert np.isnan(found[1])


def test_the_rms_is_that_of_the_loop() -> None:
    limit = FieldLimit("x", "heave.command.current", quantity=RMS)
    found = values_of(limit, [{"heave.command.current": 3.0}] * 2000, blocks=7)
    assert found[-1] == pytest.approx(3.0 * np.sqrt(1.0 - (1.0 - 1e-4) ** 2000), rel=1e-4)


@pytest.mark.parametrize("weight", [0.0, 1e-18, 1e-6, 1e-4, 0.013, 0.0999, 0.11, 0.5, 1.0])
def test_running_means_are_those_value_by_value(weight: float) -> None:
    """Within the rounding of some thousand additions."""
    values = np.random.default_rng(8).exponential(20.0, 5000)
    mean, expected = 3.0, []
    for value in values:
        mean += weight * (value - mean)
        expected.append(mean)
    assert running_mean(values, weight, 3.0) == pytest.approx(np.array(expected), rel=1e-12)


def test_a_record_of_another_version_is_read_as_far_as_it_goes() -> None:
    declared = LogFields({"a": "b"}, axis_limits("axis", ""), {"k": ("l", "m")})
    record = declared.as_record()
    assert log_fields.from_record(record) == declared
    assert log_fields.from_record(None) == LogFields()
    record["limits"] = [{"key": "a"}, 3, {"key": "a", "field": "b", "new": 1}]
    record["labels"] = [1]
    assert log_fields.from_record(record) == LogFields(
        {}, (FieldLimit("a", "b"),), {"k": ("l", "m")}
    )


MARK = "the warning mark of the bar of its stop"
TIME = "how long a difference may last, or over what time a mean is formed"
MEANS = "the check's means are not in the rows: they start afresh with the power"
JUMP = (
    "the estimate at the time of the sample, of which the reading must not jump away, is in no row"
)
TARE = "only while the zeros are measured; the rows have no extremes of that time"
WITHOUT_BAR = {
    "*.*_warn_*": MARK,
    "*_time_s": TIME,
    "power.*": MEANS,
    "*.encoder_jump_stop_*": JUMP,
    "tare.*": TARE,
    "axes.*.tare_span_stop_*": TARE,
    "axes.*.motion": "no limit: it says what the units are",
}
"""The keys of all shipped limits files that have no bar, and why."""


def flat(limits: dict[str, Any], prefix: str = "") -> set[str]:
    found = set()
    for key, value in limits.items():
        inner = flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key}
        found |= inner
    return found


def bars_of(limits: Path, rig: Path) -> tuple[set[str], list[Bound], tuple[Leaf, ...]]:
    """Return the keys of a limits file, the bars of a rig with it, and the fields of its rows."""
    file, _, kind = load_rig(rig)
    text = ""
    if file.kind == "modular":
        laws = dict.fromkeys(file.axes, IMPEDANCE)
        text = composition(file, laws).to_text()
    row = leaves(kind.room("tick").find_kind(text).row_type)
    mapping, _ = load_mapping(limits)
    fields = kind.room("display").log_fields(file)
    config = {"limits": mapping, "rig": file.model_dump(mode="json")}
    return flat(mapping), find_bounds(row, config, fields), row


SHIPPED = {
    **{
        path: CONFIGS / "rigs" / ("wavebot.yaml" if "wavebot" in path.stem else "oswec_bench.yaml")
        for path in sorted((CONFIGS / "limits").glob("*.yaml"))
    },
    **{path: path.parent / "one_body.yaml" for path in [LUPA / "limits.yaml"]},
}


@pytest.mark.parametrize("limits", SHIPPED, ids=lambda path: path.stem)
def test_every_key_of_a_shipped_limits_file_has_a_bar_or_a_reason(limits: Path) -> None:
    keys, bounds, row = bars_of(limits, SHIPPED[limits])
    shown = {each.limit.key for each in bounds}
    assert {key for key in shown if not key.startswith("rig.sensors.")} <= keys
    excused = {key for key in keys for pattern in WITHOUT_BAR if fnmatch(key, pattern)}
    assert sorted(keys - shown - excused) == [], "neither bar nor reason"
    assert sorted(shown & excused) == [], "a bar, and a reason against it"
    for each in bounds:
        assert each.low < each.high
        assert each.warn is None or each.warn < each.high
    ages = find_ages(row, bounds)
    assert [name for name, limit in ages.items() if limit is None] == (
        ["probes.age"] if "wavebot" in limits.stem else []
    ), "no check judges the age of the wave probes; all others have a limit"


def test_all_reasons_are_needed() -> None:
    keys = set.union(*(bars_of(limits, rig)[0] for limits, rig in SHIPPED.items()))
    assert [each for each in WITHOUT_BAR if not any(fnmatch(key, each) for key in keys)] == []


def test_a_new_kind_declares_its_limits_without_sections() -> None:
    rig = Path(rig_package.__file__).parent / "templates" / "kind" / "configs"
    keys = flat(load_mapping(rig / "limits.yaml")[0])
    declared = LogFields(limits=axis_limits("heave", ""))
    found = find_bounds(AXIS, {"limits": load_mapping(rig / "limits.yaml")[0]}, declared)
    assert {each.limit.key for each in found} == keys - {"slack_stop_m", "lost_ticks_stop"}
