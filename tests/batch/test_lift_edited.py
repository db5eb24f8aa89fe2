"""Compiled code of a process with an outdated law is not used by processes that start later."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

LAW = "GAIN = {gain}\n\n\ndef step(x):\n    return {factor} * GAIN * x\n"
PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import edited_law
from pathlib import Path
from rig.compilation import lifting

SOURCE = "from numba import njit\\nimport edited_law\\n\\n\\n@njit(cache=True)\\n" \
         "def run(x):\\n    return edited_law.step(x)\\n"
if len(sys.argv) > 2:
    Path(edited_law.__file__).write_text(sys.argv[2])
print(lifting.load("edited", SOURCE, (edited_law,)).run(1.0))
"""


def run_edited(folder: Path, *edits: str) -> float:
    """Run a process that imports the law, then edits its file; return the law's result."""
    environment = {
        **os.environ, "XDG_CACHE_HOME": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder), *edits],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return float(process.stdout)


def test_law_edited_after_import_is_recompiled_by_later_processes(tmp_path: Path) -> None:
    law = tmp_path / "edited_law.py"
    law.write_text(LAW.format(gain=1.0, factor=1.0))
    # The process computes with the law that it imported before the edit.
    assert run_edited(tmp_path, LAW.format(gain=1.0, factor=2.0)) == 1.0
    assert run_edited(tmp_path) == 2.0
    assert run_edited(tmp_path, LAW.format(gain=3.0, factor=2.0)) == 2.0
    assert run_edited(tmp_path) == 6.0
    folders = len(list((tmp_path / "cache").glob("*/*")))
    assert run_edited(tmp_path) == 6.0
    assert (
        len(list((tmp_path / "cache").glob("*/*"))) == folders
    )  # read from the cache, not compiled again
