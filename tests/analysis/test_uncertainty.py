"""Uncertainty of powers: contributions against closed forms, intervals, and a run with a budget."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from command_here import rig
from made_once import made_once
from matplotlib.image import imread
from pydantic import ValidationError
from rehearsing import write_yaml
from scipy import stats

from rig.analysis.rows import row_table, stations_of
from rig.analysis.uncertainty import (
    BUDGET_ATTRIBUTE,
    Budget,
    Signals,
    add_expanded,
    type_b,
)
from rig.config.problems import ConfigError
from rig.config.uncertainty import UncertaintyBudget
from rig.kinds.wavebot.campaign import open_campaign
from rig.page.subject import replay
from rig.recording.runs import open_run
from rig.stations import Station

CONFIGS = Path(__file__).parents[2] / "configs"
TICKS = 4000
ANGLE = 2.0 * np.pi * np.arange(TICKS) / 1000.0
FORCE, SPEED = 800.0, 0.3  # amplitudes, in phase
DATA = {
    "force.a": FORCE * np.cos(ANGLE) + 20.0,
    "zero.a": np.full(TICKS, 20.0),
    "force.b": 0.9 * FORCE * np.cos(ANGLE),
    "velocity": SPEED * np.cos(ANGLE) + 0.05,
    "analyser": np.full(TICKS, -40.0),
}
SIGNALS = Signals(
    {"a": ("force.a", "zero.a"), "b": ("force.b",), "v": ("velocity",), "p": ("analyser",)}
)
STATIONS = (
    Station("first", "a * v", "first", "first", "first"),
    Station("second", "b * v", "second", "second", "second"),
    Station("both", "a * v + b * v - 2.0 * p", "both", "both", "both"),
)
POWER_A, POWER_B = 0.5 * FORCE * SPEED, 0.45 * FORCE * SPEED


def source(name: str, signals: list[str], **value: Any) -> dict[str, Any]:
    return {"name": name, "signals": signals, "evidence": "drawn", **value}


def budget(*sources: dict[str, Any]) -> Budget:
    file = UncertaintyBudget.model_validate({"name": "test", "sources": list(sources)})
    return Budget(file, STATIONS, SIGNALS)


def test_contributions_are_the_derivatives_of_the_mean_power() -> None:
    found = budget(
        source("speed", ["v"], scale_percent=1.0),
        source("cell", ["a"], scale_percent=3.0, coverage_factor=2),
        source("zero", ["a"], offset=6.0, distribution="rectangular"),
        source("cells", ["a", "b"], scale_percent=1.0),
        source("angle", ["b"], alignment_deg=2.0, distribution="triangular"),
        source("analyser", ["p"], scale_percent=1.0),
    ).contributions(DATA)
    expected = np.array(
        [
            [0.01 * POWER_A, 0.015 * POWER_A, 0.05 * 6.0 / math.sqrt(3.0), 0.01 * POWER_A, 0, 0],
            [0.01 * POWER_B, 0, 0, 0.01 * POWER_B, 0, 0],
            [0, 0, 0, 0, 0, 0],
        ]
    )
    tilt = POWER_B * (1.0 - math.cos(math.radians(2.0))) / math.sqrt(6.0)
    expected[1, 4] = tilt
    expected[2] = expected[0] + expected[1]
    expected[2, 5] = -2.0 * -40.0 * 0.01
    np.testing.assert_allclose(found, expected, atol=1e-9 * POWER_A)


def test_stations_are_correlated_by_the_sources_that_they_share() -> None:
    one = budget(source("speed", ["v"], scale_percent=1.0), source("cell", ["a"], scale_percent=1))
    rows = [{"row": 0, "power_first": -1.0, "power_second": -1.0, "power_both": -1.0}]
    described = json.loads(one.describe(rows, {0: one.contributions(DATA)}))
    correlation = np.array(described["best"]["first"]["correlation"])
    assert correlation[0, 1] == pytest.approx(1.0 / math.sqrt(2.0))
    np.testing.assert_allclose(correlation, correlation.T)


def half_width(sources: list[dict[str, Any]], scatter: float, dof: float) -> tuple[float, float]:
    """Return the combined standard uncertainty and the half width of a power of one signal."""
    station = (Station("p", "p", "p", "p", "p"),)
    file = UncertaintyBudget.model_validate({"name": "test", "sources": sources})
    one = Budget(file, station, SIGNALS)
    contributions = one.contributions(DATA)
    row: dict[str, Any] = {"row": 3, "power_p_dof": dof, "power_p_se": scatter}
    row |= type_b(one, contributions)
    add_expanded(one, [row], {3: contributions})
    return row["power_p_u"], row["power_p_expanded"]


@pytest.mark.parametrize(
    ("sources", "scatter", "dof", "standard", "expanded"),
    [
        # One normal source.
        ([source("n", ["p"], offset=2.0)], 0.0, 6, 2.0, 1.96 * 2.0),
        # One rectangular source: 95 % of its half width.
        ([source("r", ["p"], offset=2.0, distribution="rectangular")], 0.0, 6,
         2.0 / math.sqrt(3.0), 0.95 * 2.0),
        # A scatter that outweighs the budget: Student's distribution.
        ([source("n", ["p"], offset=1e-6)], 1.0, 2, 1.0, float(stats.t.ppf(0.975, 2))),
        ([source("n", ["p"], offset=1e-6)], 1.0, math.inf, 1.0, 1.96),
        # Two equal rectangular sources: a triangle.
        ([source("r", ["p"], offset=2.0, distribution="rectangular"),
          source("s", ["p"], offset=2.0, distribution="rectangular")], 0.0, 6,
         2.0 * math.sqrt(2.0 / 3.0), 4.0 * (1.0 - math.sqrt(0.05))),
    ],
)  # fmt: skip
def test_the_interval_is_that_of_the_sum_of_the_errors(
    sources: list[dict[str, Any]], scatter: float, dof: float, standard: float, expanded: float
) -> None:
    """Drawn 20,000 times: the half width scatters by 0.7 %."""
    found = half_width(sources, scatter, dof)
    assert found[0] == pytest.approx(standard)
    assert found[1] == pytest.approx(expanded, rel=0.02)


def test_without_a_standard_error_only_type_b_is_known() -> None:
    standard, expanded = half_width([source("n", ["p"], offset=2.0)], math.nan, 1)
    assert math.isnan(standard)
    assert math.isnan(expanded)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"offset": 1.0}, "scale_percent and offset given; allowed exactly one of"),
        ({"scale_percent": None}, "nothing given; allowed exactly one of scale_percent"),
        ({"distribution": "rectangular", "coverage_factor": 2}, "has no coverage factor"),
        ({"signals": ["v", "v"]}, "v is listed twice"),
        ({"scale_percent": -1.0}, "greater than 0"),
        ({"distribution": "square"}, "Input should be 'normal'"),
    ],
)
def test_refused(change: dict[str, Any], text: str) -> None:
    one = source("n", ["v"], scale_percent=1.0) | change
    with pytest.raises(ValidationError, match=text):
        budget(one)


def write_files(folder: Path, **uncertainty: Any) -> Path:
    given: Any = uncertainty or str(CONFIGS / "uncertainty" / "wavebot.yaml")
    rig_file = {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "uncertainty": given}
    gains = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000}
    campaign = {
        "name": "budget",
        "rig": "rig.yaml",
        "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        "tare": {"duration_s": 1},
        "start": {"lead_in_s": 6},
        "timing": {"settle_s": 2, "interval_s": 8},
        "matrix": {"list": [{**gains, "ki_n_per_m": ki} for ki in (0, 2000)]},
    }
    write_yaml(folder / "rig.yaml", rig_file)
    return write_yaml(folder / "campaign.yaml", campaign)


def make_run(folder: Path) -> None:
    done = rig("run", write_files(folder), "--runs", folder / "runs", "--interpreted", "--json")
    assert done.returncode == 0, done.stderr


def test_a_run_has_the_uncertainty_of_its_rows(tmp_path_factory: pytest.TempPathFactory) -> None:
    (run,) = (made_once(tmp_path_factory, "budget", make_run) / "runs").iterdir()
    table = row_table(run)
    for station in ("mechanical_1", "mechanical_2", "ac", "dc"):
        scatter, b, u, half = (
            table[f"power_{station}_{part}"] for part in ("se", "type_b", "u", "expanded")
        )
        assert {each.attrs["units"] for each in (b, u, half)} == {"W"}
        np.testing.assert_allclose(u.values, np.hypot(scatter.values, b.values))
        assert (half.values > 1.5 * u.values).all()
        assert (half.values < 2.1 * u.values).all()
    power = np.abs(table["power_mechanical_2"].values)  # sensor 0.25 %, encoder 0.1 % / sqrt(3)
    expected = power * math.hypot(0.0025, 0.001 / math.sqrt(3.0))
    np.testing.assert_allclose(table["power_mechanical_2_type_b"].values, expected, rtol=0.01)
    described = json.loads(table.attrs[BUDGET_ATTRIBUTE])
    assert described["best"]["dc"]["row"] == int(np.argmin(table["power_dc"].values))
    summary = (run / "summary.txt").read_text()
    assert "Uncertainty of the best powers (95 %, Type A and B combined)" in summary
    assert "largest source power analyser, DC" in summary
    with (run / "rows.csv").open() as file:
        assert "power_dc_expanded [W]" in next(csv.reader(file))
    assert imread(run / "uncertainty.png").shape[0] > 500


def test_files_have_the_contributions_and_the_intervals(
    tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    """xarray reads the table, mat4py the structure of `rig export`; rows.csv has the same."""
    (run,) = (made_once(tmp_path_factory, "budget", make_run) / "runs").iterdir()
    with xarray.open_dataset(run / "rows.nc") as table:
        shares = table["power_ac_contributions"]
        assert shares.dims == ("row", "source")
        assert table["source"].values[-1] == "power analyser, DC"
        analyser = shares.sel(source="power analyser, AC")  # half width 0.5 W, in every row
        np.testing.assert_allclose(analyser.values, 0.5 / math.sqrt(3.0))
        scale = shares.sel(source="power analyser, common scale") / table["power_ac"]
        np.testing.assert_allclose(scale.values, 0.001 / math.sqrt(3.0), rtol=1e-6)
        squares = (shares * shares).sum("source")
        np.testing.assert_allclose(np.sqrt(squares.values), table["power_ac_type_b"].values)
    with (run / "rows.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert not any("contributions" in name for name in lines[0])
    done = rig("export", run, "--as", "mat", "-o", tmp_path / "run.mat")
    assert done.returncode == 0, done.stderr
    rows = pytest.importorskip("mat4py").loadmat(str(tmp_path / "run.mat"))["rigRows"]
    assert np.ravel(rows["kp"]).tolist() == [-2000.0, -2000.0]
    for name in ("", "_se", "_type_b", "_u", "_expanded"):
        written = [float(line[f"power_dc{name} [W]"]) for line in lines]
        np.testing.assert_allclose(np.ravel(rows[f"power_dc{name}"]), written, rtol=1e-9)


@pytest.mark.parametrize("ticks", [50, 3000])
def test_the_page_has_the_intervals_of_the_table(
    tmp_path_factory: pytest.TempPathFactory, ticks: int
) -> None:
    """From sums that grow with the log, in portions of a poll and of a fast replay."""
    (run,) = (made_once(tmp_path_factory, "budget", make_run) / "runs").iterdir()
    subject, table = replay(run), row_table(run)
    assert subject.describe()["budget"] == "wavebot"
    names = [leaf.name for leaf in subject.tap.leaves]
    log = open_run(run, fields=names)
    rows = np.stack([log[name].values for name in names], axis=1)
    intervals = subject.watch.new_intervals()
    found = {}
    for begin in range(0, len(rows), ticks):
        found |= subject.watch.powers_in(rows[begin : begin + ticks], intervals)
    for number in (0, 1):
        expected = [
            float(table[f"power_{station.name}_expanded"].values[number])
            for station in stations_of(table)
        ]
        assert found[number].half_widths == pytest.approx(expected, rel=0.006)
    # A page that began within row 0 does not know its scatter.
    first = int(np.flatnonzero(rows[:, names.index("power.samples")] == 2000.0)[0])
    late = subject.watch.powers_in(rows[first:], subject.watch.new_intervals())
    assert set(late[0].half_widths) == {None}
    assert late[1].half_widths == found[1].half_widths


def test_an_unknown_signal_is_named(tmp_path: Path) -> None:
    wrong = source("n", ["lcb", "speed"], scale_percent=1.0)
    path = write_files(tmp_path, name="wrong", sources=[wrong])
    with pytest.raises(ConfigError) as error:
        open_campaign(path)
    (problem,) = error.value.problems
    assert problem.key == "uncertainty.sources[0].signals[1]"
    assert problem.message.startswith("'speed' is no signal of a power station; allowed lcb, trs")
