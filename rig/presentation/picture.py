"""Frame of every result picture: title, run and stamp of the execution mode."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath

from rig.presentation import phrases

DARK, MUTED, ACCENT, HIGHLIGHT = "#22303c", "#66727d", "#d1495b", "#ffb703"
FRAME, TICK = "#b8c0c7", "#8a949d"
A4 = (8.27, 11.69)  # in, portrait
_HEADING_HEIGHT = 0.55  # in
_WARNING_LETTERS = 11.5  # per inch, of a warning
_SUBTITLE_LETTERS = 14.5  # per inch, of a subtitle
_GAP = 0.2  # in, between the subtitle and the run to its right
_DPI = 150


def framed_figure(
    width: float,
    height: float,
    title: str,
    attributes: Mapping[Any, Any],
    note: str = "negative is absorbed",
    subtitle: str = "",
    warning: str = "",
) -> tuple[Figure, SubFigure]:
    """Return a figure with title, run and mode stamp, and the subfigure for the picture's body.

    ``width`` and ``height`` (in) are those of the body. ``note`` stands after the run. ``subtitle``
    stands below the title, or on its own line if it does not fit next to the run; a long title gets
    a smaller font. ``warning`` is shown in a coloured box below them.
    """
    title_width = width - 3.5  # in, left of the stamp
    read_by = f"calibration {attributes['read_by']}" if attributes.get("read_by") else ""
    subtitle = "; ".join(filter(None, (read_by, subtitle)))
    run_text = "; ".join(filter(None, (f"run {attributes.get('run', '')}", note)))
    separate_line = _inches(subtitle, 8.5) + _inches(run_text, 8.0) + _GAP > 0.96 * width
    warning_lines = textwrap.wrap(warning, round(width * _WARNING_LETTERS))
    subtitle_lines = (
        textwrap.wrap(subtitle, round(width * _SUBTITLE_LETTERS)) if separate_line else [subtitle]
    )
    head_height = (
        _HEADING_HEIGHT
        + 0.2 * separate_line * len(subtitle_lines)
        + (0.12 + 0.2 * len(warning_lines) if warning_lines else 0.0)
    )
    figure = Figure(figsize=(width, height + head_height), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[head_height, height])
    head, body = parts

    def write_text(x: float, below: float, text: str, **style: Any) -> None:
        head.text(x, 1.0 - below / head_height, text, va="center", **style)

    size = min(13.0, 118.0 * title_width / max(1, len(title)))
    write_text(0.02, 0.21, title, fontsize=size, fontweight="bold", color=DARK)
    for i, line in enumerate(subtitle_lines):
        write_text(
            0.02, (0.66 if separate_line else 0.46) + 0.2 * i, line, fontsize=8.5, color=MUTED
        )
    stamp = phrases.mode_stamp(str(attributes.get("mode", "")))
    write_text(0.98, 0.19, stamp, fontsize=9, fontweight="bold", color=ACCENT, ha="right")
    write_text(0.98, 0.46, run_text, fontsize=8, color=DARK, ha="right")
    if warning_lines:
        box_height = 0.06 + 0.2 * len(warning_lines)
        box = Rectangle(
            (0.0, 0.04 / head_height), 1.0, box_height / head_height, color=ACCENT, lw=0
        )
        box.set_transform(head.transSubfigure)
        head.add_artist(box)
        style = {"fontsize": 10, "fontweight": "bold", "color": "white", "ha": "center"}
        write_text(0.5, head_height - 0.04 - 0.5 * box_height, "\n".join(warning_lines), **style)
    return figure, body


def _inches(text: str, size: float) -> float:
    """Return the width (in) of a line of text in a font of ``size`` points."""
    return float(TextPath((0.0, 0.0), text, size=size).get_extents().width) / 72.0 if text else 0.0


def sign_note(errors: str) -> str:
    """Return the note on the sign of powers and, if known, on the ± errors."""
    return "; ".join(filter(None, ("negative is absorbed", errors)))


def campaign_name(attributes: Mapping[Any, Any]) -> str:
    """Return the campaign's name for a title."""
    return str(attributes.get("campaign") or "campaign unknown")


def style_axes(axes: Axes) -> None:
    """Give ticks and frame a muted style."""
    axes.tick_params(labelsize=7, color=TICK)
    for side in axes.spines.values():
        side.set_color(FRAME)


def save(figure: Figure, path: Path, dpi: float = _DPI, **savefig_options: Any) -> Path:
    """Write the picture in the format of the file name; options are those of `Figure.savefig`."""
    lay_out(figure, dpi)
    figure.savefig(path, dpi=dpi, **savefig_options)
    return path


def lay_out(figure: Figure, dpi: float) -> None:
    """Place the parts of a figure once: savefig would do it for each file and draw all before."""
    if figure.axes and (engine := figure.get_layout_engine()) is not None:
        figure.set_dpi(dpi)
        engine.execute(figure)
        figure.set_layout_engine(None)
