"""One self-contained HTML page of a session: comparison, constants, figures, tables, notes."""

import base64
import html
from pathlib import Path
from typing import Any

from rig.analysis.stop_reason import ENDINGS, Ending
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import (
    Column,
    FigureSpec,
    Result,
    Table,
    format_estimate,
    format_number,
)
from rig.presentation.phrases import format_utc, mode_stamp
from rig.recording.runs.state import COMPLETE, RECOVERED
from rig.recording.runs.windows import ALL_TICKS_MISSING

FILE = "session.html"
_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#22303c;max-width:1080px;margin:0 auto;padding:0 18px}
header{background:#22303c;color:#fff;margin:0 -18px 20px;padding:18px}
header h1{margin:0;font-size:24px}header p{margin:4px 0 0;color:#c9d3db}
.stamp{float:right;background:#ffb703;color:#22303c;font-weight:700;padding:5px 12px}
h2{font-size:18px;border-bottom:1px solid #cfd6dc;padding-bottom:4px;margin-top:34px}
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}
th,td{padding:4px 10px;border-bottom:1px solid #e3e8ec;text-align:right;vertical-align:top}
th{color:#66727d;font-weight:600}th.text,td.text{text-align:left}
.wide{overflow-x:auto}.yes{color:#2a7f4f;font-weight:700}.no{color:#b23a48;font-weight:700}
figure{margin:18px 0;display:inline-block;vertical-align:top;max-width:100%}
figure img{max-width:100%;border:1px solid #e3e8ec}
footer{margin:40px 0 20px;color:#66727d;font-size:12px}
"""


def write_page(
    result: Result, session: SessionRun, ending: Ending, figure_paths: list[Path], folder: Path
) -> Path:
    """Write ``session.html``, which contains its figures and loads nothing. Return its path."""
    metadata = session.metadata
    subtitle = f"run {metadata.run}, started {format_utc(metadata.started_utc)}"
    body = [
        f"<header><span class=stamp>{_escape(mode_stamp(metadata.mode))}</span>"
        f"<h1>Session {_escape(session.name)}</h1><p>{_escape(subtitle)}</p></header>",
        _status_line(ending.description, ending.title == ENDINGS["complete"]),
        _status_line(session.record.sentence, session.record.state in (COMPLETE, RECOVERED)),
        _comparison_table(result),
        _constants_table(result),
        "<h2>Notes</h2><ul>"
        + "".join(f"<li>{_escape(n)}</li>" for n in page_notes(result, session))
        + "</ul>",
        "<h2>Figures</h2>",
        *(_inline_figure(p, path) for p, path in zip(result.figures, figure_paths, strict=True)),
        *(_html_table(table) for table in result.tables),
        f"<footer>{_escape(_footer(session))}</footer>",
    ]
    head = f"<meta charset=utf-8><title>{_escape(session.name)}</title><style>{_STYLE}</style>"
    path = folder / FILE
    text = "\n".join(["<!doctype html><html lang=en>", head, *filter(None, body), "</html>"])
    path.write_text(text, encoding="utf-8")
    return path


def page_notes(result: Result, session: SessionRun) -> list[str]:
    """Return notes for the reader: on the method, and on ticks and rows that the run lacks."""
    lines = [
        *result.notes,
        "The intervals include 0.1 % for the load cell's own calibration, no more.",
    ]
    lost_ticks = sum(point.lost_ticks for point in session.complete_points)
    if lost_ticks:
        lines.append(f"{lost_ticks} ticks were lost while measuring; they are interpolated.")
    reasons = {
        point.row: point.incomplete_reason for point in session.points if point.incomplete_reason
    }
    reasons |= dict.fromkeys(session.missing_rows, ALL_TICKS_MISSING)
    return [*lines, *(f"Row {row} is left out: {reasons[row]}." for row in sorted(reasons))]


def _status_line(sentence: str, good: bool) -> str:
    return f"<p>{_escape(sentence)}.</p>" if good else f"<p class=no>{_escape(sentence)}.</p>"


def _escape(value: Any) -> str:
    return html.escape(str(value))


def _comparison_table(result: Result) -> str:
    if not result.comparisons:
        return ""
    rows = []
    for each in result.comparisons:
        verdict = {True: "<td class=yes>✓</td>", False: "<td class=no>✗</td>", None: "<td></td>"}
        cells = (each.quantity, each.thesis, each.target, each.measured)
        texts = "".join(f"<td class=text>{_escape(c)}</td>" for c in cells)
        rows.append(f"<tr>{texts}{verdict[each.target_met]}</tr>")
    heads = ("quantity", "thesis", "required", "this run")
    head = "".join(f"<th class=text>{h}</th>" for h in heads) + "<th></th>"
    return f"<h2>Comparison with the thesis</h2><table><tr>{head}</tr>{''.join(rows)}</table>"


def _constants_table(result: Result) -> str:
    if not result.constants:
        return ""
    rows = [
        f"<tr><td class=text>{_escape(name)}</td><td>{_escape(format_estimate(each))}</td>"
        f"<td class=text>{_escape(each.method)}</td></tr>"
        for name, each in result.constants.items()
    ]
    head = "<tr><th class=text>constant</th><th>value ± 95 %</th><th class=text>method</th></tr>"
    return f"<h2>Constants</h2><table>{head}{''.join(rows)}</table>"


def _inline_figure(figure: FigureSpec, path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return (
        f'<figure><img alt="{_escape(figure.title)}" src="data:image/png;base64,{data}"></figure>'
    )


def _html_table(table: Table) -> str:
    texts = [_is_text(c) for c in table.columns]
    head = "".join(
        f"<th{' class=text' if t else ''}>{_escape(c.name)}"
        f"{f'<br>{_escape(c.unit)}'.replace('*', '·') if c.unit else ''}</th>"
        for c, t in zip(table.columns, texts, strict=True)
    )
    rows = []
    for values in zip(*(c.values for c in table.columns), strict=True):
        cells = (
            f"<td class=text>{_escape(v)}</td>" if t else f"<td>{_format_cell(v)}</td>"
            for v, t in zip(values, texts, strict=True)
        )
        rows.append(f"<tr>{''.join(cells)}</tr>")
    markup = f"<div class=wide><table><tr>{head}</tr>{''.join(rows)}</table></div>"
    return f"<h2>{_escape(table.title)}</h2>{markup}"


def _is_text(column: Column) -> bool:
    return any(isinstance(value, str) for value in column.values)


def _format_cell(value: Any) -> str:
    return str(value) if isinstance(value, int) else format_number(float(value))


def _footer(session: SessionRun) -> str:
    metadata = session.metadata
    code = metadata.code.get("version") or "not recorded"
    parts = (
        f"rig {(metadata.config.get('rig') or {}).get('name', 'not recorded')}",
        f"code {code} ({str(metadata.code.get('git') or 'no commit')[:12]})",
        "OSWEC thesis: University of Washington; intervals 95 %",
    )
    return "; ".join(parts)
