"""The summary as one A4 page."""

import textwrap
from pathlib import Path
from typing import Any

import xarray
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from rig.analysis import effects_table, phrases, picture, surfaces
from rig.analysis.stop_reason import ENDINGS
from rig.analysis.summary import Summary

A4 = (8.27, 11.69)  # inches, portrait
_INK = picture.INK
_SOFT = picture.SOFT
_PALE = "#eef2f5"
_GOOD, _BAD = "#2a7f4f", "#b23a48"
_LEFT, _RIGHT = 0.06, 0.94
_MOST_SPRINGS = 4  # columns of surfaces that are readable on the page
_MOST_ALARMS = 6
_LEAST_SURFACES = 0.36  # of the page: less is too little to read them
_MOST_FURTHER = 4  # best points that each have room for a second line; of more, only DC has
_LINE = 0.0135  # height of a line of text, of the page


def _header(figure: Figure, summary: Summary) -> None:
    figure.add_artist(Rectangle((0.0, 0.937), 1.0, 0.063, color=_INK, lw=0))
    figure.text(
        _LEFT,
        0.975,
        f"Campaign {summary.campaign}",
        color="white",
        fontsize=17,
        fontweight="bold",
        va="center",
    )
    figure.text(_LEFT, 0.950, f"run {summary.run}", color="#c9d3db", fontsize=8.5, va="center")
    figure.text(
        _RIGHT,
        0.968,
        summary.stamp,
        color=_INK,
        fontsize=9,
        fontweight="bold",
        ha="right",
        va="center",
        bbox={"boxstyle": "round,pad=0.45", "fc": picture.ZERO, "ec": "none"},
    )


def _heading(figure: Figure, x: float, y: float, text: str) -> None:
    figure.text(x, y, text.upper(), fontsize=7.5, fontweight="bold", color=_SOFT, va="top")


def _what(figure: Figure, summary: Summary) -> float:
    """What was run; returns the page height below it."""
    _heading(figure, _LEFT, 0.922, "What was run")
    told = {
        "Sea": summary.sea,
        "Rig": summary.rig,
        "Start": summary.started_utc,
        "End": summary.ended_utc,
        "Host": summary.host,
        "Code": summary.code,
        **({"Read by": summary.calibration} if summary.calibration else {}),
    }
    y = 0.904
    for name, value in told.items():
        figure.text(_LEFT, y, name, fontsize=8.5, color=_SOFT, va="top")
        wrapped = textwrap.wrap(value, 52) or [""]
        figure.text(_LEFT + 0.07, y, "\n".join(wrapped), fontsize=8.5, color=_INK, va="top")
        y -= _LINE * len(wrapped) + 0.001
    return y - 0.01


def _outcome(figure: Figure, summary: Summary) -> float:
    """How it ended; returns the page height below it."""
    x = 0.56
    _heading(figure, x, 0.922, "Outcome")
    good = summary.ending == ENDINGS["complete"]
    colour = _GOOD if good else _BAD
    figure.text(x, 0.905, summary.ending, fontsize=15, fontweight="bold", color=colour, va="top")
    reason = textwrap.wrap(summary.reason[:1].upper() + summary.reason[1:] + ".", 48)
    figure.text(x, 0.880, "\n".join(reason), fontsize=8.5, color=_INK, va="top")
    share = summary.rows_done / max(1, summary.rows_planned)
    y, width = min(0.843, 0.876 - _LINE * len(reason)), _RIGHT - x
    figure.add_artist(Rectangle((x, y), width, 0.006, color=_PALE, lw=0))
    figure.add_artist(Rectangle((x, y), width * share, 0.006, color=colour, lw=0))
    done = textwrap.wrap(summary.rows_words, 54)
    figure.text(x, y - 0.004, "\n".join(done), fontsize=8.5, color=_INK, va="top")
    y -= 0.004 + _LINE * len(done)
    if summary.record:
        told = textwrap.wrap(summary.record_words + ".", 48, max_lines=4, placeholder=" ...")
        colour = _SOFT if summary.record.complete else _BAD
        figure.text(x, y, "\n".join(told), fontsize=8.5, color=colour, va="top")
        y -= _LINE * len(told)
    return y - 0.006


def _table(figure: Figure, summary: Summary, top: float) -> float:
    """The optima; returns the page height below it."""
    _heading(figure, _LEFT, top, "Best points")
    told = f"negative is absorbed{summary.errors_words}"
    figure.text(_RIGHT, top, told, fontsize=7.5, color=_SOFT, ha="right", va="top")
    heads = ("station", "mean power", "spring", "stator", "Kp", "Ki", "")
    units = ("", "", "N/m", "%", "N·s/m", "N/m", "")
    sides = ("left", "right", "right", "right", "right", "right", "left")
    places = (_LEFT, 0.465, 0.57, 0.65, 0.74, 0.83, 0.85)
    y = top - 0.019
    for x, head, unit, side in zip(places, heads, units, sides, strict=True):
        text = f"{head}, {unit}" if unit else head
        figure.text(x, y, text, fontsize=7.5, color=_SOFT, ha=side, va="top")
    y -= 0.016
    if not summary.optima:
        figure.text(_LEFT, y, "No complete row.", fontsize=8.5, color=_INK, va="top")
        return y - 0.02
    last = ""
    for o in summary.optima:
        if o.kind != last:
            rule = y + 0.0028
            figure.add_artist(Line2D((_LEFT, _RIGHT), (rule, rule), color="#cfd6dc", lw=0.7))
        cells = (
            phrases.POWER_NAMES[o.kind] if o.kind != last else "",
            phrases.watts(o.power, o.error),
            phrases.signed(o.point.spring_rate),
            phrases.signed(o.point.stator),
            phrases.signed(o.point.kp),
            phrases.signed(o.point.ki),
            o.doubt,
        )
        for i, (x, cell, side) in enumerate(zip(places, cells, sides, strict=True)):
            weight = "bold" if i == 1 else "normal"
            colour = _BAD if i == 6 else _INK
            figure.text(
                x, y, cell, fontsize=8.5, color=colour, ha=side, va="top", fontweight=weight
            )
        y -= 0.0152
        last = o.kind
        further = summary.further_words(o)
        if further and (len(summary.optima) <= _MOST_FURTHER or o.kind == "dc"):
            figure.text(places[5], y, further, fontsize=7.5, color=_SOFT, ha="right", va="top")
            y -= 0.0135
    if summary.further and len(summary.optima) > _MOST_FURTHER:
        text = "Where the other columns stand at the other stations: see summary.txt"
        figure.text(_LEFT, y, text, fontsize=7.5, color=_SOFT, va="top")
        y -= 0.0135
    if summary.flat_words:
        figure.text(_LEFT, y, summary.flat_words, fontsize=7.5, color=_SOFT, va="top")
        y -= 0.0135
    return y - 0.008


def _effects(figure: Figure, summary: Summary, top: float, bottom: float) -> float:
    """Main effects of a designed matrix; returns the page height below them."""
    told = summary.effects
    if not told:
        return top
    if top - 0.085 - 0.0152 * len(told[0].effects) < bottom:
        figure.text(_LEFT, top, "Main effects: see summary.txt", fontsize=8.5, va="top")
        return top - 0.02
    _heading(figure, _LEFT, top, "Main effects: change of power over a column's range")
    stations = [f"{phrases.STATION_ABBREVIATIONS[each.kind]}, W" for each in told]
    heads = ["rank, column", "from .. to", *stations]
    places = [_LEFT, 0.30, 0.60, 0.77, 0.94][: len(heads)]
    sides = ["left", "left", *["right"] * len(stations)]
    y = top - 0.019
    for x, head, side in zip(places, heads, sides, strict=True):
        figure.text(x, y, head, fontsize=7.5, color=_SOFT, ha=side, va="top")
    y -= 0.0132
    figure.add_artist(Line2D((_LEFT, _RIGHT), (y, y), color="#cfd6dc", lw=0.7))
    y -= 0.0028
    by_name = [{e.column.name: e for e in each.effects} for each in told]
    for i, first in enumerate(told[0].effects):
        here = [known[first.column.name] for known in by_name]
        cells = [f"{i + 1}  {first.column.label}", effects_table.span(first)]
        cells += [effects_table.watts(each.watts, each.half_width) for each in here]
        for j, (x, cell, side) in enumerate(zip(places, cells, sides, strict=True)):
            weight = "bold" if i == 0 and j < 3 else "normal"
            figure.text(x, y, cell, fontsize=8.5, color=_INK, ha=side, va="top", fontweight=weight)
        y -= 0.0152
    text = "; ".join(effects_table.notes(told[0]))
    lines = textwrap.wrap(text[:1].upper() + text[1:] + ".", 128)
    figure.text(_LEFT, y, "\n".join(lines), fontsize=7.5, color=_SOFT, va="top", linespacing=1.2)
    return y - _LINE * len(lines) - 0.012


def _bottom(figure: Figure, summary: Summary) -> float:
    """Alarms and timing at the foot of the page; returns the page height above them."""
    shown = list(summary.alarms[:_MOST_ALARMS])
    if len(summary.alarms) > len(shown):
        shown.append(f"and {len(summary.alarms) - len(shown)} more in summary.txt")
    lines: list[str] = []
    for alarm in shown:
        lines += textwrap.wrap(alarm, 120, initial_indent="• ", subsequent_indent="   ")
    timing = textwrap.wrap(summary.timing, 130)
    y = 0.03 + _LINE * len(timing)
    figure.text(_LEFT, y, "\n".join(timing), fontsize=7.5, color=_SOFT, va="top")
    _heading(figure, _LEFT, y + 0.016, "Timing")
    y += 0.027 + _LINE * max(1, len(lines))
    text = "\n".join(lines) if lines else "None."
    figure.text(
        _LEFT, y, text, fontsize=8, color=_BAD if lines else _GOOD, va="top", linespacing=1.25
    )
    _heading(figure, _LEFT, y + 0.016, "Alarms")
    return y + 0.03


def _surfaces(figure: Figure, table: xarray.Dataset, bottom: float, top: float) -> None:
    """Surfaces between two heights of the page, in a figure of their own size."""
    across = surfaces.panels_across(table)
    note = ""
    if across > _MOST_SPRINGS:
        note = f"{across} spring rates: see surfaces.png"
    elif top - bottom < _LEAST_SURFACES:
        note = "Power surfaces: see surfaces.png"
    if note and across and top - bottom > 0.03:
        figure.text(0.5, (bottom + top) / 2.0, note, ha="center", color=_SOFT, fontsize=9)
    if note or across == 0:
        return
    bands: Any = figure.subfigures(
        3, 3, height_ratios=[1.0 - top, top - bottom, bottom], width_ratios=[0.04, 0.92, 0.04]
    )
    surfaces.draw(bands[1, 1], table, 0.92 * A4[0], compact=across > 2)


def write_page(summary: Summary, table: xarray.Dataset, folder: Path) -> list[Path]:
    """``summary.pdf``, and the same page as ``summary.png`` for screens."""
    figure = Figure(figsize=A4, layout="constrained")  # for the surfaces; the rest stands fixed
    _header(figure, summary)
    below = _what(figure, summary)
    top = _table(figure, summary, min(0.805, below, _outcome(figure, summary)))
    bottom = _bottom(figure, summary)
    top = _effects(figure, summary, top, bottom)
    _surfaces(figure, table, bottom, top)
    paper, screen = folder / "summary.pdf", folder / "summary.png"
    title = f"{summary.campaign}, run {summary.run}"
    picture.save(figure, screen, 130.0)
    picture.save(figure, paper, 100.0, metadata={"Title": title})
    return [paper, screen]
