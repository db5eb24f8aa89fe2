"""Effects of a changed calibration on a log and on run folders."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from calibration_files import CALIBRATIONS, calibration
from log_books import MASK4_LOG, write_log
from measured_data import needs, reference

from rig.interop.legacy.testlog import read_log, values_in_log
from rig.recording.calibration import RecordingTime, open_history
from rig.recording.calibration_changes import (
    PRODUCTS,
    IncomparableError,
    RecordedValue,
    compare_calibrations,
    values_in_runs,
)

FILE = "waveBotCtrlMdl_2023_09_21_04_46_26"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(
        tmp_path / "log.xlsx",
        ("MASK4_024", None, FILE, "None", "heave multisine, mag spring @ -12kN/m", ""),
        ("MASK4_036", 16, None, "0.4 Hz Regular wave, 5 inch AMPLITUDE", "GainMatrix002", ""),
        ("MASK4_039", None, None, "none", "v1.0.2 ramps", ""),
        ("MASK4_062", 38, None, '2.5 s 10" Hs JONSWAP', "GainMatrix006_2, magK=-6152", ""),
        ("MASK4_063", 39, None, "0.4 Hz Regular wave, 5 inch AMPLITUDE", "GainMatrix011", ""),
    )


def run_folder(runs: Path, name: str, started: str, rates: tuple[float, ...], **more: Any) -> None:
    """Write the files of a finished run; `rows.csv` with mean positions if given."""
    folder = runs / name
    folder.mkdir(parents=True)
    status = {"run": name, "status": "complete", "mode": "rehearsal", "started_utc": started}
    config = {"rig": {"heave": {"torque_constant_n_m_per_a": 6.1745}}}
    plan = {"rows": [{"row": i, "spring_rate": rate} for i, rate in enumerate(rates)]}
    for file, value in (("run.json", status), ("config.json", config), ("plan.json", plan)):
        (folder / file).write_text(json.dumps(value))
    means = more.get("means")
    if means is not None:
        lines = [f"{i},{mean}" for i, mean in enumerate(means)]
        (folder / "rows.csv").write_text("\n".join(["row,position_mean [m]", *lines]) + "\n")
        (folder / "surfaces.png").write_bytes(b"")


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    run_folder(folder, "20230914T100000Z_a", "2023-09-14T10:00:00+00:00", (490.9, -5715.0))
    late = "2023-09-20T23:59:59Z"
    run_folder(folder, "20230920T235959Z_b", late, (490.9, 0.0), means=(0.25, "nan"))
    return folder


def pair(folder: Path, **changes: Any) -> Any:
    """Return versions 1 and 2 of a calibration; ``new`` applies to version 2 only."""
    new = changes.pop("new")
    old = calibration(folder, **changes)
    return old, calibration(folder, **(changes | {"version": 2, "supersedes": 1} | new))


def test_a_log_is_compared(log: Path) -> None:
    old, new = (known.file for known in open_history(CALIBRATIONS).versions)
    found = compare_calibrations(old, new, values_in_log(read_log(log), "spring_rate"))
    assert [(c.where, c.field, c.recorded, c.old, c.new, c.stale) for c in found.changed] == [
        ("MASK4_024", "E2", -12000.0, -12000.0, -9228.0, ("identified impedance",)),
        ("MASK4_036", "row 3", None, None, None, ("row table", "power surfaces")),
    ]
    assert found.changed[1].note == "spring rates are in GainMatrix002, not in the log"
    assert (found.unchanged, found.undetermined) == (2, ())
    assert ("correction.factor", 1.0, 0.769) in found.keys
    assert compare_calibrations(new, new, values_in_log(read_log(log), "spring_rate")).changed == ()
    assert values_in_log(read_log(log), "torque_constant") == ()


@needs(MASK4_LOG)
def test_the_measured_log_of_the_mask4_test() -> None:
    """Numbers of the MASK4 report (Sandia), section 4.1, for every rate of the log."""
    old, new = (known.file for known in open_history(CALIBRATIONS).versions)
    found = compare_calibrations(
        old, new, values_in_log(read_log(reference(MASK4_LOG)), "spring_rate")
    )
    rates = {int(c.where[-3:]): (c.old, c.new) for c in found.changed if c.recorded is not None}
    assert rates == {
        21: (10000, 7690), 22: (-12000, -9228), 23: (-12000, -9228), 24: (-12000, -9228),
        25: (-10000, -7690), 26: (-6000, -4614), 29: (5000, 3845), 30: (5000, 3845),
        31: (10000, 7690), 32: (10000, 7690), 33: (10000, 7690), 35: (-12000, -9228),
        42: (-8000, -6152), 46: (-10000, -7690), 47: (-12000, -9228),
    }  # fmt: skip
    in_matrices = [int(c.where[-3:]) for c in found.changed if c.recorded is None]
    assert in_matrices == [34, 36, 37, 38, 40, 41, 43, 44, 45, 48, 49]
    assert set(found.stale) == {c.where for c in found.changed}


def test_rows_of_runs_by_the_day_they_started(tmp_path: Path, runs: Path) -> None:
    valid = "{dates: {from: 2023-09-15, before: 2023-09-21}}"
    new = {"correction": "{kind: scale, factor: 0.769}"}
    old, new = pair(tmp_path, valid=valid, correction="{kind: scale, factor: 1}", new=new)
    found = compare_calibrations(old, new, values_in_runs(runs, "spring_rate"))
    assert [(c.where, c.field, c.old, c.new) for c in found.changed] == [
        ("20230920T235959Z_b", "row 0", 490.9, 377.5021),
    ]  # fmt: skip
    assert found.unchanged == 3  # the earlier run, and a rate of zero
    assert found.stale == {"20230920T235959Z_b": ("rows.csv", "surfaces.png")}


def test_a_changed_range_changes_the_runs_between(tmp_path: Path, runs: Path) -> None:
    new = {"valid": "{dates: {from: 2023-09-01}}", "outside": "refuse"}
    valid = "{dates: {from: 2023-09-20}}"
    old, new = pair(tmp_path, valid=valid, outside="refuse", new=new)
    found = compare_calibrations(old, new, values_in_runs(runs, "spring_rate"))
    assert [(c.where[-1], c.old, c.new) for c in found.changed] == [
        ("a", None, 245.45), ("a", None, -2857.5),
    ]  # fmt: skip
    assert ("valid.dates.from", "2023-09-20", "2023-09-01") in found.keys


def test_the_validity_of_runs_without_a_number_is_unknown(runs: Path) -> None:
    old, new = (known.file for known in open_history(CALIBRATIONS).versions)
    found = compare_calibrations(old, new, values_in_runs(runs, "spring_rate"))
    assert (found.changed, found.unchanged) == ((), 0)
    assert [where for where, _ in found.undetermined] == [
        "20230914T100000Z_a",
        "20230920T235959Z_b",
    ]
    assert "valid for MASK4 runs before 51" in found.undetermined[0][1]


def test_other_quantities_come_from_other_files(tmp_path: Path, runs: Path) -> None:
    more = {
        "valid": "{dates: {from: 2023-01-01}}",
        "new": {"correction": "{kind: offset, offset: 1}"},
    }
    old, new = pair(tmp_path, quantity="torque_constant", **more)
    found = compare_calibrations(old, new, values_in_runs(runs, "torque_constant"))
    assert [(c.field, c.old, c.new) for c in found.changed] == [
        ("rig.heave.torque_constant_n_m_per_a", 3.08725, 7.1745)
    ] * 2
    more["new"] = {"correction": "{kind: offset, offset: -0.25}"}
    old, new = pair(tmp_path, quantity="heave_position", **more)
    found = compare_calibrations(old, new, values_in_runs(runs, "heave_position"))
    assert [(c.where[-1], c.field, c.old, c.new, c.note) for c in found.changed] == [
        ("a", "position_mean", None, None, "no rows.csv; rig plot makes it"),
        ("b", "row 0", 0.125, 0.0, ""),
    ]
    more["new"] = {"correction": "{kind: table, recorded: [-1, 1], corrected: [-2, 2]}"}
    old, new = pair(tmp_path, quantity="heave_position", **more)
    found = compare_calibrations(old, new, values_in_runs(runs, "heave_position"))
    assert found.undetermined == (
        ("20230920T235959Z_b", "a mean cannot be corrected by a table; read the record"),
    )


def test_a_run_that_cannot_be_read_is_listed_with_the_reason(tmp_path: Path, runs: Path) -> None:
    (runs / "20230921T000000Z_c").mkdir()
    valid = "{dates: {from: 2023-01-01}}"
    old, new = pair(tmp_path, valid=valid, new={"correction": "{kind: scale, factor: 2}"})
    found = compare_calibrations(old, new, values_in_runs(runs, "spring_rate"))
    assert len(found.changed) == 3
    ((where, why),) = found.undetermined
    assert where == "20230921T000000Z_c"
    assert "no run.mcap" in why


def test_different_quantities_are_not_compared(tmp_path: Path) -> None:
    one = calibration(tmp_path)
    for other in ({"name": "other"}, {"quantity": "torque_constant"}):
        with pytest.raises(IncomparableError, match="do not correct the same thing"):
            compare_calibrations(one, calibration(tmp_path, **other), ())


def test_a_scale_of_one_is_the_same_as_no_calibration(tmp_path: Path) -> None:
    new = {"correction": "{kind: offset, offset: 0}", "valid": "{runs: {series: T, before: 5}}"}
    old, new = pair(tmp_path, correction="{kind: scale, factor: 1}", new=new)
    at = RecordingTime("T", 7, date(2023, 1, 1))
    stood = (
        RecordedValue("T_007", "E1", at, 5.0, "", ()),
        RecordedValue("T_007", "E1", at, None, "note", ()),
    )
    found = compare_calibrations(old, new, stood)
    assert (found.changed, found.unchanged) == ((), 2)


def test_the_list_of_products_matches_a_run() -> None:
    from rig.analysis import page, report, rows, summary

    writers = (report, summary, page, rows)
    sources = "".join(Path(str(writer.__file__)).read_text() for writer in writers)
    for name in PRODUCTS:
        assert f'"{name}"' in sources, name
