"""Calibration files: errors with their lines, and chains of versions."""

from __future__ import annotations

import hashlib
import importlib
import pkgutil
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from calibration_files import CALIBRATIONS, calibration, write

from rig.config.problems import ConfigError
from rig.recording.calibration import open_calibration, open_history


def problems_of(action: Any) -> list[tuple[str, int, str, str]]:
    with pytest.raises(ConfigError) as caught:
        action()
    return [(Path(p.file).name, p.line, p.key, p.message) for p in caught.value.problems]


def test_the_shipped_calibrations_are_one_chain() -> None:
    history = open_history(CALIBRATIONS)
    first, second = history.chain("mask4_spring_rate")
    assert (first.file.version, second.file.version, second.file.supersedes) == (1, 2, 1)
    assert history.find("mask4_spring_rate") is second
    assert history.find("mask4_spring_rate@1") is first
    assert history.find("mask4_spring_rate@v2") is second
    assert second.sha256 == hashlib.sha256(second.path.read_bytes()).hexdigest()
    assert second.description() == f"mask4_spring_rate v2 (sha256 {second.sha256[:12]})"


def test_unknown_names_are_reported_with_the_known_ones() -> None:
    history = open_history(CALIBRATIONS)
    with pytest.raises(KeyError, match="there are: mask4_spring_rate"):
        history.find("mask4")
    with pytest.raises(KeyError, match="has no version 7; there are 1, 2"):
        history.find("mask4_spring_rate@7")


@pytest.mark.parametrize(
    ("changes", "line", "key", "message"),
    [
        ({"name": "Bad"}, 1, "name", "character"),
        ({"version": 0}, 2, "version", "out of range"),
        ({"quantity": "mass", "unit": "kg"}, 3, "quantity", "allowed spring_rate, torque_constant"),
        ({"unit": "kN/m"}, 4, "unit", "'kN/m' is not the unit of spring_rate; allowed N/m"),
        ({"correction": "{kind: scale, factor: 0}"}, 5, "correction.factor", "cannot be inverted"),
        ({"correction": "{kind: scale, factor: .nan}"}, 5, "correction.factor", "finite"),
        ({"correction": "{kind: scale}"}, 5, "correction.factor", "missing"),
        ({"correction": "{kind: cubic}"}, 5, "correction.kind", "allowed scale, offset, table"),
        ({"correction": "{kind: table, recorded: [0, 1], corrected: [0]}"}, 5,
         "correction.corrected", "too few entries"),
        ({"correction": "{kind: table, recorded: [0, 1, 2], corrected: [0, 1]}"}, 5,
         "correction.corrected", "2 entries; allowed 3"),
        ({"correction": "{kind: table, recorded: [0, 0], corrected: [0, 1]}"}, 5,
         "correction.recorded[1]", "0 does not rise above 0"),
        ({"correction": "{kind: table, recorded: [0, 1, 2], corrected: [0, 1, 1]}"}, 5,
         "correction.corrected[2]", "the table must rise strictly"),
        ({"valid": "{}"}, 6, "valid", "nothing given; allowed exactly one of runs, dates"),
        ({"valid": "{runs: {series: T}}"}, 6, "valid.runs", "no end given"),
        ({"valid": "{runs: {series: T, from: 5, before: 5}}"}, 6, "valid.runs.before",
         "makes the range empty"),
        ({"valid": "{runs: {series: T, from: 50, before: 6}}"}, 6, "valid.runs.before",
         "6 is before from = 50"),
        ({"valid": "{dates: {from: 26.9.2023}}"}, 6, "valid.dates.from", "allowed as 2023-09-26"),
        ({"valid": "{dates: {from: 2023-02-30}}"}, 6, "valid.dates.from", "is not a date"),
        ({"valid": "{dates: {from: 2023-09-26, before: 2023-09-25}}"}, 6, "valid.dates.before",
         "is before"),
        ({"valid": "{runs: {series: T, before: 1}, dates: {before: 2023-01-01}}"}, 6, "valid",
         "runs and dates given"),
        ({"outside": "ignore"}, 7, "outside", "allowed refuse, unchanged"),
        ({"version": 2}, 1, "", "supersedes missing; allowed a version before 2"),
        ({"supersedes": 1}, 8, "supersedes", "version 1 supersedes nothing"),
        ({"version": 2, "supersedes": 2}, 8, "supersedes", "is not an earlier version"),
    ],
)  # fmt: skip
def test_each_mistake_is_reported_at_its_line(
    tmp_path: Path, changes: dict[str, Any], line: int, key: str, message: str
) -> None:
    path = write(tmp_path, **changes)
    found = problems_of(lambda: open_calibration(path))
    assert [p[:3] for p in found] == [(path.name, line, key)], found
    assert message in found[0][3]


def test_all_problems_of_a_file_are_reported_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, unit="m", outside="never")
    path.write_text(path.read_text() + "author: me\n")
    assert [(line, key) for _, line, key, _ in problems_of(lambda: open_calibration(path))] == [
        (7, "outside"), (10, "author"),
    ]  # fmt: skip


def test_frozen_and_with_whole_numbers_as_people_write_them(tmp_path: Path) -> None:
    file = calibration(tmp_path, version="1e0")
    assert file.version == 1
    with pytest.raises(ValueError, match="frozen"):
        file.version = 2


def test_ranges_have_a_description(tmp_path: Path) -> None:
    for valid, text in (
        ("{runs: {series: T, before: 51}}", "T runs before 51"),
        ("{runs: {series: T, from: 0, before: 51}}", "T runs from 0 before 51"),
        ("{dates: {from: 2023-09-26}}", "dates from 2023-09-26"),
    ):
        assert calibration(tmp_path, valid=valid).valid.description() == text


def test_broken_chains_are_reported_at_their_line(tmp_path: Path) -> None:
    write(tmp_path, version=1)
    write(tmp_path, version=2, supersedes=1)
    write(tmp_path, version=3, supersedes=1)
    write(tmp_path, version=7, supersedes=4)
    write(tmp_path, version=8, supersedes=2, quantity="torque_constant")
    write(tmp_path, version=1).rename(tmp_path / "again.yaml")
    write(tmp_path, version=1)
    write(tmp_path, name="bad", outside="never")
    found = problems_of(lambda: open_history(tmp_path))
    assert [(file, key) for file, _, key, _ in found] == [
        ("bad_1.yaml", "outside"),
        ("one_1.yaml", "version"),
        ("one_3.yaml", "supersedes"),
        ("one_7.yaml", "supersedes"),
        ("one_8.yaml", "supersedes"),
    ]
    for problem, message in zip(
        found[1:],
        (
            "one v1 is defined in",
            "one v1 is superseded by one v2 already",
            "one v4 does not exist",
            "one v2 corrects spring_rate, not torque_constant",
        ),
        strict=True,
    ):
        assert message in problem[3]
    assert "no such folder" in problems_of(lambda: open_history(tmp_path / "none"))[0][3]


@pytest.mark.parametrize("name", ["rig.interop.legacy.testlog"])
def test_no_module_hides_a_function_of_its_package(name: str) -> None:
    """A module of the same name replaces a function of the package once it is imported."""
    package = importlib.import_module(name)
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{name}.{module.name}")
    offered = {text_part: getattr(package, text_part) for text_part in package.__all__}
    assert [text_part for text_part, what in offered.items() if isinstance(what, ModuleType)] == []
    assert not {module.name for module in pkgutil.iter_modules(package.__path__)} & set(offered)
