"""Open-loop stimuli: every kind as the loop plays it, and what is wrong with them in words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from rehearsing import CONFIGS, campaign_file

from rig.config.reference import AnyStimulus, Reference
from rig.design.predictions import predict
from rig.execution.rehearsal.job import problems
from rig.kinds.wavebot.build import wavebot_params
from rig.planning.campaign import check
from rig.planning.campaign.multisine import design, odd_lines, some_odd_lines
from rig.planning.campaign.reference import Record, table, ticks_of

RATE, FACTOR = 1000, 76.98
ADAPTER: TypeAdapter[AnyStimulus] = TypeAdapter(Reference)
BAND = {"low_hz": 0.2, "high_hz": 1.0, "repeat_s": 20}


def stimulus(**keys: Any) -> AnyStimulus:
    return ADAPTER.validate_python(keys, strict=True)


def force(told: AnyStimulus, several: tuple[int, ...] = (1,), record: Record | None = None) -> Any:
    return np.array(table(told, FACTOR, RATE, 3, several, record))


def lines(values: Any) -> Any:
    return np.abs(np.fft.rfft(values)) * 2.0 / len(values)


@pytest.mark.parametrize(
    ("keys", "newtons"), [({"amplitude_a": 10}, 769.8), ({"amplitude_n": 500.0}, 500.0)]
)
@pytest.mark.parametrize(
    "kind",
    [
        {"kind": "sine", "frequency_hz": 0.35},
        {"kind": "stepped sine", "frequencies_hz": [0.2, 0.5, 1.0], "hold_s": 10},
        {"kind": "chirp", **BAND},
        {"kind": "chirp", "sweep": "logarithmic", **BAND},
        {"kind": "multisine", **BAND},
        {"kind": "multisine", "colour": "pink", "lines": "odd", **BAND},
    ],
    ids=lambda kind: f"{kind['kind']} {len(kind)}",
)
def test_the_peak_is_what_was_asked_for(
    kind: dict[str, Any], keys: dict[str, Any], newtons: float
) -> None:
    """0.5 % below at most: the greatest value may fall between two ticks."""
    values = force(stimulus(**kind, **keys))
    assert 0.995 * newtons <= np.abs(values).max() <= newtons * (1 + 1e-3)


def test_a_stepped_sine_goes_on_without_a_jump() -> None:
    told = stimulus(
        kind="stepped sine", amplitude_n=100, hold_s=10,
        frequencies_hz={"from": 0.2, "to": 1.0, "step": 0.2},
    )  # fmt: skip
    values = force(told)
    assert len(values) == 50_000
    steps = np.abs(np.diff(np.append(values, values[0])))
    assert steps.max() <= 100 * 2 * np.pi * 1.0 / RATE * 1.001
    for i, cycles in enumerate((2, 4, 6, 8, 10)):
        held = lines(values[10_000 * i : 10_000 * (i + 1)])
        assert held[cycles] == pytest.approx(100.0)


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_a_chirp_sweeps_its_band_and_ends_where_it_began(sweep: str) -> None:
    values = force(
        stimulus(kind="chirp", sweep=sweep, amplitude_n=100, **{**BAND, "repeat_s": 100})
    )
    steps = np.abs(np.diff(np.append(values, values[0])))
    assert steps.max() <= 100 * 2 * np.pi * 1.0 / RATE * 1.02
    power = lines(values) ** 2
    frequency = np.arange(len(power)) / 100.0
    inside = (frequency > 0.15) & (frequency < 1.1)
    assert power[inside].sum() > 0.98 * power.sum()
    turns = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    assert 1.0 / np.diff(turns)[[0, -1]] * RATE == pytest.approx([0.235, 0.99], abs=0.03)


def test_realisations_are_the_same_lines_with_other_phases() -> None:
    told = stimulus(kind="multisine", amplitude_a=10, **BAND)
    both = force(told, (1, 2)).reshape(2, -1)
    assert both[0].tolist() == force(told).tolist()
    assert abs(np.corrcoef(both)[0, 1]) < 0.6
    for values in both:
        found = lines(values)
        assert np.flatnonzero(found > 1e-6).tolist() == list(range(4, 21))
        assert np.ptp(found[4:21]) < 1e-9 * found.max()


def test_lines_left_out_are_the_same_in_all_realisations() -> None:
    told = stimulus(
        kind="multisine", amplitude_n=100, lines="random odd", **{**BAND, "repeat_s": 100}
    )
    both = [np.flatnonzero(lines(v) > 1e-6) for v in force(told, (1, 2)).reshape(2, -1)]
    assert both[0].tolist() == both[1].tolist()
    assert (both[0] % 2 == 1).all()
    odd = odd_lines(np.arange(20, 101))
    assert len(both[0]) == len(odd) - len(odd) // 4
    other = design(0.2, 1.0, 100.0, rms=1.0, seed=3, choose=some_odd_lines(4))
    assert other.cycles.tolist() != both[0].tolist()


def test_a_record_is_played_on_straight_lines_and_begins_again(tmp_path: Path) -> None:
    rows = "\n".join(f"{i / 50:.2f},{np.sin(2 * np.pi * i / 50):.6f}" for i in range(150))
    (tmp_path / "push.csv").write_text(f"time_s,push\n{rows}\n")
    told = {"kind": "recorded", "file": "push.csv", "channel": "push", "unit": "A", "end_s": 2}
    path = campaign(tmp_path, told, {})
    report = check(path, also=problems, foresee=predict)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.campaign.record is not None
    assert report.campaign.record.rate_hz == 50.0
    assert "reference" in [one.role for one in report.campaign.files]
    played = force(stimulus(**told), (1,), report.campaign.record)
    t = np.arange(2000) / RATE
    assert np.abs(played - FACTOR * np.sin(2 * np.pi * t)).max() < 0.003 * FACTOR


def campaign(folder: Path, told: dict[str, Any], column: dict[str, Any], **keys: Any) -> Path:
    matrix = {"grid": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": 0, "ki_n_per_m": 0, **column}]}
    calm = {"sea": {"kind": "calm"}}
    return campaign_file(folder, reference=told, matrix=matrix, **{**calm, **keys})


def test_rows_measure_whole_repeat_periods_and_play_their_realisation(tmp_path: Path) -> None:
    told = {"kind": "multisine", "amplitude_a": 10, **BAND}
    path = campaign(tmp_path, told, {"realisation": [2, 5]}, timing={"periods": 3})
    report = check(path, also=problems)
    assert report.ok, report.text()
    assert report.plan is not None
    assert report.campaign is not None
    assert [(row.periods, row.measure) for row in report.plan.rows] == [(3, 60.0)] * 2
    one = report.campaign
    params = wavebot_params(
        one.file, one.rig, one.limits, report.plan.segments, report.plan.setpoints
    ).rig
    assert params.reference.realisations == 2
    assert set(params.setpoints.realisation) == {0, 1}
    expected = table(stimulus(**told), FACTOR, RATE, 1, (2, 5))
    assert params.reference.table == pytest.approx(expected, rel=1e-3)


MULTISINE = {"kind": "multisine", "amplitude_a": 10, **BAND}


@pytest.mark.parametrize(
    ("told", "column", "keys", "said"),
    [
        ({"kind": "sine", "frequency_hz": 0.5}, {}, {}, "amplitude missing"),
        ({**MULTISINE, "amplitude_n": 5}, {}, {}, "allowed one of the two"),
        (
            {"kind": "stepped sine", "amplitude_a": 1, "frequencies_hz": [0.25], "hold_s": 10},
            {}, {}, "the nearest that does is 0.2 Hz",
        ),
        ({**MULTISINE, "low_hz": 1.0, "high_hz": 0.5}, {}, {}, "not above low_hz"),
        ({**MULTISINE, "low_hz": 0.201, "high_hz": 0.204}, {}, {}, "no multiple of 1/20"),
        ({**MULTISINE, "repeat_s": 20.00007}, {}, {}, "no whole number of ticks"),
        ({"kind": "sine", "amplitude_a": 1, "frequency_hz": 0.5}, {"realisation": 2}, {}, "only a"),
        (
            {**MULTISINE, "repeat_s": 3600}, {"realisation": [1, 2, 3]}, {},
            "allowed 2 in a campaign",
        ),
        ({**MULTISINE, "axis": "surge"}, {}, {"surge": {"use": "off"}}, "surge cannot be pushed"),
        (
            {"kind": "recorded", "file": "no.csv", "channel": "x", "unit": "N", "end_s": 9},
            {}, {}, "'no.csv' is not there",
        ),
        ({"kind": "recorded", "file": "a.txt", "channel": "x", "unit": "N", "end_s": 9},
         {}, {}, "*.csv"),
        ({**MULTISINE}, {}, {"timing": {"interval_s": 20}}, "allowed interval_s at least 30 s"),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_place(
    told: dict[str, Any], column: dict[str, Any], keys: dict[str, Any], said: str, tmp_path: Path
) -> None:
    report = check(campaign(tmp_path, told, column, **keys), also=problems)
    assert not report.ok
    assert any(said in problem.message for problem in report.problems), report.text()


def test_a_calibration_has_nothing_to_push(tmp_path: Path) -> None:
    sea = {"kind": "pink", "hm0_m": 0.1}
    path = campaign_file(tmp_path, sea=sea, device="absent", reference=MULTISINE)
    assert "nothing to push" in check(path).text()


def test_the_shipped_campaigns_are_those_of_the_report() -> None:
    """MASK4: three amplitudes, two realisations, two periods of 300 s each."""
    report = check(CONFIGS / "campaigns" / "identification.yaml", also=problems)
    assert report.plan is not None
    settings = [(r.setting.reference_scale, r.setting.realisation) for r in report.plan.rows]
    assert settings == [(s, r) for s in (1.0, 2.0, 3.0) for r in (1.0, 2.0)]
    assert {(r.periods, r.measure) for r in report.plan.rows} == {(2, 600.0)}
    for name in ("identification_short", "identification_surge", "identification_waves"):
        made = check(CONFIGS / "campaigns" / f"{name}.yaml", also=problems)
        assert made.ok, made.text()


def test_ticks_of_a_sine_are_whole_seconds() -> None:
    assert ticks_of(stimulus(kind="sine", amplitude_a=1, frequency_hz=0.37), RATE) == 100_000
    with pytest.raises(ValueError, match="on no whole second"):
        ticks_of(stimulus(kind="sine", amplitude_a=1, frequency_hz=0.5000001), RATE)
