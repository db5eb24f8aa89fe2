"""Codecs and parsers import nothing that could block."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from drivers.errors import CodecError

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ["checksums", "errors", "compax3", "encoder", "force_torque"]
PURE = {"binascii", "drivers", "enum", "math", "re", "struct", "typing"}
FILES = sorted(
    path
    for package in PACKAGES
    for path in (
        [ROOT / "drivers" / f"{package}.py"]
        if (ROOT / "drivers" / f"{package}.py").exists()
        else (ROOT / "drivers" / package).glob("*.py")
    )
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_codecs_and_parsers_import_nothing_that_blocks(path: Path) -> None:
    tree = ast.parse(path.read_text())
    roots = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            roots |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots.add((node.module or "").split(".")[0])
    assert roots <= PURE
    assert len(path.read_text().splitlines()) <= 250


def test_the_packages_exist() -> None:
    assert len(FILES) >= 15


def test_an_error_has_subject_field_expected_and_got() -> None:
    error = CodecError("a record", "length", "8 bytes", 7)
    assert str(error) == "a record: length: expected 8 bytes, got 7"
    assert (error.subject, error.field, error.expected, error.got) == (
        "a record", "length", "8 bytes", 7,
    )  # fmt: skip
