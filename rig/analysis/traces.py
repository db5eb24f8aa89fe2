"""Time series of a run, one panel a unit, phases of the plan shaded behind them."""

import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rig.analysis import phrases, picture
from rig.realtime.sequence import Phase
from rig.recording.runs import reader
from rig.recording.runs.folder import facts

DEFAULT_FIELDS = ("heave.estimate", "heave.command.force", "power.mechanical_1", "power.ac")
_WIDE, _PAGE = 11.0, 8.0  # in: of the picture, and of all panels together where they can be read
_HIGHEST, _LEAST = 2.2, 1.1  # in, of a panel
_LETTERS = 160  # of a line beneath the title
_UNITLESS = ("flag", "index", "1")
COLUMNS = 2000  # time bins of a picture; each keeps its least and greatest sample
_INK = "#22303c"
_LINES = ("#0b6e99", "#d1495b", "#2e933c", "#8d5a97", "#b8860b", "#5c6b73")
_SHADES = {  # pale enough for the lines, far enough apart to be told from one another
    Phase.TARE: "#ddd2f2",
    Phase.LEAD_IN: "#d3ecf8",
    Phase.MOVING: "#fbdcc6",
    Phase.SETTLE: "#fdf1bd",
    Phase.MEASURE: "#cdebd9",
    Phase.TAIL: "#f7dfea",
    Phase.DONE: "#e0e0e0",
}


def decimate(time: Any, values: Any, columns: int = COLUMNS) -> tuple[Any, Any]:
    """The least and greatest sample of each of ``columns`` bins, in order of time.

    No peak is lost; a series of at most two samples a bin is returned as it is. Bins that hold a
    NaN show it.
    """
    count = len(values)
    if count <= 2 * columns:
        return time, values
    edges = np.linspace(0, count, columns + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, count))
    places = []
    for begin, length in zip(edges.tolist(), size.tolist(), strict=True):
        part = values[begin : begin + length]
        places += sorted((begin + int(part.argmin()), begin + int(part.argmax())))
    return time[places], values[places]


def _broken(time: Any, values: Any, step: float) -> tuple[Any, Any]:
    """The series with a NaN where time jumps, so that no line bridges ticks that were not read."""
    jumps = np.flatnonzero(np.diff(time) > step) + 1
    return np.insert(time, jumps, np.nan), np.insert(values.astype(float), jumps, np.nan)


def _shade(axes: Axes, time: Any, phase: Any, step: float) -> set[Phase]:
    edges = np.flatnonzero((np.diff(phase) != 0) | (np.diff(time) > step)) + 1
    begins = np.concatenate(([0], edges))
    ends = np.concatenate((edges, [len(phase)])) - 1
    seen = {Phase(int(value)) for value in np.unique(phase)}
    for each in seen:  # one artist a phase: a long run has thousands of stretches
        spans = [
            (time[b], time[e] - time[b])
            for b, e in zip(begins.tolist(), ends.tolist(), strict=True)
            if phase[b] == each
        ]
        across = axes.get_xaxis_transform()
        axes.broken_barh(spans, (0.0, 1.0), transform=across, color=_SHADES[each], lw=0, zorder=0)
    return seen


def _shown(unit: str) -> str:
    return unit.replace("^2", "²").replace("*", "·")


def _still(data: dict[str, Any], names: list[str]) -> list[str]:
    """Fields that keep one value throughout, unless all do."""
    still = [n for n in names if len(data[n]) > 1 and (data[n] == data[n][0]).all()]
    return still if len(still) < len(names) else []


def _constants(data: dict[str, Any], still: list[str], units: dict[str, str]) -> str:
    """What they are, in a sentence; a number where the unit is one of labels."""
    told = [
        f"{name} {float(data[name][0]):g}"
        + ("" if units[name] in _UNITLESS else f" {_shown(units[name])}")
        for name in still
    ]
    return f"constant: {', '.join(told)}" if told else ""


def write_traces(
    run: Path,
    path: Path,
    fields: Iterable[str] = DEFAULT_FIELDS,
    rows: int | Iterable[int] | None = None,
) -> Path:
    """A picture of the named fields over time (s from run start), of some rows or the whole run.

    Fields that never change are told in words, unless all are such.

    ``fields`` are names, prefixes or shell patterns as in `rig.recording.runs.open_run`; KeyError
    for an unknown field or row, RunError for a run that cannot be read.
    """
    source = reader.source(run)
    names = [name for name in reader.choose(source.leaves, fields) if name != "time"]
    if isinstance(rows, int):
        rows = [rows]
    place = [leaf.name for leaf in source.leaves if leaf.name == "plan.phase"]
    data = reader.columns(source, ["time", *dict.fromkeys([*place, *names])], rows)
    time = data["time"]
    units = {leaf.name: leaf.unit for leaf in source.leaves}
    still = _still(data, names)
    panels: dict[str, list[str]] = {}
    for name in names:
        if name not in still:
            panels.setdefault(_shown(units[name]), []).append(name)
    told = textwrap.wrap(_constants(data, still, units), _LETTERS)
    high = min(_HIGHEST, max(_LEAST, _PAGE / max(1, len(panels))))
    heights = [0.05 + 0.13 * len(told)] * bool(told) + [high] * max(1, len(panels))
    figure = Figure(figsize=(_WIDE, 1.1 + sum(heights)), layout="constrained")
    axes_of: Any = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )[:, 0]
    if told:
        axes_of[0].set_axis_off()
        axes_of[0].margins(x=0.0)  # it shares the others' axis of time
        where: dict[str, Any] = {"transform": axes_of[0].transAxes, "va": "top", "color": _INK}
        where["in_layout"] = False
        axes_of[0].text(0.0, 1.0, "\n".join(told), fontsize=7, **where)
        axes_of = axes_of[1:]
    step = 1.5 * float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    seen: set[Phase] = set()
    for axes, (unit, members) in zip(axes_of, panels.items(), strict=False):
        if place and len(time):
            seen |= _shade(axes, time, data["plan.phase"], step)
        for i, name in enumerate(members):
            x, y = _broken(time, data[name], step)
            style = ("-", "--", ":")[i // len(_LINES) % 3]
            axes.plot(*decimate(x, y), style, color=_LINES[i % len(_LINES)], lw=0.9, label=name)
        axes.set_ylabel(unit)
        axes.grid(alpha=0.25)
        axes.margins(x=0.0)
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            fontsize=7,
            ncols=5,
            frameon=False,
            borderpad=0.2,
        )
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    axes_of[-1].set_xlabel("time from run start, s")
    figure.align_ylabels(list(axes_of))
    known = facts(run, source.contents)
    stamp = phrases.mode_stamp(known.mode)
    figure.suptitle(
        f"{known.campaign or 'campaign unknown'}, run {known.run}   [{stamp}]",
        fontsize=10,
        color=_INK,
        x=0.01,
        ha="left",
    )
    if seen:
        patches = [
            Patch(color=_SHADES[phase], label=phase.name.lower().replace("_", "-"))
            for phase in sorted(seen)
        ]
        figure.legend(handles=patches, loc="outside lower right", ncols=len(patches), fontsize=7)
    return picture.save(figure, path, 140.0)
