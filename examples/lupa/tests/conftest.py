"""The package as an installer leaves it, for commands in processes of their own."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

LUPA = Path(__file__).resolve().parents[1]
Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(name="site", scope="session")
def of_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder for PYTHONPATH with the package and the metadata that an installer writes."""
    site = tmp_path_factory.mktemp("site")
    (site / "wec_lupa").symlink_to(LUPA / "wec_lupa")
    info = site / "wec_lupa-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: wec-lupa\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[wec_rig.laws]\nlupa feedback = wec_lupa.feedback\n")
    return site


@pytest.fixture(name="rig", scope="session")
def of_rig(site: Path) -> Command:
    """Return a function that runs `rig` with arguments where the package is installed."""

    def run(*arguments: object, folder: Path = LUPA) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "rig", *map(str, arguments)],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(site), "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
        )

    return run
