"""Each Python of this host installs the wheel, rehearses compiled, and replays to the bit."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from installation import Installation, install, wheel_of

pytestmark = pytest.mark.slow


def interpreter(version: str) -> str:
    """Return the path of a Python of this host; empty if it has none of the version.

    PYTHON_3_12=/path/to/python3.12 names one; else it is on the PATH or among those of pyenv.
    """
    if named := os.environ.get("PYTHON_" + version.replace(".", "_")):
        return named
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"), "versions")
    found = [shutil.which(f"python{version}"), *map(str, pyenv.glob(f"{version}.*/bin/python"))]
    for path in filter(None, found):  # a program of pyenv on the PATH may stand for no Python
        done = subprocess.run([path, "-c", ""], capture_output=True, check=False)
        if done.returncode == 0:
            return path
    return ""


@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13", "3.14"])
def test_each_python_rehearses_and_replays(
    version: str, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    if not (python := interpreter(version)):
        pytest.skip(f"this host has no Python {version}")
    wheel, folder = wheel_of(tmp_path_factory), tmp_path / "work"
    folder.mkdir()
    installation = Installation(install(tmp_path / "venv", wheel, python=python), folder)
    assert f"Python {version}." in installation.rig("--version")
    (folder / "short.yaml").write_text(
        "extends: quick\nname: short\ntare: {duration_s: 1}\n"
        "start: {set_point_s: 1, lead_in_s: 4}\ntiming: {settle_s: 1, interval_s: 4}\n"
    )
    installation.rig("compile", "short.yaml")
    run = installation.json("run", "short.yaml")
    assert run["status"] == "complete"
    compiled_from = json.loads((folder / run["folder"] / "run.json").read_text())["compiled_from"]
    assert 0 <= compiled_from <= 1
    assert installation.json("replay", run["folder"], "--interpreted")["same"]
