"""The notebooks in docs/notebooks: executed in full, their stored outputs are those of today."""

from __future__ import annotations

import copy
from pathlib import Path

import nbformat
import notebooks
import pytest

LARGEST_BYTES = 400_000


@pytest.mark.slow
@pytest.mark.sampled(pool="notebooks")
@pytest.mark.filterwarnings("ignore:.*:DeprecationWarning")
@pytest.mark.parametrize("name", notebooks.NAMES)
def test_outputs_are_those_stored(name: str, tmp_path: Path) -> None:
    stored = notebooks.read(name)
    executed = notebooks.execute(stored, tmp_path)
    assert notebooks.differences(stored, executed) == []


@pytest.mark.parametrize("name", notebooks.NAMES)
def test_stored_notebooks_are_small_and_complete(name: str) -> None:
    path = notebooks.FOLDER / f"{name}.ipynb"
    assert path.stat().st_size < LARGEST_BYTES
    stored = notebooks.read(name)
    nbformat.validate(stored)
    assert all(
        "error" not in each.output_type for c in stored.cells for each in c.get("outputs", [])
    )
    assert any("picture" in notebooks.texts(cell) for cell in stored.cells)
    html = [str(each.get("data", {}).get("text/html", "")) for c in stored.cells
            for each in c.get("outputs", [])]  # fmt: skip
    assert not any("http" in each for each in html)


def test_every_notebook_is_executed() -> None:
    assert sorted(path.stem for path in notebooks.FOLDER.glob("*.ipynb")) == sorted(notebooks.NAMES)


@pytest.mark.parametrize(
    ("stored", "executed", "same"),
    [
        ("run 20261127T080148Z_x", "run 20270101T000000Z_x", True),
        ("begun 2026-11-27 08:01:48 UTC", "begun 2027-01-01 00:00:00 UTC", True),
        ("power -91.40 W", "power -91.401 W", True),
        ("power \u221291.40 W", "power \u221291.50 W", False),
        ("power -91.40 W", "power 91.40 W", False),
        ("6 of 6 complete", "5 of 6 complete", False),
        ("RUN", "STOP_0", False),
        ("a 1", "a 1 2", False),
    ],
)
def test_comparison_of_texts(stored: str, executed: str, same: bool) -> None:
    assert notebooks.same_text(stored, executed) is same


def test_a_changed_output_or_a_missing_picture_is_found() -> None:
    stored = notebooks.read("campaign")
    changed = copy.deepcopy(stored)
    cell = next(c for c in changed.cells if "picture" in notebooks.texts(c))
    cell.outputs = []
    (message,) = notebooks.differences(stored, changed)
    assert cell.source in message
