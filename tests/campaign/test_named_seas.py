"""The shipped sea files: heights, spectra and energy periods against independent formulas."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML
from scipy.integrate import quad
from scipy.signal import welch

from rig.emulation.campaign_sea import requested_sea
from rig.emulation.sea import build_sea
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.rehearsal.job import plant_settings, problems
from sim_plant import sea_states
from sim_plant.bem import read_bem

CONFIGS = Path(__file__).parents[2] / "configs"
SEAS = sorted((CONFIGS / "seas").glob("*.yaml"))
BEM = read_bem(CONFIGS / "plants" / "wavebot_bem.npz")
DT = 0.001

# MASK4 report (Sandia), Table 3-1: Hs (m), Tp (s), gamma.
TABLE = {(0.127, 3.45), (0.127, 2.5), (0.254, 2.5), (0.127, 1.58), (0.254, 1.58)}
# Share of energy in 0.2-1 Hz and energy period (s) of the whole spectrum, by peak period.
KNOWN_BY_TP = {3.45: (0.992, 3.116), 2.5: (0.980, 2.258), 1.58: (0.882, 1.427)}


def sea_file(path: Path) -> dict[str, Any]:
    mapping: dict[str, Any] = YAML(typ="safe").load(path)
    return mapping


JONSWAP = [path for path in SEAS if sea_file(path)["kind"] == "jonswap"]


def density(f: float, hs: float, tp: float, gamma: float) -> float:
    """IEC TS 62600-2, annex C: Pierson-Moskowitz (5/16) Hs² fp⁴ f⁻⁵ exp(-(5/4)(fp/f)⁴) with a
    peak of gamma, times 1 - 0.287 ln gamma.
    """
    fp = 1.0 / tp
    sigma = 0.07 if f <= fp else 0.09
    peak_factor = gamma ** math.exp(-0.5 * ((f - fp) / (sigma * fp)) ** 2)
    pm = 5.0 / 16.0 * hs**2 * fp**4 / f**5 * math.exp(-1.25 * (fp / f) ** 4)
    return (1.0 - 0.287 * math.log(gamma)) * pm * peak_factor


def moment(n: int, low: float, high: float, hs: float, tp: float) -> float:
    peak = [1.0 / tp] if low < 1.0 / tp < high else None
    value, _ = quad(
        lambda f: density(f, hs, tp, 3.3) * f**n, low, high, points=peak, epsrel=1e-9, limit=400
    )
    return float(value)


def campaign(tmp_path: Path, sea: Path, device: str = "present") -> Any:
    """Return the report of a campaign that names a sea file."""
    path = tmp_path / "campaign.yaml"
    matrix = "matrix: {list: [{spring_n_per_m: 0, kp_n_s_per_m: -2000, ki_n_per_m: 0}]}\n"
    path.write_text(
        f"name: x\nrig: {CONFIGS / 'rigs' / 'wavebot.yaml'}\nsea: {sea}\n"
        f"device: {device}\n{matrix if device == 'present' else ''}"
    )
    report = check_campaign(path, problems)
    assert report.ok, report.text()
    return report


def simulated_sea(report: Any) -> sea_states.Sea:
    return build_sea(plant_settings(report.campaign)["sea"])


def test_table_3_1_is_complete_and_its_file_names_match() -> None:
    result = {(sea["hs_m"], sea["tp_s"]) for sea in map(sea_file, JONSWAP)}
    assert result == TABLE
    for path in JONSWAP:
        sea = sea_file(path)
        name = re.fullmatch(r"jonswap_(\d+)p(\d+)m_(\d+)p(\d+)s", path.stem)
        assert name is not None
        assert float(f"{name[1]}.{name[2]}") == sea["hs_m"]
        assert float(f"{name[3]}.{name[4]}") == sea["tp_s"]
        assert (sea["gamma"], sea["repeat_s"]) == (3.3, 300)


@pytest.mark.parametrize("tp", sorted(KNOWN_BY_TP))
def test_the_formula_of_this_file_gives_the_known_shares_and_energy_periods(tp: float) -> None:
    """The values have three digits; the share also depends on the cut of the tail (0.002)."""
    m0 = moment(0, 0.01, 20.0, 0.127, tp)
    share, te = KNOWN_BY_TP[tp]
    assert moment(0, 0.2, 1.0, 0.127, tp) / m0 == pytest.approx(share, abs=0.002)
    assert moment(-1, 0.01, 20.0, 0.127, tp) / m0 == pytest.approx(te, abs=0.001)
    assert 4.0 * math.sqrt(m0) / 0.127 == pytest.approx(1.0012, abs=1e-4)


@pytest.mark.parametrize("path", JONSWAP, ids=lambda p: p.stem)
def test_jonswap_seas(path: Path, tmp_path: Path) -> None:
    """Compare Hm0 (to 1e-6), moments, share and each line with the formula over 0.05-2 Hz.

    Lines have a spacing of 1/300 Hz, so sums differ from integrals by less than 1e-3 of m0.
    """
    sea = simulated_sea(campaign(tmp_path, path))
    hs, tp = sea_file(path)["hs_m"], sea_file(path)["tp_s"]
    table = sea_states.tables(sea, BEM, DT).elevation
    assert 4.0 * table.std() == pytest.approx(hs, rel=1e-6)
    bins = np.fft.rfft(table) / table.size
    f = np.fft.rfftfreq(table.size, DT)
    energy = 2.0 * np.abs(bins) ** 2
    inside = (f >= 0.05 - 1e-9) & (f <= 2.0 + 1e-9)
    assert energy[~inside].sum() < 1e-24 * energy.sum()
    f, energy = f[inside], energy[inside]
    m0 = moment(0, 0.05, 2.0, hs, tp)
    share = energy[(f >= 0.2 - 1e-9) & (f <= 1.0 + 1e-9)].sum() / energy.sum()
    assert share == pytest.approx(moment(0, 0.2, 1.0, hs, tp) / m0, abs=1e-3)
    te = (energy / f).sum() / energy.sum()
    assert te == pytest.approx(moment(-1, 0.05, 2.0, hs, tp) / m0, rel=1e-3)
    assert te == pytest.approx(KNOWN_BY_TP[tp][1], rel=0.007)  # cut at 2 Hz
    # the known shares refer to the full spectrum; the cut at 2 Hz adds 0.7 % for the shortest sea
    assert share == pytest.approx(KNOWN_BY_TP[tp][0], abs=0.007)
    line = np.array([density(x, hs, tp, 3.3) for x in f]) / 300.0
    scale = (hs / 4.0) ** 2 / line.sum()
    np.testing.assert_allclose(energy, scale * line, rtol=1e-6, atol=1e-12 * hs**2)
    assert scale == pytest.approx(1.0, abs=0.006)


@pytest.mark.parametrize("path", JONSWAP, ids=lambda p: p.stem)
def test_welch_finds_the_spectrum(path: Path, tmp_path: Path) -> None:
    """Estimate the spectrum as a basin does: 75 s windows, 50 % overlap, 50 Hz, one repeat period.

    Averages of seven windows scatter by 40 % per bin, and by 15 % over bands of 0.1 Hz.
    """
    sea = simulated_sea(campaign(tmp_path, path))
    hs, tp = sea_file(path)["hs_m"], sea_file(path)["tp_s"]
    table = sea_states.tables(sea, BEM, DT).elevation[::20]
    f, result = welch(np.tile(table, 4), 50.0, nperseg=3750, noverlap=1875)
    for low in np.arange(0.2, 0.9, 0.1):
        inside = (f >= low) & (f < low + 0.1)
        expected = moment(0, low, low + 0.1, hs, tp)
        if expected > 0.02 * hs**2 / 16.0:
            assert result[inside].sum() * (f[1] - f[0]) == pytest.approx(expected, rel=0.4)
    assert 4.0 * math.sqrt(np.trapezoid(result, f)) == pytest.approx(hs, rel=0.03)


def test_the_pink_sea_is_that_of_the_report(tmp_path: Path) -> None:
    """The lines are 1/300 Hz apart from 0.2 to 1 Hz, with amplitude ~ f^-0.5 and an exact Hm0."""
    sea = simulated_sea(campaign(tmp_path, CONFIGS / "seas" / "pink_0p254m.yaml"))
    tables = sea_states.tables(sea, BEM, DT)
    assert 4.0 * tables.elevation.std() == pytest.approx(0.254, rel=1e-6)
    bins = np.abs(np.fft.rfft(tables.elevation)) * 2.0 / 300_000
    k = np.arange(60, 301)
    np.testing.assert_allclose(bins[k] * np.sqrt(k / 300.0), bins[60] * np.sqrt(0.2), rtol=1e-9)
    for table in tables:
        line = np.abs(np.fft.rfft(table))
        line[k] = 0.0
        assert line.max() < 1e-9 * np.abs(np.fft.rfft(table)).max()


def test_the_multisine_sea_has_low_peaks(tmp_path: Path) -> None:
    sea = simulated_sea(campaign(tmp_path, CONFIGS / "seas" / "multisine_0p127m.yaml"))
    table = sea_states.tables(sea, BEM, DT).elevation
    assert 4.0 * table.std() == pytest.approx(0.127, rel=1e-6)
    assert np.abs(table).max() / table.std() < 3.2  # random phases: 3.5 and more
    np.testing.assert_allclose(np.abs(sea.amplitude), np.abs(sea.amplitude[0]), rtol=1e-12)


@pytest.mark.parametrize("path", SEAS, ids=lambda p: p.stem)
def test_every_sea_file_repeats_exactly_and_is_the_same_in_every_campaign(
    path: Path, tmp_path: Path
) -> None:
    """The plant's table is one period; a table synthesised over two periods repeats it."""
    report = campaign(tmp_path, path)
    one = simulated_sea(report)
    assert one.repeat == 300.0
    table = sea_states.tables(one, BEM, 0.02).elevation
    twice = sea_states.tables(
        one._replace(repeat=600.0, cycles=2 * one.cycles), BEM, 0.02
    ).elevation
    np.testing.assert_allclose(twice[:15_000], twice[15_000:], atol=1e-15)
    np.testing.assert_allclose(twice[:15_000], table, atol=1e-14)
    text = (tmp_path / "campaign.yaml").read_text()
    (tmp_path / "campaign.yaml").write_text(f"seed: 99\n{text}")  # affects only noise and order
    other = check_campaign(tmp_path / "campaign.yaml", problems)
    assert np.array_equal(simulated_sea(other).amplitude, one.amplitude)


@pytest.mark.parametrize("path", SEAS, ids=lambda p: p.stem)
def test_the_requested_lines_are_those_of_the_plant(path: Path, tmp_path: Path) -> None:
    report = campaign(tmp_path, path, device="absent")
    lines = requested_sea(report.campaign)
    assert lines["repeat_s"] == 300.0
    time = np.arange(0.0, 300.0, 0.31)
    result = np.zeros(time.size)
    for k, a, phase in zip(lines["cycles"], lines["amplitude_m"], lines["phase_rad"], strict=True):
        result += a * np.cos(2.0 * np.pi * k * time / 300.0 + phase)
    table = sea_states.tables(simulated_sea(report), BEM, 0.01).elevation
    np.testing.assert_allclose(result, table[np.round(time / 0.01).astype(int)], atol=1e-12)


SCRIPT = """
import hashlib, sys
from pathlib import Path
from rig.emulation.sea import build_sea
from rig.kinds.wavebot.rehearsal.job import plant_settings
from rig.kinds.wavebot.campaign import check_campaign
for path in sys.argv[1:]:
    sea = build_sea(plant_settings(check_campaign(Path(path)).campaign)["sea"])
    print(hashlib.sha256(sea.amplitude.tobytes() + sea.cycles.tobytes()).hexdigest())
"""


def test_another_process_builds_the_same_waves_and_realisations_differ() -> None:
    """Realisations of the pink sea are independent.

    Random signals of 241 lines correlate with a standard deviation of 0.046; the test allows four
    times that value.
    """
    paths = [CONFIGS / "campaigns" / f"wave_calibration{n}.yaml" for n in ("", "_2", "_3")]
    seas = [simulated_sea(check_campaign(path)) for path in paths]
    process = subprocess.run(
        [sys.executable, "-c", SCRIPT, *map(str, [*paths, paths[0]])],
        capture_output=True,
        text=True,
        check=True,
    )
    first, second, third, repeated = process.stdout.split()
    assert first == repeated
    assert len({first, second, third}) == 3
    repeated = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(paths[1])], capture_output=True, text=True, check=True
    )
    assert repeated.stdout.split() == [second]
    tables = [sea_states.tables(sea, BEM, 0.02).elevation for sea in seas]
    rho = np.corrcoef(tables)[np.triu_indices(3, 1)]
    assert np.abs(rho).max() < 4.0 / math.sqrt(2.0 * 241.0)
