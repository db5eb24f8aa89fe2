"""Time series of a run: one panel for each unit, with the phases of the plan shaded."""

import textwrap
from collections.abc import Iterable
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rig import log_fields
from rig.presentation import phrases, picture
from rig.realtime.sequence import Phase
from rig.recording.runs import RunInfo, reader, run_info
from rig.stations import shown

_WIDTH = 11.0  # in
_PAGE_HEIGHT = 8.0  # in, preferred height of all panels together
_MAX_PANEL_HEIGHT, _MIN_PANEL_HEIGHT = 2.2, 1.1  # in
_LINE_LETTERS = 160  # of a line below the title
_LEGEND: dict[str, Any] = {  # above a panel
    "loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "fontsize": 7, "ncols": 5,
    "frameon": False, "borderpad": 0.2,
}  # fmt: skip
PHASE = "plan.phase"
BEFORE_TRIP_S, AFTER_TRIP_S = 4.0, 1.0
_TRIP_FIELDS = ("*.estimate.position", "*.estimate.velocity", "*.command.force", "*age")
_TRIP_COLOUR = "#c00000"
_MAX_QUANTITIES, _LABEL_LETTERS = 3, 20  # of a panel's label, and of a line of it
_UNITLESS = ("flag", "index", "1")
TIME_BINS = 2000  # time bins of a picture; each keeps its minimum and maximum
_LINE_COLOURS = ("#0b6e99", "#d1495b", "#2e933c", "#8d5a97", "#b8860b", "#5c6b73")
_PHASE_COLOURS = {  # pale enough for the lines, different enough to be distinguished
    Phase.TARE: "#ddd2f2",
    Phase.LEAD_IN: "#d3ecf8",
    Phase.MOVING: "#fbdcc6",
    Phase.SETTLE: "#fdf1bd",
    Phase.MEASURE: "#cdebd9",
    Phase.TAIL: "#f7dfea",
    Phase.DONE: "#e0e0e0",
    Phase.STANDBY: "#c4c9cf",
    Phase.MANUAL: "#b9c9f2",
    Phase.CHOICE: "#a5d8d3",
}


def decimate(time: Any, values: Any, columns: int = TIME_BINS) -> tuple[Any, Any]:
    """Return the minimum and maximum of each of ``columns`` bins in order of time.

    Peaks are kept. A series of at most two samples per bin is returned unchanged. A bin with a NaN
    returns NaN.
    """
    count = len(values)
    if count <= 2 * columns:
        return time, values
    edges = np.linspace(0, count, columns + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, count))
    indices = []
    for begin, length in zip(edges.tolist(), size.tolist(), strict=True):
        samples = values[begin : begin + length]
        indices += sorted((begin + int(samples.argmin()), begin + int(samples.argmax())))
    return time[indices], values[indices]


def _break_at_gaps(time: Any, values: Any, step: float) -> tuple[Any, Any]:
    """Insert a NaN where time jumps, so that no line bridges missing ticks."""
    jumps = np.flatnonzero(np.diff(time) > step) + 1
    return np.insert(time, jumps, np.nan), np.insert(values.astype(float), jumps, np.nan)


def _shade_phases(axes: Axes, time: Any, phase: Any, step: float) -> set[Phase]:
    edges = np.flatnonzero((np.diff(phase) != 0) | (np.diff(time) > step)) + 1
    begins = np.concatenate(([0], edges))
    ends = np.concatenate((edges, [len(phase)])) - 1
    phases = {Phase(int(value)) for value in np.unique(phase)}
    for phase_ in phases:  # one artist per phase: a long run has thousands of intervals
        spans = [
            (time[b], time[e] - time[b])
            for b, e in zip(begins.tolist(), ends.tolist(), strict=True)
            if phase[b] == phase_
        ]
        transform = axes.get_xaxis_transform()
        axes.broken_barh(
            spans, (0.0, 1.0), transform=transform, color=_PHASE_COLOURS[phase_], lw=0, zorder=0
        )
    return phases


def _display_unit(unit: str) -> str:
    return unit.replace("^2", "²").replace("*", "·")


def _panel_label(names: list[str], unit: str) -> str:
    """Return the quantities of a panel with their unit: the last parts of the fields' names."""
    lasts = ("power" if name.startswith("power.") else name.rpartition(".")[2] for name in names)
    quantities = list(dict.fromkeys(last.replace("_", " ") for last in lasts))
    if len(quantities) > _MAX_QUANTITIES:
        quantities = []  # the legend has the names
    text = ", ".join(filter(None, (" / ".join(quantities), "" if unit in _UNITLESS else unit)))
    return textwrap.fill(text, _LABEL_LETTERS)


def _constant_fields(data: dict[str, Any], names: list[str]) -> list[str]:
    """Return the fields with a constant value; empty if all fields are constant."""
    constant = [n for n in names if len(data[n]) > 1 and (data[n] == data[n][0]).all()]
    return constant if len(constant) < len(names) else []


def _format_constants(data: dict[str, Any], constant: list[str], units: dict[str, str]) -> str:
    """Return the values of constant fields as text, with their units."""
    texts = [
        f"{name} {float(data[name][0]):g}"
        + ("" if units[name] in _UNITLESS else f" {_display_unit(units[name])}")
        for name in constant
    ]
    return f"constant: {', '.join(texts)}" if texts else ""


def _default_fields(run_facts: RunInfo) -> list[str]:
    """Return motion and force of the powered axis, and two powers."""
    axis = run_facts.row_contents.axis
    powers = [f"power.{station.name}" for station in shown(run_facts.stations)[:2]]
    return [f"{axis}.estimate", f"{axis}.command.force", *powers]


def write_traces(
    run: Path,
    path: Path,
    fields: Iterable[str] = (),
    rows: int | Iterable[int] | None = None,
) -> Path:
    """Write a picture of the named fields over time (s from run start).

    ``fields`` are names, prefixes or shell patterns as in `rig.recording.runs.open_run`; default
    are motion, force and two powers. ``rows`` selects rows, None the whole run. Constant fields are
    listed as text, unless all are constant. Raises KeyError for an unknown field or row, and
    RunError for a run that cannot be read.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    selected = reader.select_fields(source.leaves, list(fields) or _default_fields(run_facts))
    names = [name for name in selected if name != "time"]
    if isinstance(rows, int):
        rows = [rows]
    data = reader.columns(source, _columns(source, names), rows)
    return _draw(run_facts, source, data, names, path)


def write_trip(run: Path, trip_time: float, path: Path) -> Path:
    """Write a picture of the last seconds around a trip, with a line at the trip.

    ``trip_time``: s from the start of the run. The fields are those by which a rig trips: motion,
    command and age of the readings, and all that its limits stop. Raises RunError for a run that
    cannot be read.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    limits = log_fields.from_record(run_facts.plan.get("log_fields")).limits
    limited = {each.field for each in limits if each.stops}
    names = [
        leaf.name
        for leaf in source.leaves
        if leaf.name in limited or any(fnmatch(leaf.name, each) for each in _TRIP_FIELDS)
    ]
    columns = _columns(source, names)
    last = source._replace(stages=source.stages[-1:])
    parts: dict[str, list[Any]] = {name: [] for name in columns}
    for block in reader.blocks(last, fields=columns):
        time = block["time"]
        inside = (time >= trip_time - BEFORE_TRIP_S) & (time <= trip_time + AFTER_TRIP_S)
        for name, values in parts.items():
            values.append(block[name][inside])
    data = {name: np.concatenate(values) for name, values in parts.items()}
    return _draw(run_facts, source, data, names, path, trip_time)


def _columns(source: reader.RunFiles, names: list[str]) -> list[str]:
    """Return the fields that a picture of ``names`` needs: time, and the phase where there is."""
    phases = [leaf.name for leaf in source.leaves if leaf.name == PHASE]
    return ["time", *dict.fromkeys([*phases, *names])]


def _draw(
    run_facts: RunInfo,
    source: reader.RunFiles,
    data: dict[str, Any],
    names: list[str],
    path: Path,
    mark: float | None = None,
) -> Path:
    """Draw fields over time, with a line at the time ``mark`` of a trip (s)."""
    time = data["time"]
    units = {leaf.name: leaf.unit for leaf in source.leaves}
    constant = _constant_fields(data, names)
    panels: dict[str, list[str]] = {}
    for name in names:
        if name not in constant:
            panels.setdefault(_display_unit(units[name]), []).append(name)
    constant_lines = textwrap.wrap(_format_constants(data, constant, units), _LINE_LETTERS)
    panel_height = min(
        _MAX_PANEL_HEIGHT, max(_MIN_PANEL_HEIGHT, _PAGE_HEIGHT / max(1, len(panels)))
    )
    heights = [panel_height] * max(1, len(panels))
    if constant_lines:
        heights.insert(0, 0.05 + 0.13 * len(constant_lines))
    figure = Figure(figsize=(_WIDTH, 1.1 + sum(heights)), layout="constrained")
    axes_of: Any = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )[:, 0]
    if constant_lines:
        axes_of[0].set_axis_off()
        axes_of[0].margins(x=0.0)  # it shares the time axis of the panels
        text_style: dict[str, Any] = {"va": "top", "color": picture.DARK, "in_layout": False}
        text_style["transform"] = axes_of[0].transAxes
        axes_of[0].text(0.0, 1.0, "\n".join(constant_lines), fontsize=7, **text_style)
        axes_of = axes_of[1:]
    step = 1.5 * float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    phases: set[Phase] = set()
    for axes, (unit, members) in zip(axes_of, panels.items(), strict=False):
        if PHASE in data and len(time):
            phases |= _shade_phases(axes, time, data[PHASE], step)
        for i, name in enumerate(members):
            x, y = _break_at_gaps(time, data[name], step)
            style = ("-", "--", ":")[i // len(_LINE_COLOURS) % 3]
            colour = _LINE_COLOURS[i % len(_LINE_COLOURS)]
            axes.plot(*decimate(x, y), style, color=colour, lw=0.9, label=name)
        if mark is not None:
            axes.axvline(mark, color=_TRIP_COLOUR, lw=1.2, label="trip")
        axes.set_ylabel(_panel_label(members, unit))
        axes.grid(alpha=0.25)
        axes.margins(x=0.0)
        axes.legend(**_LEGEND)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    axes_of[-1].set_xlabel("time from run start, s")
    figure.align_ylabels(list(axes_of))
    stamp = phrases.mode_stamp(run_facts.mode)
    title = f"{run_facts.campaign or 'campaign unknown'}, run {run_facts.run}   [{stamp}]"
    figure.suptitle(title, fontsize=10, color=picture.DARK, x=0.01, ha="left")
    if phases:
        patches = [
            Patch(color=_PHASE_COLOURS[phase], label=phase.name.lower().replace("_", "-"))
            for phase in sorted(phases)
        ]
        figure.legend(handles=patches, loc="outside lower right", ncols=len(patches), fontsize=7)
    return picture.save(figure, path, 140.0)
