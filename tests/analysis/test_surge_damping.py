"""The surge damping determination: a closed form, a blind device, what is refused, the command."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, run, yaml_file
from rig_command import rig_here
from synthetic_runs import Row, Shape, plan_json, run_rows, write_run

from rig.analysis.rows import POWERS
from rig.analysis.surge_damping import Row as Damped
from rig.analysis.surge_damping import allowed_stroke, as_dict, as_text, choose, measured
from rig.planning.campaign import check_campaign
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError
from rig.recording.runs.folder import facts

OMEGA = math.pi  # 0.5 Hz
DAMPINGS = (250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)


def oscillator(damping: float, excitation: float = 1000.0, own: float = 1500.0) -> Damped:
    """A surge axis at resonance: x = F / (w (own + damping)), drive force = damping w x."""
    velocity = excitation / (own + damping)
    stroke = velocity / OMEGA
    return Damped(0, damping, stroke, damping * velocity, 0.1, -45.0, 0.01, 12.0, True)


def test_at_resonance_the_stroke_says_the_damping() -> None:
    """Force grows with the damping, so the least that keeps the stroke counts: the closed form
    F / (w stroke) - own, rounded up to 50 N s/m (interpolated between rows, within one step)."""
    rows = [oscillator(damping) for damping in DAMPINGS]
    for stroke in (0.06, 0.09, 0.11):
        exact = 1000.0 / (OMEGA * stroke) - 1500.0
        choice = choose(rows, stroke)
        assert choice.bound == "stroke"
        assert choice.damping == pytest.approx(50.0 * math.ceil(exact / 50.0), abs=50.0)
        assert choice.predicted[0] <= stroke
        assert choice.kp == -choice.damping


def test_heave_power_may_bind_and_a_least_force_may_lie_within() -> None:
    rows = [oscillator(damping) for damping in DAMPINGS]
    starved = [row._replace(power=-45.0 if row.damping >= 2000.0 else -30.0) for row in rows]
    choice = choose(starved, 1.0)
    assert (choice.bound, choice.damping > 1000.0) == ("heave power", True)
    dipped = [row._replace(force=abs(math.log(row.damping / 1000.0)) + 1.0) for row in rows]
    assert choose(dipped, 1.0)[3:6] == (1000.0, pytest.approx((0.127, 1.0, -45.0), abs=1e-3),
                                       "least force")  # fmt: skip
    free = choose(rows, 1.0)
    assert (free.bound, free.damping) == ("end of the range", 250.0)
    assert "beyond it was not measured" in as_text(free)


def test_a_stroke_that_nothing_keeps() -> None:
    choice = choose([oscillator(damping) for damping in DAMPINGS], 0.01)
    assert math.isnan(choice.damping)
    assert "no damping of this range keeps a stroke of 0.010 m" in as_text(choice)


def campaign(folder: Path, **keys: Any) -> Path:
    """Four dampings in a small wave on a device whose surge stiffness and drag the rig does not
    know."""
    plant = yaml_file(
        folder / "plant.yaml",
        {
            "extends": str(CONFIGS / "plants" / "wavebot_linear.yaml"),
            "bem": str(CONFIGS / "plants" / "wavebot_bem.npz"),
            "surge": {
                "stiffness": {"value": 16500.0, "unit": "N/m", "source": "drawn"},
                "viscous_linear": {"value": 1300.0, "unit": "N s/m", "source": "drawn"},
            },
        },
    )
    whole = {
        "name": "damping", "rig": str(CONFIGS / "rigs" / "wavebot.yaml"), "plant": str(plant),
        "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        "surge": {"use": "station keeping"}, "tare": {"duration_s": 1},
        "start": {"lead_in_s": 12}, "timing": {"settle_s": 8, "interval_s": 12.1},
        "matrix": {"grid": [{"spring_n_per_m": 7690, "kp_n_s_per_m": -2500, "ki_n_per_m": 0,
                             "surge_kp_n_s_per_m": [-700, -1500, -3000, -6000]}]},
    }  # fmt: skip
    return yaml_file(folder / "campaign.yaml", {**whole, **keys})


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("damping")
    ended = run(campaign(folder), folder / "runs")
    assert ended.outcome.status == "complete"
    return ended.folder


def stepped(folder: Path, lost: slice) -> Path:
    """A synthetic run of five dampings; the record lacks these ticks of row 3."""
    rows = [Row(i, 0, 7690.0, -2500.0, 0.0, dict.fromkeys(POWERS, -10.0)) for i in range(5)]
    plan = plan_json(rows, Shape())
    for i, row in enumerate(plan["rows"]):
        row |= {"surge_kp": -(500.0 + 500.0 * i), "surge_ki": 0.0}
    data = run_rows(rows, Shape())
    inside = np.flatnonzero((data["plan.row"] == 3) & (data["plan.phase"] == Phase.MEASURE))
    return write_run(folder, np.delete(data, inside[lost]), plan, ticks=len(data))


def test_a_row_that_the_record_lacks_ticks_of_is_left_out_and_named(tmp_path: Path) -> None:
    torn = stepped(tmp_path / "torn", slice(100, 150))
    said = "row 3 is left out: 50 of 1000 ticks missing from the record"
    found = measured(torn)
    assert [row.row for row in found.rows] == [0, 1, 2, 4]
    assert found.notes == (said,)
    choice = choose(found.rows, 0.1)._replace(notes=found.notes)
    assert f"note: {said}" in as_text(choice)
    assert as_dict(choice)["notes"] == [said]
    code, out, _ = rig_here("surge-damping", torn, "--stroke-m", "0.1", "--json")
    assert json.loads(out)["notes"] == [said], code
    asked = measured(torn, incomplete_rows=True)
    assert ([row.row for row in asked.rows], asked.notes) == ([0, 1, 2, 3, 4], ())
    gone = measured(stepped(tmp_path / "gone", slice(None)))
    assert [row.row for row in gone.rows] == [0, 1, 2, 4]
    assert gone.notes == ("row 3 is left out: all of its ticks are missing from the record",)


@pytest.mark.slow
def test_rows_are_those_of_the_bem(finished: Path) -> None:
    """Amplitudes by the BEM at 0.5 Hz and the drawn stiffness and drag: |Fe| a / |k - (m + A) w²
    + i w (B + drag + damping)|. 3 %: the fit of the radiation, the loop's delay of 1.5 ms (a
    stiffness of damping w² 1.5 ms), and what is left of transients."""
    with np.load(CONFIGS / "plants" / "wavebot_surge_bem.npz") as bem:
        frequency, size = bem["f_hz"], np.abs(bem["Fe_complex"])
        added, radiated = (float(np.interp(0.5, frequency, bem[key])) for key in ("A", "B"))
        force = float(np.interp(0.5, frequency, size))
    for row in measured(finished).rows:
        own = radiated + 1300.0
        z = 16500.0 - (1420.0 + added) * OMEGA**2 + 1j * OMEGA * (own + row.damping)
        stroke = 0.1 * force / abs(z)
        assert row.stroke == pytest.approx(stroke, rel=0.03)
        assert row.force == pytest.approx(row.damping * OMEGA * stroke, rel=0.03)
        assert row.settled
        assert row.power < 0.0 < row.guide


@pytest.mark.slow
def test_the_command_tells_the_damping(finished: Path) -> None:
    assert allowed_stroke(facts(finished)) == 0.125  # half of the soft stop's reach of 0.25 m
    code, said, err = rig_here("surge-damping", finished, "--stroke-m", "0.08", "--json")
    assert (code, err) == (0, "")
    told = json.loads(said)
    assert told["bound_by"] == "stroke"
    rows = {row["damping"]: row["stroke"] for row in told["rows"]}
    below = max(damping for damping in rows if rows[damping] > 0.08)
    above = min(damping for damping in rows if rows[damping] <= 0.08)
    assert below < -told["surge_kp_n_s_per_m"] <= above
    assert all(Path(path).exists() for path in told["written"])
    code, said, _ = rig_here("surge-damping", finished, "--stroke-m", "0.001")
    assert (code, "no damping of this range" in said) == (1, True)


def test_other_runs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError):
        measured(tmp_path)
    code, _, err = rig_here("surge-damping", tmp_path / "none", "--runs", tmp_path)
    assert (code, "no such run" in err) == (2, True)


def test_the_shipped_campaign_can_be_run() -> None:
    report = check_campaign(CONFIGS / "campaigns" / "surge_damping.yaml")
    assert report.plan is not None, report.text()
    assert {row.spring_rate for row in report.plan.rows} == {7690.0}
