"""Contents of the page for a run of any kind, from its folder and the schema of its rows."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rig import log_fields, stations
from rig.analysis.limits import Bound, as_mapping, find_bounds, is_age
from rig.log_fields import LogFields, label_of
from rig.presentation.phrases import phase_text, unit_text
from rig.realtime.sequence import Phase
from rig.recording.row_layout import Leaf
from rig.row_contents import PANEL, X, Y, columns_from_records, main_columns, with_role

_SYSTEM = ("tick", "time", "timing", "plan", "safety", "tick_end")
_GROUPS = (  # units that share an axis of the traces, and the number of fields to begin with
    (("m", "rad"), 3),
    (("m/s", "rad/s"), 2),
    (("N", "N*m"), 3),
    (("W",), 4),
    (("A",), 2),
    (("V",), 0),
)
_ROW_NUMBERS = ("row", "point", "repetition", "periods", "measure_s")


def fields_of(plan: Mapping[str, Any]) -> LogFields:
    """Return the labels and limits that a run recorded, with the labels of its power stations."""
    fields = log_fields.from_record(plan.get("log_fields"))
    powers = {}
    for each in stations.from_records(plan.get("stations") or ()):
        powers[f"power.{each.name}"] = f"power {each.short_label or each.name}"
        powers[f"power.mean_{each.name}"] = f"mean power {each.short_label or each.name}"
    return fields._replace(labels=powers | dict(fields.labels))


def find_ages(leaves: Sequence[Leaf], bounds: Iterable[Bound]) -> dict[str, float | None]:
    """Return the fields of all ages in the rows, each with its limit (s); None without one."""
    limits: dict[str, float] = {}
    for each in bounds:
        field = each.limit.field
        limits[field] = min(each.high, limits.get(field, each.high))
    ages = (leaf.name for leaf in leaves if leaf.unit == "s" and is_age(leaf.name))
    return {name: limits.get(name) for name in ages}


def find_traces(leaves: Sequence[Leaf], plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the groups of traces: fields of like units, and those to begin with."""
    axis = str(plan.get("axis") or "")
    stations = [f"power.{each['name']}" for each in plan.get("stations", ())]
    groups = []
    for units, count in _GROUPS:
        fields = [leaf for leaf in leaves if leaf.unit in units and _is_trace(leaf)]
        ranked = sorted(fields, key=lambda leaf: _rank(leaf, axis, stations))
        if not fields:
            continue
        first = [leaf.name for leaf in ranked[:count]]
        groups.append(
            {
                "unit": " / ".join(unit_text(u) for u in units if any(f.unit == u for f in fields)),
                "fields": [leaf.name for leaf in ranked],
                "first": first,
            }
        )
    return groups


def plan_columns(plan: Mapping[str, Any], fields: LogFields) -> list[dict[str, str]]:
    """Return name, label, heading and unit of the columns of the plan's rows that people see.

    Those are the columns of surfaces and those that vary from row to row.
    """
    rows = _rows(plan)
    if plan.get("columns") is None:
        texts = {
            key: fields.settings.get(key, (key.replace("_", " "), ""))
            for key in (rows[0] if rows else {})
            if key in fields.settings or (key not in _ROW_NUMBERS and _varies(rows, key))
        }
        return [
            {"name": key, "label": label, "heading": label, "unit": unit}
            for key, (label, unit) in texts.items()
        ]
    columns = columns_from_records(plan["columns"])
    main = main_columns(columns)
    return [
        {"name": each.name, "label": each.label, "heading": each.heading or each.label}
        | {"unit": unit_text(each.unit)}
        for each in columns
        if each in main or _varies(rows, each.name)
    ]


def surface_axes(plan: Mapping[str, Any], columns: Sequence[Mapping[str, str]]) -> dict[str, int]:
    """Return the columns over which powers are drawn: places of `x`, `y` and `panel`.

    Those are the main columns that vary, or else the first numbers that do. With one, powers are
    drawn over `x`; with none there is nothing to draw.
    """
    rows, names = _rows(plan), [each["name"] for each in columns]
    recorded = columns_from_records(plan.get("columns") or ())
    main = [each.name for role in (X, Y, PANEL) if (each := with_role(recorded, role))]
    varying = [name for name in main if _varies(rows, name)] or [
        name
        for name in names
        if _varies(rows, name) and all(isinstance(row.get(name), int | float) for row in rows)
    ]
    return dict(zip(("x", "y", "panel"), map(names.index, varying), strict=False))


def best_station(plan: Mapping[str, Any]) -> str:
    """Return the station by which `rig` sorts and marks rows: the last one of pictures."""
    table = stations.from_records(plan.get("stations") or ())
    averaged = [each for each in table if each.running_mean]
    return next((each.name for each in reversed(stations.shown(averaged) or averaged)), "")


def describe(
    leaves: Sequence[Leaf], config: Mapping[str, Any], plan: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the contents of the page as JSON values."""
    fields = fields_of(plan)
    columns = plan_columns(plan, fields)
    bounds = find_bounds(leaves, config, fields)
    names = {leaf.name for leaf in leaves}
    return {
        "fields": {
            leaf.name: {"label": label_of(leaf.name, fields.labels), "unit": unit_text(leaf.unit)}
            for leaf in leaves
            if leaf.code == "d"
        },
        "traces": find_traces(leaves, plan),
        "limits": [
            {"key": each.limit.key, "field": each.limit.field, "label": each.label}
            | {"unit": unit_text(each.unit), "low": each.low, "high": each.high}
            | {"warn": each.warn, "both": each.limit.both, "stops": each.limit.stops}
            | {"derived": each.is_derived}
            for each in bounds
            if not each.is_age
        ],
        "ages": [
            {"field": name, "limit": limit, "label": label_of(name, fields.labels)}
            for name, limit in find_ages(leaves, bounds).items()
        ],
        "stations": [
            {"name": each["name"], "label": each.get("short_label") or each["label"]}
            | {"heading": each.get("heading") or each["name"]}
            | {"mean": f"power.mean_{each['name']}" in names}
            for each in plan.get("stations", ())
            if f"power.{each['name']}" in names
        ],
        "best_station": best_station(plan),
        "columns": columns,
        "surface": surface_axes(plan, columns),
        "rows": [[row.get(column["name"]) for column in columns] for row in _rows(plan)],
        "points": [row.get("point", at) for at, row in enumerate(_rows(plan))],
        "phases": [phase_text(phase) for phase in Phase],
        "duration_s": plan.get("duration_s"),
        "sea": str(as_mapping(plan.get("sea")).get("words") or ""),
    }


def _rows(plan: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [row for row in plan.get("rows") or () if isinstance(row, dict)]


def _varies(rows: Sequence[Mapping[str, Any]], name: str) -> bool:
    values = [row.get(name) for row in rows]
    return any(each != values[0] for each in values) and not isinstance(values[0], dict)


def _is_trace(leaf: Leaf) -> bool:
    first = leaf.path[0]
    plain = first not in _SYSTEM and not first.startswith("tare") and "settings" not in leaf.path
    return leaf.code == "d" and plain and not leaf.path[-1].startswith("mean_")


def _rank(leaf: Leaf, axis: str, stations: Sequence[str]) -> tuple[int, int]:
    """Return the place of a field in its group: the plan's axis first, powers as they flow."""
    if leaf.name in stations:
        return (0, stations.index(leaf.name))
    kinds = ("estimate", "", "command", "reference", "demand", "sense")
    present = [kinds.index(part) for part in leaf.path if part in kinds]
    place = present[0] if present else (1 if len(leaf.path) == 2 else len(kinds))
    if "command" in leaf.path and leaf.path[-1] in ("force", "torque", "current"):
        place = 0
    return (0 if leaf.path[0] == axis else 1, place)
