"""A refused recommendation names the campaign to run; adaptive runs serve like others in waves."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest
from identified import rehearse_identification
from made_once import made_once
from rig_command import rig_here

from rig.analysis.rows import COMPLETE, row_table
from rig.kinds.wavebot.twin.needed_runs import IDENTIFICATION, campaign_of
from rig.recording.runs import run_info

pytestmark = pytest.mark.slow

ADAPTIVE = """\
extends: default
name: looking
start: {lead_in_s: 20}
timing: {settle_s: 4, interval_s: 8}
adaptive: {precision_w: 5, first_rows: 2, max_rows: 3}
matrix:
  grid:
    - spring_n_per_m: -2763
      kp_n_s_per_m: [-1500, -2500]
      ki_n_per_m: [0, 3000]
"""


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in calm water with an open-loop reference."""
    folder = made_once(tmp_path_factory, "twin", rehearse_identification)
    (run,) = (folder / "runs").glob("*/")
    return run


@pytest.fixture(scope="module")
def adaptive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rehearsed adaptive run in waves."""
    folder = tmp_path_factory.mktemp("adaptive")
    (folder / "looking.yaml").write_text(ADAPTIVE)
    code, _, error = rig_here("run", folder / "looking.yaml", "--runs", folder / "runs")
    assert code == 0, error
    (run,) = (folder / "runs").glob("*/")
    return run


def refusal(*arguments: str | Path) -> str:
    """Return the message of a refused recommendation."""
    code, out, error = rig_here("recommend", *arguments)
    assert (code, out) == (2, "")
    return error


def named_campaign(message: str) -> str:
    """Return the campaign that a refusal names; it must be one that `rig check` accepts."""
    (name,) = re.findall(r"`rig run (\w+)", message)
    code, _, error = rig_here("check", name)
    assert code == 0, error
    return name


def test_a_run_in_waves_alone_needs_the_identification(adaptive: Path) -> None:
    message = refusal(adaptive)
    assert "rows in waves alone, the device's impedance" in message
    assert named_campaign(message) == IDENTIFICATION
    assert message.rstrip().endswith(f"{IDENTIFICATION} {adaptive.name}")


def test_a_run_in_calm_water_alone_needs_a_sea(calm: Path) -> None:
    message = refusal(calm)
    assert "no run in waves" in message
    assert named_campaign(message) == "default"
    assert "--campaign default" in message


def test_a_run_of_another_kind_names_what_serves_it(tmp_path: Path) -> None:
    code, _, error = rig_here("run", "sessions/flap_free_decay", "--runs", tmp_path)
    assert code == 0, error
    (run,) = tmp_path.glob("*/")
    message = refusal(run)
    assert "needs a run of kind wavebot; this one is oswec bench" in message
    assert "adaptive:" in message


def test_an_adaptive_run_serves_with_an_identification(
    calm: Path, adaptive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "next.yaml"
    code, text, error = rig_here(
        "recommend", calm, adaptive, "--rows", "2", "--no-pictures", "-o", out, "--json"
    )
    assert code == 0, error
    measured = json.loads(text)["measured"]
    states = row_table(adaptive)["state"].values.tolist()
    assert len(measured) == states.count(COMPLETE) >= 2, states
    code, text, error = rig_here("check", out)
    assert code == 0, out.read_text() + text + error


def test_a_shipped_campaign_is_found_from_another_folder(
    adaptive: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A run records a path that is relative to the folder in which it was started."""
    monkeypatch.chdir(tmp_path)
    run = run_info(adaptive)
    shipped = Path(__file__).parents[2] / "configs" / "campaigns" / "quick.yaml"
    digest = hashlib.sha256(shipped.read_bytes()).hexdigest()
    for sha256, expected in ((digest, shipped), ("0" * 64, None)):
        entry = {"role": "campaign", "path": "configs/campaigns/quick.yaml", "sha256": sha256}
        recorded = run._replace(config={**run.config, "files": [entry]})
        assert campaign_of(recorded) == expected
