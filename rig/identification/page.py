"""The identification as one A4 page: what was run, models, amplitudes, pictures, doubts."""

import textwrap
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from rig.analysis import phrases, picture
from rig.analysis.page import A4
from rig.identification import report
from rig.identification.identify import Identification
from rig.identification.pictures import (
    COLOURS,
    PER_KILONEWTON,
    Curve,
    admittances,
    excitation_curves,
    four_panels,
    inverse,
    largest,
)

_LEFT, _RIGHT, _LINE = 0.06, 0.94, 0.0145
_MOST = 12  # rows of a table; of more the last are in the text
_MOST_NOTES = 4


def write_page(found: Identification, folder: Path) -> list[Path]:
    """``identification.pdf``, and the same page as ``identification.png``."""
    figure = Figure(figsize=A4, layout="constrained")
    _header(figure, found)
    cells = report.model_cells(found)
    y = _table(figure, "Models of the impedance", report.MODEL_HEADS, cells, 0.9)
    y = _table(
        figure, "With amplitude", report.FAMILY_HEADS, report.family_cells(found.family), y - 0.01
    )
    bottom = _notes(figure, found)
    _pictures(figure, found, bottom, y - 0.01)
    out = [folder / "identification.pdf", folder / "identification.png"]
    picture.save(figure, out[1])
    picture.save(figure, out[0], 100.0)
    return out


def _header(figure: Figure, found: Identification) -> None:
    figure.add_artist(Rectangle((0.0, 0.937), 1.0, 0.063, color=picture.DARK, lw=0))
    title = f"Identification: {picture.campaign_name(found.attributes)}"
    style: dict[str, Any] = {"color": "white", "fontweight": "bold", "va": "center"}
    figure.text(_LEFT, 0.975, title, fontsize=min(16.0, 620.0 / len(title)), **style)
    runs = textwrap.shorten("runs " + ", ".join(found.runs), 130, placeholder=" …")
    figure.text(_LEFT, 0.950, runs, color="#c9d3db", fontsize=7.5, va="center")
    stamp = phrases.mode_stamp(str(found.attributes.get("mode", "")))
    box = {"boxstyle": "round,pad=0.45", "fc": picture.HIGHLIGHT, "ec": "none"}
    style = {"fontsize": 8.5, "fontweight": "bold", "ha": "right", "va": "center", "bbox": box}
    figure.text(_RIGHT, 0.975, stamp, color=picture.DARK, **style)


def _table(
    figure: Figure, heading: str, heads: tuple[str, ...], rows: list[tuple[str, ...]], top: float
) -> float:
    """A table over the page's width; returns the height below it."""
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
    for row in rows[:_MOST]:
        for x, cell in zip(places, row, strict=True):
            figure.text(x, y, cell, ha="right", color=picture.DARK, **style)
        y -= _LINE
    if len(rows) > _MOST:
        more = f"and {len(rows) - _MOST} more: see {report.JSON}"
        figure.text(_LEFT, y, more, **soft)
        y -= _LINE
    return y - 0.012


def _notes(figure: Figure, found: Identification) -> float:
    """What was left out, and how to read the page; returns the height above."""
    lines: list[str] = []
    for note in found.notes[:_MOST_NOTES]:
        lines += textwrap.wrap(note, 130, initial_indent="• ", subsequent_indent="   ")
    if len(found.notes) > _MOST_NOTES:
        lines.append(f"and {len(found.notes) - _MOST_NOTES} more in {report.JSON}")
    lines.append(
        "Z = F/v, force on the body, e^(+iωt). Bands: 95 %, from the scatter of periods; "
        "distortion: what realisations scatter beyond it."
    )
    y = 0.02 + _LINE * len(lines)
    colour = picture.ACCENT if found.notes else picture.MUTED
    figure.text(_LEFT, y, "\n".join(lines), fontsize=7.5, color=colour, va="top")
    return y + 0.015


def _pictures(figure: Figure, found: Identification, bottom: float, top: float) -> None:
    """Admittances, and excitation where there is room and there is one; else the drivetrain."""
    first = largest(found.models)[0]
    fits = found.fits[found.models.index(first)]
    told: list[tuple[str, list[Curve], str, str]] = [
        (f"Admittance, {first.name}", admittances(first, fits), "Y", PER_KILONEWTON)
    ]
    if found.excitations:
        curves = excitation_curves(found.excitations[0], found.bem)
        told.append(("Wave excitation", curves, "f_exc", "N/m"))
    elif "Z_d" in first.responses:
        family = [
            m for m in found.models if (m.axis, m.spring_rate) == (first.axis, first.spring_rate)
        ]
        pairs = zip(family, COLOURS * 4, strict=False)
        curves = [inverse(m, "Z_d", f"{m.peak_a:.3g} A", c) for m, c in pairs]
        told.append(("Drivetrain admittance by amplitude", curves, "Y_d", PER_KILONEWTON))
    heights = [1.0 - top, *[(top - bottom) / len(told)] * len(told), bottom]
    bands: Any = figure.subfigures(
        len(heights), 3, height_ratios=heights, width_ratios=[0.03, 0.94, 0.03]
    )
    for place, (title, curves, what, unit) in zip(bands[1:-1, 1], told, strict=True):
        place.suptitle(title, fontsize=8.5, fontweight="bold", color=picture.MUTED)
        four_panels(place, curves, what, unit)
