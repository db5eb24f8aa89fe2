"""Composition of a modular rig's tick: NamedTuples and functions, written once from its parts.

`compose` fills in the template and executes it as a module of its own, so that it is lifted into
compiled code like any other module (`rig.compilation.lifting`).
"""

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from controllers import impedance
from rig import laws
from rig.kinds.modular.tick.composition import (
    AXIS_SIGNALS,
    ROTATION,
    AxisPart,
    Composition,
    signal_names,
)
from rig.kinds.modular.tick.reasons import axis_reasons, own_reasons, sensor_range, stale_sensor
from rig.kinds.modular.tick.template import TEMPLATE
from rig.module_source import execute
from rig.realtime import cycle, power


@cache
def find_kind(text: str) -> cycle.Kind:
    """Return the cycle of a composition's text; an empty one is that of the smallest rig.

    Raises LawError if the file of a law is not that of the request.
    """
    composition = Composition.from_text(text) if text else Composition.default()
    kind: cycle.Kind = compose(composition).KIND
    return kind


@cache
def compose(composition: Composition) -> Any:
    """Return the module of a composition: `Sense`, `Command`, `Params`, `Setpoints`, `KIND`, ...

    Raises ValueError for a station whose formula is invalid (`rig.realtime.power`), LawError for a
    law that cannot be used.
    """
    found = {axis.name: _law(axis) for axis in composition.axes}
    source = tick_source(composition, found)
    formulas = [f"{each.name} {each.formula} {each.running_mean}" for each in composition.stations]
    identity = [*formulas, *(law.__name__ for law in found.values())]

    def names(module: str) -> dict[str, Any]:
        code = power.compile_stations(composition.stations, _signals(composition), module)
        return {
            "Power": code.power_type,
            "start_power": code.start,
            "step_power": code.step,
            **{f"law_of_{axis}": law for axis, law in found.items()},
            **{f"reasons_of_{axis}": axis_reasons(index) for index, axis in enumerate(found)},
        }

    composed = execute(__name__, source, identity, names)
    composed.KIND = cycle.Kind(
        composed.Row,
        composed.Params,
        composed.start,
        composed.observe,
        composed.ready,
        composed.check,
        composed.control,
        composed.row,
        reasons=own_reasons(composition),
        sense_type=composed.Sense,
        assessed=composed.assessed,
    )
    return composed


def _signals(composition: Composition) -> tuple[str, ...]:
    return signal_names(
        (axis.name for axis in composition.axes), (each.name for each in composition.sensors)
    )


def _law(axis: AxisPart) -> Any:
    """Return the module of an axis's law."""
    return laws.from_request(axis.law).module if axis.law else impedance


def reserved_names() -> frozenset[str]:
    """Return the fields of the composed types that are no part: no part can have their names."""
    types = [each for each in vars(compose(Composition.default())).values() if _is_composed(each)]
    fields = {name for each in types for name in each._fields}
    return frozenset(name for name in fields if name.partition("_")[0] != _EXAMPLE)


def _is_composed(value: Any) -> bool:
    module = compose(Composition.default()).__name__
    return isinstance(value, type) and value.__module__ == module and hasattr(value, "_fields")


_EXAMPLE = Composition.default().axes[0].name


def tick_source(composition: Composition, found: Mapping[str, Any]) -> str:
    """Return the source of a composition's tick; ``found``: the law's module of each axis."""
    axes = [
        _axis_names(index, axis, found[axis.name]) for index, axis in enumerate(composition.axes)
    ]
    sensors = [
        {
            "SENSOR_TYPE": "".join(part.capitalize() for part in each.name.split("_")) + "Reading",
            "SENSOR_UNIT": each.unit,
            "SENSOR_STALE": str(stale_sensor(index)),
            "SENSOR_RANGE": str(sensor_range(index)),
            "SENSOR": each.name,
        }
        for index, each in enumerate(composition.sensors)
    ]
    tared = [
        {"TARED_UNIT": each.unit, "TARED": each.name} for each in composition.sensors if each.tared
    ]
    template = TEMPLATE.replace("STATION_SIGNALS", "\n        ".join(_signal_lines(composition)))
    powers = "".join(f"power.{each.name}, " for each in composition.stations)
    template = template.replace("STATION_POWERS", powers)
    template = template.replace("FIRST_NAME", composition.axes[0].name)
    for marker, parts in (("AXIS", axes), ("SENSOR", sensors), ("TARED", tared)):
        template = _repeat(template, marker, parts)
    return template


def _axis_names(index: int, axis: AxisPart, law: Any) -> dict[str, str]:
    """Return the markers of the template for an axis, longer ones first."""
    rotates = axis.motion == ROTATION
    fields = range(len(law.SetPoint._fields))
    return {
        "AXIS_COLUMNS": ", ".join(f"table.{axis.name}[{i}][setpoint]" for i in fields),
        "AXIS_ZEROS": ", ".join("0.0" for _ in fields),
        "AXIS_RECORD": "RotaryRecord" if rotates else "axis.Record",
        "AXIS_UNIT": "Radian" if rotates else "Metre",
        "AXIS_INDEX": str(index),
        "AXIS": axis.name,
    }


def _signal_lines(composition: Composition) -> list[str]:
    """Return an argument of `step_power` for each signal, in the order of their names."""
    tared = " - tare.zeros."
    return [
        *(
            f"{_AXIS_SIGNALS[signal].format(index, axis.name)},"
            for index, axis in enumerate(composition.axes)
            for signal in AXIS_SIGNALS
        ),
        *(
            f"sense.{each.name}.value{tared + each.name if each.tared else ''},"
            for each in composition.sensors
        ),
    ]


_AXIS_SIGNALS = {
    "position": "motion[{0}].position",
    "velocity": "motion[{0}].velocity",
    "force": "record_of_{1}.command.force",
    "current": "record_of_{1}.sense.current",
}


def _repeat(template: str, marker: str, parts: Sequence[Mapping[str, str]]) -> str:
    """Return the template with each unit that has a marker once for each part."""
    marked = re.compile(rf"(?<![A-Z]){marker}(?![A-Z])")
    lines, written = template.splitlines(), []
    while lines:
        unit = [lines.pop(0)]
        if not marked.search(unit[0]):
            written += unit
            continue
        indent = _indent(unit[0])
        while lines and (_indent(lines[0]) > indent or lines[0] in (" " * indent + ")",)):
            unit.append(lines.pop(0))
        for part in parts:
            text = "\n".join(unit)
            for name, value in part.items():
                text = re.sub(rf"(?<![A-Z]){name}(?![A-Z])", value, text)
            written += text.splitlines()
    return "\n".join(written) + "\n"


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip()) if line.strip() else 0
