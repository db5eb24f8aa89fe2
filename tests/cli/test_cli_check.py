"""`rig check` on a campaign with three bad rows: the report names each row and its reason.

The campaign uses the custom drive with a Z_c that drives the hull. So one campaign can hold a row
with too large a motion, an unstable row, a row with too high a bus voltage, and a row that may run.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command_here import rig

from rig.kinds.wavebot.tasks import examine

CONFIGS = Path(__file__).parents[2] / "configs"
PLANTED = f"""\
name: planted
rig: {CONFIGS}/rigs/wavebot_custom.yaml
sea: {{kind: regular, amplitude_m: 0.26, frequency_hz: 0.4}}
law: {{zc: {{numerator: [90000], denominator: [1, 20]}}}}
matrix:
  csv: rows.csv
"""
ROWS = """\
spring_n_per_m,kp_n_s_per_m,ki_n_per_m,discharge_level
490.9,-7000,0,15
-8508,-4900,4000,15
490.9,-100,0,15
490.9,-7000,0,0
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    path = tmp_path / "planted.yaml"
    path.write_text(PLANTED)
    (tmp_path / "rows.csv").write_text(ROWS)
    return path


def test_bad_rows_are_refused_by_name(campaign: Path) -> None:
    done = rig("check", campaign)
    assert done.returncode == 2
    text = done.stdout
    assert "refused: 3" in text
    assert "the campaign cannot be run" in text
    far, unstable, overvoltage = (
        line for line in text.splitlines() if "rows.csv:" in line and "row " in line
    )

    assert "rows.csv:3:" in far
    assert "row 1 (spring -8508 N/m, Kp -4900 N*s/m, Ki 4000 N/m)" in far
    found = re.search(r"predicted position peak (0\.\d+) m, allowed up to 0\.35 m", far)
    assert found is not None
    assert 0.36 < float(found.group(1)) < 0.6
    assert "limits/wavebot.yaml:4: heave.position_stop_m" in far

    assert "rows.csv:4:" in unstable
    assert "row 2 (spring 490.9 N/m, Kp -100 N*s/m, Ki 0 N/m)" in unstable
    assert "the sampled heave loop is unstable, stable up to 0.514 times these gains" in unstable

    assert "rows.csv:5:" in overvoltage
    assert "row 3 (spring 490.9 N/m, Kp -7000 N*s/m, Ki 0 N/m)" in overvoltage
    assert re.search(r"predicted bus voltage [23]\d\d V, allowed up to 200 V", overvoltage)
    assert "plants/wavebot_custom.yaml:44: drive.overvoltage_trip" in overvoltage


def test_bad_rows_in_json(campaign: Path) -> None:
    done = rig("check", campaign, "--json")
    assert done.returncode == 2
    report = json.loads(done.stdout)
    assert [problem["line"] for problem in report["problems"]] == [3, 4, 5]
    broken = {
        row["row"]: {margin["limit"] for margin in row["margins"] if margin["broken"]}
        for row in report["predictions"]
    }
    assert broken[0] == set()
    assert "position" in broken[1]
    assert "loop gain" in broken[2]
    assert "bus voltage" in broken[3]


def test_no_number_of_a_wide_table_is_cut(campaign: Path) -> None:
    """A width of 100 does not hold all columns of varying settings: the table drops some."""
    text = ROWS.replace("discharge_level", "discharge_level,km_kg,bus_voltage_v")
    lines = [f"{line},{10 * n},75.5" for n, line in enumerate(text.splitlines()[1:])]
    table = "\n".join([text.splitlines()[0], *lines[:3], lines[3].replace("75.5", "80")])
    (campaign.parent / "rows.csv").write_text(f"{table}\n")
    shown = rig("check", campaign, "--rows").stdout
    assert "\N{HORIZONTAL ELLIPSIS}" not in shown
    start = shown.index("All 4 rows")
    assert " bus " in shown[start:]
    assert " mech 2 " not in shown[start:] or " surge " not in shown[start:]


@pytest.mark.parametrize(
    "path", sorted((CONFIGS / "campaigns").glob("*.yaml")), ids=lambda path: path.stem
)
def test_every_ready_campaign_passes(path: Path) -> None:
    """The check includes the prediction; it refuses no row."""
    report = examine(path)
    assert report.ok, report.text()
    assert report.problems == ()


QUICK = """\
name: short
rig: {rig}
sea: {{kind: regular, amplitude_m: 0.1, frequency_hz: 0.5}}
tare: {{duration_s: 1}}
start: {{lead_in_s: 6}}
timing: {{settle_s: 4, interval_s: 8}}
matrix:
  list: [{{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}}]
"""


def test_the_size_of_the_log_is_estimated_and_compared_with_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The estimate is at least the size that the rehearsal then has, and at most a half more."""
    campaign = tmp_path / "short.yaml"
    campaign.write_text(QUICK.format(rig=CONFIGS / "rigs" / "wavebot.yaml"))
    expected = json.loads(rig("check", campaign, "--json").stdout)["log_bytes"]
    done = rig("run", campaign, "--runs", tmp_path / "runs", "--json")
    assert done.returncode == 0, done.stderr
    size = (Path(json.loads(done.stdout)["folder"]) / "run.mcap").stat().st_size
    assert size < expected < 1.5 * size
    done = rig("check", campaign, "--runs", tmp_path / "none yet")
    assert re.search(r"^disk +about [0-9.]+ MB of log *$", done.stdout, re.MULTILINE)
    assert "free" not in done.stderr
    monkeypatch.setattr("rig.host.disk._free_bytes", lambda place: expected - 1.0)
    warning = f"are free in {tmp_path / 'runs'}; --runs names a folder on another disk"
    assert warning in rig("check", campaign, "--runs", tmp_path / "runs").stderr


def test_a_session_has_the_estimate_too() -> None:
    session = CONFIGS / "sessions" / "driveline_short.yaml"
    assert json.loads(rig("check", session, "--json").stdout)["log_bytes"] > 1e6
    assert "\ndisk        about " in rig("check", session).stdout
