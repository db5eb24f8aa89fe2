"""Seas: height, shape, exact repeat, phase convention, refusals, and a real basin record."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from measured_data import reference
from plant_files import bem
from random_examples import examples

from sim_plant import sea_states
from sim_plant.bem import excitation_at

DT = 0.001
MASK4 = [(0.127, 3.45), (0.127, 2.5), (0.127, 1.58), (0.254, 2.5), (0.254, 3.45)]


@pytest.mark.parametrize(("hs", "tp"), MASK4)
def test_height_is_hs(hs: float, tp: float) -> None:
    sea = sea_states.jonswap(hs, tp, 3.3, 300.0, seed=7)
    elevation = sea_states.tables(sea, bem(), DT).elevation
    assert sea_states.hm0(sea) == pytest.approx(hs, rel=1e-6)
    assert 4.0 * elevation.std() == pytest.approx(hs, rel=1e-6)
    assert float(sea.description["hm0_raw_m"]) == pytest.approx(hs, rel=0.03)


@pytest.mark.parametrize(("tp", "te"), [(3.45, 3.116), (2.5, 2.258), (1.58, 1.427)])
def test_shape_has_the_moments_of_the_spectrum(tp: float, te: float) -> None:
    """m(-1), m0, m1 against a fine integral over the same band, and the known energy period.

    The known period is that of the full spectrum: the cut at 2 Hz lengthens the shortest by 0.6 %.
    """
    sea = sea_states.jonswap(0.127, tp, 3.3, 300.0, seed=1)
    f = sea_states.frequencies(sea)
    energy = 0.5 * np.abs(sea.amplitude) ** 2
    fine = np.linspace(f[0], f[-1], 200001)
    density = sea_states.jonswap_density(fine, 0.127, tp, 3.3)
    moments = {n: float(np.sum(energy * f**n)) for n in (-1, 0, 1)}
    total = {n: float(np.trapezoid(density * fine**n, fine)) for n in (-1, 0, 1)}
    for n in (-1, 1):
        assert moments[n] / moments[0] == pytest.approx(total[n] / total[0], rel=1e-3)
    assert moments[-1] / moments[0] == pytest.approx(te, rel=0.007)


def test_mhkit_factor_is_0_12_percent_high() -> None:
    raw = sea_states.jonswap(0.254, 3.45, 3.3, 300.0, seed=1).description["hm0_raw_m"]
    assert float(raw) / 0.254 == pytest.approx(1.0012, abs=0.0005)


def test_table_is_an_independent_cosine_sum() -> None:
    """Re(sum Fe a e^{-iwt}) term by term: amplitude, phase sign and time origin."""
    sea = sea_states.jonswap(0.127, 2.5, 3.3, 20.0, seed=3)
    table = sea_states.tables(sea, bem(), DT)
    t = np.arange(0, 20000, 97) * DT
    elevation = np.zeros(t.size)
    force = np.zeros(t.size)
    for f, a in zip(sea_states.frequencies(sea), sea.amplitude, strict=True):
        coefficient = complex(excitation_at(bem(), np.array([f]))[0])
        turn = 2 * np.pi * f * t
        elevation += abs(a) * np.cos(turn - np.angle(a))
        force += abs(a * coefficient) * np.cos(turn - np.angle(a) - np.angle(coefficient))
    np.testing.assert_allclose(table.elevation[::97], elevation, atol=1e-12)
    np.testing.assert_allclose(table.excitation[::97], force, atol=1e-7)


def test_excitation_leads_at_a_crest() -> None:
    """Fe has a phase of -33 degrees at 0.5 Hz in e^{-iwt}: the force leads the crest."""
    table = sea_states.tables(sea_states.regular(0.127, 0.5), bem(), DT)
    assert table.elevation[0] == pytest.approx(0.127)
    lead = (len(table.excitation) - int(np.argmax(table.excitation))) * DT
    phase = -np.angle(excitation_at(bem(), np.array([0.5]))[0])
    assert lead == pytest.approx(phase / (2 * np.pi * 0.5), abs=DT)


def test_nothing_excites_above_2_hz() -> None:
    rng = np.random.default_rng(0)
    sea = sea_states.recorded(0.1 * rng.standard_normal(2000), 20.0)
    table = sea_states.tables(sea, bem(), DT)
    f = np.fft.rfftfreq(table.excitation.size, DT)
    force = np.abs(np.fft.rfft(table.excitation))
    assert force[f > 2.0 + 1e-9].max() <= 1e-9 * force.max()
    assert sea_states.frequencies(sea_states.jonswap(0.1, 1.0, 1.0, 300.0, 0)).max() <= 2.0


@pytest.mark.parametrize(
    ("frequency", "repeat"), [(0.3, 10.0), (1 / 3.45, 69.0), (0.5, 2.0), (0.1 + 0.2, 10.0)]
)
def test_regular_repeat(frequency: float, repeat: float) -> None:
    assert sea_states.regular(0.127, frequency).repeat == repeat


@given(st.integers(1, 2000), st.integers(1, 1000))
@settings(max_examples=examples(50))
def test_any_rational_frequency_repeats_exactly(numerator: int, denominator: int) -> None:
    frequency = numerator / denominator
    if frequency > 2.0:
        return
    sea = sea_states.regular(0.1, frequency)
    cycles = sea.repeat * frequency
    assert cycles == pytest.approx(round(cycles), abs=1e-9)
    assert int(sea.cycles[0]) == round(cycles)


def test_refusals() -> None:
    with pytest.raises(ValueError, match="nearest that does"):
        sea_states.regular(0.1, 0.2898550724)
    with pytest.raises(ValueError, match="frequency"):
        sea_states.regular(0.1, 2.5)
    with pytest.raises(ValueError, match="amplitude"):
        sea_states.regular(float("nan"), 0.5)
    with pytest.raises(ValueError, match="no whole number"):
        sea_states.tables(sea_states.recorded(np.arange(7.0), 13.0), bem(), DT)
    with pytest.raises(ValueError, match="half the tick rate"):
        sea_states.tables(sea_states.recorded(np.arange(5000.0), 1000.0), bem(), 0.005)
    with pytest.raises(ValueError, match="finite"):
        sea_states.recorded([0.0, 1.0, float("nan"), 1.0], 1.0)
    for bad in ({"tp_s": 0.1}, {"gamma": 0.5}, {"repeat_s": 1.0}, {"hs_m": -1.0}):
        good = {"hs_m": 0.1, "tp_s": 2.0, "gamma": 3.3, "repeat_s": 300.0}
        with pytest.raises(ValueError, match=next(iter(bad)).split("_", maxsplit=1)[0]):
            sea_states.jonswap(**{**good, **bad}, seed=0)


def test_calm_and_seeds() -> None:
    assert not np.any(sea_states.tables(sea_states.calm(), bem(), DT).excitation)
    sea, repeated, other = (sea_states.jonswap(0.1, 2.0, 3.3, 60.0, seed) for seed in (1, 1, 2))
    assert np.array_equal(sea.amplitude, repeated.amplitude)
    assert not np.array_equal(sea.amplitude, other.amplitude)


def read_twe(name: str) -> np.ndarray:
    """Probe SAA 01 of a basin record, m, 20 Hz (a reader used only by this test)."""
    lines = reference(name).read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("DATA:"))
    rows = [line.split("\t") for line in lines[first:] if line.strip()]
    return np.array([[float(row[2]), float(row[3])] for row in rows])


def test_basin_record_drives_the_plant() -> None:
    """Empty-basin pink record, 120-1320 s: four repeat periods of 300 s."""
    time, inches = read_twe("AWDC-SAADAQ-s00113.twe").T
    window = (time >= 120.0 - 0.01) & (time < 1320.0 - 0.01)
    record = 0.0254 * inches[window]
    assert record.size == 24000
    sea = sea_states.recorded(record, 20.0)
    assert sea_states.hm0(sea) == pytest.approx(0.253, rel=0.005)
    centred = record - record.mean()
    shift = 6000
    product = float(np.sum(centred[:-shift] * centred[shift:]))
    sizes = float(np.sum(centred[:-shift] ** 2) * np.sum(centred[shift:] ** 2)) ** 0.5
    assert product / sizes >= 0.98
    lags = range(shift - 200, shift + 201)
    peak = max(lags, key=lambda k: float(np.mean(centred[:-k] * centred[k:])))
    assert peak / 20.0 == pytest.approx(300.0, abs=0.05)
    table = sea_states.tables(sea, bem(), DT)
    assert table.elevation.size == 1_200_000
    np.testing.assert_allclose(table.elevation[::50], centred, atol=1e-4)


LINES = {
    "repeat_s": 10.0,
    "cycles": [2, 5, 20],
    "amplitude_m": [0.1, 0.0, 0.02],
    "phase_rad": [0.3, 1.0, -2.0],
}


def test_components_are_the_listed_cosines() -> None:
    sea = sea_states.components(**LINES)
    t = np.arange(10_000) * DT
    expected = 0.1 * np.cos(2 * np.pi * 0.2 * t + 0.3) + 0.02 * np.cos(2 * np.pi * 2.0 * t - 2.0)
    np.testing.assert_allclose(sea_states.tables(sea, bem(), DT).elevation, expected, atol=1e-14)
    assert sea_states.hm0(sea) == pytest.approx(4.0 * np.sqrt(0.5 * (0.1**2 + 0.02**2)), rel=1e-12)
    assert sea_states.frequencies(sea).tolist() == [0.2, 0.5, 2.0]


def test_a_component_is_a_regular_sea_of_its_frequency() -> None:
    tables = sea_states.tables(sea_states.components(2.0, [1], [0.127], [0.0]), bem(), DT)
    regular = sea_states.tables(sea_states.regular(0.127, 0.5), bem(), DT)
    assert tables.elevation.tobytes() == regular.elevation.tobytes()
    assert tables.excitation.tobytes() == regular.excitation.tobytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cycles": [2, 5]}, "three lists of one length"),
        ({"cycles": [], "amplitude_m": [], "phase_rad": []}, "three lists of one length"),
        ({"cycles": 2, "amplitude_m": 0.1, "phase_rad": 0.0}, "three lists of one length"),
        ({"cycles": [0, 5, 20]}, "whole numbers >= 1 that rise"),
        ({"cycles": [2.5, 5, 20]}, "whole numbers >= 1 that rise"),
        ({"cycles": [5, 2, 20]}, "whole numbers >= 1 that rise"),
        ({"cycles": [2, 2, 20]}, "whole numbers >= 1 that rise"),
        ({"cycles": [2, 5, float("nan")]}, "whole numbers >= 1 that rise"),
        ({"cycles": [2, 5, 21]}, "2.1 Hz; allowed up to 2 Hz"),
        ({"amplitude_m": [0.1, -0.1, 0.1]}, "amplitudes must be >= 0 m"),
        ({"amplitude_m": [0.1, float("inf"), 0.1]}, "amplitudes must be >= 0 m"),
        ({"phase_rad": [0.0, float("nan"), 0.0]}, "phases finite"),
        ({"repeat_s": 0.0}, "repeat must be"),
        ({"repeat_s": 4000.0}, "repeat must be"),
    ],
)
def test_invalid_components_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sea_states.components(**{**LINES, **change})
