"""Two runs beside each other: surfaces on one colour scale, and their difference.

Only matched points are shown. Columns that are left out stand where the station absorbs most in
either run, the same for both, so that what is subtracted belongs together. Points that make no
surface are drawn with error bars, over the one column that varies or in the order of run A.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from rig.analysis import labels, panel, phrases, picture
from rig.analysis.comparison import Comparison, Gap, gap, gap_words, joint_setting, mean_gap
from rig.analysis.matching import Pair
from rig.analysis.mesh import Place, spans_surface
from rig.analysis.picture import INK, MARK
from rig.analysis.points import Matrix, Point, Setting, agrees, varied
from rig.analysis.slices import Slice, cut
from rig.analysis.surfaces import KINDS, View, default_view
from rig.config.columns import Column

_GAPS = colormaps["PuOr_r"]  # purple: B absorbs more
_A, _B = "#0b6e99", "#d17a22"
_LABELS = 50  # that stand beside each other, turned
_SURE = 2.0  # standard errors
_WIDTH = 11.7  # in
_ROOM = 3.3  # in, of a panel's caption
_NAMED = 2  # settings in the heading


class _Sides(NamedTuple):
    """Points of both runs under one set point each, and their differences."""

    a: Matrix
    b: Matrix
    pairs: tuple[Pair, ...]
    settings: tuple[Setting, ...]


def _sides(told: Comparison) -> _Sides:
    pairs = told.matched.pairs
    settings = tuple(p.a.setting | joint_setting(told.matched, p) for p in pairs)

    def one(side: int) -> Matrix:
        points = tuple(p[side]._replace(setting=s) for p, s in zip(pairs, settings, strict=True))
        return Matrix(points, settings)

    return _Sides(one(0), one(1), pairs, settings)


def write_comparison(told: Comparison, path: Path, held: Setting | None = None) -> Path:
    """The picture of a comparison; ``held`` (SI) says where left-out columns stand instead.

    Raises ValueError where no point matched, or for a held value that no pair has.
    """
    both = _sides(told)
    if not both.pairs:
        raise ValueError("no set point in common: nothing to draw")
    view = default_view(both.a)._replace(by_spring=False)
    cuts = {kind: _cuts(both, kind, view, held or {}) for kind in KINDS}
    # A run that does not know what the other varies has no surface over it.
    flat = not told.matched.alone and all(
        spans_surface(each[0].places) for each in cuts.values() if each[0].points
    )
    mode = told.a.mode if told.a.mode == told.b.mode else f"A {told.a.mode}, B {told.b.mode}"
    runs = f"A {told.a.run}, B {told.b.run}"
    figure, body = picture.framed(
        _WIDTH,
        9.6,
        f"A {told.a.campaign} against B {told.b.campaign}",
        {"mode": mode, "run": runs},
        "",
        _beneath(told),
        "; ".join(told.warnings),
    )
    if flat:
        _surfaces(body, cuts, both)
    else:
        _lines(body, both, held or {}, (f"A {told.a.campaign}", f"B {told.b.campaign}"))
    return picture.save(figure, path)


def _beneath(told: Comparison) -> str:
    """The sea if it is one, whose rig it was, and what held heave and surge if that differs."""
    parts = [f"sea {told.a.sea}"] if told.same_sea else []
    if told.a.rig != told.b.rig:
        parts.append(f"A on {told.a.rig}, B on {told.b.rig}")
    apart = [each for each in told.differences if each.group == "control"]
    parts += [f"{each.key}: A {each.a}, B {each.b}" for each in apart[:_NAMED]]
    if len(apart) > _NAMED:
        parts.append("and more")
    return "; ".join(parts)


def _cuts(both: _Sides, kind: str, view: View, held: Setting) -> tuple[Slice, Slice]:
    """The same slice of both runs, through the best point of either."""
    free = {c.name for c in varied(both.a)} - {view.x.name, view.y.name}
    found = [cut(side, kind, view.x, view.y, held) for side in (both.a, both.b)]
    tops = [each.best for each in found if each.best is not None]
    if not tops:
        return found[0], found[1]
    here = min(tops, key=lambda top: top.power).point.setting
    fixed = found[0].held | {name: here[name] for name in free if name in here}
    return cut(both.a, kind, view.x, view.y, fixed), cut(both.b, kind, view.x, view.y, fixed)


def _surfaces(body: FigureBase, cuts: dict[str, tuple[Slice, Slice]], both: _Sides) -> None:
    panels: Any = body.subplots(len(KINDS), 3, squeeze=False)
    for i, kind in enumerate(KINDS):
        one, other = cuts[kind]
        row: list[Axes] = panels[i].tolist()
        captions = [panel.caption(each, _ROOM) for each in cuts[kind]]
        lines = panel.lines_of(captions)
        on = panel.scale([*one.values, *other.values])
        name = phrases.STATION_ABBREVIATIONS[kind]
        for axes, each, letter, text in zip(row, cuts[kind], "AB", captions, strict=False):
            panel.panel(axes, each, on, text)
            said = f"{letter}: {name}"
            if each.held:
                said += f"\nat {labels.settings(each.held)}"
            panel.above(axes, said, lines)
        panel.colour_bar(body, row[:2], on, f"{name}, W", fraction=0.05)
        _difference(body, row[2], one, both, kind, lines)


def _difference(
    body: FigureBase, axes: Axes, of: Slice, both: _Sides, kind: str, lines: int
) -> None:
    """B less A over the slice; points whose difference is beyond its error are filled."""
    here = [
        (setting, pair)
        for setting, pair in zip(both.settings, both.pairs, strict=True)
        if agrees(setting, of.held) and np.isfinite(gap(pair, kind).watts)
    ]
    picture.quiet(axes)
    places: list[Place] = [(s[of.x.name], s[of.y.name]) for s, _ in here]
    gaps = [gap(pair, kind) for _, pair in here]
    if not spans_surface(places):
        axes.set_axis_off()
        return
    on = panel.scale([each.watts for each in gaps], _GAPS, even=True)
    shown = panel.shown_places(of, places)
    panel.surface(axes, shown, [each.watts for each in gaps], on, zero=False)
    panel.ticks(axes)
    sure = [place for place, each in zip(shown, gaps, strict=True) if _is_sure(each)]
    if sure:
        x, y = zip(*sure, strict=True)
        axes.plot(x, y, "o", color=INK, ms=3.4, clip_on=False)
    axes.set_xlabel(labels.heading(of.x) if kind == KINDS[-1] else "", fontsize=8)
    mean = gap_words(mean_gap(tuple(pair for _, pair in here), kind))
    text = f"mean of these points {mean} W\nfilled: beyond {_SURE:g} standard errors"
    axes.set_title(text, fontsize=7.5, color=MARK, pad=4)
    panel.above(axes, "B − A (negative: B absorbs more)", max(lines, 2))
    panel.colour_bar(body, [axes], on, "B − A, W", fraction=0.08)


def _is_sure(told: Gap) -> bool:
    return bool(np.isfinite(told.error) and abs(told.watts) > _SURE * told.error)


def _lines(body: FigureBase, both: _Sides, held: Setting, names: tuple[str, str]) -> None:
    """Both runs with error bars on the left, their difference on the right."""
    kept = [i for i, s in enumerate(both.settings) if agrees(s, held)]
    if not kept:
        raise ValueError(f"no matched point at {labels.settings(held)}")
    left = Matrix((), tuple(both.settings[i] for i in kept))
    moving = varied(left)
    column = moving[0] if len(moving) == 1 else None
    if column is not None:
        kept.sort(key=lambda i: both.settings[i][column.name])
    x = np.array([_at(both, i, n, column) for n, i in enumerate(kept)])
    panels: Any = body.subplots(len(KINDS), 2, squeeze=False, sharex=True)
    for i, kind in enumerate(KINDS):
        pair_axes, gap_axes = panels[i].tolist()
        style: dict[str, Any] = {"ms": 4.0, "lw": 1.0, "capsize": 2.5}
        joined = "-" if column is not None else ""
        for name, side, colour, sign in zip(names, (both.a, both.b), (_A, _B), "os", strict=True):
            points: list[Point] = [side.points[n] for n in kept]
            y = [p.power[kind] for p in points]
            errors = np.nan_to_num([p.error[kind] for p in points])
            pair_axes.errorbar(
                x, y, yerr=errors, fmt=f"{sign}{joined}", color=colour, label=name, **style
            )
        gaps = [gap(both.pairs[n], kind) for n in kept]
        errors = np.nan_to_num([each.error for each in gaps])
        watts = [each.watts for each in gaps]
        gap_axes.errorbar(x, watts, yerr=errors, fmt=f"D{joined}", color=INK, **style)
        gap_axes.axhline(0.0, color=MARK, lw=1.0)
        pair_axes.set_ylabel(f"{phrases.STATION_ABBREVIATIONS[kind]}, W", fontsize=8)
        gap_axes.set_ylabel("B − A, W", fontsize=8)
        mean = gap_words(mean_gap(tuple(both.pairs[n] for n in kept), kind))
        gap_axes.set_title(f"mean {mean} W (negative: B absorbs more)", fontsize=8, color=MARK)
        if i == 0:
            at: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.98)}
            pair_axes.legend(fontsize=8, frameon=False, ncols=2, borderpad=0.1, **at)
        for axes in (pair_axes, gap_axes):
            picture.quiet(axes)
            axes.grid(alpha=0.3)
            if i == len(KINDS) - 1:
                axes.set_xlabel(_axis(column), fontsize=8)
    if column is None:
        rows = [f"{both.pairs[n].a.rows[0]}|{both.pairs[n].b.rows[0]}" for n in kept]
        turned = 90 if len(rows) > 12 else 0
        every = int(np.ceil(len(rows) / _LABELS))
        for axes in panels[-1]:
            axes.set_xticks(x[::every], rows[::every], rotation=turned)


def _at(both: _Sides, i: int, number: int, column: Column | None) -> float:
    if column is None:
        return float(number)
    return both.settings[i][column.name] * labels.factor(column)


def _axis(column: Column | None) -> str:
    return "matched points, row of A | row of B" if column is None else labels.heading(column)
