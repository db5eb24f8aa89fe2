"""The wheel of the tree, and installations of it in virtual environments of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from made_once import made_once

ROOT = Path(__file__).resolve().parents[1]
UV = Path(sys.executable).with_name("uv")
CONSTRAINTS = str(ROOT / "constraints.txt")


def command(*arguments: object) -> str:
    """Run a command and return its output; a failure shows what it printed."""
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{arguments}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def build(folder: Path) -> None:
    """Build the wheel of the tree."""
    if UV.is_file():
        command(UV, "build", "--quiet", "--wheel", "--build-constraint", CONSTRAINTS,
                "--out-dir", folder, ROOT)  # fmt: skip
    else:
        command(sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", folder, ROOT)


def wheel_of(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel of the tree, or the released one that WEC_RIG_WHEEL names."""
    if released := os.environ.get("WEC_RIG_WHEEL"):
        return Path(released).resolve()
    (path,) = made_once(tmp_path_factory, "wheel", build).glob("*.whl")
    return path


class Installation:
    """A virtual environment with the wheel, and an empty folder in which its commands run."""

    def __init__(self, environment: Path, folder: Path) -> None:
        self.folder = folder
        self.program = environment / "bin" / "rig"
        (self.site,) = environment.glob("lib/python*/site-packages")
        self.variables = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def start(self, *arguments: object) -> subprocess.Popen[str]:
        """Start `rig ARGUMENTS` in the folder."""
        return subprocess.Popen(
            [str(self.program), *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.folder,
            env=self.variables,
        )

    def rig(self, *arguments: object, code: int = 0) -> str:
        """Run `rig ARGUMENTS` to its end and return its output."""
        process = self.start(*arguments)
        out, err = process.communicate(timeout=600)
        assert process.returncode == code, f"{arguments}\n{out}\n{err}"
        return out

    def json(self, *arguments: object) -> Any:
        """Run `rig ARGUMENTS --json` and return what it printed."""
        return json.loads(self.rig(*arguments, "--json"))

    def files(self) -> dict[Path, tuple[int, int]]:
        """Return size and time of every installed file but compiled Python."""
        return {
            path: (path.stat().st_size, path.stat().st_mtime_ns)
            for path in self.site.rglob("*")
            if path.is_file() and path.suffix != ".pyc"
        }


def install(folder: Path, *packages: object, python: str = sys.executable) -> Path:
    """Return a new virtual environment with packages and what they require, in tested versions."""
    if UV.is_file():
        command(UV, "venv", "--quiet", "--python", python, folder)
        pip = (UV, "pip", "install", "--quiet", "--python", folder / "bin" / "python")
    else:
        command(python, "-m", "venv", folder)
        pip = (folder / "bin" / "python", "-m", "pip", "install", "--quiet")
    command(*pip, "--constraint", CONSTRAINTS, *packages)
    return folder
