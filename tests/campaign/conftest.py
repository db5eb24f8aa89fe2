"""Fixture that writes campaigns next to copies of the shipped rig and limits, and a stub plant."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

CONFIGS = Path(__file__).parents[2] / "configs"

HEAD = """\
name: test
rig: ../rigs/wavebot.yaml
sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.5}
"""

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a campaign (by default with one row) and returns its path."""
    for folder in ("rigs", "limits"):
        shutil.copytree(CONFIGS / folder, tmp_path / folder)
    (tmp_path / "plants").mkdir()
    (tmp_path / "plants" / "wavebot.yaml").write_text("kind: stub\n")
    (tmp_path / "campaigns").mkdir()

    def write_campaign(body: str = "", head: str = HEAD) -> Path:
        path = tmp_path / "campaigns" / "test.yaml"
        if "matrix" not in body and "extends" not in body:
            body += "\nmatrix: {list: [{spring_n_per_m: 0, kp_n_s_per_m: -2000, ki_n_per_m: 0}]}\n"
        path.write_text(head + body)
        return path

    return write_campaign
