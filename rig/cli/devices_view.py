"""How `rig devices` shows what it found."""

import math
from collections.abc import Callable
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from drivers.canopen import arming, emcy, statusword
from drivers.canopen.heartbeat import Nmt
from rig.execution.hardware.line_survey import LineFound, UnitFound, ValueFound
from rig.execution.hardware.listen import Heard
from rig.execution.hardware.survey import BusFound, Found, NodeFound, register_words

BAD, NOTE = "bold red", "dim"


def as_dict(rig: str, found: Found) -> dict[str, Any]:
    """All of it as JSON values; null for what did not come."""
    can = found.can
    return {
        "status": "trouble" if found.trouble else "ok",
        "rig": rig,
        "trouble": list(found.trouble),
        "can": {
            "interface": can.bus.interface,
            "channel": can.bus.channel,
            "bit_rate": can.bus.bit_rate,
            "planned_load": can.load,
            "trouble": can.trouble,
            "nodes": [_node_dict(node) for node in can.nodes],
            "strangers": list(can.strangers),
        },
        "lines": [line_dict(line, found.at) for line in found.lines],
    }


def _node_dict(node: NodeFound) -> dict[str, Any]:
    told = node._asdict()
    told["identity"] = node.identity._asdict()
    told["nmt"] = None if node.nmt is None else Nmt(node.nmt).name
    told["wrong"] = [one._asdict() for one in node.wrong]
    told["unset"] = [one._asdict() for one in node.unset]
    code = node.error_code
    told["error_words"] = emcy.meaning(code) if code else None if code is None else "none"
    told["status_words"] = None if node.statusword is None else statusword.describe(node.statusword)
    told["trouble"] = list(node.trouble)
    return told


def line_dict(line: LineFound, at: float) -> dict[str, Any]:
    """A line with its units as JSON values; ``at``: when all had been looked at (s)."""
    return {**line._asdict(), "units": [_unit_dict(unit, at) for unit in line.units]}


def _unit_dict(unit: UnitFound, at: float) -> dict[str, Any]:
    told = unit._asdict() | {"age": at - unit.asked if unit.answers else None}
    del told["asked"]
    told["values"] = [
        value._asdict() | {"value": value.value if math.isfinite(value.value) else None}
        for value in unit.values
    ]
    return told


def drawn(rig: str, found: Found, *, every_object: bool) -> Group:
    """The bus with a column a node, the lines with a row a unit, and what is wrong."""
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), ": who answers on its wires\n")]
    parts += [_bus_words(found.can)]
    if not found.can.trouble:
        parts.append(_nodes(found.can))
        if found.can.strangers:
            numbers = ", ".join(map(str, found.can.strangers))
            parts.append(Text(f"\nalso on the bus, not in the rig file: node {numbers}", "yellow"))
    parts.append(Text(""))
    parts += [line for one in found.lines for line in drawn_line(one, found.at)]
    if every_object:
        parts += [_objects(node) for node in found.can.nodes if node.unset]
    parts.append(verdict(found.trouble))
    return Group(*parts)


def heard_dict(rig: str, found: Heard) -> dict[str, Any]:
    """What was heard without sending, as JSON values."""
    nodes = [
        one._asdict() | {"nmt": None if one.nmt is None else Nmt(one.nmt).name}
        for one in found.nodes
    ]
    return {
        "status": "trouble" if found.trouble else "ok",
        "rig": rig,
        "listened_only": True,
        "trouble": list(found.trouble),
        "can": {"nodes": nodes, "strangers": list(found.strangers)},
    }


def heard_drawn(rig: str, found: Heard) -> Group:
    """A row a node that was heard without sending, and what is wrong."""
    head = Text.assemble((rig, "bold"), ": what its wires say by themselves; nothing was sent\n")
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("node", "", "state", "heartbeat", "emergency"):
        table.add_column(name)
    for one in found.nodes:
        age = "none" if one.heartbeat_age is None else f"{1e3 * one.heartbeat_age:.0f} ms ago"
        state = "-" if one.nmt is None else Nmt(one.nmt).name.lower().replace("_", "-")
        code = emcy.meaning(one.emergency) if one.emergency else "none"
        table.add_row(str(one.node), one.name, state, age, code)
    parts: list[Table | Text] = [head, table] if found.nodes else [head]
    if found.strangers:
        numbers = ", ".join(map(str, found.strangers))
        parts.append(Text(f"\nalso on the bus, not in the rig file: node {numbers}", "yellow"))
    return Group(*parts, Text(""), verdict(found.trouble))


def _bus_words(can: BusFound) -> Text:
    bus = can.bus
    words = (
        f"{bus.interface} {bus.channel}, {bus.bit_rate / 1e3:g} kbit/s, "
        f"{100 * can.load:.0f} % full while a campaign runs"
    )
    text = Text.assemble(("CAN  ", "bold cyan"), words)
    return text.append(f"\n  {can.trouble}", BAD) if can.trouble else text


def _nodes(can: BusFound) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0), expand=True)
    table.add_column("", width=18, style="dim")
    for node in can.nodes:
        table.add_column(f"node {node.node}: {node.name}", ratio=1, overflow="fold")
    for name, words in _ROWS:
        table.add_row(
            f"  {name}",
            *(words(node) if node.answers or name == "answers" else Text("") for node in can.nodes),
        )
    return table


def _some(value: str | None) -> Text:
    return Text("-", NOTE) if value is None else Text(value)


def _hexadecimal(value: int | None) -> Text:
    return _some(None if value is None else f"{value:#010x}")


def _nmt(one: NodeFound) -> Text:
    if one.nmt is None:
        return Text("not known: no heartbeat", NOTE)
    return Text(Nmt(one.nmt).name.lower().replace("_", "-"))


def _heartbeat(one: NodeFound) -> Text:
    if one.heartbeat_age is not None:
        every = f" (every {one.heartbeat_every:g} s)" if one.heartbeat_every else ""
        return Text(f"{one.heartbeat_age:.2f} s ago{every}")
    return Text("none came", BAD) if one.heartbeat_every else Text("off until a run", NOTE)


def _status(one: NodeFound) -> Text:
    if one.statusword is None:
        return Text("-", BAD)
    bad = statusword.decode(one.statusword) in (statusword.FAULT, statusword.FAULT_REACTION)
    return Text(statusword.describe(one.statusword), BAD if bad else "")


def _register(one: NodeFound) -> Text:
    value = one.identity.error_register
    if not value:
        return _some("clear" if value == 0 else None)
    words = f"{value:#04x} {register_words(value)}"
    return Text(f"{words}: misses its master", "yellow") if one.waits else Text(words, BAD)


def _error(code: int | None) -> Text:
    if not code:
        return _some("none" if code == 0 else None)
    return Text(f"{code:#06x} {emcy.meaning(code)}", BAD)


def _standing(one: NodeFound) -> Text:
    if not one.wrong:
        return Text("all as wanted", "green")
    return Text("\n".join(f"not {mismatch.name}" for mismatch in one.wrong), BAD)


def _unset(one: NodeFound) -> Text:
    return Text(f"{len(one.unset)} of {one.checked} objects" if one.unset else "nothing", NOTE)


# A function of the node for each row.
_ROWS: tuple[tuple[str, Callable[[NodeFound], Text]], ...] = (
    ("answers", lambda one: Text("yes", "green") if one.answers else Text("no", BAD)),
    ("device name", lambda one: _some(one.identity.name)),
    ("device type", lambda one: _hexadecimal(one.identity.device_type)),
    ("vendor", lambda one: _hexadecimal(one.identity.vendor)),
    ("product", lambda one: _hexadecimal(one.identity.product)),
    ("revision", lambda one: _hexadecimal(one.identity.revision)),
    ("NMT state", _nmt),
    ("heartbeat", _heartbeat),
    ("statusword", _status),
    ("error register", _register),
    ("error code", lambda one: _error(one.error_code)),
    ("must stand there", _standing),
    ("a run will set", _unset),
)


def _objects(node: NodeFound) -> Text:
    head = f"{node.name} (node {node.node}): what a run will set before it arms\n"
    text = arming.refusal(node.unset).replace("wanted", "to be").replace("got", "is")
    return Text.assemble((head, "bold"), text.replace("\n", "\n  ").join(("  ", "\n")))


def drawn_line(line: LineFound, at: float) -> list[Table | Text]:
    """A line with a row a unit."""
    kind = "Modbus TCP" if line.kind == "tcp" else "Modbus RTU"
    head = Text.assemble((f"line {line.name}  ", "bold cyan"), f"{kind} at {line.address}")
    if line.trouble:
        return [head.append(f"\n  {line.trouble}", BAD), Text("")]
    table = Table(box=None, header_style=NOTE, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("  unit", no_wrap=True)
    table.add_column("", style="bold", no_wrap=True, min_width=9)
    table.add_column("answered in", justify="right", no_wrap=True)
    table.add_column("age", justify="right", no_wrap=True)
    table.add_column("")
    for unit in line.units:
        took, age = Text("no answer", BAD), Text("-", NOTE)
        if unit.answers:
            took, age = Text(f"{1e3 * unit.took:.1f} ms"), Text(f"{at - unit.asked:.2f} s")
        table.add_row(f"  {unit.unit}", unit.name, took, age, _values(unit))
    return [head, table, Text("")]


def _values(unit: UnitFound) -> Table | Text:
    """Name and value side by side, never cut between number and unit."""
    if not unit.answers:
        return Text(unit.trouble, BAD)
    if unit.told:
        return Text("is told by a run, not read", NOTE)
    return valued(unit.values)


def valued(values: tuple[ValueFound, ...]) -> Table:
    """Values in a row, each with its name and unit."""
    table = Table.grid(padding=(0, 3, 0, 0))
    cells = []
    for value in values:
        table.add_column(no_wrap=True, overflow="fold")
        digits = ".0f" if value.unit == "count" else ".4g"
        number = f"{value.value:{digits}}" + (f" {value.unit}" if value.unit != "flag" else "")
        style = "" if value.believed else BAD
        cells.append(Text.assemble((f"{value.name} ", NOTE), (number, style)))
    table.add_row(*cells)
    return table


def verdict(trouble: tuple[str, ...]) -> Text:
    """What it all comes to."""
    if not trouble:
        return Text("All answer, and what must stand in them does.", "bold green")
    head = "One thing is wrong:" if len(trouble) == 1 else f"{len(trouble)} things are wrong:"
    return Text("\n  ".join((head, *trouble)), "bold red")
