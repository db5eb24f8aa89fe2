"""Execution of the notebooks in docs/notebooks, and the comparison of their outputs.

`python tests/api/notebooks.py [NAME...]` executes notebooks and stores their outputs.

Of an output, its text is compared: what differs from run to run (ids and times of runs) is left
out, and numbers may differ by 1 in 10,000, because processors round differently. A picture must be
there; its pixels depend on the fonts of the host.
"""

from __future__ import annotations

import math
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
NAMES = ("campaign", "identification", "bench_session")
RELATIVE = 1e-4
_VARYING = (
    re.compile(r"\d{8}T\d{6}Z"),  # of the id of a run
    re.compile(r"\d{4}-\d{2}-\d{2}[ T]\d{2}:\d{2}:\d{2}(\.\d+)?(\+00:00| UTC|Z)?"),
    re.compile(r"0x[0-9a-f]+"),
)
_NUMBER = re.compile(r"[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_ZERO = 1e-9  # smaller differences are rounding errors of sums


def read(name: str) -> Any:
    """Return a stored notebook."""
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def execute(notebook: Any, folder: Path) -> Any:
    """Return a copy of a notebook with the outputs of its execution in a folder."""
    os.environ["IPYTHONDIR"] = str(folder / ".ipython")
    copy = nbformat.from_dict(notebook)
    for cell in copy.cells:
        cell.pop("execution", None)
    client = NotebookClient(
        copy, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    )
    executed = client.execute()
    for cell in executed.cells:
        cell.metadata = {}  # times of the execution
        if cell.cell_type == "code":
            # Progress and warnings of libraries on standard error are no results.
            cell.outputs = [each for each in cell.outputs if each.get("name") != "stderr"]
    return executed


def texts(cell: Any) -> list[str]:
    """Return the text of each output of a cell; a picture as its type."""
    found = []
    for output in cell.get("outputs", []):
        if output.output_type == "stream":
            found.append(str(output.text))
            continue
        data = output.get("data", {})
        found.append("picture" if "image/png" in data else str(data.get("text/plain", "")))
    return found


def same_text(stored: str, executed: str) -> bool:
    """Return whether two texts agree: their words are equal, their numbers nearly."""
    for pattern in _VARYING:
        stored, executed = pattern.sub("*", stored), pattern.sub("*", executed)

    def shape(text: str) -> list[str]:
        return _NUMBER.sub("#", text).split()

    pairs = zip(_NUMBER.findall(stored), _NUMBER.findall(executed), strict=False)
    return shape(stored) == shape(executed) and all(
        math.isclose(_value(a), _value(b), rel_tol=RELATIVE, abs_tol=_ZERO) for a, b in pairs
    )


def _value(text: str) -> float:
    return float(text.replace("\u2212", "-"))


def differences(stored: Any, executed: Any) -> list[str]:
    """Return a message for each cell whose outputs differ."""
    found = []
    for place, (before, now) in enumerate(zip(stored.cells, executed.cells, strict=True)):
        a, b = texts(before), texts(now)
        agree = len(a) == len(b) and all(map(same_text, a, b))
        if not agree:
            found.append(f"cell {place}:\n{before.source}\nstored:\n{a}\nexecuted:\n{b}")
    return found


def main() -> None:
    """Execute notebooks and store their outputs."""
    for name in sys.argv[1:] or NAMES:
        with tempfile.TemporaryDirectory() as folder:
            executed = execute(read(name), Path(folder))
        path = FOLDER / f"{name}.ipynb"
        nbformat.write(executed, path)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
