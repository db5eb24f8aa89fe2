"""`rig sweep` and `rig recommend` warn of a spring map that is not valid today."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rig_command import rig_here

from rig.cli import calibration_dates
from rig.cli import sweep as sweep_command
from rig.kinds.wavebot.campaign import open_campaign
from rig.sweeps import sweep

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
    """Write a campaign of one row on a rig whose spring map was valid before a day."""
    (folder / "map.yaml").write_text(MAP % before)
    rig = {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "spring_map": "map.yaml"}
    (folder / "rig.yaml").write_text(json.dumps(rig))
    path = folder / "campaign.yaml"
    row = {"spring_n_per_m": 0, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    sea = {"kind": "regular", "amplitude_m": 0.02, "frequency_hz": 1.0}
    timing = {"settle_s": 1, "interval_s": 2}
    contents: dict[str, Any] = {
        "name": "dated",
        "rig": "rig.yaml",
        "sea": sea,
        "matrix": {"list": [row]},
        "timing": timing,
        "start": {"set_point_s": 0, "lead_in_s": 1},
    }
    path.write_text(json.dumps(contents))
    return path


@pytest.mark.parametrize(("before", "warns"), [("2001-01-01", True), ("2999-01-01", False)])
def test_a_sweep_warns(
    before: str, warns: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sweep runs no cases: the warning does not depend on them."""

    def run_no_case(opened: sweep.Sweep, *_: Any) -> Any:
        raise ValueError("no case is run")

    monkeypatch.setattr(sweep, "run", run_no_case)
    monkeypatch.setattr(sweep_command, "compile_loop", lambda _: None)
    _, _, err = rig_here("sweep", campaign(tmp_path, before), "--sweeps", tmp_path / "sweeps")
    assert ("spring_map v1 does not hold on" in err) is warns
    assert "no case is run" in err


EXPIRED, VALID = "2001-01-01", "2999-01-01"
BEFORE = "rig.spring_map.valid.dates.before"


@pytest.mark.parametrize(
    ("own", "swept", "expected"),
    [
        (VALID, [EXPIRED, VALID], {EXPIRED}),
        (EXPIRED, [VALID, "2998-01-01"], set()),  # no case has the file's own value
        (EXPIRED, [EXPIRED, "2002-01-01"], {EXPIRED, "2002-01-01"}),
        (EXPIRED, [], {EXPIRED}),
    ],
)
def test_a_sweep_warns_of_the_values_that_its_cases_have(
    own: str, swept: list[str], expected: set[str], tmp_path: Path
) -> None:
    """The sweep has another parameter that does not change the map."""
    parameters = ["sea.amplitude_m=0.01,0.02"]
    parameters += [f"{BEFORE}=" + ",".join(f"'{day}'" for day in swept)] if swept else []
    opened = sweep.open_sweep(
        campaign(tmp_path, own), parameters, tmp_path / "sweeps", sequential=False, lead_in=15.0
    )
    expired = calibration_dates.expired_calibrations(opened.task, opened.swept, date(2026, 1, 1))
    assert len(expired) == len(expected)
    text = str([problem.text() for problem in expired])
    assert {day for day in (EXPIRED, VALID, "2002-01-01") if day in text} == expected


@pytest.mark.parametrize(("before", "count"), [("2001-01-01", 1), ("2999-01-01", 0)])
def test_a_recommendation_warns(
    before: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The warning depends on the campaign only; the recommendation itself is a stub."""
    opened = open_campaign(campaign(tmp_path, before))
    result = SimpleNamespace(campaign=opened)
    command = "rig.kinds.wavebot.commands.recommend"
    monkeypatch.setattr(f"{command}.recommend", lambda *_: result)
    for name, stub in (("write", []), ("as_dict", {}), ("as_text", "nothing")):
        monkeypatch.setattr(
            f"rig.kinds.wavebot.recommend.report.{name}", lambda *_, value=stub: value
        )
    monkeypatch.setattr(f"{command}.find_run_of_kind", lambda *arguments: arguments[1])
    code, out, err = rig_here("recommend", tmp_path, "--no-pictures", "--json")
    assert code == 0, err
    assert len(json.loads(out)["warnings"]) == count
    code, _, err = rig_here("recommend", tmp_path, "--no-pictures")
    assert code == 0
    assert err.count("spring_map v1 does not hold on") == count
