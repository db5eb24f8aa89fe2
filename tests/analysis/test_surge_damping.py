"""The surge damping determination: a closed form, an unknown device, refusals, the command."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS, rehearse, write_yaml
from rig_command import rig_here
from synthetic_runs import POWERS, Row, Shape, plan_json, run_rows, write_run

from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.products.surge_damping import DampingRow as Damped
from rig.kinds.wavebot.products.surge_damping import (
    allowed_stroke,
    as_dict,
    as_text,
    choose_damping,
    measure_rows,
)
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, run_info
from rig.row_contents import LAW, Column, column_records

OMEGA = math.pi  # 0.5 Hz
DAMPINGS = (250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)


def oscillator_row(damping: float, excitation: float = 1000.0, own: float = 1500.0) -> Damped:
    """Return a row at resonance: x = F / (w (own + damping)), drive force = damping w x."""
    velocity = excitation / (own + damping)
    stroke = velocity / OMEGA
    return Damped(0, damping, stroke, damping * velocity, 0.1, -45.0, 0.01, 12.0, True)


def test_damping_for_a_stroke_at_resonance() -> None:
    """Force grows with damping, so the smallest damping that keeps the stroke is chosen.

    The closed form is F / (w stroke) - own, rounded up to 50 N s/m; the interpolation between rows
    is within one step.
    """
    rows = [oscillator_row(damping) for damping in DAMPINGS]
    for stroke in (0.06, 0.09, 0.11):
        exact = 1000.0 / (OMEGA * stroke) - 1500.0
        choice = choose_damping(rows, stroke)
        assert choice.bound == "stroke"
        assert choice.damping == pytest.approx(50.0 * math.ceil(exact / 50.0), abs=50.0)
        assert choice.predicted[0] <= stroke
        assert choice.kp == -choice.damping


def test_heave_power_and_least_force_can_determine_the_damping() -> None:
    rows = [oscillator_row(damping) for damping in DAMPINGS]
    weak_heave = [row._replace(power=-45.0 if row.damping >= 2000.0 else -30.0) for row in rows]
    choice = choose_damping(weak_heave, 1.0)
    assert (choice.bound, choice.damping > 1000.0) == ("heave power", True)
    with_minimum = [row._replace(force=abs(math.log(row.damping / 1000.0)) + 1.0) for row in rows]
    choice = choose_damping(with_minimum, 1.0)
    assert (choice.damping, choice.bound) == (1000.0, "least force")
    assert choice.predicted == pytest.approx((0.127, 1.0, -45.0), abs=1e-3)
    free = choose_damping(rows, 1.0)
    assert (free.bound, free.damping) == ("end of the range", 250.0)
    assert "beyond it were not measured" in as_text(free)


def test_no_damping_keeps_a_small_stroke() -> None:
    choice = choose_damping([oscillator_row(damping) for damping in DAMPINGS], 0.01)
    assert math.isnan(choice.damping)
    assert "no damping of this range keeps a stroke of 0.010 m" in as_text(choice)


def campaign(folder: Path, **keys: Any) -> Path:
    """Write a campaign of four dampings in a small wave.

    The surge stiffness and drag of the device are unknown to the rig.
    """
    plant = write_yaml(
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
    settings = {
        "name": "damping", "rig": str(CONFIGS / "rigs" / "wavebot.yaml"), "plant": str(plant),
        "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        "surge": {"use": "station keeping"}, "tare": {"duration_s": 1},
        "start": {"lead_in_s": 12}, "timing": {"settle_s": 8, "interval_s": 12.1},
        "matrix": {"grid": [{"spring_n_per_m": 7690, "kp_n_s_per_m": -2500, "ki_n_per_m": 0,
                             "surge_kp_n_s_per_m": [-700, -1500, -3000, -6000]}]},
    }  # fmt: skip
    return write_yaml(folder / "campaign.yaml", {**settings, **keys})


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("damping")
    ended = rehearse(campaign(folder), folder / "runs")
    assert ended.outcome.status == "complete"
    return ended.folder


def stepped(
    folder: Path, lost: slice, columns: tuple[Column, ...] = (), **values: list[float]
) -> Path:
    """Write a synthetic run of five dampings whose record lacks these ticks of row 3.

    ``columns`` and ``values``, one for each row, take the place of the gains.
    """
    rows = [Row(i, 0, 7690.0, -2500.0, 0.0, dict.fromkeys(POWERS, -10.0)) for i in range(5)]
    plan = plan_json(rows, Shape())
    for i, row in enumerate(plan["rows"]):
        row |= {"surge_kp": -(500.0 + 500.0 * i), "surge_ki": 0.0}
        if columns:
            plan["columns"] = column_records(columns)
            del row["kp"], row["ki"]
            row |= {name: value[i] for name, value in values.items()}
    data = run_rows(rows, Shape())
    inside = np.flatnonzero((data["plan.row"] == 3) & (data["plan.phase"] == Phase.MEASURE))
    return write_run(folder, np.delete(data, inside[lost]), plan, ticks=len(data))


def test_a_row_with_missing_ticks_is_left_out_and_reported(tmp_path: Path) -> None:
    damaged = stepped(tmp_path / "torn", slice(100, 150))
    message = "row 3 is left out: 50 of 1000 ticks missing from the record"
    rows, notes = measure_rows(damaged)
    assert [row.row for row in rows] == [0, 1, 2, 4]
    assert notes == (message,)
    choice = choose_damping(rows, 0.1)._replace(notes=notes)
    assert f"note: {message}" in as_text(choice)
    assert as_dict(choice)["notes"] == [message]
    code, out, _ = rig_here("surge-damping", damaged, "--stroke-m", "0.1", "--json")
    assert json.loads(out)["notes"] == [message], code
    rows, notes = measure_rows(damaged, incomplete_rows=True)
    assert ([row.row for row in rows], notes) == ([0, 1, 2, 3, 4], ())
    rows, notes = measure_rows(stepped(tmp_path / "gone", slice(None)))
    assert [row.row for row in rows] == [0, 1, 2, 4]
    assert notes == ("row 3 is left out: all of its ticks are missing from the record",)


@pytest.mark.slow
def test_rows_agree_with_the_bem(finished: Path) -> None:
    """The amplitudes are |Fe| a / |k - (m + A) w² + i w (B + drag + damping)| within 3 %.

    Fe, A and B are from the BEM at 0.5 Hz. The tolerance covers the fit of the radiation, the
    loop's delay of 1.5 ms (a stiffness of damping w² 1.5 ms), and remaining transients.
    """
    with np.load(CONFIGS / "plants" / "wavebot_surge_bem.npz") as bem:
        frequency, size = bem["f_hz"], np.abs(bem["Fe_complex"])
        added, radiated = (float(np.interp(0.5, frequency, bem[key])) for key in ("A", "B"))
        force = float(np.interp(0.5, frequency, size))
    for row in measure_rows(finished)[0]:
        own = radiated + 1300.0
        z = 16500.0 - (1420.0 + added) * OMEGA**2 + 1j * OMEGA * (own + row.damping)
        stroke = 0.1 * force / abs(z)
        assert row.stroke == pytest.approx(stroke, rel=0.03)
        assert row.force == pytest.approx(row.damping * OMEGA * stroke, rel=0.03)
        assert row.settled
        assert row.power < 0.0 < row.guide


@pytest.mark.slow
def test_the_command_reports_the_damping(finished: Path) -> None:
    assert allowed_stroke(run_info(finished)) == 0.125  # half of the soft stop's reach of 0.25 m
    code, stdout, err = rig_here("surge-damping", finished, "--stroke-m", "0.08", "--json")
    assert (code, err) == (0, "")
    result = json.loads(stdout)
    assert result["bound_by"] == "stroke"
    rows = {row["damping"]: row["stroke"] for row in result["rows"]}
    below = max(damping for damping in rows if rows[damping] > 0.08)
    above = min(damping for damping in rows if rows[damping] <= 0.08)
    assert below < -result["surge_kp_n_s_per_m"] <= above
    assert all(Path(path).exists() for path in result["written"])
    code, stdout, _ = rig_here("surge-damping", finished, "--stroke-m", "0.001")
    assert (code, "no damping of this range" in stdout) == (1, True)


def test_other_runs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError):
        measure_rows(tmp_path)
    code, _, err = rig_here("surge-damping", tmp_path / "none", "--runs", tmp_path)
    assert (code, "no such run" in err) == (2, True)


def test_rows_of_another_law_may_vary_in_the_damping_alone(tmp_path: Path) -> None:
    columns = (
        Column("level_n", "level", "N", "level", LAW),
        Column("surge_kp_n_s_per_m", "surge_kp", "N*s/m", "surge Kp"),
    )
    run = stepped(tmp_path / "equal", slice(0), columns, level=[300.0] * 5)
    assert [row.damping for row in measure_rows(run)[0]] == [500.0 * i for i in range(1, 6)]
    run = stepped(tmp_path / "varied", slice(0), columns, level=[300.0] * 4 + [400.0])
    code, _, err = rig_here("surge-damping", run)
    assert (code, "level varies as well; only the surge damping may vary" in err) == (2, True)


def test_a_run_without_surge_dampings_is_refused(tmp_path: Path) -> None:
    rows = [Row(0, 0, 7690.0, -2500.0, 0.0, dict.fromkeys(POWERS, -10.0))]
    run = write_run(tmp_path / "run", run_rows(rows, Shape()), plan_json(rows, Shape()))
    code, _, err = rig_here("surge-damping", run)
    assert (code, "its rows have no surge_kp" in err) == (2, True)


def test_the_shipped_campaign_can_be_run() -> None:
    report = check_campaign(CONFIGS / "campaigns" / "surge_damping.yaml")
    assert report.plan is not None, report.text()
    assert {row.setting.spring_rate for row in report.plan.rows} == {7690.0}
