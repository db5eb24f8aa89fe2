"""What turns bytes to words can reach nothing it could wait for, under whatever name it stands."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from drivers.errors import CodecError

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ["checksums", "errors", "compax3", "encoder", "force_torque"]
PURE = {"binascii", "drivers", "enum", "math", "re", "struct", "typing"}
FILES = sorted(
    path
    for room in ROOMS
    for path in (
        [ROOT / "drivers" / f"{room}.py"]
        if (ROOT / "drivers" / f"{room}.py").exists()
        else (ROOT / "drivers" / room).glob("*.py")
    )
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_codecs_and_parsers_reach_nothing_to_wait_for(path: Path) -> None:
    tree = ast.parse(path.read_text())
    roots = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            roots |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots.add((node.module or "").split(".")[0])
    assert roots <= PURE
    assert len(path.read_text().splitlines()) <= 250


def test_the_rooms_are_there() -> None:
    assert len(FILES) >= 15


def test_an_error_says_what_where_expected_and_got() -> None:
    error = CodecError("a record", "length", "8 bytes", 7)
    assert str(error) == "a record: length: expected 8 bytes, got 7"
    assert (error.what, error.where, error.expected, error.got) == (
        "a record", "length", "8 bytes", 7,
    )  # fmt: skip
