"""Modules that a sweep does not import before its first case, so that it starts quickly."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from rehearsing import CONFIGS, write_campaign

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
    from rig.compilation import tick_code
    import numba.np.arraymath
    loaded["before"] = [name for name in sys.argv[3:] if name in sys.modules]
    loaded["threads"] = os.environ.get("OPENBLAS_NUM_THREADS")
    import scipy.linalg
    loaded["solved"] = float(scipy.linalg.solve([[2.0]], [4.0])[0])
    raise ValueError("no case is run")

import rig.sweeps.sweep
rig.sweeps.sweep.run = begin
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


# The first window of a campaign, and whether the compiler was imported for it.
_WARM = """
import sys
from pathlib import Path
from rig.campaign import build_plan
from rig.kinds.wavebot.campaign import open_campaign
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator

campaign = open_campaign(Path(sys.argv[1]))
plan = build_plan(campaign)
simulator = CampaignSimulator(campaign, plan)
next(iter(simulator.simulate(plan)))
print("numba" in sys.modules)
"""


_GAINS: dict[str, dict[str, float]] = {
    "impedance": {"kp_n_s_per_m": -2000, "ki_n_per_m": 0},
    "nonlinear damping": {"quadratic_n_s2_per_m2": 4000, "coulomb_n": 0},
}


@pytest.mark.parametrize("law", _GAINS)
def test_a_later_process_finds_the_compiled_loop(law: str, tmp_path: Path) -> None:
    """It does not import the compiler."""
    path = write_campaign(
        tmp_path,
        sea={"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        timing={"settle_s": 1, "interval_s": 5.5},
        law=law,
        matrix={"list": [{"spring_n_per_m": 490.9} | _GAINS[law]]},
    )
    imported = [
        subprocess.check_output([sys.executable, "-c", _WARM, str(path)], text=True)
        for _ in range(2)
    ]
    assert imported[1] == "False\n"
