"""Files of a session's results: one self-contained HTML page and CSV tables for people, JSON and
NetCDF for programs, and the calibration file, to which rig files and later sessions refer.
"""

import base64
import html
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from rig.analysis.stop_reason import ENDINGS, Ending
from rig.kinds.oswec_bench.products.estimate import Estimate, format_number
from rig.kinds.oswec_bench.products.points import SessionRun
from rig.kinds.oswec_bench.products.result import Result, Table
from rig.presentation.json_values import json_value
from rig.presentation.phrases import format_utc, mode_stamp
from rig.recording.runs.state import COMPLETE, RECOVERED
from rig.recording.table_file import write_table
from rig.regular_file import MAX_CONFIG_BYTES, read_regular

PAGE, JSON, CALIBRATION = "session.html", "session.json", "calibration.yaml"
_DIGITS = 9  # of the numbers in the calibration file
_VERDICTS = {"met": ("✓", "yes"), "missed": ("✗", "no"), "undecided": ("?", ""), "": ("", "")}
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


def write_tables(result: Result, facts: dict[str, Any], folder: Path) -> list[Path]:
    """Write a CSV and a NetCDF file for each table, and everything in one JSON file. Return the
    paths.
    """
    paths = []
    for table in result.tables:
        columns = {
            f"{c.name} [{c.unit}]" if c.unit else c.name: json_value(c.values)
            for c in table.columns
        }
        paths.append(write_table(columns, folder / f"{table.name}.csv"))
        paths.append(_write_netcdf(table, facts, folder))
    path = folder / JSON
    text = json.dumps({**facts, **result_as_dict(result)}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")
    return [*paths, path]


def result_as_dict(result: Result) -> dict[str, Any]:
    """Return constants, comparisons, notes and tables in the form of JSON: NaN is null."""
    tables = {t.name: {"title": t.title, "columns": t.columns} for t in result.tables}
    comparisons = [each._asdict() | {"verdict": each.verdict} for each in result.comparisons]
    changed = {"tables": tables, "comparisons": comparisons}
    document: dict[str, Any] = json_value(result._asdict() | changed)
    return {key: document[key] for key in ("constants", "comparisons", "notes", "tables")}


def _write_netcdf(table: Table, facts: dict[str, Any], folder: Path) -> Path:
    path = folder / f"{table.name}.nc"
    variables = {
        c.name.replace("/", "per"): ("point", np.array(c.values), {"units": c.unit})
        for c in table.columns
    }
    plain = {key: value for key, value in facts.items() if isinstance(value, str | float | int)}
    dataset = xarray.Dataset(variables, attrs={"title": table.title, **plain})
    dataset.to_netcdf(path, engine="h5netcdf")
    return path


def write_constants(result: Result, session: SessionRun, folder: Path) -> list[Path]:
    """Write ``calibration.yaml``: value, unit and 95 % half width of each constant, date, run,
    method.

    Constants without an interval are left out, since nothing may be based on them. No file is
    written if a session gives no constants and no maps. Return the paths written.
    """
    constants = {
        name: {
            "value": _round_numbers(each.value),
            "unit": each.unit,
            "uncertainty": _round_numbers(each.uncertainty),
            "method": each.method,
        }
        for name, each in result.constants.items()
        if math.isfinite(each.value) and math.isfinite(each.uncertainty)
    }
    if not constants and not result.maps:
        return []
    metadata = session.metadata
    document: dict[str, Any] = {
        "name": session.kind,
        "rig": str((metadata.config.get("rig") or {}).get("name") or "not recorded"),
        "run": metadata.run,
        "date": metadata.started_utc[:10] or "1970-01-01",
        "constants": constants,
        **{key: _round_numbers(value) for key, value in result.maps.items()},
    }
    yaml = YAML()
    yaml.width = 400  # one constant per line
    path = folder / CALIBRATION
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(_flow_style(document), file)
    return [path]


def read_constant(run: Path, name: str) -> Estimate:
    """Return a constant from the calibration file of an analysed run.

    Raises ValueError if there is no such file or no constant of that name.
    """
    path = run / CALIBRATION
    if not path.is_file():
        raise ValueError(f"{run}: no {CALIBRATION}; analyse that run first")
    constants = YAML(typ="safe").load(read_regular(path, MAX_CONFIG_BYTES).decode())["constants"]
    entry = (constants or {}).get(name)
    if entry is None:
        raise ValueError(f"{path}: no {name}")
    method = f"of run {run.name}"
    return Estimate(float(entry["value"]), float(entry["uncertainty"]), entry["unit"], method)


def _round_numbers(value: Any) -> Any:
    """Return a value with its numbers rounded to the significant digits, at any depth."""
    if isinstance(value, dict):
        return {key: _round_numbers(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_round_numbers(each) for each in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _flow_style(value: Any) -> Any:
    """Return a value for YAML; mappings of plain values and lists of numbers take one line each."""
    if isinstance(value, dict):
        mapping = CommentedMap({key: _flow_style(each) for key, each in value.items()})
        if not any(isinstance(each, dict | list) for each in value.values()):
            mapping.fa.set_flow_style()
        return mapping
    if isinstance(value, list):
        row = CommentedSeq([_flow_style(each) for each in value])
        if all(isinstance(each, float | int) for each in value):
            row.fa.set_flow_style()
        return row
    return value


def write_page(
    result: Result, session: SessionRun, ending: Ending, figure_paths: list[Path], folder: Path
) -> Path:
    """Write ``session.html``, which contains its figures and loads nothing. Return its path."""
    metadata = session.metadata
    subtitle = f"run {metadata.run}, started {format_utc(metadata.started_utc)}"
    notes = (f"<li>{_escape(note)}</li>" for note in page_notes(result, session))
    body = [
        f"<header><span class=stamp>{_escape(mode_stamp(metadata.mode))}</span>"
        f"<h1>Session {_escape(session.name)}</h1><p>{_escape(subtitle)}</p></header>",
        *(
            f"<p{'' if good else ' class=no'}>{_escape(sentence)}.</p>"
            for sentence, good in (
                (ending.description, ending.title == ENDINGS["complete"]),
                (session.record.sentence, session.record.state in (COMPLETE, RECOVERED)),
            )
        ),
        _comparison_table(result),
        _constants_table(result),
        f"<h2>Notes</h2><ul>{''.join(notes)}</ul>",
        "<h2>Figures</h2>",
        *map(_inline_figure, (figure.title for figure in result.figures), figure_paths),
        *map(_html_table, result.tables),
        f"<footer>{_escape(_footer(session))}</footer>",
    ]
    head = f"<meta charset=utf-8><title>{_escape(session.name)}</title><style>{_STYLE}</style>"
    path = folder / PAGE
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
    reasons |= session.missing_rows
    return [*lines, *(f"Row {row} is left out: {reasons[row]}." for row in sorted(reasons))]


def _escape(value: Any) -> str:
    return html.escape(str(value))


def _cell(tag: str, text: str, css: str = "") -> str:
    return f"<{tag} class={css}>{text}</{tag}>" if css else f"<{tag}>{text}</{tag}>"


def _markup(rows: Iterable[Iterable[str]]) -> str:
    """Return a table of rows of cells, the first of which are headings."""
    lines = ("".join(row) for row in rows)
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _comparison_table(result: Result) -> str:
    if not result.comparisons:
        return ""
    heads = ("quantity", "thesis", "required", "this run")
    rows = [[*(_cell("th", each, "text") for each in heads), "<th></th>"]]
    for comparison in result.comparisons:
        cells = [_cell("td", _escape(each), "text") for each in comparison[:-1]]
        rows.append([*cells, _cell("td", *_VERDICTS[comparison.verdict])])
    return f"<h2>Comparison with the thesis</h2>{_markup(rows)}"


def _constants_table(result: Result) -> str:
    if not result.constants:
        return ""
    rows = [["<th class=text>constant</th><th>value ± 95 %</th><th class=text>method</th>"]]
    for name, each in result.constants.items():
        method = _cell("td", _escape(each.method), "text")
        rows.append([_cell("td", _escape(name), "text"), _cell("td", _escape(each)), method])
    return f"<h2>Constants</h2>{_markup(rows)}"


def _inline_figure(title: str, path: Path) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<figure><img alt="{_escape(title)}" src="data:image/png;base64,{data}"></figure>'


def _html_table(table: Table) -> str:
    columns = []
    for name, unit, values in table.columns:
        css = "text" if any(isinstance(value, str) for value in values) else ""
        unit_line = f"<br>{_escape(unit)}".replace("*", "·") if unit else ""
        cells = [_cell("td", _escape(v) if css else _format_cell(v), css) for v in values]
        columns.append([_cell("th", f"{_escape(name)}{unit_line}", css), *cells])
    markup = _markup(zip(*columns, strict=True))
    return f"<h2>{_escape(table.title)}</h2><div class=wide>{markup}</div>"


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
