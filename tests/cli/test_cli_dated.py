"""A spring map that does not hold today is warned of by who sweeps and by who recommends."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rig_command import rig_here

from rig.cli import calibration_dates, sweep_run
from rig.planning.campaign import open_campaign
from rig.sweep import sweep

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
MAP = """\
name: spring_map
version: 1
quantity: spring_map
unit: N/m
correction: {kind: table, recorded: [-50, 50], corrected: [4000, -9000]}
stroke_m: [0.5, 0.5]
valid: {dates: {before: %s}}
outside: refuse
source: a test
reason: to see
"""


def campaign(folder: Path, before: str) -> Path:
    """One row on a rig with a spring map that held before a day."""
    (folder / "map.yaml").write_text(MAP % before)
    rig = {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "spring_map": "map.yaml"}
    (folder / "rig.yaml").write_text(json.dumps(rig))
    path = folder / "campaign.yaml"
    row = {"spring_n_per_m": 0, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    sea = {"kind": "regular", "amplitude_m": 0.02, "frequency_hz": 1.0}
    timing = {"settle_s": 1, "interval_s": 2}
    told: dict[str, Any] = {
        "name": "dated",
        "rig": "rig.yaml",
        "sea": sea,
        "matrix": {"list": [row]},
    }
    path.write_text(
        json.dumps(
            told
            | {
                "matrix": {"list": [row]},
                "timing": timing,
                "start": {"set_point_s": 0, "lead_in_s": 1},
            }
        )
    )
    return path


@pytest.mark.parametrize(("before", "told"), [("2001-01-01", True), ("2999-01-01", False)])
def test_a_sweep_warns(
    before: str, told: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its cases are left out: what is said does not depend on them."""

    def nothing(opened: sweep.Sweep, *_: Any) -> Any:
        raise ValueError("no case is run")

    monkeypatch.setattr(sweep, "run", nothing)
    monkeypatch.setattr(sweep_run, "_compile", lambda _: None)
    _, _, err = rig_here("sweep", campaign(tmp_path, before), "--sweeps", tmp_path / "sweeps")
    assert ("spring_map v1 does not hold on" in err) is told
    assert "no case is run" in err


LATE, FINE = "2001-01-01", "2999-01-01"
BEFORE = "rig.spring_map.valid.dates.before"


@pytest.mark.parametrize(
    ("own", "swept", "told"),
    [
        (FINE, [LATE, FINE], {LATE}),
        (LATE, [FINE, "2998-01-01"], set()),  # no case has the file's own
        (LATE, [LATE, "2002-01-01"], {LATE, "2002-01-01"}),
        (LATE, [], {LATE}),
    ],
)
def test_a_sweep_warns_of_the_values_that_its_cases_have(
    own: str, swept: list[str], told: set[str], tmp_path: Path
) -> None:
    """Beside a parameter that changes nothing of the map."""
    words = ["sea.amplitude_m=0.01,0.02"]
    words += [f"{BEFORE}=" + ",".join(f"'{day}'" for day in swept)] if swept else []
    opened = sweep.open_sweep(
        campaign(tmp_path, own), words, tmp_path / "sweeps", sequential=False, lead_in=15.0
    )
    late = calibration_dates.of_cases(opened.campaign, opened.swept, date(2026, 1, 1))
    assert len(late) == len(told)
    assert {
        day for day in (LATE, FINE, "2002-01-01") if day in str([p.text() for p in late])
    } == told


@pytest.mark.parametrize(("before", "told"), [("2001-01-01", 1), ("2999-01-01", 0)])
def test_a_recommendation_warns(
    before: str, told: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it is asked for is looked at, not what it finds."""
    opened = open_campaign(campaign(tmp_path, before))
    found = SimpleNamespace(campaign=opened)
    monkeypatch.setattr("rig.design.recommend.recommendation.advise", lambda *_: found)
    for name, told_of in (("write", []), ("as_dict", {}), ("as_text", "nothing")):
        monkeypatch.setattr(f"rig.design.recommend.report.{name}", lambda *_, what=told_of: what)
    monkeypatch.setattr("rig.cli.find_run.find_run", lambda named, _: named)
    code, out, err = rig_here("recommend", tmp_path, "--no-pictures", "--json")
    assert code == 0, err
    assert len(json.loads(out)["warnings"]) == told
    code, _, err = rig_here("recommend", tmp_path, "--no-pictures")
    assert code == 0
    assert err.count("spring_map v1 does not hold on") == told
