"""The frame of every picture of results: what it shows, of which run, and who played the plant."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath

from rig.analysis import phrases

INK, SOFT, MARK, ZERO = "#22303c", "#66727d", "#d1495b", "#ffb703"
FRAME, TICK = "#b8c0c7", "#8a949d"
_HEADING = 0.55  # in
_SHOUTED = 11.5  # letters an inch, of a warning
_SMALL = 14.5  # letters an inch, of what stands beneath a title
_GAP = 0.2  # in, between the line beneath and the run beside it
_DPI = 150


def framed(
    width: float,
    height: float,
    title: str,
    attributes: Mapping[Any, Any],
    said: str = "negative is absorbed",
    beneath: str = "",
    warning: str = "",
) -> tuple[Figure, SubFigure]:
    """A figure of that size (in) for the picture's body, with title and the run's stamp above it.

    ``beneath`` stands under the title, or on a line of its own where it is too long for the room
    beside the stamp; a title that is too long is set smaller. ``warning`` is shouted below them.
    """
    room = width - 3.5  # in, beside the stamp
    read = f"read by {attributes['read_by']}" if attributes.get("read_by") else ""
    beneath = "; ".join(filter(None, (read, beneath)))
    told = "; ".join(filter(None, (f"run {attributes.get('run', '')}", said)))
    own_line = _inches(beneath, 8.5) + _inches(told, 8.0) + _GAP > 0.96 * width
    calls = textwrap.wrap(warning, round(width * _SHOUTED))
    lines = textwrap.wrap(beneath, round(width * _SMALL)) if own_line else [beneath]
    head = _HEADING + 0.2 * own_line * len(lines) + (0.12 + 0.2 * len(calls) if calls else 0.0)
    figure = Figure(figsize=(width, height + head), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[head, height])
    top, body = parts

    def write(x: float, below: float, text: str, **style: Any) -> None:
        top.text(x, 1.0 - below / head, text, va="center", **style)

    size = min(13.0, 118.0 * room / max(1, len(title)))
    write(0.02, 0.21, title, fontsize=size, fontweight="bold", color=INK)
    for i, line in enumerate(lines):
        write(0.02, (0.66 if own_line else 0.46) + 0.2 * i, line, fontsize=8.5, color=SOFT)
    stamp = phrases.mode_stamp(str(attributes.get("mode", "")))
    write(0.98, 0.19, stamp, fontsize=9, fontweight="bold", color=MARK, ha="right")
    write(0.98, 0.46, told, fontsize=8, color=INK, ha="right")
    if calls:
        high = 0.06 + 0.2 * len(calls)
        box = Rectangle((0.0, 0.04 / head), 1.0, high / head, color=MARK, lw=0)
        box.set_transform(top.transSubfigure)
        top.add_artist(box)
        style = {"fontsize": 10, "fontweight": "bold", "color": "white", "ha": "center"}
        write(0.5, head - 0.04 - 0.5 * high, "\n".join(calls), **style)
    return figure, body


def _inches(text: str, size: float) -> float:
    """Width of a line of text in points of ``size``."""
    return float(TextPath((0.0, 0.0), text, size=size).get_extents().width) / 72.0 if text else 0.0


def absorbed(errors: str) -> str:
    """What a picture says of its powers: their sign, and what the ± is where there is one."""
    return "; ".join(filter(None, ("negative is absorbed", errors and f"± by {errors}")))


def campaign(attributes: Mapping[Any, Any]) -> str:
    """The campaign's name for a title."""
    return str(attributes.get("campaign") or "campaign unknown")


def quiet(axes: Axes) -> None:
    """Ticks and frame that stand back behind what is shown."""
    axes.tick_params(labelsize=7, color=TICK)
    for side in axes.spines.values():
        side.set_color(FRAME)


def save(figure: Figure, path: Path, dpi: float = _DPI, **told: Any) -> Path:
    """Write the picture in the format of the file's name; ``told`` is for `Figure.savefig`.

    It is laid out once, here: savefig would do it for each file, and draw all in vain before.
    """
    if figure.axes and (engine := figure.get_layout_engine()) is not None:
        figure.set_dpi(dpi)
        engine.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(path, dpi=dpi, **told)
    return path
