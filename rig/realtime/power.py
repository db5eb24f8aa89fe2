"""Compilation of a table of power stations into the loop's code: per tick and as running means.

`compile_stations` writes the source of a NamedTuple ``Power`` and of plain functions ``start`` and
``step`` and executes it in the name of the module that owns the table, so that they are lifted into
compiled code with that module (`rig.compilation.lifting`) and their types can be pickled.
"""

import ast
import keyword
from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

from controllers.signals import Count, Watt
from rig.realtime.sequence import MEASURE, TAIL
from rig.stations import FIELD_NAME, Station

_ALLOWED = (ast.Add, ast.Sub, ast.Mult, ast.UAdd, ast.USub, ast.BinOp, ast.UnaryOp, ast.Load)
"""Arithmetic that Python and compiled code compute alike; a division by zero would differ."""


class StationCode(NamedTuple):
    """The code of a table of stations.

    ``Power`` has a field for each station (W), ``mean_NAME`` for each running mean over the
    measured part of the row so far, and ``samples``, the ticks in these means. ``start()`` returns
    zero power and empty means. ``step(previous, SIGNALS, phase)`` returns the `Power` of a tick
    from its signals, each by its name, and its `rig.realtime.sequence.Phase`.
    """

    power_type: Any
    start: Callable[[], Any]
    step: Callable[..., Any]


def compile_stations(
    stations: Sequence[Station], signals: Collection[str], module: str
) -> StationCode:
    """Return the code of a table of stations for the module that assigns it to its names.

    ``signals`` are the names that a formula may use. Raises ValueError for a station whose name is
    taken or no ROS field name, or whose formula uses another name or another operation.
    """
    for station in stations:
        _check_formula(station, signals)
    means = [station.name for station in stations if station.running_mean]
    fields = [*(station.name for station in stations), *(f"mean_{name}" for name in means)]
    for name in fields:
        if fields.count(name) > 1 or name == "samples":
            raise ValueError(f"station {name!r}: a second field of this name")
        if not FIELD_NAME.fullmatch(name) or keyword.iskeyword(name):
            raise ValueError(f"station {name!r}: not a ROS field name ([a-z][a-z0-9_]*)")
    source = _source(stations, signals, means)
    namespace = {"__name__": module, "NamedTuple": NamedTuple, "Watt": Watt, "Count": Count,
                 "MEASURE": MEASURE, "TAIL": TAIL}  # fmt: skip
    exec(compile(source, f"<power stations of {module}>", "exec", dont_inherit=True), namespace)
    return StationCode(namespace["Power"], namespace["start"], namespace["step"])  # type: ignore[arg-type]


def _check_formula(station: Station, signals: Collection[str]) -> None:
    where = f"station {station.name!r}: formula {station.formula!r}"
    try:
        nodes = list(ast.walk(ast.parse(station.formula, mode="eval").body))
    except SyntaxError as error:
        raise ValueError(f"{where}: {error.msg}") from None
    names = [node.id for node in nodes if isinstance(node, ast.Name)]
    if missing := [name for name in names if name not in signals]:
        raise ValueError(f"{where}: no signal {missing[0]!r}; signals are {', '.join(signals)}")
    others = [node for node in nodes if not isinstance(node, (*_ALLOWED, ast.Name, ast.Constant))]
    numbers = [node.value for node in nodes if isinstance(node, ast.Constant)]
    if others or not names or not all(type(number) is float for number in numbers):
        raise ValueError(f"{where}: write +, - and * of signals and numbers such as 2.0")


def _source(stations: Sequence[Station], signals: Collection[str], means: list[str]) -> str:
    names = [station.name for station in stations]
    fields = [*names, *(f"mean_{name}" for name in means)]
    unused = "_, " * len(names)
    kept = "".join(f"mean_{name}, " for name in means)
    lines = [
        "class Power(NamedTuple):",
        *(f"    {field}: Watt" for field in fields),
        "    samples: Count",
        "def start():",
        f"    return Power({'0.0, ' * len(fields)}0)",
        f"def step(previous, {', '.join(signals)}, phase):",
        *(f"    power_{station.name} = {station.formula}" for station in stations),
        f"    {unused}{kept}samples = previous",
        "    if phase == MEASURE:",
        "        samples = samples + 1",
        *(f"        mean_{n} = mean_{n} + (power_{n} - mean_{n}) / samples" for n in means),
        "    elif phase != TAIL:",  # the tail keeps the row's result readable
        *(f"        mean_{name} = 0.0" for name in means),
        "        samples = 0",
        f"    return Power({''.join(f'power_{name}, ' for name in names)}{kept}samples)",
    ]
    return "\n".join(lines) + "\n"
