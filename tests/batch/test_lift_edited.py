"""A law edited while a process that has read it goes on is not served to those that start later."""

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
from rig.sweep import lifting

SOURCE = "from numba import njit\\nimport edited_law\\n\\n\\n@njit(cache=True)\\n" \
         "def run(x):\\n    return edited_law.step(x)\\n"
if len(sys.argv) > 2:
    Path(edited_law.__file__).write_text(sys.argv[2])
print(lifting.load("edited", SOURCE, (edited_law,)).run(1.0))
"""


def said(folder: Path, *edit: str) -> float:
    """What a process of its own computes, which edits the law after it has read it."""
    environment = {
        **os.environ, "XDG_CACHE_HOME": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(folder), *edit],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return float(done.stdout)


def test_a_law_that_is_edited_after_it_was_read_is_seen_afterwards(tmp_path: Path) -> None:
    law = tmp_path / "edited_law.py"
    law.write_text(LAW.format(gain=1.0, factor=1.0))
    assert said(tmp_path, LAW.format(gain=1.0, factor=2.0)) == 1.0  # the process has the old one
    assert said(tmp_path) == 2.0
    assert said(tmp_path, LAW.format(gain=3.0, factor=2.0)) == 2.0
    assert said(tmp_path) == 6.0
    folders = len(list((tmp_path / "cache").glob("*/*")))
    assert said(tmp_path) == 6.0
    assert len(list((tmp_path / "cache").glob("*/*"))) == folders  # found, not compiled anew
