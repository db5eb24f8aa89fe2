"""One self-contained HTML page of a session: comparison, constants, figures, tables, notes."""

import base64
import html
from pathlib import Path
from typing import Any

from rig.analysis.phrases import mode_stamp, utc
from rig.analysis.session.points import Session
from rig.analysis.session.result import Column, Picture, Result, Table, number, words
from rig.analysis.stop_reason import ENDINGS, Ending
from rig.analysis.windows import GONE
from rig.recording.runs.state import RECOVERED, WHOLE

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
    result: Result, session: Session, ending: Ending, pictures: list[Path], folder: Path
) -> Path:
    """``session.html``: pictures inside, nothing is loaded from elsewhere."""
    known = session.known
    said = f"run {known.run}, started {utc(known.started_utc)}"
    body = [
        f"<header><span class=stamp>{_text(mode_stamp(known.mode))}</span>"
        f"<h1>Session {_text(session.name)}</h1><p>{_text(said)}</p></header>",
        _state(ending.description, ending.title == ENDINGS["complete"]),
        _state(session.record.sentence, session.record.state in (WHOLE, RECOVERED)),
        _compared(result),
        _constants(result),
        "<h2>Notes</h2><ul>" + "".join(f"<li>{_text(n)}</li>" for n in notes(result, session))
        + "</ul>",
        "<h2>Figures</h2>",
        *(_picture(p, path) for p, path in zip(result.pictures, pictures, strict=True)),
        *(_table(table) for table in result.tables),
        f"<footer>{_text(_foot(session))}</footer>",
    ]  # fmt: skip
    head = f"<meta charset=utf-8><title>{_text(session.name)}</title><style>{_STYLE}</style>"
    path = folder / FILE
    text = "\n".join(["<!doctype html><html lang=en>", head, *filter(None, body), "</html>"])
    path.write_text(text, encoding="utf-8")
    return path


def notes(result: Result, session: Session) -> list[str]:
    """What a reader has to know: of the method, and of what is missing in the run."""
    out = [*result.notes, "Of the load cell's own calibration 0.1 % is in the intervals, no more."]
    lost = sum(point.lost for point in session.whole)
    if lost:
        out.append(f"{lost} ticks were lost while measuring; they are interpolated.")
    why = {
        point.row: point.incomplete_reason for point in session.points if point.incomplete_reason
    }
    why |= dict.fromkeys(session.gone, GONE)
    return [*out, *(f"Row {row} is left out: {why[row]}." for row in sorted(why))]


def _state(said: str, good: bool) -> str:
    return f"<p>{_text(said)}.</p>" if good else f"<p class=no>{_text(said)}.</p>"


def _text(value: Any) -> str:
    return html.escape(str(value))


def _compared(result: Result) -> str:
    if not result.compared:
        return ""
    rows = []
    for each in result.compared:
        verdict = {True: "<td class=yes>✓</td>", False: "<td class=no>✗</td>", None: "<td></td>"}
        cells = (each.quantity, each.thesis, each.wanted, each.found)
        told = "".join(f"<td class=text>{_text(c)}</td>" for c in cells)
        rows.append(f"<tr>{told}{verdict[each.held]}</tr>")
    heads = ("quantity", "thesis", "must show", "this run")
    head = "".join(f"<th class=text>{h}</th>" for h in heads) + "<th></th>"
    return f"<h2>Beside the thesis</h2><table><tr>{head}</tr>{''.join(rows)}</table>"


def _constants(result: Result) -> str:
    if not result.constants:
        return ""
    rows = [
        f"<tr><td class=text>{_text(name)}</td><td>{_text(words(each))}</td>"
        f"<td class=text>{_text(each.method)}</td></tr>"
        for name, each in result.constants.items()
    ]
    head = "<tr><th class=text>constant</th><th>value ± 95 %</th><th class=text>method</th></tr>"
    return f"<h2>Constants</h2><table>{head}{''.join(rows)}</table>"


def _picture(of: Picture, path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<figure><img alt="{_text(of.title)}" src="data:image/png;base64,{data}"></figure>'


def _table(of: Table) -> str:
    texts = [_is_text(c) for c in of.columns]
    head = "".join(
        f"<th{' class=text' if t else ''}>{_text(c.name)}"
        f"{f'<br>{_text(c.unit)}'.replace('*', '·') if c.unit else ''}</th>"
        for c, t in zip(of.columns, texts, strict=True)
    )
    rows = []
    for values in zip(*(c.values for c in of.columns), strict=True):
        cells = (
            f"<td class=text>{_text(v)}</td>" if t else f"<td>{_shown(v)}</td>"
            for v, t in zip(values, texts, strict=True)
        )
        rows.append(f"<tr>{''.join(cells)}</tr>")
    table = f"<div class=wide><table><tr>{head}</tr>{''.join(rows)}</table></div>"
    return f"<h2>{_text(of.title)}</h2>{table}"


def _is_text(column: Column) -> bool:
    return any(isinstance(value, str) for value in column.values)


def _shown(value: Any) -> str:
    return str(value) if isinstance(value, int) else number(float(value))


def _foot(session: Session) -> str:
    known = session.known
    code = known.code.get("version") or "not recorded"
    parts = (
        f"rig {(known.config.get('rig') or {}).get('name', 'not recorded')}",
        f"code {code} ({str(known.code.get('git') or 'no commit')[:12]})",
        "OSWEC thesis: University of Washington; intervals 95 %",
    )
    return "; ".join(parts)
