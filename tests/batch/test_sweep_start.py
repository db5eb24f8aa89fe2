"""Modules that a sweep does not import before its first case, so that it starts quickly."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from rehearsing import CONFIGS

DEFERRED = ("matplotlib", "xarray", "pandas", "scipy.linalg", "scipy.signal", "dask", "filterpy")

# A sweep up to its first case, with all imports of the compiled loop but without compiling.
_PROGRAM = """
import json, os, sys
from pathlib import Path
from rig.cli.app import app
from rig.cli import sweep
from typer.testing import CliRunner

loaded = {}

def begin(opened, executor, *_):
    from rig.compilation import lifting
    from rig.kinds.wavebot.simulation import compiled, simulation
    import numba.np.arraymath
    loaded["before"] = [name for name in sys.argv[3:] if name in sys.modules]
    loaded["threads"] = os.environ.get("OPENBLAS_NUM_THREADS")
    import scipy.linalg
    loaded["solved"] = float(scipy.linalg.solve([[2.0]], [4.0])[0])
    raise ValueError("no case is run")

import rig.sweep.sweep
rig.sweep.sweep.run = begin
sweep._compile = lambda opened: None
CliRunner().invoke(app, ["sweep", sys.argv[1], "--sweeps", sys.argv[2], "--json"])
print(json.dumps(loaded))
"""


def test_plotting_datasets_and_blas_are_imported_after_the_first_case(tmp_path: Path) -> None:
    """scipy.linalg, which is hidden while numba is imported, can be imported afterwards."""
    arguments = [str(CONFIGS / "campaigns" / "quick.yaml"), str(tmp_path), *DEFERRED]
    process = subprocess.run(
        [sys.executable, "-c", _PROGRAM, *arguments], capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stderr
    loaded = json.loads(process.stdout)
    assert loaded == {"before": [], "threads": "1", "solved": 2.0}
