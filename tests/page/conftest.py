from __future__ import annotations

from pathlib import Path

import pytest
from made_once import made_once
from rig_command import rig


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run of four rows."""

    def make(folder: Path) -> None:
        result = rig("run", "quick", "--runs", folder)
        assert result.returncode == 0, result.stderr

    (run,) = made_once(tmp_path_factory, "page_run", make).iterdir()
    return run
