"""The representation of a run on a terminal and in a notebook."""

from html import escape
from typing import Any, NamedTuple

import numpy as np

from rig.api.errors import RigError
from rig.config.problems import error_text
from rig.presentation.phrases import clock_text, count_text, format_utc
from rig.row_contents import Column

_MAX_WARNINGS = 3
_MAX_CONSTANTS = 6
_GOOD, _STOPPED, _BAD = "good", "stopped", "bad"
_TONES = {"complete": _GOOD, "stopped": _STOPPED, "running": _STOPPED}
# Readable on light and dark pages: the text has the colour of the page, tones are mid-tones.
_COLOURS = {_GOOD: "#2e9e5b", _STOPPED: "#c98a00", _BAD: "#d64545"}
_STYLE = """\
<style>
.wec-run{font:13px/1.45 system-ui,sans-serif;max-width:54em;border:1px solid #8885;
border-left:4px solid var(--tone);border-radius:5px;padding:.55em .9em .65em;margin:.3em 0}
.wec-run .head{display:flex;gap:.3em .8em;align-items:baseline;flex-wrap:wrap}
.wec-run .name{font-size:1.12em;font-weight:600}
.wec-run .end{color:var(--tone);font-weight:600}
.wec-run .id{opacity:.65;font-family:ui-monospace,monospace;font-size:.9em}
.wec-run dl{display:grid;grid-template-columns:max-content 1fr;gap:.1em 1em;margin:.4em 0 0}
.wec-run dt{opacity:.65;font-weight:400;margin:0}
.wec-run dd{margin:0}
.wec-run table{border-collapse:collapse;margin:.5em 0 0;font-variant-numeric:tabular-nums}
.wec-run th,.wec-run td{padding:.1em 1em .1em 0;text-align:left;border:0;
background:none;font-weight:400;white-space:nowrap}
.wec-run th{opacity:.65}
.wec-run td.number,.wec-run th.number{text-align:right}
.wec-run .results{overflow-x:auto}
.wec-run ul{margin:.4em 0 0;padding-left:1.2em}
.wec-run li{margin:0}
.wec-run .bar{height:4px;border-radius:2px;background:#8883;margin:.5em 0 0;overflow:hidden}
.wec-run .bar div{height:100%;background:var(--tone)}
</style>"""


class ResultTable(NamedTuple):
    """The best points of a campaign, or the constants of a session."""

    heading: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    numbers: frozenset[int]  # columns that are aligned to the right


class RunCard(NamedTuple):
    """Contents of the representation of a run."""

    title: str
    run: str
    ending: str
    tone: str
    facts: tuple[tuple[str, str], ...]
    share: float  # of the planned rows that are complete, 0 to 1; NaN without rows
    results: ResultTable | None
    warnings: tuple[str, ...]


def describe(run: Any) -> RunCard:
    """Return the contents of the representation of a run (`rig.api.run.Run`).

    A part that cannot be read is a warning.
    """
    warnings: list[str] = []

    def read(name: str, default: Any) -> Any:
        try:
            return getattr(run, name)
        except RigError as error:
            warnings.append(error_text(error))
            return default

    outcome, rows = read("outcome", None), read("rows", None)
    planned = 0 if rows is None else len(rows)
    done = 0 if rows is None or not planned else int((rows["state"] == "complete").sum())
    rig, info = run.config.get("rig"), run.info
    rig_text = f"{rig.get('name')} ({run.kind})" if rig is not None else run.kind
    facts = [("rig", rig_text), ("mode", run.mode_text), ("begun", format_utc(run.started_utc))]
    if sea := _sea(run):
        facts.append(("sea", sea))
    if planned:
        facts.append(("rows", f"{done} of {planned} complete"))
    record, dt = read("record", None), info.plan.get("dt")
    if record is not None and dt:
        facts.append(("duration", f"{clock_text(record.ticks * float(dt))} of rig time"))
    if record is not None and record.state != "complete":
        facts.append(("record", record.description))
    results = _best(run, read("best", None)) or _constants(read("constants", None))
    warnings += read("alarms", ())
    return RunCard(
        info.campaign or run.name,
        run.name,
        "" if outcome is None else outcome.text,
        _BAD if outcome is None else _TONES.get(outcome.status, _BAD),
        tuple((label, text) for label, text in facts if text),
        done / planned if planned else float("nan"),
        results,
        tuple(dict.fromkeys(warnings)),
    )


def _sea(run: Any) -> str:
    from rig.analysis.summary import sea_text

    return sea_text(run.info.plan) if run.info.plan.get("sea") else ""


def _best(run: Any, best: Any) -> ResultTable | None:
    if best is None or best.empty:
        return None
    from rig.analysis.labels import heading
    from rig.analysis.rows import columns_of

    columns = [each for each in columns_of(run.table) if each.name in best.columns]
    lines = [
        (
            str(each["label"]),
            str(each["text"]),
            ", ".join(map(str, each["rows"])),
            *(_setting(column, each[column.name]) for column in columns),
            str(each["caveat"]),
        )
        for _, each in best.iterrows()
    ]
    titles = ("best point", "power", "row", *map(heading, columns), "")
    return ResultTable(titles, tuple(lines), frozenset(range(1, len(titles) - 1)))


def _constants(constants: Any) -> ResultTable | None:
    if constants is None or constants.empty:
        return None
    lines = [
        (str(name).replace("_", " "), _estimate(each["value"], each["uncertainty"]),
         str(each["unit"]).replace("*", "·"))
        for name, each in constants.head(_MAX_CONSTANTS).iterrows()
    ]  # fmt: skip
    more = len(constants) - len(lines)
    if more > 0:
        lines.append((f"and {more} more in run.constants", "", ""))
    return ResultTable(("constant", "value (95 %)", "unit"), tuple(lines), frozenset({1}))


def _estimate(value: float, uncertainty: float) -> str:
    """Return a value with the decimals of its uncertainty, which has two significant digits."""
    if not (np.isfinite(uncertainty) and uncertainty > 0.0):
        return f"{value:.5g}"
    decimals = max(0, 1 - int(np.floor(np.log10(uncertainty))))
    return f"{value:.{decimals}f} ± {uncertainty:.{decimals}f}"


def _setting(column: Column, value: float | None) -> str:
    from rig.analysis.labels import format_number

    return "-" if value is None or not np.isfinite(value) else format_number(column, value)


def as_text(card: RunCard) -> str:
    """Return the representation for a terminal."""
    width = max((len(label) for label, _ in card.facts), default=0)
    lines = [f"{card.title}: {card.ending}", f"  {card.run}"]
    lines += [f"  {label:<{width}}  {text}" for label, text in card.facts]
    if card.results is not None:
        lines += ["", *_aligned(card.results)]
    if card.warnings:
        lines += ["", f"  {count_text(len(card.warnings), 'warning')}:"]
        lines += [f"    {text}" for text in card.warnings[:_MAX_WARNINGS]]
        if (more := len(card.warnings) - _MAX_WARNINGS) > 0:
            lines.append(f"    and {more} more in run.alarms")
    return "\n".join(lines)


def _aligned(table: ResultTable) -> list[str]:
    every = [table.heading, *table.lines]
    widths = [max(map(len, column)) for column in zip(*every, strict=True)]
    return [
        "  "
        + "  ".join(
            cell.rjust(widths[at]) if at in table.numbers else cell.ljust(widths[at])
            for at, cell in enumerate(line)
        ).rstrip()
        for line in every
    ]


def as_html(card: RunCard) -> str:
    """Return the representation for a notebook: one element that needs nothing from elsewhere."""
    parts = [
        f'<div class="wec-run" style="--tone:{_COLOURS[card.tone]}">',
        f'<div class="head"><span class="name">{escape(card.title)}</span>'
        f'<span class="end">{escape(card.ending)}</span>'
        f'<span class="id">{escape(card.run)}</span></div>',
    ]
    if np.isfinite(card.share):
        parts.append(f'<div class="bar"><div style="width:{100.0 * card.share:.1f}%"></div></div>')
    facts = "".join(f"<dt>{escape(a)}</dt><dd>{escape(b)}</dd>" for a, b in card.facts)
    parts.append(f"<dl>{facts}</dl>")
    if card.results is not None:
        parts.append(_html_table(card.results))
    if card.warnings:
        shown = [*card.warnings[:_MAX_WARNINGS]]
        if (more := len(card.warnings) - _MAX_WARNINGS) > 0:
            shown.append(f"and {more} more in run.alarms")
        parts.append(f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in shown)}</ul>")
    return _STYLE + "".join(parts) + "</div>"


def _html_table(table: ResultTable) -> str:
    def line(cells: tuple[str, ...], tag: str) -> str:
        marked = (
            f'<{tag} class="number">{escape(cell)}</{tag}>'
            if at in table.numbers
            else f"<{tag}>{escape(cell)}</{tag}>"
            for at, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>"

    body = "".join(line(cells, "td") for cells in table.lines)
    return f'<div class="results"><table>{line(table.heading, "th")}{body}</table></div>'
