"""Main effects against certified regressions, contrasts of factorials, and simulated coverage."""

import csv
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from scipy import stats
from synthetic_runs import COLUMNS

from rig.analysis.effects import (
    MISFIT,
    PERIODS,
    REPETITIONS,
    Effects,
    all_effects,
    compute_effects,
    effect_notes,
    effects_json,
    effects_text,
    is_designed,
    main_effects,
    write_effects,
)
from rig.analysis.intervals import half_width
from rig.analysis.points import Matrix, gain_matrix
from rig.analysis.report import write_products
from rig.analysis.rows import row_table
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.stations import as_records

# Longley's data, NIST Statistical Reference Datasets (linear regression, higher difficulty), and
# the certified estimates of B1 .. B6 with their standard deviations and residual deviation.
LONGLEY = np.array(
    [
        [60323, 83.0, 234289, 2356, 1590, 107608, 1947],
        [61122, 88.5, 259426, 2325, 1456, 108632, 1948],
        [60171, 88.2, 258054, 3682, 1616, 109773, 1949],
        [61187, 89.5, 284599, 3351, 1650, 110929, 1950],
        [63221, 96.2, 328975, 2099, 3099, 112075, 1951],
        [63639, 98.1, 346999, 1932, 3594, 113270, 1952],
        [64989, 99.0, 365385, 1870, 3547, 115094, 1953],
        [63761, 100.0, 363112, 3578, 3350, 116219, 1954],
        [66019, 101.2, 397469, 2904, 3048, 117388, 1955],
        [67857, 104.6, 419180, 2822, 2857, 118734, 1956],
        [68169, 108.4, 442769, 2936, 2798, 120445, 1957],
        [66513, 110.8, 444546, 4681, 2637, 121950, 1958],
        [68655, 112.6, 482704, 3813, 2552, 123366, 1959],
        [69564, 114.2, 502601, 3931, 2514, 125368, 1960],
        [69331, 115.7, 518173, 4806, 2572, 127852, 1961],
        [70551, 116.9, 554894, 4007, 2827, 130081, 1962],
    ]
)
CERTIFIED = [
    (15.0618722713733, 84.9149257747669),
    (-0.0358191792925910, 0.0334910077722432),
    (-2.02022980381683, 0.488399681651699),
    (-1.03322686717359, 0.214274163161675),
    (-0.0511041056535807, 0.226073200069370),
    (1829.15146461355, 455.478499142212),
]
RESIDUAL = 304.854073561965


def estimate_effects(
    levels: Any, response: Any, points: list[int] | None = None, **known: Any
) -> Effects:
    count = len(response)
    return main_effects(
        STATIONS[-1],
        list(COLUMNS[: levels.shape[1]]),
        levels,
        response,
        list(range(count)) if points is None else points,
        known.get("errors", np.full(count, np.nan)),
        known.get("dofs", np.zeros(count)),
    )


def by_name(effects: Effects) -> dict[str, Any]:
    return {each.column.name: each for each in effects.effects}


def test_longley_data_agree_with_the_certified_values() -> None:
    levels, response = LONGLEY[:, 1:], LONGLEY[:, 0]
    effects = estimate_effects(levels, response)
    assert (effects.source, effects.misfit_dof) == (MISFIT, 9)
    assert effects.misfit == pytest.approx(RESIDUAL, rel=1e-8)
    named = by_name(effects)
    for i, (slope, deviation) in enumerate(CERTIFIED):
        effect = named[COLUMNS[i].name]
        reach = np.ptp(levels[:, i])
        assert effect.watts / reach == pytest.approx(slope, rel=1e-7)
        assert effect.standard_error / reach == pytest.approx(deviation, rel=1e-7)
        assert effect.half_width == pytest.approx(2.262157 * effect.standard_error, rel=1e-6)


def test_one_column_is_a_line_through_points() -> None:
    random = np.random.default_rng(3)
    x = random.uniform(50.0, 200.0, 12)
    y = 3.0 - 0.05 * x + random.normal(size=12)
    (effect,) = estimate_effects(x[:, None], y).effects
    line = stats.linregress(x, y)
    assert effect.watts == pytest.approx(line.slope * np.ptp(x))
    assert effect.standard_error == pytest.approx(line.stderr * np.ptp(x))


def factorial(repetitions: int = 1) -> Any:
    return np.array(list(product((0.0, 1.0), (10.0, 30.0), (-2.0, 2.0))) * repetitions)


def test_effects_of_a_factorial_are_its_contrasts() -> None:
    levels = factorial(3)
    random = np.random.default_rng(5)
    response = random.normal(-20.0, 4.0, 24)
    points = list(range(8)) * 3
    effects = estimate_effects(levels, response, points)
    within = response.reshape(3, 8).std(axis=0, ddof=1)
    pooled = np.sqrt((within**2).mean())
    assert effects.source == REPETITIONS
    assert effects.scatter == pytest.approx(pooled)
    for i, effect in enumerate(by_name(effects).values()):
        high = (
            levels[:, COLUMNS.index(effect.column)] == levels[:, COLUMNS.index(effect.column)].max()
        )
        contrast = response[high].mean() - response[~high].mean()
        assert effect.watts == pytest.approx(contrast), i
        assert effect.standard_error == pytest.approx(pooled * np.sqrt(4.0 / 24.0))
        assert effect.dof == 16
    lead = abs(effects.effects[0].watts) - abs(effects.effects[1].watts)
    assert effects.lead == pytest.approx(lead)
    # Contrasts of a factorial are independent, so their difference has the sum of variances.
    single = effects.effects[0].half_width
    assert effects.lead_half_width == pytest.approx(np.sqrt(2.0) * single)


def test_unequal_row_errors_use_satterthwaites_degrees_of_freedom() -> None:
    levels = np.array([[0.0], [0.0], [1.0], [1.0]])
    errors = np.array([0.5, 0.5, 2.0, 2.0])
    dofs = np.array([4.0, 4.0, 7.0, 7.0])
    effects = estimate_effects(levels, np.array([1.0, 2.0, 5.0, 6.0]), errors=errors, dofs=dofs)
    (effect,) = effects.effects
    parts = errors**2 / 4.0
    assert effects.source == PERIODS
    assert effect.watts == pytest.approx(4.0)
    assert effect.standard_error == pytest.approx(np.sqrt(parts.sum()))
    welch = parts.sum() ** 2 / np.sum(parts**2 / dofs)
    assert effect.dof == pytest.approx(welch)
    assert effect.half_width == pytest.approx(stats.t.ppf(0.975, welch) * effect.standard_error)


def test_source_of_the_error() -> None:
    levels, response = factorial(), np.arange(8.0)
    period_errors = {"errors": np.ones(8), "dofs": np.full(8, 4.0)}
    assert estimate_effects(levels, response).source == MISFIT
    assert estimate_effects(levels, response, **period_errors).source == PERIODS
    twice = [0, 0, 2, 3, 4, 5, 6, 7]  # one degree of freedom is less reliable than the periods
    assert estimate_effects(levels, response, twice, **period_errors).source == PERIODS
    assert estimate_effects(levels, response, twice).source == REPETITIONS
    assert (
        estimate_effects(levels, response, [0, 0, 1, 1, 2, 2, 6, 7], **period_errors).source
        == REPETITIONS
    )


def test_equal_periods_report_the_misfit() -> None:
    period_errors = {"errors": np.zeros(8), "dofs": np.full(8, 6.0)}
    levels = factorial()
    response = levels[:, 0] * 3.0 + levels[:, 0] * levels[:, 2]  # with an interaction
    effects = estimate_effects(levels, response, **period_errors)
    assert effects.effects[0].half_width == 0.0
    assert effects.effects[0].misfit_half_width > 0.0
    assert "by misfit, spring rate is ±" in "; ".join(effect_notes(effects))


def test_lead_beyond_scatter_but_not_misfit_is_not_significant() -> None:
    """The rows scatter little, but an interaction exceeds the linear model."""
    levels = factorial()
    unit = (levels - levels.min(axis=0)) / np.ptp(levels, axis=0)
    period_errors = {"errors": np.full(8, 0.02), "dofs": np.full(8, 6.0)}
    straight = 4.0 * unit[:, 0] + unit[:, 1]
    linear = estimate_effects(levels, straight, **period_errors)
    assert linear.lead_is_significant
    assert (
        "exceeds that of Kp by 3.0 W (± 0.04 W by wave periods, ± <0.01 W by misfit)"
        in effect_notes(linear)[2]
    )
    curved = estimate_effects(levels, straight + 6.0 * unit[:, 0] * unit[:, 1], **period_errors)
    assert curved.lead == pytest.approx(3.0)
    assert curved.lead_half_width == pytest.approx(linear.lead_half_width)
    # The product leaves +-1.5 W at all rows with 4 dof, so 2.1 W; a contrast of 8 rows has
    # sqrt(4 / 8) of that, a difference of two sqrt(2) times as much: 2.776 x 2.1 W.
    assert curved.lead_misfit_half_width == pytest.approx(2.776 * 1.5 * np.sqrt(2.0), rel=1e-3)
    assert not curved.lead_is_significant
    assert (
        "(± 0.04 W by wave periods, ± 5.9 W by misfit: not significant)" in effect_notes(curved)[2]
    )


def test_columns_that_vary_together_are_confounded() -> None:
    levels = np.array([[0.0, 5.0, 1.0], [1.0, 7.0, 0.0], [0.0, 5.0, 0.0], [1.0, 7.0, 1.0]] * 2)
    effects = estimate_effects(levels, levels[:, 2] * -4.0 + levels[:, 0])
    named = by_name(effects)
    assert named["ki"].watts == pytest.approx(-4.0)
    assert np.isnan([named["spring_rate"].watts, named["kp"].watts]).all()
    assert effects.effects[0].column.name == "ki"
    assert "cannot separate spring rate, Kp (confounded)" in "; ".join(effect_notes(effects))
    assert np.isnan(effects.lead)


@pytest.mark.parametrize("source", [REPETITIONS, PERIODS, MISFIT])
def test_the_intervals_cover(source: str) -> None:
    """Coverage is 95 % within three deviations of the count.

    The tolerance is 1 % larger for periods, because Satterthwaite's formula is an approximation.
    Their row errors differ from row to row, as with breaking waves.
    """
    random = np.random.default_rng(17)
    trials, truth = 1200, np.array([3.0, -2.0, 0.0])
    levels = factorial(2 if source == REPETITIONS else 1)
    count = len(levels)
    unit = (levels - levels.min(axis=0)) / np.ptp(levels, axis=0)
    deviation = np.where(unit[:, 0] > 0.5, 1.0, 0.4) if source == PERIODS else np.ones(count)
    inside = 0
    for _ in range(trials):
        periods = random.normal(0.0, 1.0, (count, 5)) * deviation[:, None] * np.sqrt(5.0)
        response = unit @ truth + periods.mean(axis=1)
        errors = periods.std(axis=1, ddof=1) / np.sqrt(5.0)
        period_errors = {"errors": errors, "dofs": np.full(count, 4.0)} if source == PERIODS else {}
        effects = estimate_effects(levels, response, list(range(8)) * (count // 8), **period_errors)
        assert effects.source == source
        named = by_name(effects)
        for column, true in zip(COLUMNS[:3], truth, strict=True):
            inside += abs(named[column.name].watts - true) <= named[column.name].half_width
    tolerance = 3.0 * np.sqrt(0.05 * 0.95 / (3 * trials)) + (0.01 if source == PERIODS else 0.0)
    assert inside / (3 * trials) == pytest.approx(0.95, abs=tolerance)


@pytest.fixture(scope="module")
def designed(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    folder = tmp_path_factory.mktemp("designed")
    shape = synthetic.Shape(noise=1.0, wander=1.0, settle=5, tail=2, lead_in=10, seed=2)
    rows = synthetic.drive_rows(repetitions=2)
    synthetic.write_run(folder, synthetic.run_rows(rows, shape), synthetic.plan_json(rows, shape))
    return row_table(folder)


def test_the_page_has_room_for_more_stations(tmp_path: Path) -> None:
    """The run's own list decides which stations are shown, and in which order."""
    shape = synthetic.Shape(settle=5, tail=2, lead_in=10)
    rows = synthetic.drive_rows()
    plan = synthetic.plan_json(rows, shape)
    plan["stations"] = as_records(station._replace(shown=True) for station in STATIONS)
    run = synthetic.write_run(tmp_path / "run", synthetic.run_rows(rows, shape), plan)
    assert all(path.stat().st_size > 0 for path in write_products(run))
    effects = json.loads((run / "summary.json").read_text())["effects"]
    assert [each["power"] for each in effects] == ["dc", "ac", "mechanical_2", "mechanical_1"]


def test_switching_comes_first_with_an_interval(designed: xarray.Dataset) -> None:
    effects = compute_effects(designed, "dc")
    assert effects is not None
    assert [e.column.name for e in effects.effects] == [
        "switching_period",
        "kp",
        "bus_voltage",
        "velocity_threshold",
    ]
    truth = {"switching_period": -8.0, "kp": 3.0, "bus_voltage": 2.0, "velocity_threshold": -1.0}
    for effect in effects.effects:  # seeded: all of four intervals hold
        assert abs(effect.watts - truth[effect.column.name]) < 1.5 * effect.half_width
        assert 0.1 < effect.half_width < 0.5
        assert effect.dof == 36
    assert effects.lead == pytest.approx(5.0, abs=1.0)
    assert effects.lead > effects.lead_half_width
    assert is_designed(gain_matrix(designed))


def test_effects_as_text_json_and_csv(designed: xarray.Dataset, tmp_path: Path) -> None:
    by_station = all_effects(designed)
    text = "\n".join(effects_text(by_station))
    assert "1. switching period  50 .. 200 µs" in text
    assert "95 % interval by scatter of repetitions (at least 36 dof)" in text
    found = effects_json(by_station)
    assert [each["power"] for each in found] == ["dc", "ac", "mechanical_2", "mechanical_1"]
    dc = found[0]
    assert dc["first_surely_first"] is True
    assert dc["first_over_second_half_width_by_misfit_w"] > 0.0
    assert dc["effects"][0]["column"] == "switching_period"
    assert dc["effects"][0]["to"] == 200e-6
    with write_effects(by_station, tmp_path / "effects.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 16
    first = lines[0]
    assert (first["column"], first["rank"], first["error by"]) == (
        "switching_period",
        "1",
        "repetitions",
    )
    low, high = float(first["interval from [W]"]), float(first["interval to [W]"])
    assert low < -8.0 < high


def test_no_effects_without_variation_or_with_too_few_rows(designed: xarray.Dataset) -> None:
    assert compute_effects(designed.isel(row=[0, 36]), "dc") is None
    assert compute_effects(designed.isel(row=[0, 11]), "dc") is None  # four columns, two rows
    assert compute_effects(designed.isel(row=[]), "dc") is None
    assert all_effects(designed.isel(row=[])) == ()
    assert np.isnan(half_width(1.0, 0.0))


def test_realisation_is_categorical() -> None:
    """Rows of different realisations are repetitions: no linear term for the realisation."""
    kp = np.repeat([-1000.0, -2000.0], 3)
    table = xarray.Dataset(
        {
            "kp": ("row", kp),
            "realisation": ("row", np.tile([1.0, 2.0, 3.0], 2)),
            "state": ("row", ["complete"] * 6),
            "power_dc": ("row", 0.01 * kp + np.tile([-1.0, 0.0, 4.0], 2)),
            "power_dc_se": ("row", [np.nan] * 6),
            "periods": ("row", [1] * 6),
        },
        attrs=synthetic.STATIONS_ATTRIBUTES,
    )
    effects = compute_effects(table, "dc")
    assert effects is not None
    assert [each.column.name for each in effects.effects] == ["kp"]
    assert effects.effects[0].watts == pytest.approx(10.0)
    assert effects.source == REPETITIONS
    planned = tuple({"kp": -1000.0, "realisation": float(i)} for i in (1, 2))
    assert not is_designed(Matrix((), planned, COLUMNS))
