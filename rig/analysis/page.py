"""The run summary as one A4 page."""

import textwrap
from math import isfinite
from pathlib import Path
from typing import Any

import xarray
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from rig.analysis import labels, surfaces
from rig.analysis.effects import effect_notes
from rig.analysis.points import gain_matrix
from rig.analysis.rows import columns_of, stations_of
from rig.analysis.slices import ENDED_EARLY
from rig.analysis.stop_reason import ENDINGS
from rig.analysis.summary import Summary
from rig.presentation import phrases, picture
from rig.row_contents import PANEL, with_role
from rig.stations import shown

_DARK = picture.DARK
_MUTED = picture.MUTED
_PALE = "#eef2f5"
_GOOD, _BAD = "#2a7f4f", "#b23a48"
_LEFT, _RIGHT = 0.06, 0.94
_COLUMN_EDGES = (0.57, 0.65, 0.74, 0.83)  # of the main columns, in the table of best points
_MAX_PANELS = 4  # columns of surfaces that remain readable on the page
_MAX_ALARMS = 6
_MIN_SURFACE_HEIGHT = 0.112  # of the page height, by station; smaller surfaces are unreadable
_MAX_WIDE_COLUMNS = 3  # stations whose short labels fit side by side
_MAX_TWO_LINE_OPTIMA = 4  # with more, only those of the last station get a second line
_CUT = "†"  # of a row that ended early, with a footnote
_LINE = 0.0135  # height of a text line, share of the page


def _header(figure: Figure, summary: Summary) -> None:
    figure.add_artist(Rectangle((0.0, 0.937), 1.0, 0.063, color=_DARK, lw=0))
    title: dict[str, Any] = {"fontsize": 17, "fontweight": "bold"}
    stamp: dict[str, Any] = {"fontsize": 9, "fontweight": "bold", "ha": "right"}
    stamp["bbox"] = {"boxstyle": "round,pad=0.45", "fc": picture.HIGHLIGHT, "ec": "none"}
    _text(figure, _LEFT, 0.975, f"Campaign {summary.campaign}", color="white", va="center", **title)
    _text(figure, _LEFT, 0.950, f"run {summary.run}", color="#c9d3db", va="center")
    _text(figure, _RIGHT, 0.968, summary.stamp, va="center", **stamp)


def _heading(figure: Figure, x: float, y: float, text: str) -> None:
    _note(figure, x, y, text.upper(), fontweight="bold")


def _text(figure: Figure, x: float, y: float, text: str, **style: Any) -> None:
    """Write text below ``y``."""
    usual: dict[str, Any] = {"fontsize": 8.5, "color": _DARK, "va": "top"}
    figure.text(x, y, text, **usual | style)


def _note(figure: Figure, x: float, y: float, text: str, **style: Any) -> None:
    _text(figure, x, y, text, **{"fontsize": 7.5, "color": _MUTED} | style)


def _run_details(figure: Figure, summary: Summary) -> float:
    """Draw sea, rig, times, host and code; return the page height below them."""
    _heading(figure, _LEFT, 0.922, "Run")
    details = {
        "Sea": summary.sea,
        "Rig": summary.rig,
        "Start": summary.started_utc,
        **(
            {summary.next_stages.capitalize(): ", ".join(summary.resumed_utc)}
            if summary.resumed_utc
            else {}
        ),
        "End": summary.ended_utc,
        **({"Rig time": summary.rig_time_text} if summary.rig_time_text else {}),
        "Host": summary.host,
        "Code": summary.code,
        **({"Calib.": summary.calibration} if summary.calibration else {}),
    }
    y = 0.904
    for name, value in details.items():
        _text(figure, _LEFT, y, name, color=_MUTED)
        wrapped = textwrap.wrap(value, 52) or [""]
        _text(figure, _LEFT + 0.07, y, "\n".join(wrapped))
        y -= _LINE * len(wrapped) + 0.001
    return y - 0.01


def _outcome(figure: Figure, summary: Summary) -> float:
    """Draw the end and the completed rows of the run; return the page height below them."""
    x = 0.56
    _heading(figure, x, 0.922, "Outcome")
    complete = summary.ending == ENDINGS["complete"]
    colour = _GOOD if complete else _BAD
    _text(figure, x, 0.905, summary.ending, fontsize=15, fontweight="bold", color=colour)
    reason = textwrap.wrap(summary.reason[:1].upper() + summary.reason[1:] + ".", 48)
    for hint in summary.hints:
        reason += textwrap.wrap(hint, 48, max_lines=3, placeholder=" ...")
    _text(figure, x, 0.880, "\n".join(reason))
    share = summary.rows_done / max(1, summary.rows_planned)
    y, width = min(0.843, 0.876 - _LINE * len(reason)), _RIGHT - x
    figure.add_artist(Rectangle((x, y), width, 0.006, color=_PALE, lw=0))
    figure.add_artist(Rectangle((x, y), width * share, 0.006, color=colour, lw=0))
    rows_lines = textwrap.wrap(summary.rows_text, 54)
    _text(figure, x, y - 0.004, "\n".join(rows_lines))
    y -= 0.004 + _LINE * len(rows_lines)
    if summary.record:
        record_lines = textwrap.wrap(summary.record_text + ".", 48, max_lines=4, placeholder=" ...")
        colour = _MUTED if summary.record.complete else _BAD
        _text(figure, x, y, "\n".join(record_lines), color=colour)
        y -= _LINE * len(record_lines)
    return y - 0.006


def _best_points(figure: Figure, summary: Summary, top: float) -> float:
    """Draw the table of best points; return the page height below it."""
    _heading(figure, _LEFT, top, "Best points")
    note = f"negative is absorbed{summary.error_text}"
    _note(figure, _RIGHT, top, note, ha="right")
    columns = [c for column in summary.main for c in (column, column.actuator) if c is not None]
    headings = ("station", "mean power", *map(labels.heading, columns), "")
    alignments = ("left", *["right"] * (len(columns) + 1), "left")
    positions = (_LEFT, 0.465, *_COLUMN_EDGES[: len(columns)], 0.85)
    y = top - 0.019
    for x, text, side in zip(positions, headings, alignments, strict=True):
        _note(figure, x, y, text, ha=side)
    y -= 0.016
    if not summary.optima:
        _text(figure, _LEFT, y, "No complete row.")
        return y - 0.02
    last_name, main_name = "", summary.optima[-1].station.name
    for optimum in summary.optima:
        if optimum.station.name != last_name:
            rule = y + 0.0028
            figure.add_artist(Line2D((_LEFT, _RIGHT), (rule, rule), color="#cfd6dc", lw=0.7))
        cells = (
            optimum.station.label if optimum.station.name != last_name else "",
            optimum.power_text + _CUT * bool(optimum.point.cut_rows),
            *(
                phrases.format_signed(value)
                if isfinite(value)
                else "-" * (column.name in optimum.point.lacking)
                for column, value in labels.best_values(summary.main, optimum.point)
            ),
            "\n".join(caveats := [c for c in optimum.caveat.split("; ") if c != ENDED_EARLY]),
        )
        for i, (x, cell, side) in enumerate(zip(positions, cells, alignments, strict=True)):
            weight = "bold" if i == 1 else "normal"
            colour = _BAD if i == len(cells) - 1 else _DARK
            _text(figure, x, y, cell, color=colour, ha=side, fontweight=weight)
        y -= 0.0152
        last_name = optimum.station.name
        further_text = summary.further_text(optimum)
        few = len(summary.optima) <= _MAX_TWO_LINE_OPTIMA
        has_further = further_text and (few or optimum.station.name == main_name)
        if has_further:
            _note(figure, _COLUMN_EDGES[-1], y, further_text, ha="right")
        y -= 0.0135 * max(bool(has_further), len(caveats) - 1)
    if summary.further and len(summary.optima) > _MAX_TWO_LINE_OPTIMA:
        text = "Other columns of the best points at the other stations: see summary.txt"
        _note(figure, _LEFT, y, text)
        y -= 0.0135
    if summary.caveat_text:
        _note(figure, _LEFT, y, summary.caveat_text)
        y -= 0.0135
    footnote = f"{_CUT} {summary.ended_early}" if summary.ended_early else ""
    for line in textwrap.wrap(footnote, 136):
        _note(figure, _LEFT, y, line)
        y -= 0.0135
    return y - 0.008


def _effects(figure: Figure, summary: Summary, top: float, bottom: float) -> float:
    """Draw the main effects of a designed matrix; return the page height below them."""
    by_station = summary.effects
    if not by_station:
        return top
    if any(effects.law for effects in by_station):
        _text(figure, _LEFT, top, "Laws, and main effects with each: see summary.txt")
        return top - 0.02
    if top - 0.085 - 0.0152 * len(by_station[0].effects) < bottom:
        _text(figure, _LEFT, top, "Main effects: see summary.txt")
        return top - 0.02
    _heading(figure, _LEFT, top, "Main effects: change of power over a column's range")
    narrow = len(by_station) > _MAX_WIDE_COLUMNS
    names = (e.station.heading if narrow else e.station.short_label for e in by_station)
    stations = [f"{name}, W" for name in names]
    headings = ["rank, column", "from .. to", *stations]
    spacing = min(0.17, 0.34 / max(1, len(stations) - 1))
    positions = [_LEFT, 0.30, *(0.60 + spacing * i for i in range(len(stations)))]
    alignments = ["left", "left", *["right"] * len(stations)]
    y = top - 0.019
    for x, head, side in zip(positions, headings, alignments, strict=True):
        _note(figure, x, y, head, ha=side)
    y -= 0.0132
    figure.add_artist(Line2D((_LEFT, _RIGHT), (y, y), color="#cfd6dc", lw=0.7))
    y -= 0.0028
    for i, effect in enumerate(by_station[0].effects):
        cells = [f"{i + 1}  {effect.column.label}", effect.range_text]
        cells += [each.text_of(effect.column) for each in by_station]
        for j, (x, cell, side) in enumerate(zip(positions, cells, alignments, strict=True)):
            weight = "bold" if i == 0 and j < 3 else "normal"
            _text(figure, x, y, cell, ha=side, fontweight=weight)
        y -= 0.0152
    text = "; ".join(effect_notes(by_station[0]))
    lines = textwrap.wrap(text[:1].upper() + text[1:] + ".", 128)
    _note(figure, _LEFT, y, "\n".join(lines), linespacing=1.2)
    return y - _LINE * len(lines) - 0.012


def _alarms_and_timing(figure: Figure, summary: Summary) -> float:
    """Draw alarms and timing at the foot of the page; return the page height above them."""
    messages = list(summary.alarms[:_MAX_ALARMS])
    if len(summary.alarms) > len(messages):
        messages.append(f"and {len(summary.alarms) - len(messages)} more in summary.txt")
    lines: list[str] = []
    for alarm in messages:
        lines += textwrap.wrap(alarm, 120, initial_indent="• ", subsequent_indent="   ")
    timing = textwrap.wrap(summary.timing, 130)
    y = 0.03 + _LINE * len(timing)
    _note(figure, _LEFT, y, "\n".join(timing))
    _heading(figure, _LEFT, y + 0.016, "Timing")
    y += 0.027 + _LINE * max(1, len(lines))
    text = "\n".join(lines) if lines else "None."
    _text(figure, _LEFT, y, text, fontsize=8, color=_BAD if lines else _GOOD, linespacing=1.25)
    _heading(figure, _LEFT, y + 0.016, "Alarms")
    return y + 0.03


def has_few_chosen(summary: Summary, table: xarray.Dataset) -> bool:
    """Return whether an adaptive campaign measured too few of its candidates for any surface."""
    if not summary.choices:
        return False
    return summary.few_chosen or not surfaces.has_surface(gain_matrix(table))


def _surfaces(
    figure: Figure, summary: Summary, table: xarray.Dataset, bottom: float, top: float
) -> None:
    """Draw the surfaces between two heights of the page, in their own subfigure."""
    columns = surfaces.panel_columns(table)
    note = ""
    if has_few_chosen(summary, table):
        share = f"{summary.rows_done} of {summary.rows_planned}"
        note = f"{share} candidates are too few for surfaces: see choices.png"
    elif columns > _MAX_PANELS:
        panel = with_role(columns_of(table), PANEL)
        note = f"{columns} {panel.label if panel else 'panel'}s: see surfaces.png"
    elif top - bottom < _MIN_SURFACE_HEIGHT * len(shown(stations_of(table))):
        note = "Power surfaces: see surfaces.png"
    if note and columns and top - bottom > 0.03:
        figure.text(0.5, (bottom + top) / 2.0, note, ha="center", color=_MUTED, fontsize=9)
    if note or columns == 0:
        return
    bands: Any = figure.subfigures(
        3, 3, height_ratios=[1.0 - top, top - bottom, bottom], width_ratios=[0.04, 0.92, 0.04]
    )
    surfaces.draw_surfaces(bands[1, 1], table, 0.92 * picture.A4[0], compact=columns > 2)


@picture.drawn_as(picture.DrawStyle())  # always the same page, in both formats
def write_page(summary: Summary, table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write ``summary.pdf``, and the same page as ``summary.png`` for screens."""
    # The layout is for the surfaces; all else has a fixed place.
    figure = Figure(figsize=picture.A4, layout="constrained")
    _header(figure, summary)
    details_bottom = _run_details(figure, summary)
    top = _best_points(figure, summary, min(0.805, details_bottom, _outcome(figure, summary)))
    bottom = _alarms_and_timing(figure, summary)
    top = _effects(figure, summary, top, bottom)
    _surfaces(figure, summary, table, bottom, top)
    pdf, png = folder / "summary.pdf", folder / "summary.png"
    title = f"{summary.campaign}, run {summary.run}"
    picture.save(figure, png, 130.0)
    picture.save(figure, pdf, 100.0, metadata={"Title": title})
    return [pdf, png]
