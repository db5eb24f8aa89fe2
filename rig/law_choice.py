"""A law that is one of several: its set point has the number of the law that acts.

The module of such a choice is written for its laws, because compiled code has no table of functions
of different types. A change of law begins with the new law's memory at its start, so its gains are
ramped, and the force fades from that of the law before in the same time.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from controllers.law import Column, Parameter
from rig.module_source import execute

CHOICE = "law"
"""Key and name of the column with the number of the law."""


def choice_module(modules: Mapping[str, Any]) -> Any:
    """Return the module (`controllers.law`) of a choice among laws, given by name.

    The first law is the default. The columns of the others have the value nearest to zero where a
    matrix lacks them. ValueError if two laws have a column or a parameter of one key, but not of
    one meaning.
    """
    laws = list(modules.values())
    columns = _union([module.COLUMNS for module in laws], "column")
    first = {column.key for column in laws[0].COLUMNS}
    columns = [each if each.key in first else _with_default(each) for each in columns]
    columns = [each._replace(laws=_laws_with(modules, each.key)) for each in columns]
    columns.append(_choice_column(tuple(modules)))
    parameters = _union([module.PARAMETERS for module in laws], "parameter")
    source = _source(laws, [column.name for column in columns])
    names = {f"law_{i}": module for i, module in enumerate(laws)}
    names |= {"COLUMNS": tuple(columns), "PARAMETERS": tuple(parameters)}
    identity = [*modules, *(module.__name__ for module in laws)]
    return execute("wec_rig_laws", source, identity, lambda _: names)


def _choice_column(names: tuple[str, ...]) -> Column:
    return Column(
        CHOICE, CHOICE, "1", CHOICE, 0.0, len(names) - 1.0,
        "Law that acts, by its name or its place in the list.", default=0.0, choices=names,
    )  # fmt: skip


def _laws_with(modules: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the names of the laws that have a column; empty if all have it."""
    found = [name for name, m in modules.items() if key in {each.key for each in m.COLUMNS}]
    return () if len(found) == len(modules) else tuple(found)


def _with_default(column: Column) -> Column:
    nearest = min(max(column.low, 0.0), column.high)
    return column._replace(default=nearest if column.default is None else column.default)


def _union(groups: Sequence[Sequence[Any]], noun: str) -> list[Any]:
    """Return the entries of all laws, one of each key."""
    found: dict[str, Any] = {}
    for each in (entry for group in groups for entry in group):
        known = found.setdefault(each.key, each)
        if _meaning(known) != _meaning(each):
            raise ValueError(
                f"the {noun} {each.key} of two laws differs in name, unit, range, default or names "
                f"of its values: {known.low:g} .. {known.high:g} {known.unit} and "
                f"{each.low:g} .. {each.high:g} {each.unit}"
            )
    names = [_name(each) for each in found.values()]
    for each in found.values():
        if CHOICE in (each.key, _name(each)) or names.count(_name(each)) > 1:
            raise ValueError(f"the {noun} {each.key} has a name that another one has")
    return list(found.values())


def _name(entry: Column | Parameter) -> str:
    return entry.name if isinstance(entry, Column) else entry.key


def _meaning(entry: Column | Parameter) -> tuple[Any, ...]:
    # One file gives both laws the same value, also where it leaves it out.
    own = (entry.listed,) if isinstance(entry, Parameter) else entry.choices
    return (_name(entry), entry.unit, entry.low, entry.high, entry.default, own)


def _source(laws: Sequence[Any], names: Sequence[str]) -> str:
    """Return the source of the choice; ``names``: the fields of its SetPoint."""
    numbers = range(len(laws))
    states = ", ".join(f"state_{i}" for i in numbers)
    lines = [
        '"""One of several laws, by its set point."""',
        "",
        "from typing import NamedTuple",
        "",
        "from controllers.blocks import fade_step",
        "from controllers.signals import Demand",
        "",
        "",
        "class SetPoint(NamedTuple):",
        *(f"    {name}: float" for name in names),
        "",
        "",
        "class Params(NamedTuple):",
        "    ramp: float  # s, of gains and of the force after a change of law",
        *(f"    law_{i}: law_{i}.Params" for i in numbers),
        "",
        "",
        "class State(NamedTuple):",
        "    law: float  # that acted in the last tick; -1: none yet",
        "    force: float  # N, its demand",
        "    fade_force: float  # N, granted when the law last changed",
        "    fade: float  # 1 .. 0, share of `fade_force` that is still in the demand",
        *(f"    law_{i}: law_{i}.State" for i in numbers),
        "",
        "",
        "def params(settings, ramp, dt):",
        "    return Params(",
        "        ramp,",
        *(f"        law_{i}.params(settings, ramp, dt)," for i in numbers),
        "    )",
        "",
        "",
        "def start(params):",
        "    return State(",
        "        -1.0, 0.0, 0.0, 0.0,",
        *(f"        law_{i}.start(params.law_{i})," for i in numbers),
        "    )",
        "",
        "",
        "def step(params, state, setpoint, motion, reference, deficit, dt):",
        f"    law, force, fade_force, fade, {states} = state",
        "    if setpoint.law != law:",
        "        if law >= 0.0:",
        "            fade_force, fade = force + deficit, 1.0",
        "        law, deficit = setpoint.law, 0.0",
        *(f"        state_{i} = law_{i}.start(params.law_{i})" for i in numbers),
    ]
    for i, law in enumerate(laws):
        test = "else:" if i == len(laws) - 1 else f"{'el' if i else ''}if law < {i + 0.5}:"
        chosen = ", ".join(f"setpoint.{column.name}" for column in law.COLUMNS)
        lines += [
            f"    {test}",
            f"        chosen_{i} = law_{i}.SetPoint({chosen})",
            f"        state_{i}, demand = law_{i}.step(",
            f"            params.law_{i}, state_{i}, chosen_{i}, motion, reference, deficit, dt",
            "        )",
        ]
    lines += [
        "    if fade > 0.0:",
        "        fade = fade_step(fade, params.ramp, dt)",
        "        kp, ki, km, force = demand",
        "        demand = Demand(kp, ki, km, force + fade * (fade_force - force))",
        f"    return State(law, demand.force, fade_force, fade, {states}), demand",
    ]
    return "\n".join(lines) + "\n"
