from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from rehearsing import Execution


@pytest.fixture(params=["interpreted", pytest.param("compiled", marks=pytest.mark.slow)])
def execution(request: pytest.FixtureRequest) -> Execution:
    """Both executions of a rehearsal's ticks."""
    return Execution(request.param)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 3 MB; skipped where it may not be mounted."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small file system cannot be mounted here (needs root)")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)
