"""A complete kind of rig outside the tree: checked, rehearsed, replayed, swept, run on its wires.

The kind is the modular one under another name in a distribution of its own. Nothing in the core
belongs to the original, so all commands must work with the copy alone.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from benchmarks.support.free_port import free_port

ROOT = Path(__file__).resolve().parents[2]
CYLINDER = ROOT / "configs" / "plants" / "cylinder_bem.nc"
STATIONS = ("mechanical", "dc")
ROWS = [{"kp_n_s_per_m": -7000, "ki_n_per_m": 0}, {"kp_n_s_per_m": -5300, "ki_n_per_m": 3200}]


def write_distribution(site: Path) -> None:
    """Write the copy as package `wec_outside`, and the entry point of its distribution."""
    package = site / "wec_outside"
    source = ROOT / "rig" / "kinds" / "modular"
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    for file in package.rglob("*.py"):
        text = file.read_text().replace("rig.kinds.modular", "wec_outside")
        file.write_text(text.replace('Literal["modular"]', 'Literal["outside"]'))
    info = site / "wec_outside-0.7.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: wec-outside\nVersion: 0.7\n")
    (info / "entry_points.txt").write_text("[wec_rig.kinds]\noutside = wec_outside\n")


pytestmark = pytest.mark.long(group="outside kind")  # compiles a copy of a kind


@pytest.fixture(name="lab", scope="module")
def of_lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the distribution and a rig of its kind, with two short rows."""
    lab = tmp_path_factory.mktemp("lab")
    write_distribution(lab / "site")
    rig(lab, "new", "rig", "buoy", "--bem", CYLINDER, "--dof", "Heave")
    for name in ("rig.yaml", "rig_hil.yaml"):
        file = lab / "buoy" / name
        text = file.read_text().replace("kind: modular", "kind: outside")
        addresses = [f"port: {free_port()}" if "port: " in each else each
                     for each in re.split(r"(port: \d+)", text)]  # fmt: skip
        file.write_text("".join(addresses))
    campaign = lab / "buoy" / "campaign.yaml"
    text = campaign.read_text().split("tare:")[0]
    campaign.write_text(
        f"{text}tare: {{duration_s: 1}}\nstart: {{lead_in_s: 12}}\n"
        f"timing: {{settle_s: 4, interval_s: 11}}\nmatrix: {{list: {json.dumps(ROWS)}}}\n"
    )
    return lab


def rig(lab: Path, *arguments: object) -> Any:
    """Return the JSON of a command that succeeds in a process that finds the distribution."""
    paths = os.pathsep.join(map(str, (ROOT, lab / "site")))
    done = subprocess.run(
        [sys.executable, "-P", "-m", "rig", *map(str, arguments), "--json"],
        capture_output=True, text=True, check=False, cwd=lab, timeout=600,
        env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


def test_the_kind_is_listed_with_its_origin(lab: Path) -> None:
    (listed,) = [each for each in rig(lab, "kinds")["kinds"] if each["name"] == "outside"]
    assert (listed["origin"], listed["package"]) == ("wec-outside 0.7", "wec_outside")


@pytest.fixture(name="run", scope="module")
def of_run(lab: Path) -> Any:
    return rig(lab, "run", "buoy/campaign.yaml")


def test_it_is_checked_rehearsed_and_replayed(lab: Path, run: Any) -> None:
    assert rig(lab, "check", "buoy/campaign.yaml")["rows"] == 2
    assert (run["status"], run["reason"]) == ("complete", "PLAN_END")
    assert rig(lab, "replay", run["folder"])["same"] is True


@pytest.mark.slow
def test_a_sweep_has_the_powers_of_the_rehearsal(lab: Path, run: Any) -> None:
    """Within 0.5 %: a sweep begins each row anew, so its transient before the window is another."""
    swept = rig(lab, "sweep", "buoy/campaign.yaml", "--out", "swept.nc")
    assert swept["rows"] == {"complete": 2}
    rows = xarray.load_dataset(lab / run["folder"] / "rows.nc", engine="h5netcdf")
    simulated = xarray.load_dataset(lab / "swept.nc", engine="h5netcdf")
    for station in STATIONS:
        power = rows[f"power_{station}"].values
        assert (power < 0.0).all()
        found = simulated[f"power_{station}"].values.ravel()
        np.testing.assert_allclose(found, power, rtol=0.005)


@pytest.mark.realtime
def test_it_runs_on_its_wires(lab: Path) -> None:
    """Power within 2 %: the wires' delay shifts the force against the velocity by about 1 ms."""
    campaign = lab / "buoy" / "one_row.yaml"
    text = (lab / "buoy" / "campaign.yaml").read_text()
    campaign.write_text(text.replace(f", {json.dumps(ROWS[1])}", ""))
    rehearsed = rig(lab, "run", campaign)
    wired = rig(lab, "run", campaign, "--rig", "buoy/rig_hil.yaml", "--sim")
    assert wired["status"] == "complete"
    powers = [
        xarray.load_dataset(lab / each["folder"] / "rows.nc", engine="h5netcdf")[
            "power_mechanical"
        ].values
        for each in (rehearsed, wired)
    ]
    np.testing.assert_allclose(powers[1], powers[0], rtol=0.02)
