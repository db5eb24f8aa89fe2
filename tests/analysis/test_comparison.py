"""Comparison of two runs: matched points, differing settings, power differences and errors."""

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from matplotlib.image import imread
from synthetic_runs import COLUMNS, POWERS, Row, Shape
from test_slices import rows
from typer.testing import CliRunner

from rig import laws
from rig.analysis import comparison as comparisons
from rig.analysis import summary as summaries
from rig.analysis.comparison import (
    Comparison,
    Pair,
    as_json,
    compare,
    describe_pair,
    match,
    mean_difference,
    power_difference,
    write_csv,
)
from rig.analysis.comparison_picture import write_comparison
from rig.analysis.comparison_text import as_text
from rig.analysis.differences import differences
from rig.analysis.points import Matrix, Point
from rig.analysis.report import analyse
from rig.analysis.rows import contents_attributes
from rig.analysis.slices import find_optima
from rig.cli.app import app
from rig.kinds.wavebot.row_contents import row_contents
from rig.recording.runs.folder import RunInfo
from rig.row_contents import find_column

SHAPE = Shape(noise=1.0, wander=1.0, settle=5, tail=2, lead_in=10)
CUSTOM = {
    "bus_voltage": 75.0,
    "switching_period": 50e-6,
    "hysteresis_tolerance": 0.5,
    "velocity_threshold": 0.0,
    "discharge_level": 15.0,
}
GAIN = -12.0  # W, change of DC power with the custom drive


def drive(kind: str, loss: float) -> dict[str, Any]:
    settings = {"kind": kind} | ({"modulation": "svpwm"} if kind == "custom" else {})
    return {
        "name": kind,
        "campaign": {"name": kind, "seed": 1, "timing": {"settle_s": 4.0}},
        "rig": {"drive": settings, "heave": {"torque_constant_n_m_per_a": 6.1745}},
        "plant": {"drive": {"fixed_loss": {"value": loss, "unit": "W", "source": "a guess"}}},
    }


def write(folder: Path, rows: list[Row], shape: Shape = SHAPE, **more: Any) -> Path:
    plan = synthetic.plan_json(rows, shape)
    return synthetic.write_run(folder, synthetic.run_rows(rows, shape), plan, **more)


def custom(rows: list[Row]) -> list[Row]:
    return [
        row._replace(power={**row.power, "dc": row.power["dc"] + GAIN}, more=CUSTOM) for row in rows
    ]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    rows = synthetic.default_rows()
    write(folder / "cots", rows, config=drive("cots", 30.0))
    later = [row._replace(ki=row.ki + 9.0) if row.ki == 0.0 else row for row in custom(rows)]
    less = [row for i, row in enumerate(later) if i not in (7, 50)]
    other = SHAPE._replace(seed=5)
    write(folder / "custom", less, other, config=drive("custom", 4.0))
    slower = SHAPE._replace(frequency=0.4, periods=4)
    write(folder / "slower", less[:6], slower, config=drive("custom", 4.0))
    line = [row for row in rows if row.kp == -2000.0 and row.spring_rate > 0.0]
    write(folder / "line", line, config=drive("cots", 30.0))
    write(folder / "settings", synthetic.drive_rows(), config=drive("custom", 4.0))
    return folder


@pytest.fixture(scope="module")
def comparison(runs: Path) -> Comparison:
    return compare(runs / "cots", runs / "custom")


def test_points_match_by_set_point_and_not_by_row(comparison: Comparison) -> None:
    assert len(comparison.matched.pairs) == 64
    assert [p.rows for p in comparison.matched.only_a] == [(7,), (50,)]
    unmatched = as_text(comparison).split("Only in A\n")[1].splitlines()[0]
    varying = [c.label for c in (*comparison.matched.columns, *comparison.matched.one_sided)]
    assert [name for name in (c.label for c in COLUMNS) if name in unmatched] == varying
    assert comparison.matched.only_b == ()
    assert [c.name for c in comparison.matched.columns] == ["spring_rate", "kp", "ki"]
    for pair in comparison.matched.pairs:
        assert (pair.a.setting["spring_rate"], pair.a.setting["kp"]) == (
            pair.b.setting["spring_rate"],
            pair.b.setting["kp"],
        )
        assert pair.b.setting["ki"] - pair.a.setting["ki"] == (
            9.0 if pair.a.setting["ki"] == 0.0 else 0.0
        )
    assert "Ki 0 N/m (B differs in Ki by +9 N/m)" in describe_pair(
        comparison.matched, comparison.matched.pairs[0]
    )


def test_tolerances_are_by_column(runs: Path) -> None:
    strict = compare(runs / "cots", runs / "custom", {"ki": 5.0})
    assert len(strict.matched.pairs) == 64 - 12  # the two springs' points without Ki
    assert strict.tolerances["ki"] == 5.0
    assert strict.tolerances["kp"] == find_column(COLUMNS, "kp").tolerance


def test_differences_are_b_less_a_with_both_errors(comparison: Comparison) -> None:
    for pair in comparison.matched.pairs[:5]:
        for kind in POWERS:
            here = power_difference(pair, kind)
            assert here.watts == pair.b.power[kind] - pair.a.power[kind]
            both = np.hypot(pair.a.error[kind], pair.b.error[kind])
            assert here.error == pytest.approx(both)
    dc, ac = (mean_difference(comparison.matched.pairs, kind) for kind in ("dc", "ac"))
    assert abs(dc.watts - GAIN) < 3.0 * dc.error
    assert abs(ac.watts) < 3.0 * ac.error
    assert dc.error < 0.2


def test_error_of_a_shared_point_counts_once() -> None:
    def point(row: int, error: float) -> Point:
        return Point({}, dict.fromkeys(POWERS, 1.0), dict.fromkeys(POWERS, error), (row,))

    shared = point(0, 3.0)
    pairs = tuple(Pair(shared, point(i, 4.0)) for i in (1, 2))
    assert mean_difference(pairs, "dc").error == pytest.approx(np.sqrt(3.0**2 + 4.0**2 / 2.0))
    separate = (Pair(point(0, 3.0), point(1, 4.0)), Pair(point(5, 3.0), point(2, 4.0)))
    assert mean_difference(separate, "dc").error == pytest.approx(5.0 / np.sqrt(2.0))


def test_the_settings_that_differ_come_first(comparison: Comparison) -> None:
    text = as_text(comparison)
    assert text.index("Settings that differ") < text.index("Mean difference")
    keys = {(each.group, each.key): (each.a, each.b) for each in comparison.differences}
    assert keys["drive", "rig.drive.kind"] == ("cots", "custom")
    assert keys["drive", "plant.drive.fixed_loss"] == ("30 W", "4 W")
    assert keys["drive", "rig.drive.modulation"] == ("absent", "svpwm")
    assert not any(group in ("sea", "calibration", "code") for group, _ in keys)
    constant = {
        each.column.name: (each.a, each.b) for each in comparison.matched.constant_differences
    }
    assert constant == {name: (None, value) for name, value in CUSTOM.items()}
    assert re.search(r"set point +switching period +A absent +B 50 µs", text)
    assert "!!" not in text
    assert comparison.same_sea


def run_facts(**more: Any) -> RunInfo:
    blank: dict[str, Any] = {name: {} for name in RunInfo._fields[3:]}
    return RunInfo("r", "hardware", "c", **{**blank, **more})


def test_groups_of_settings() -> None:
    one = run_facts(
        config={
            "campaign": {"seed": 1, "drive": {"supply": "connected"}, "tare": {"duration_s": 5.0}},
            "rig": {"heave": {"gear_ratio_rad_per_m": 12.4666}, "spring": {"map": [{"a": 1.0}]}},
            "limits": {"heave": {"current_peak_a": 40}},
            "plant": {"effect": {"value": 1.0, "unit": "1"}, "mass": {"value": 9.0, "unit": "kg"}},
            "files": [{"role": "plant", "path": "x", "sha256": "1" * 64}],
        },
        code={"git": "aaa", "packages": {"numpy": "2.0"}},
        host={"name": "basin"},
        plan={"sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5, "words": "x"}},
    )
    changed = json.loads(json.dumps(one.config))
    changed["campaign"].update(seed=2, drive={"supply": "disconnected"}, tare={"duration_s": 6.0})
    changed["campaign"]["surge"] = {"use": "off"}
    changed["rig"]["heave"]["gear_ratio_rad_per_m"] = 12.5
    changed["rig"]["spring"]["map"][0]["a"] = 2.0
    changed["limits"]["heave"]["current_peak_a"] = 30
    changed["plant"]["mass"]["value"] = 8.0
    changed["plant"]["effect"]["value"] = 0.65
    changed["files"][0]["sha256"] = "2" * 64  # a changed comment: the values are compared directly
    sea = {"kind": "regular", "amplitude_m": 0.1, "period_s": 2.0, "words": "y"}  # the same sea
    other = one._replace(
        config=changed,
        code={"git": "bbb", "packages": {"numpy": "2.1"}},
        host={"name": "office"},
        plan={"sea": sea},
    )
    groups = [(each.group, each.key) for each in differences(one, other)]
    assert groups == [
        ("drive", "campaign.drive.supply"),
        ("control", "campaign.surge.use"),
        ("plant", "plant.effect"),
        ("plant", "plant.mass"),
        ("calibration", "rig.heave.gear_ratio_rad_per_m"),
        ("calibration", "rig.spring.map[0].a"),
        ("code", "code.git"),
        ("code", "code.packages.numpy"),
        ("timing", "campaign.tare.duration_s"),
        ("limits", "limits.heave.current_peak_a"),
        ("campaign", "campaign.seed"),
        ("host", "host"),
    ]
    assert differences(one, one) == []
    assert differences(one, other)[2][2:] == ("1", "0.65")
    assert differences(one, other)[3][2:] == ("9 kg", "8 kg")


def test_the_seed_of_random_waves_is_part_of_the_sea() -> None:
    plan = {"sea": {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2.5, "seed": None}}
    one = run_facts(plan=plan, config={"campaign": {"seed": 1}})
    other = run_facts(plan=plan, config={"campaign": {"seed": 2}})
    assert ("sea", "sea.seed") in {(d.group, d.key) for d in differences(one, other)}


def test_different_seas_give_a_warning(runs: Path, tmp_path: Path) -> None:
    comparison = compare(runs / "cots", runs / "slower")
    assert not comparison.same_sea
    (warning,) = comparison.warnings
    assert warning.startswith("DIFFERENT SEAS: A regular, amplitude 0.127 m, 0.5 Hz; B regular")
    assert f"!! {warning}" in as_text(comparison)
    assert imread(write_comparison(comparison, tmp_path / "x.png")).std() > 0.02
    modes = run_facts()._replace(mode="hil")
    assert [d.key for d in differences(run_facts(), modes)] == ["mode"]


def test_a_commercial_drive_is_compared_with_every_setting_of_the_other(runs: Path) -> None:
    comparison = compare(runs / "cots", runs / "settings")
    names = ["bus_voltage", "switching_period", "velocity_threshold"]
    assert [c.name for c in comparison.matched.one_sided] == names
    assert len(comparison.matched.pairs) == 36
    assert {pair.a.rows for pair in comparison.matched.pairs} == {(48,), (43,)}
    assert len({pair.b.rows for pair in comparison.matched.pairs}) == 36
    turned = compare(runs / "settings", runs / "cots")
    assert len(turned.matched.pairs) == 36
    setting = as_json(turned)["pairs"][0]["setting"]
    assert setting["switching_period"] == 50e-6
    assert as_json(comparison)["varied_in_one_run"] == names


def point(**setting: float) -> Point:
    power = dict.fromkeys(POWERS, -1.0)
    return Point(setting, power, power, (int(setting.get("row", 0)),))


def test_the_nearest_pairs_are_taken_once_each() -> None:
    def matrix_of(kis: list[float]) -> Matrix:
        points = tuple(point(kp=-1.0, ki=ki) for ki in kis)
        return Matrix(points, tuple(p.setting for p in points), COLUMNS)

    matched = match(matrix_of([0.0, 20.0, 500.0]), matrix_of([18.0, 1.0, 900.0]))
    assert [(p.a.setting["ki"], p.b.setting["ki"]) for p in matched.pairs] == [
        (0.0, 1.0),
        (20.0, 18.0),
    ]
    assert [p.setting["ki"] for p in matched.only_a] == [500.0]
    assert [p.setting["ki"] for p in matched.only_b] == [900.0]
    assert match(matrix_of([1.0, 2.0]), Matrix((), (), COLUMNS)).pairs == ()
    single = match(matrix_of([3.0]), matrix_of([3000.0]))  # varies in neither: a setting of the run
    assert len(single.pairs) == 1
    assert [(h.column.name, h.a, h.b) for h in single.constant_differences] == [("ki", 3.0, 3000.0)]


def test_the_csv_has_pairs_and_unmatched_points(comparison: Comparison, tmp_path: Path) -> None:
    with write_csv(comparison, tmp_path / "x.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["in"] for line in lines] == ["both"] * 64 + ["A"] * 2
    first, alone = lines[0], lines[-1]
    pair = comparison.matched.pairs[0]
    assert float(first["dc B - A [W]"]) == pytest.approx(power_difference(pair, "dc").watts)
    assert float(first["ki [N/m]"]) == 0.0
    assert alone["rows A"] == "50"
    assert (alone["dc B [W]"], alone["dc B - A [W]"]) == ("", "")
    assert float(alone["dc A [W]"]) < 100.0


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("a", "b", "fixed"),
    [
        ("cots", "custom", {}),
        ("cots", "custom", {"spring_rate": 490.9}),
        ("line", "custom", {}),
        ("cots", "settings", {}),
        ("settings", "settings", {}),
    ],
)
def test_the_picture_is_drawn(
    runs: Path, tmp_path: Path, a: str, b: str, fixed: dict[str, float]
) -> None:
    comparison = compare(runs / a, runs / b)
    assert imread(write_comparison(comparison, tmp_path / "x.png", fixed)).std() > 0.03


def test_compare_as_a_command(runs: Path, tmp_path: Path) -> None:
    call = CliRunner().invoke
    arguments = ["compare", "cots", "custom", "--runs", str(runs)]
    picture = tmp_path / "c.png"
    done = call(app, [*arguments, "--json", "-o", str(picture), "--tolerance", "ki=5"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["written"] == [str(tmp_path / "c.csv"), str(picture)]
    assert picture.exists()
    assert len(result["pairs"]) == 52
    assert result["mean_difference_w"]["dc"]["b_less_a"] == pytest.approx(GAIN, abs=0.5)
    slower = ["compare", "cots", "slower", "--runs", str(runs), "-o", str(picture)]
    done = call(app, slower)
    assert "DIFFERENT SEAS" in done.stderr
    assert "6 pairs of points matched by spring rate within 25 N/m" in done.stdout
    for wrong, expected in (
        (["--tolerance", "ki"], "write COLUMN=VALUE"),
        (["--tolerance", "speed=1"], "no column 'speed'"),
        (["--left-out", "spring_rate=1"], "spring rate +1 N/m is not in the campaign"),
    ):
        done = call(app, [*arguments, "-o", str(picture), *wrong])
        assert done.exit_code == 2
        assert expected in done.stderr
    assert call(app, ["compare", "cots", "none", "--runs", str(runs)]).exit_code == 2


def test_plot_as_a_command(runs: Path, tmp_path: Path) -> None:
    call = CliRunner().invoke
    picture = tmp_path / "p.png"
    arguments = ["plot", "settings", "--runs", str(runs), "-o", str(picture)]
    surface = ["--surface", "switching_period", "kp", "--station", "dc"]
    bars = ["--sort", "power"]
    drawn = {}
    for more in (
        surface,
        [*surface, "--left-out", "bus_voltage=75"],
        bars,
        [*bars, "--station", "mechanical_1", "--station", "electrical DC"],
    ):
        done = call(app, [*arguments, *more, "--json"])
        assert done.exit_code == 0, done.output
        assert json.loads(done.stdout) == [str(picture)]
        drawn[tuple(more)] = imread(picture)
        assert drawn[tuple(more)].std() > 0.02
    of_the_drive, of_the_body = [*drawn.values()][2:]
    assert not np.array_equal(of_the_drive, of_the_body)
    for more, expected in (
        (["--surface", "kp", "speed"], "no column 'speed'"),
        (
            [*surface, "--left-out", "ki"],
            "ki cannot be left out; besides the axes these vary: bus_",
        ),
        (
            [*surface, "--left-out", "bus_voltage=7"],
            "bus voltage 7 V is not in the campaign; allowed 60 V",
        ),
        (
            ["--station", "shore"],
            "unknown station 'shore'; allowed mechanical (column",
        ),
        ([*bars, "--station", "shore"], "unknown station 'shore'; allowed mechanical (column"),
        (["--sort", "size"], "allowed run, power"),
        (["--sort", "run", "-f", "power.*"], "give options of one of them"),
    ):
        done = call(app, [*arguments, *more])
        assert done.exit_code == 2
        assert expected in done.stderr


def test_best_points_and_rig_times_stand_side_by_side_without_a_common_set_point(
    tmp_path: Path,
) -> None:
    """A coarse grid and a finer one, as of an adaptive campaign: which took less time for more?"""
    rows = synthetic.default_rows()
    write(tmp_path / "grid", rows)
    finer = [row._replace(kp=row.kp - 300.0) for row in rows[:9]]
    write(tmp_path / "finer", finer, SHAPE._replace(seed=5))
    comparison = compare(tmp_path / "grid", tmp_path / "finer")
    assert comparison.matched.pairs == ()
    values = as_json(comparison)
    for side, length in (("a", rows), ("b", finer)):
        table = synthetic.run_rows(length, SHAPE)
        assert values[side]["rig_time_s"] == pytest.approx(len(table) * SHAPE.dt)
    text = as_text(comparison)
    assert "!! NO SET POINT IN COMMON" in text
    for name, planned in (("a", rows), ("b", finer)):
        best = values["best"]["dc"][name]
        (row,) = best["rows"]
        assert planned[row].power["dc"] == min(each.power["dc"] for each in planned)
        assert best["setting"]["kp"] == planned[row].kp
    lines = text.split("Best points of each run")[1].splitlines()
    (begin,) = (at for at, line in enumerate(lines) if line.startswith("  electrical DC"))
    assert re.search(r" A +[−-]\S+ ± \S+   row \d+: .*Kp ", lines[begin])
    assert re.search(r"^ +B +[−-]\S+ ± \S+   row \d+: .*Kp ", lines[begin + 1])
    assert "B - A" in lines[begin + 2]
    assert re.search(r"^rig time \d+:\d\d$", analysed(tmp_path / "grid"), re.MULTILINE)


def of_law(law: str, settings: list[dict[str, float]], offset: float) -> xarray.Dataset:
    """Return a row table of one law in the seas of seeds 1 and 2: -10 W and -20 W at the best."""
    seeds = [1] * len(settings) + [2] * len(settings)

    def power(setting: dict[str, float]) -> dict[str, float]:
        return dict.fromkeys(POWERS, sum(setting.values()) - setting["spring_rate"])

    table = rows(settings * 2, power)
    for name in POWERS:
        table[f"power_{name}"] = table[f"power_{name}"] + offset - 10.0 * np.array(seeds)
    contents = contents_attributes(row_contents(laws.own(law).columns))
    return table.assign(seed=("row", seeds)).assign_attrs(contents)


def give_tables(monkeypatch: pytest.MonkeyPatch, tables: dict[str, xarray.Dataset]) -> None:
    """Let runs have these row tables, by name, with the state of their own records."""
    read = comparisons.current_table

    def with_record(run: Path, **options: bool) -> xarray.Dataset:
        state = read(run, **options).attrs["record_state"]
        return tables[run.name].assign_attrs(record_state=state)

    monkeypatch.setattr(comparisons, "current_table", with_record)


def test_runs_with_different_axes_are_compared_by_their_best_points(
    runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing says which damping belongs to which Kp: each point would pair with every other."""
    spring = {"spring_rate": 490.9}
    tables = {
        "cots": of_law("impedance", [{**spring, "kp": k, "ki": 0.0} for k in (1, 2, 3)], 0.0),
        "custom": of_law(
            "nonlinear damping", [{**spring, "quadratic": b, "coulomb": 0.0} for b in (4, 5)], -7.0
        ),
    }
    give_tables(monkeypatch, tables)
    comparison = compare(runs / "cots", runs / "custom")
    assert comparison.matched.axes_differ
    assert comparison.matched.pairs == ()
    text = as_text(comparison)
    assert (
        "!! DIFFERENT AXES: A alone varies Kp; B alone varies quadratic damping; the best points "
        "are compared"
    ) in text
    assert "Only in" not in text
    assert "pairs of points" not in text
    values = as_json(comparison)
    assert values["axes_differ"]
    assert [values["best"]["dc"][side]["mean_w"] for side in "ab"] == [1.0 - 15.0, 4.0 - 22.0]
    for seed in (1, 2):
        best = values["best_by_seed"][str(seed)]["dc"]
        expected = [1.0 - 10.0 * seed, 4.0 - 7.0 - 10.0 * seed]
        assert [best[side]["mean_w"] for side in "ab"] == expected
        assert re.search(rf"electrical DC +seed {seed} .* B - A +−4\.00\n", text)


def of_laws(settings: list[dict[str, float]], names: tuple[str, ...]) -> xarray.Dataset:
    """Return a row table of rows of several laws: power by `kp`, and 5 W less if latched."""
    law = laws.choice([laws.own(name) for name in names])
    latched = names.index("latching")
    spring = {"spring_rate": 490.9, "ki": 0.0, "km": 0.0}
    table = rows(
        [{**spring, **each} for each in settings],
        lambda each: dict.fromkeys(POWERS, each["kp"] / 100.0 - 5.0 * (each["law"] == latched)),
    )
    return table.assign_attrs(contents_attributes(row_contents(law.columns)))


def test_points_of_different_laws_are_no_pairs(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A latched row and one of the default law may have the same Kp."""
    gains = (-1000.0, -2000.0, -3000.0)
    plain = [{"spring_rate": 490.9, "kp": kp, "ki": 0.0} for kp in gains]
    both = [{"kp": kp, "latch": 0.0, "law": 0.0} for kp in gains]
    latched = [{"kp": kp, "latch": 0.1 * i, "law": 1.0} for i, kp in enumerate(gains, 1)]
    one, two = ("impedance", "latching"), ("latching", "impedance")
    swapped = [{**each, "law": 1.0 - each["law"]} for each in (*both, *latched)]
    tables = {
        "cots": of_laws([*both, *latched], one),
        "custom": of_law("impedance", plain, 0.0),
        "line": of_laws(swapped, two),
        "slower": of_laws(latched, one),
    }
    give_tables(monkeypatch, tables)
    found = compare(runs / "cots", runs / "custom")
    assert [(pair.a.rows, pair.b.rows[0]) for pair in found.matched.pairs] == [
        ((0,), 0), ((1,), 1), ((2,), 2),
    ]  # fmt: skip
    assert [point.rows for point in found.matched.only_a] == [(3,), (4,), (5,)]
    text = as_text(found)
    assert "only A has rows of the law latching: they are in no pair" in text
    assert "its points share points" not in text
    assert "DIFFERENT" not in text
    # The places of the laws in the lists do not count.
    found = compare(runs / "cots", runs / "line")
    assert [(pair.a.rows, pair.b.rows) for pair in found.matched.pairs] == [
        ((row,), (row,)) for row in range(6)
    ]
    assert [power_difference(pair, "dc").watts for pair in found.matched.pairs] == [0.0] * 6
    assert "matched by equal law" in as_text(found) or ", equal law" in as_text(found)
    found = compare(runs / "slower", runs / "custom")
    assert (found.matched.pairs, found.matched.axes_differ) == ((), True)
    text = as_text(found)
    assert "!! DIFFERENT LAWS: A has latching; B has impedance; the best points are c" in text
    assert "Mean difference" not in text
    best = as_json(found)["best"]["dc"]
    assert best["a"]["mean_w"] == -35.0
    # The remarks are those of `rig show`, which names the edge of the grid.
    (shown,) = (each for each in find_optima(tables["custom"]) if each.station.name == "dc")
    assert best["b"]["caveat"] == shown.caveat == "grid's edge"
    assert re.search(r"^ +B .* law impedance.*   grid's edge$", text, re.MULTILINE)


def analysed(run: Path) -> str:
    return summaries.as_text(analyse(run).summary)
