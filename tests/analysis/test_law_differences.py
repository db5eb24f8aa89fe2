"""Campaigns of two laws: panels, bars, effects and best points are those of each law."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import xarray
from matplotlib.figure import Figure
from test_slices import own_optima, rows, three_springs

from rig import laws
from rig.analysis import bars, surfaces
from rig.analysis.effects import all_effects, effect_lines, effects_text
from rig.analysis.law_differences import best_of_laws, law_groups, laws_json, laws_text
from rig.analysis.points import Matrix, gain_matrix
from rig.analysis.rows import contents_attributes, stations_of, write_rows
from rig.api.row_frames import row_frame
from rig.kinds.wavebot.row_contents import row_contents

CHOICE = laws.choice([laws.own("impedance"), laws.own("nonlinear damping")])
IMPEDANCE, DAMPING = 0.0, 1.0
STATIONS = ("dc", "ac", "mechanical_2", "mechanical_1")


def power_of(at: dict[str, float]) -> dict[str, float]:
    """Return powers (W): linear in the columns of each law, so that effects are known."""
    if at["law"] == IMPEDANCE:
        value = -30.0 + at["kp"] / 100.0 - at["ki"] / 1000.0
    else:
        value = -20.0 - at["quadratic"] / 500.0 + at["coulomb"] / 10.0
    return dict.fromkeys(STATIONS, value)


@pytest.fixture(name="table")
def of_table() -> xarray.Dataset:
    spring = {"spring_rate": 490.9}
    settings: list[dict[str, float]] = [
        {**spring, "kp": kp, "ki": ki, "quadratic": 0.0, "coulomb": 0.0, "law": IMPEDANCE}
        for kp, ki in product((-1000.0, -2000.0, -3000.0), (0.0, 1000.0, 2000.0))
    ]
    settings += [
        {**spring, "kp": 0.0, "ki": 0.0, "quadratic": b, "coulomb": c, "law": DAMPING}
        for b, c in product((1000.0, 2000.0, 4000.0), (0.0, 50.0, 100.0, 150.0))
    ]
    table = rows(settings, power_of)
    dofs = {f"power_{name}_dof": ("row", np.full(len(settings), 8.0)) for name in STATIONS}
    table = table.assign(dofs)
    return table.assign_attrs(contents_attributes(row_contents(CHOICE.columns)))


def test_each_law_has_its_own_points_and_axes(table: xarray.Dataset) -> None:
    groups = law_groups(gain_matrix(table))
    assert [(group.name, len(group.matrix.points)) for group in groups] == [
        ("impedance", 9), ("nonlinear damping", 12),
    ]  # fmt: skip
    views = [surfaces.default_view(group.matrix) for group in groups]
    assert [{view.x.name, view.y.name} for view in views] == [
        {"ki", "kp"}, {"quadratic", "coulomb"},
    ]  # fmt: skip
    single = gain_matrix(rows(three_springs(), own_optima))
    assert law_groups(single) == [("", {}, single)]
    assert law_groups(Matrix((), ())) == [("", {}, Matrix((), ()))]


def test_surfaces_have_a_column_of_panels_for_each_law(table: xarray.Dataset) -> None:
    assert surfaces.panel_columns(table) == 2
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    surfaces.draw_surfaces(figure, table, 10.0)
    figure.draw_without_rendering()
    panels = [axes for axes in figure.axes if axes.get_subplotspec() is not None]
    assert len(panels) == 8
    first, second = panels[0], panels[1]
    assert first.get_ylabel() == "Kp, N·s/m"
    assert second.get_ylabel() == "quadratic damping, N·s^2/m^2"
    assert panels[-1].get_xlabel() == "Coulomb force, N"
    headings = [[text.get_text().split("\n")[0] for text in axes.texts] for axes in panels[:2]]
    assert "law impedance" in headings[0]
    assert "law nonlinear damping" in headings[1]
    # Both panels of a station have the colours of one scale.
    norms = [axes.collections[0].norm for axes in (first, second)]
    assert (norms[0].vmin, norms[0].vmax) == (norms[1].vmin, norms[1].vmax)
    assert norms[0].vmin <= -62.0
    assert norms[0].vmax >= -7.0


def test_bars_of_a_law_stand_together(
    table: xarray.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    shuffled = table.isel(row=np.random.default_rng(4).permutation(21))
    order = bars.row_order(shuffled, "power", stations_of(shuffled)[-1])
    chosen = shuffled.isel(row=order)
    assert chosen["law"].values.tolist() == [IMPEDANCE] * 9 + [DAMPING] * 12
    for start, end in ((0, 9), (9, 21)):
        assert (np.diff(chosen["power_dc"].values[start:end]) >= 0.0).all()
    figures: list[Any] = []
    monkeypatch.setattr(bars.picture, "save", lambda figure, path: figures.append(figure) or path)
    bars.write_bars(table, Path("unused.png"))
    (figure,) = figures
    names = [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    assert not any("law" in name for name in names)
    labels = [text.get_text() for text in figure.axes[-1].texts]
    assert labels[:2] == ["law impedance", "law nonlinear damping"]


def test_settings_that_a_law_lacks_are_no_numbers_in_files_and_frames(
    table: xarray.Dataset, tmp_path: Path
) -> None:
    """A 0 would read as a gain that was run."""
    rows = table.assign(row=("row", np.arange(table.sizes["row"])))
    path, _ = write_rows(rows, tmp_path)
    written = pandas.read_csv(path)
    damping = table["law"].values == DAMPING
    for name, lacked in (("kp", damping), ("ki", damping), ("quadratic", ~damping)):
        values = written[name].to_numpy()
        assert (np.isnan(values) == lacked).all(), name
        assert (values[~lacked] == table[name].values[~lacked]).all()
        assert (np.isnan(row_frame(rows)[name].to_numpy()) == lacked).all()


def test_difference_of_the_best_points_has_its_interval(table: xarray.Dataset) -> None:
    """Errors of 0.5 W with 8 degrees of freedom each: those of the difference are 16."""
    found = best_of_laws(table)
    assert [(each.station.name, each.law) for each in found] == [
        (name, law) for name in STATIONS for law in ("impedance", "nonlinear damping")
    ]
    best, other = found[:2]
    assert best.point.power["dc"] == pytest.approx(-62.0)
    assert (best.watts, other.watts) == (0.0, pytest.approx(-28.0 + 62.0))
    assert other.half_width == pytest.approx(2.119905 * 0.5 * np.sqrt(2.0), rel=1e-5)
    text = laws_text(found)
    assert "impedance" in text[1]
    assert text[2].endswith("row 17   +34.0 ± 1.5 W")
    assert laws_json(found)[1]["rows"] == (17,)
    assert best_of_laws(rows(three_springs(), own_optima)) == ()
    near = table.assign(power_dc=table["power_dc"].where(table["law"] == 0, -61.0))
    assert laws_text(best_of_laws(near))[2].endswith("(not different)")


def test_effects_are_those_within_a_law(table: xarray.Dataset) -> None:
    """Kp is zero under the other law: a common fit would give Kp the difference of the laws."""
    watts = {
        (line["law"], line["column"]): (line["effect [W]"], line["from"], line["to"])
        for line in effect_lines(all_effects(table))
        if line["power"] == "dc"
    }
    assert watts == {
        ("impedance", "kp"): (pytest.approx(20.0), -3000.0, -1000.0),
        ("impedance", "ki"): (pytest.approx(-2.0), 0.0, 2000.0),
        ("nonlinear damping", "quadratic"): (pytest.approx(-6.0), 1000.0, 4000.0),
        ("nonlinear damping", "coulomb"): (pytest.approx(15.0), 0.0, 150.0),
    }
    headings = [line for line in effects_text(all_effects(table)) if line.startswith("Main")]
    assert [line.split(" (")[0] for line in headings] == [
        "Main effects with the law impedance", "Main effects with the law nonlinear damping",
    ]  # fmt: skip
