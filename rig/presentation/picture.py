"""Frame of every result picture: title, run and stamp of the execution mode; style and format.

Pictures for papers have neither frame nor panel captions, the width of one column or two, and texts
of 8 points. A context of `drawn_as` sets style and format for all pictures drawn in it.
"""

import textwrap
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
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
_PAPER_DPI = 300  # of pictures for papers, of what is no vector in them
_PAPER_FONT = 8.0  # points
_PAPER_WIDTHS = {1: 3.5, 2: 7.16}  # in, of one and of two columns of a journal page
_AS_TEXT: dict[Any, Any] = {
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
}  # other programs can search and edit it

Format = Literal["png", "pdf", "svg"]
FORMATS: tuple[Format, ...] = ("png", "pdf", "svg")


class DrawStyle(NamedTuple):
    """Appearance of pictures and the format of their files."""

    paper: bool = False
    columns: int = 2  # of a journal page, for papers
    format: Format | None = None  # None: that of the file's name


_style = DrawStyle()


@contextmanager
def drawn_as(style: DrawStyle) -> Iterator[None]:
    """Draw all pictures of a context in a style; processes forked in it do so, too."""
    global _style  # noqa: PLW0603 - one style for a command, as in matplotlib's rcParams
    before, _style = _style, style
    try:
        yield
    finally:
        _style = before


def current_style() -> DrawStyle:
    """Return the style in which pictures are drawn now."""
    return _style


def for_paper() -> bool:
    """Return whether pictures are drawn for papers now."""
    return _style.paper


def paper_columns() -> int:
    """Return the number of columns of a journal page that pictures cover; 0 for screens."""
    return _style.columns if _style.paper else 0


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

    ``width`` and ``height`` (in) are those of the body. ``note`` stands after the run, or below it
    if the line would be too long. ``subtitle`` stands below the title, or on its own line if it
    does not fit next to the run; a long title gets
    a smaller font. ``warning`` is shown in a coloured box below them. For papers there is only the
    body, scaled to the width of one column or two.
    """
    if _style.paper:
        return _paper_figure(width, height)
    title_width = width - 3.5  # in, left of the stamp
    read_by = f"calibration {attributes['read_by']}" if attributes.get("read_by") else ""
    subtitle = "; ".join(filter(None, (read_by, subtitle)))
    run_text = "; ".join(filter(None, (f"run {attributes.get('run', '')}", note)))
    run_lines = [run_text]
    if _inches(run_text, 8.0) > 0.96 * width:
        run_name, note_text = run_text.split("; ", 1)
        run_lines = [run_name, *textwrap.wrap(note_text, round(width * _SUBTITLE_LETTERS))]
    run_width = max(_inches(line, 8.0) for line in run_lines)
    separate_line = _inches(subtitle, 8.5) + run_width + _GAP > 0.96 * width
    warning_lines = textwrap.wrap(warning, round(width * _WARNING_LETTERS))
    subtitle_lines = (
        textwrap.wrap(subtitle, round(width * _SUBTITLE_LETTERS)) if separate_line else [subtitle]
    )
    more_lines = len(run_lines) - 1 + separate_line * len(subtitle_lines)
    head_height = (
        _HEADING_HEIGHT
        + 0.2 * more_lines
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
            0.02, 0.46 + 0.2 * (separate_line * len(run_lines) + i), line, fontsize=8.5, color=MUTED
        )
    stamp = phrases.mode_stamp(str(attributes.get("mode", "")))
    write_text(0.98, 0.19, stamp, fontsize=9, fontweight="bold", color=ACCENT, ha="right")
    for i, line in enumerate(run_lines):
        write_text(0.98, 0.46 + 0.2 * i, line, fontsize=8, color=DARK, ha="right")
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


def _paper_figure(width: float, height: float) -> tuple[Figure, SubFigure]:
    """Return a figure with a body of ``width`` by ``height`` (in), scaled to a journal page."""
    paper_width = _PAPER_WIDTHS[_style.columns]
    # Fonts keep their size, so panels need more height than the scale of the width would leave.
    height *= min(1.0, max(0.6, paper_width / width))
    figure = Figure(figsize=(paper_width, height), layout="constrained")
    body: Any = figure.subfigures(1, 1)
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
    """Write the picture; options are those of `Figure.savefig`. Return the path.

    The format is that of the style; without one, that of the file's name.
    """
    if _style.format is not None:
        path = path.with_suffix(f".{_style.format}")
    if _style.paper:
        dpi = _PAPER_DPI
        for text in figure.findobj(Text):
            text.set_fontsize(_PAPER_FONT)
    lay_out(figure, dpi)
    with mpl.rc_context(_AS_TEXT):
        figure.savefig(path, dpi=dpi, **savefig_options)
    return path


def lay_out(figure: Figure, dpi: float) -> None:
    """Place the parts of a figure once: savefig would do it for each file and draw all before."""
    if figure.axes and (engine := figure.get_layout_engine()) is not None:
        figure.set_dpi(dpi)
        engine.execute(figure)
        figure.set_layout_engine(None)
