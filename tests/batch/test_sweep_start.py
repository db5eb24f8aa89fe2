"""What a sweep does not load before its first case: a second start must not wait for it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from rehearsing import CONFIGS

LATER = ("matplotlib", "xarray", "pandas", "scipy.linalg", "scipy.signal", "dask", "filterpy")

# A sweep up to where its cases begin, all imports of the compiled loop with it, nothing compiled.
_PROGRAM = """
import json, os, sys
from pathlib import Path
import rig.cli
from rig.cli import sweep
from typer.testing import CliRunner

loaded = {}

def begin(opened, executor, *_):
    from rig.sweep import compiled, lifting, simulation as subject
    import numba.np.arraymath
    loaded["before"] = [name for name in sys.argv[3:] if name in sys.modules]
    loaded["threads"] = os.environ.get("OPENBLAS_NUM_THREADS")
    import scipy.linalg
    loaded["solved"] = float(scipy.linalg.solve([[2.0]], [4.0])[0])
    raise ValueError("no case is run")

import rig.sweep.sweep
import rig.cli.sweep_run
rig.sweep.sweep.run = begin
rig.cli.sweep_run._compile = lambda opened: None
CliRunner().invoke(rig.cli.app, ["sweep", sys.argv[1], "--sweeps", sys.argv[2], "--json"])
print(json.dumps(loaded))
"""


def test_pictures_datasets_and_blas_come_after_the_first_case(tmp_path: Path) -> None:
    """And scipy.linalg, which is hidden from numba for a moment, is there for who wants it."""
    words = [str(CONFIGS / "campaigns" / "quick.yaml"), str(tmp_path), *LATER]
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told == {"before": [], "threads": "1", "solved": 2.0}
