"""The identification as one A4 page: runs, models, amplitudes, pictures, notes."""

import textwrap
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from rig.identification import report
from rig.identification.identify import Identification
from rig.identification.pictures import (
    PER_KILONEWTON,
    Curve,
    admittances,
    by_colour,
    excitation_curves,
    four_panels,
    largest,
)
from rig.presentation import phrases, picture

_LEFT, _RIGHT, _LINE = 0.06, 0.94, 0.0145
_MAX_ROWS = 12  # rows of a table; further rows are only in the JSON file
_MAX_NOTES = 4


def write_page(identification: Identification, folder: Path) -> list[Path]:
    """Write ``identification.pdf`` and the same page as ``identification.png``."""
    figure = Figure(figsize=picture.A4, layout="constrained")
    _header(figure, identification)
    cells = report.model_cells(identification)
    y = _table(figure, "Models of the impedance", report.MODEL_HEADS, cells, 0.9)
    cells = report.family_cells(identification.family)
    y = _table(figure, "With amplitude", report.FAMILY_HEADS, cells, y - 0.01)
    bottom = _notes(figure, identification)
    _pictures(figure, identification, bottom, y - 0.01)
    out = [folder / "identification.pdf", folder / "identification.png"]
    picture.save(figure, out[1])
    picture.save(figure, out[0], 100.0)
    return out


def _header(figure: Figure, identification: Identification) -> None:
    figure.add_artist(Rectangle((0.0, 0.937), 1.0, 0.063, color=picture.DARK, lw=0))
    title = f"Identification: {picture.campaign_name(identification.attributes)}"
    style: dict[str, Any] = {"color": "white", "fontweight": "bold", "va": "center"}
    figure.text(_LEFT, 0.975, title, fontsize=min(16.0, 620.0 / len(title)), **style)
    runs = textwrap.shorten("runs " + ", ".join(identification.runs), 130, placeholder=" …")
    figure.text(_LEFT, 0.950, runs, color="#c9d3db", fontsize=7.5, va="center")
    stamp = phrases.mode_stamp(str(identification.attributes.get("mode", "")))
    box = {"boxstyle": "round,pad=0.45", "fc": picture.HIGHLIGHT, "ec": "none"}
    style = {"fontsize": 8.5, "fontweight": "bold", "ha": "right", "va": "center", "bbox": box}
    figure.text(_RIGHT, 0.975, stamp, color=picture.DARK, **style)


def _table(
    figure: Figure, heading: str, heads: tuple[str, ...], rows: list[tuple[str, ...]], top: float
) -> float:
    """Draw a table over the page's width; return the y position below it."""
    style: dict[str, Any] = {"fontsize": 7.5, "va": "top"}
    soft = {**style, "color": picture.MUTED}
    figure.text(_LEFT, top + 0.012, heading.upper(), fontweight="bold", **soft)
    step = (_RIGHT - _LEFT) / len(heads)
    places = [_LEFT + step * (i + 1) for i in range(len(heads))]
    y = top - 0.006
    for x, head in zip(places, heads, strict=True):
        figure.text(x, y, head, ha="right", **{**soft, "fontsize": 7})
    y -= 0.013
    figure.add_artist(Line2D((_LEFT, _RIGHT), (y, y), color="#cfd6dc", lw=0.7))
    y -= 0.003
    for row in rows[:_MAX_ROWS]:
        for x, cell in zip(places, row, strict=True):
            figure.text(x, y, cell, ha="right", color=picture.DARK, **style)
        y -= _LINE
    if len(rows) > _MAX_ROWS:
        more = f"and {len(rows) - _MAX_ROWS} more: see {report.JSON}"
        figure.text(_LEFT, y, more, **soft)
        y -= _LINE
    return y - 0.012


def _notes(figure: Figure, identification: Identification) -> float:
    """Draw the notes and the legend of the page; return the y position above them."""
    lines: list[str] = []
    for note in identification.notes[:_MAX_NOTES]:
        lines += textwrap.wrap(note, 130, initial_indent="• ", subsequent_indent="   ")
    if len(identification.notes) > _MAX_NOTES:
        lines.append(f"and {len(identification.notes) - _MAX_NOTES} more in {report.JSON}")
    lines.append(
        "Z = F/v, force on the body, e^(+iωt). Bands: 95 %, from the scatter of periods; "
        "distortion: scatter of realisations in excess of it."
    )
    y = 0.02 + _LINE * len(lines)
    colour = picture.ACCENT if identification.notes else picture.MUTED
    figure.text(_LEFT, y, "\n".join(lines), fontsize=7.5, color=colour, va="top")
    return y + 0.015


def _pictures(figure: Figure, identification: Identification, bottom: float, top: float) -> None:
    """Draw the admittances, and the excitation if identified, else the drivetrain."""
    largest_model = largest(identification.models)[0]
    fits = identification.fits[identification.models.index(largest_model)]
    figures: list[tuple[str, list[Curve], str, str]] = [
        (f"Admittance, {largest_model.name}", admittances(largest_model, fits), "Y", PER_KILONEWTON)
    ]
    if identification.excitations:
        curves = excitation_curves(identification.excitations[0], identification.bem)
        figures.append(("Wave excitation", curves, "f_exc", "N/m"))
    elif "Z_d" in largest_model.responses:
        family = [
            model
            for model in identification.models
            if (model.axis, model.spring_rate) == (largest_model.axis, largest_model.spring_rate)
        ]
        curves = by_colour(family, "Z_d", "{0.peak_a:.3g} A")
        figures.append(("Drivetrain admittance by amplitude", curves, "Y_d", PER_KILONEWTON))
    heights = [1.0 - top, *[(top - bottom) / len(figures)] * len(figures), bottom]
    bands: Any = figure.subfigures(
        len(heights), 3, height_ratios=heights, width_ratios=[0.03, 0.94, 0.03]
    )
    for panel, (title, curves, symbol, unit) in zip(bands[1:-1, 1], figures, strict=True):
        panel.suptitle(title, fontsize=8.5, fontweight="bold", color=picture.MUTED)
        four_panels(panel, curves, symbol, unit)
