"""Contents of the page for a run of any kind, from its folder and the schema of its rows."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rig.presentation.phrases import unit_text
from rig.realtime.sequence import Phase
from rig.recording.row_layout import Leaf
from rig.row_contents import columns_from_records, main_columns

_SYSTEM = ("tick", "time", "timing", "plan", "safety", "tick_end")
_AGE = re.compile(r"(.*_)?age")
_LIMIT = re.compile(
    r"(?P<quantity>[a-z_]+?)_(?P<level>stop|peak)_(?P<unit>m|rad|deg|m_per_s|rad_per_s|a|v|n|n_m)"
)
_NO_LEVEL = re.compile(r".*(difference|jump|span|fed)")  # limits of something that no row has
_UNITS = {  # suffix of a key: the unit of the field, and its size in the unit of the key
    "m": ("m", 1.0),
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180.0),
    "m_per_s": ("m/s", 1.0),
    "rad_per_s": ("rad/s", 1.0),
    "a": ("A", 1.0),
    "v": ("V", 1.0),
    "n": ("N", 1.0),
    "n_m": ("N*m", 1.0),
}
_GROUPS = (  # units that share an axis of the traces, and the number of fields to begin with
    (("m", "rad"), 3),
    (("m/s", "rad/s"), 2),
    (("N", "N*m"), 3),
    (("W",), 4),
    (("A",), 2),
    (("V",), 0),
)
_ROW_NUMBERS = ("row", "point", "repetition", "periods", "measure_s")


class Limit(NamedTuple):
    """A field with the range in which it must stay."""

    field: str
    unit: str
    low: float
    high: float
    warn: float | None = None  # size from which people should look at it


class AgeLimit(NamedTuple):
    """The age of a device's values."""

    field: str
    limit: float | None  # s; None: without one


def name_of(field: str) -> str:
    """Return the name of a log field for people."""
    return field.replace(".estimate.", ".").replace(".", " ").replace("_", " ")


def find_limits(leaves: Sequence[Leaf], config: Mapping[str, Any]) -> list[Limit]:
    """Return the limits of a configuration that bound a field of its rows.

    A limit bounds the field of its section and quantity (`SECTION.position_stop_m` the field
    `SECTION.estimate.position`) with the same unit, or else no field. Limits of differences, slews
    and times have no field.
    """
    by_name = {leaf.name: leaf for leaf in leaves if leaf.code == "d"}
    found: dict[str, Limit] = {}
    for section, keys in _sections(config.get("limits")):
        for key, value in keys.items():
            match = _LIMIT.fullmatch(key)
            if match is None or not _is_number(value) or _NO_LEVEL.fullmatch(match["quantity"]):
                continue
            quantity, (unit, size) = match["quantity"], _UNITS[match["unit"]]
            field = _field_of(section, quantity, unit, by_name)
            warn = keys.get(f"{quantity}_warn_{match['unit']}")
            if field and field not in found:
                high = size * value
                warning = size * float(warn) if isinstance(warn, int | float) else None
                found[field] = Limit(field, unit, -high, high, warning)
    for name, sensor in _mapping(_mapping(config.get("rig")).get("sensors")).items():
        span, leaf = _mapping(sensor).get("range"), by_name.get(f"{name}.value")
        if leaf is not None and isinstance(span, list) and len(span) == 2:
            found[leaf.name] = Limit(leaf.name, leaf.unit, float(span[0]), float(span[1]))
    order = ("position", "angle", "velocity", "current")

    def place(limit: Limit) -> int:
        last = limit.field.rpartition(".")[2]
        return order.index(last) if last in order else len(order)

    return sorted(found.values(), key=place)


def find_ages(leaves: Sequence[Leaf], config: Mapping[str, Any]) -> list[AgeLimit]:
    """Return all ages in the rows, each with its limit where the configuration has one."""
    limits: list[tuple[str, str, float]] = [
        (section, key.removesuffix("_stop_s"), value)
        for section, keys in _sections(config.get("limits"))
        for key, value in keys.items()
        if key.endswith("age_stop_s") and _is_number(value)
    ]
    sensors = _mapping(_mapping(config.get("rig")).get("sensors"))
    limits += [
        (name, "age", sensor["age_limit_s"])
        for name, sensor in sensors.items()
        if _is_number(_mapping(sensor).get("age_limit_s"))
    ]
    ages = [leaf for leaf in leaves if _AGE.fullmatch(leaf.path[-1]) and leaf.unit == "s"]
    return [AgeLimit(leaf.name, _age_limit(leaf, limits)) for leaf in ages]


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


def plan_columns(plan: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return name, label and unit of the columns of the plan's rows that people see.

    Those are the columns of surfaces and those that vary from row to row.
    """
    rows = [row for row in plan.get("rows", ()) if isinstance(row, dict)]

    def varies(name: str) -> bool:
        return len({str(row.get(name)) for row in rows}) > 1

    if plan.get("columns") is None:
        keys = [key for key in (rows[0] if rows else {}) if key not in _ROW_NUMBERS]
        return [{"name": key, "label": key.replace("_", " "), "unit": ""} for key in keys]
    columns = columns_from_records(plan["columns"])
    main = main_columns(columns)
    return [
        {"name": each.name, "label": each.heading or each.label, "unit": unit_text(each.unit)}
        for each in columns
        if each in main or varies(each.name)
    ]


def describe(
    leaves: Sequence[Leaf], config: Mapping[str, Any], plan: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the contents of the page as JSON values."""
    columns = plan_columns(plan)
    names = {leaf.name for leaf in leaves}
    return {
        "fields": {
            leaf.name: {"label": name_of(leaf.name), "unit": unit_text(leaf.unit)}
            for leaf in leaves
            if leaf.code == "d"
        },
        "traces": find_traces(leaves, plan),
        "limits": [
            each._asdict() | {"label": name_of(each.field), "unit": unit_text(each.unit)}
            for each in find_limits(leaves, config)
        ],
        "ages": [
            each._asdict() | {"label": name_of(each.field)} for each in find_ages(leaves, config)
        ],
        "stations": [
            {"name": each["name"], "label": each.get("short_label") or each["label"]}
            | {"heading": each.get("heading") or each["name"]}
            | {"mean": f"power.mean_{each['name']}" in names}
            for each in plan.get("stations", ())
            if f"power.{each['name']}" in names
        ],
        "columns": columns,
        "rows": [
            [row.get(column["name"]) for column in columns]
            for row in plan.get("rows", ())
            if isinstance(row, dict)
        ],
        "phases": [phase.name.lower().replace("_", "-") for phase in Phase],
        "duration_s": plan.get("duration_s"),
        "sea": str(_mapping(plan.get("sea")).get("words") or ""),
    }


def _field_of(section: str, quantity: str, unit: str, leaves: Mapping[str, Leaf]) -> str:
    """Return the field that a limit bounds; empty for none."""
    candidates = [
        f"{section}.estimate.{quantity}",
        f"{section}.{quantity}",
        f"{section}.command.{quantity}",
        *(
            name
            for name, leaf in leaves.items()
            if leaf.path[-1] == f"{section}_{quantity}" and len(leaf.path) == 2
        ),
    ]
    own = any(name.startswith(f"{section}.") for name in leaves)
    if own:  # a rig with one drive
        candidates.append(f"command.{quantity}")
    fitting = (name for name in candidates if name in leaves and leaves[name].unit == unit)
    return next(fitting, "")


def _age_limit(leaf: Leaf, limits: Iterable[tuple[str, str, float]]) -> float | None:
    """Return the limit of an age: of the same section and name, or of a device named likewise."""
    group, last = leaf.path[0], leaf.path[-1]
    for section, key, value in limits:
        device = key.removesuffix("age").strip("_")
        same = section == group and key == last
        if same or (last == "age" and _alike(group, device or section)):
            return float(value)
        if last == "age" and device and _alike(group, section) and len(leaf.path) == 2:
            return float(value)
    return None


def _alike(group: str, device: str) -> bool:
    """Return whether a group of fields is that of a device: `panel`, `encoders` of `encoder`."""
    return group in (device, f"{device}s", f"{device}_sense") or device.startswith(f"{group}_")


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


def _sections(limits: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the sections of a limits file by name; those of `axes` like the others."""
    for name, keys in _mapping(limits).items():
        if name == "axes":
            yield from _sections(keys)
        elif isinstance(keys, dict):
            yield name, keys


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
