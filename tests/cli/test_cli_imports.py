"""Libraries that a command imports: each process of `rig` pays for them, also those of a run."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """\
import sys
from rig.cli.app import app
try:
    app(["check", "quick", "--json"], standalone_mode=False)
except SystemExit:
    pass
heavy = ("xarray", "pandas", "matplotlib", "numba", "scipy.fft", "scipy.signal", "scipy.optimize")
print([name for name in heavy if name in sys.modules], file=sys.stderr)
"""


def test_a_check_imports_no_library_of_results() -> None:
    """xarray with pandas takes half a second, `scipy.fft` a quarter."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert '"ok": true' in done.stdout
    assert done.stderr.splitlines()[-1] == "[]", done.stderr
