"""Open-loop stimuli: the force table of every kind, and the problems of invalid ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from rehearsing import CONFIGS, write_campaign

from rig.config.reference import AnyStimulus, Reference
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.predictions.rows import predict
from rig.kinds.wavebot.rehearsal.job import problems
from rig.planning.multisine import design_multisine, odd_lines, random_odd_lines
from rig.planning.reference import ReferenceRecord, force_table, repeat_ticks

RATE, FACTOR = 1000, 76.98
ADAPTER: TypeAdapter[AnyStimulus] = TypeAdapter(Reference)
BAND = {"low_hz": 0.2, "high_hz": 1.0, "repeat_s": 20}


def stimulus(**keys: Any) -> AnyStimulus:
    return ADAPTER.validate_python(keys)


def force(
    reference: AnyStimulus,
    realisations: tuple[int, ...] = (1,),
    record: ReferenceRecord | None = None,
) -> Any:
    return np.array(force_table(reference, FACTOR, RATE, 3, realisations, record))


def lines(values: Any) -> Any:
    return np.abs(np.fft.rfft(values)) * 2.0 / len(values)


@pytest.mark.parametrize(
    ("keys", "newtons"),
    [({"amplitude_a": 10}, 769.8), ({"amplitude_n": 500.0}, 500.0), ({"amplitude_n_m": 9.0}, 9.0)],
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
        {"kind": "noise", **BAND},
        {"kind": "profile", "points": [[5, 0], [15, -1], [15, 0.5]], "repeat_s": 20},
    ],
    ids=lambda kind: f"{kind['kind']} {len(kind)}",
)
def test_the_peak_is_the_given_amplitude(
    kind: dict[str, Any], keys: dict[str, Any], newtons: float
) -> None:
    """The peak may be up to 0.5 % too low, because it may fall between two ticks."""
    values = force(stimulus(**kind, **keys))
    assert 0.995 * newtons <= np.abs(values).max() <= newtons * (1 + 1e-3)


def test_noise_is_gaussian_within_its_band() -> None:
    """Of 2,400 lines, the power in four bands differs by 4 % of itself, the kurtosis by 0.05."""
    band = {"low_hz": 0.2, "high_hz": 1.0, "repeat_s": 3000.0}
    values = force(stimulus(kind="noise", amplitude_n=100.0, seed=5, **band))
    spectrum = lines(values)
    inside = spectrum[600:3001]
    assert np.delete(spectrum, np.arange(600, 3001)).max() < 1e-9 * inside.max()
    power = [np.mean(part**2) for part in np.array_split(inside, 4)]
    assert max(power) < 1.25 * min(power)
    assert np.mean(values**4) / np.mean(values**2) ** 2 == pytest.approx(3.0, abs=0.2)
    other = force(stimulus(kind="noise", amplitude_n=100.0, seed=6, **band))
    assert abs(np.corrcoef(values, other)[0, 1]) < 0.1


def test_a_profile_has_ramps_and_steps() -> None:
    reference = stimulus(
        kind="profile", amplitude_n=200, repeat_s=20,
        points=[[2, 0], [6, 1], [6, 0], [10, -0.5], [12, -0.5], [12, 0.25]],
    )  # fmt: skip
    values = force(reference)
    at = [values[round(time * RATE)] for time in (0.0, 1.0, 4.0, 6.0, 8.0, 11.0, 12.0, 19.0)]
    assert at == pytest.approx([0.0, 0.0, 100.0, 0.0, -50.0, -100.0, 50.0, 50.0])
    assert values[round(6.0 * RATE) - 1] == pytest.approx(200.0 - 50.0 / RATE)


def test_a_step_of_a_profile_is_at_its_tick() -> None:
    """57000 / 100000 * 100 is below 57 in binary numbers."""
    reference = stimulus(kind="profile", amplitude_n=1, repeat_s=100, points=[[57, 0], [57, 1]])
    values = force(reference)
    assert (values[56_999], values[57_000]) == (0.0, 1.0)


def test_a_stepped_sine_has_no_steps() -> None:
    reference = stimulus(
        kind="stepped sine", amplitude_n=100, hold_s=10,
        frequencies_hz={"from": 0.2, "to": 1.0, "step": 0.2},
    )  # fmt: skip
    values = force(reference)
    assert len(values) == 50_000
    steps = np.abs(np.diff(np.append(values, values[0])))
    assert steps.max() <= 100 * 2 * np.pi * 1.0 / RATE * 1.001
    for i, cycles in enumerate((2, 4, 6, 8, 10)):
        amplitudes = lines(values[10_000 * i : 10_000 * (i + 1)])
        assert amplitudes[cycles] == pytest.approx(100.0)


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_a_chirp_sweeps_its_band_and_is_periodic(sweep: str) -> None:
    values = force(
        stimulus(kind="chirp", sweep=sweep, amplitude_n=100, **{**BAND, "repeat_s": 100})
    )
    steps = np.abs(np.diff(np.append(values, values[0])))
    assert steps.max() <= 100 * 2 * np.pi * 1.0 / RATE * 1.02
    power = lines(values) ** 2
    frequency = np.arange(len(power)) / 100.0
    inside = (frequency > 0.15) & (frequency < 1.1)
    assert power[inside].sum() > 0.98 * power.sum()
    crossings = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    assert 1.0 / np.diff(crossings)[[0, -1]] * RATE == pytest.approx([0.235, 0.99], abs=0.03)


def test_realisations_have_the_same_lines_with_other_phases() -> None:
    reference = stimulus(kind="multisine", amplitude_a=10, **BAND)
    spectra = force(reference, (1, 2)).reshape(2, -1)
    assert spectra[0].tolist() == force(reference).tolist()
    assert abs(np.corrcoef(spectra)[0, 1]) < 0.6
    for values in spectra:
        amplitudes = lines(values)
        assert np.flatnonzero(amplitudes > 1e-6).tolist() == list(range(4, 21))
        assert np.ptp(amplitudes[4:21]) < 1e-9 * amplitudes.max()


def test_omitted_lines_are_the_same_in_all_realisations() -> None:
    reference = stimulus(
        kind="multisine", amplitude_n=100, lines="random odd", **{**BAND, "repeat_s": 100}
    )
    line_sets = [np.flatnonzero(lines(v) > 1e-6) for v in force(reference, (1, 2)).reshape(2, -1)]
    assert line_sets[0].tolist() == line_sets[1].tolist()
    assert (line_sets[0] % 2 == 1).all()
    odd = odd_lines(np.arange(20, 101))
    assert len(line_sets[0]) == len(odd) - len(odd) // 4
    other = design_multisine(0.2, 1.0, 100.0, rms=1.0, seed=3, choose=random_odd_lines(4))
    assert other.cycles.tolist() != line_sets[0].tolist()


def test_a_record_is_interpolated_linearly_and_repeats(tmp_path: Path) -> None:
    rows = "\n".join(f"{i / 50:.2f},{np.sin(2 * np.pi * i / 50):.6f}" for i in range(150))
    (tmp_path / "force.csv").write_text(f"time_s,force\n{rows}\n")
    reference = {
        "kind": "recorded",
        "file": "force.csv",
        "channel": "force",
        "unit": "A",
        "end_s": 2,
    }
    path = campaign(tmp_path, reference, {})
    report = check_campaign(path, extra_check=problems, predictor=predict)
    assert report.ok, report.text()
    assert report.campaign is not None
    assert report.campaign.record is not None
    assert report.campaign.record.rate_hz == 50.0
    assert "reference" in [file.role for file in report.campaign.files]
    played = force(stimulus(**reference), (1,), report.campaign.record)
    t = np.arange(2000) / RATE
    assert np.abs(played - FACTOR * np.sin(2 * np.pi * t)).max() < 0.003 * FACTOR


def campaign(folder: Path, reference: dict[str, Any], column: dict[str, Any], **keys: Any) -> Path:
    matrix = {"grid": [{"spring_n_per_m": 490.9, "kp_n_s_per_m": 0, "ki_n_per_m": 0, **column}]}
    calm = {"sea": {"kind": "calm"}}
    return write_campaign(folder, reference=reference, matrix=matrix, **{**calm, **keys})


def test_rows_measure_whole_repeat_periods_and_play_their_realisation(tmp_path: Path) -> None:
    reference = {"kind": "multisine", "amplitude_a": 10, **BAND}
    path = campaign(tmp_path, reference, {"realisation": [2, 5]}, timing={"periods": 3})
    report = check_campaign(path, extra_check=problems)
    assert report.ok, report.text()
    assert report.plan is not None
    assert report.campaign is not None
    assert [(row.periods, row.measure) for row in report.plan.rows] == [(3, 60.0)] * 2
    checked = report.campaign
    params = wavebot_params(checked, report.plan.segments, report.plan.setpoints).rig
    assert params.reference.realisations == 2
    assert set(params.setpoints.realisation) == {0, 1}
    expected = force_table(stimulus(**reference), FACTOR, RATE, 1, (2, 5))
    assert params.reference.table == pytest.approx(expected, rel=1e-3)


MULTISINE = {"kind": "multisine", "amplitude_a": 10, **BAND}


@pytest.mark.parametrize(
    ("reference", "column", "keys", "expected"),
    [
        ({"kind": "sine", "frequency_hz": 0.5}, {}, {}, "amplitude missing"),
        ({**MULTISINE, "amplitude_n": 5}, {}, {}, "allowed one of them"),
        (
            {"kind": "multisine", "amplitude_n_m": 5, **BAND}, {}, {},
            "heave does not rotate; allowed a force in N or a current in A",
        ),
        (
            {"kind": "stepped sine", "amplitude_a": 1, "frequencies_hz": [0.25], "hold_s": 10},
            {}, {}, "the nearest that does is 0.2 Hz",
        ),
        ({**MULTISINE, "low_hz": 1.0, "high_hz": 0.5}, {}, {}, "not above low_hz"),
        ({**MULTISINE, "low_hz": 0.201, "high_hz": 0.204}, {}, {}, "no multiple of 1/20"),
        ({**MULTISINE, "repeat_s": 20.00007}, {}, {}, "not a whole number of ticks"),
        ({"kind": "sine", "amplitude_a": 1, "frequency_hz": 0.5}, {"realisation": 2}, {}, "only a"),
        (
            {**MULTISINE, "repeat_s": 3600}, {"realisation": [1, 2, 3]}, {},
            "allowed 2 in a campaign",
        ),
        ({**MULTISINE, "axis": "surge"}, {}, {"surge": {"use": "off"}}, "surge cannot be excited"),
        (
            {"kind": "recorded", "file": "no.csv", "channel": "x", "unit": "N", "end_s": 9},
            {}, {}, "no.csv: No such file or directory; allowed the path of a file",
        ),
        ({"kind": "recorded", "file": "a.txt", "channel": "x", "unit": "N", "end_s": 9},
         {}, {}, "*.csv"),
        (
            {"kind": "profile", "amplitude_a": 1, "points": [[3, 0], [2, 1]], "repeat_s": 20},
            {}, {}, "times ascend from 0 to repeat_s",
        ),
        (
            {"kind": "profile", "amplitude_a": 1, "points": [[3, 0.5]], "repeat_s": 20},
            {}, {}, "the largest share is 0.5; it must be 1 or -1",
        ),
        ({"kind": "noise", "amplitude_a": 1, **BAND, "low_hz": 2.0}, {}, {}, "not above low_hz"),
        ({**MULTISINE}, {}, {"timing": {"interval_s": 20}}, "allowed interval_s at least 30 s"),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)  # fmt: skip
def test_invalid_references_are_reported(
    reference: dict[str, Any],
    column: dict[str, Any],
    keys: dict[str, Any],
    expected: str,
    tmp_path: Path,
) -> None:
    report = check_campaign(campaign(tmp_path, reference, column, **keys), extra_check=problems)
    assert not report.ok
    assert any(expected in problem.message for problem in report.problems), report.text()


def test_a_calibration_refuses_a_reference(tmp_path: Path) -> None:
    sea = {"kind": "pink", "hm0_m": 0.1}
    path = write_campaign(tmp_path, sea=sea, device="absent", reference=MULTISINE)
    assert "no axis to excite" in check_campaign(path).text()


def test_the_shipped_campaigns_are_those_of_the_report() -> None:
    """MASK4: three amplitudes, two realisations, two periods of 300 s each."""
    report = check_campaign(CONFIGS / "campaigns" / "identification.yaml", extra_check=problems)
    assert report.plan is not None
    settings = [(r.setting.reference_scale, r.setting.realisation) for r in report.plan.rows]
    assert settings == [(s, r) for s in (1.0, 2.0, 3.0) for r in (1.0, 2.0)]
    assert {(r.periods, r.measure) for r in report.plan.rows} == {(2, 600.0)}
    for name in ("identification_short", "identification_surge", "identification_waves"):
        report = check_campaign(CONFIGS / "campaigns" / f"{name}.yaml", extra_check=problems)
        assert report.ok, report.text()


def test_ticks_of_a_sine_are_whole_seconds() -> None:
    assert repeat_ticks(stimulus(kind="sine", amplitude_a=1, frequency_hz=0.37), RATE) == 100_000
    with pytest.raises(ValueError, match="not repeat on a whole second"):
        repeat_ticks(stimulus(kind="sine", amplitude_a=1, frequency_hz=0.5000001), RATE)
