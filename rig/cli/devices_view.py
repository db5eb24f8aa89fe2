"""Output of `rig devices`, for people and for programs."""

import math
from collections.abc import Callable
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from drivers.canopen import arming, emcy, statusword
from drivers.canopen.heartbeat import NmtState
from rig.wires.can_survey import BusSurvey, NodeSurvey, RigSurvey, error_register_text
from rig.wires.line_survey import LineSurvey, SurveyedValue, UnitSurvey
from rig.wires.listen import BusActivity

BAD_STYLE, NOTE_STYLE = "bold red", "dim"


def as_dict(rig: str, survey: RigSurvey) -> dict[str, Any]:
    """Return the survey as JSON values; null for a value that no device sent."""
    can = survey.can
    return {
        "status": "trouble" if survey.trouble else "ok",
        "rig": rig,
        "trouble": list(survey.trouble),
        "can": {
            "interface": can.bus.interface,
            "channel": can.bus.channel,
            "bit_rate": can.bus.bit_rate,
            "planned_load": can.load,
            "trouble": can.trouble,
            "nodes": [_node_as_dict(node) for node in can.nodes],
            "unlisted_nodes": list(can.unexpected_nodes),
        },
        "lines": [line_as_dict(line, survey.at) for line in survey.lines],
    }


def _node_as_dict(node: NodeSurvey) -> dict[str, Any]:
    code, status = node.error_code, node.statusword
    return {
        "name": node.name,
        "node": node.node,
        "answers": node.answers,
        "identity": node.identity._asdict(),
        "nmt": None if node.nmt is None else NmtState(node.nmt).name,
        "heartbeat_age": node.heartbeat_age,
        "heartbeat_every": node.heartbeat_every,
        "error_code": code,
        "error_text": emcy.meaning(code) if code else None if code is None else "none",
        "statusword": status,
        "status_text": None if status is None else statusword.describe(status),
        "emergency": node.emergency,
        "checked": node.checked,
        "wrong": [_mismatch_as_dict(mismatch) for mismatch in node.wrong],
        "unset": [_mismatch_as_dict(mismatch) for mismatch in node.unset],
        "trouble": list(node.trouble),
    }


def _mismatch_as_dict(mismatch: arming.Mismatch) -> dict[str, Any]:
    return {
        "object": mismatch.object,
        "sub": mismatch.sub,
        "name": mismatch.name,
        "expected": mismatch.expected,
        "actual": mismatch.actual,
    }


def line_as_dict(line: LineSurvey, at: float) -> dict[str, Any]:
    """Return a line and its units as JSON values; ``at``: time of the survey, monotonic (s)."""
    return {
        "name": line.name,
        "kind": line.kind,
        "address": line.address,
        "trouble": line.trouble,
        "units": [_unit_as_dict(unit, at) for unit in line.units],
    }


def _unit_as_dict(unit: UnitSurvey, at: float) -> dict[str, Any]:
    return {
        "name": unit.name,
        "unit": unit.unit,
        "registers": unit.registers,
        "answers": unit.answers,
        "answered_in_s": unit.took,
        "age": at - unit.request_time if unit.answers else None,
        "written_by_run": unit.written,
        "values": [value_as_dict(value) for value in unit.values],
        "trouble": unit.trouble,
    }


def value_as_dict(value: SurveyedValue) -> dict[str, Any]:
    """Return a value as JSON values; null where it is not finite."""
    return {
        "name": value.name,
        "value": value.value if math.isfinite(value.value) else None,
        "unit": value.unit,
        "plausible": value.plausible,
    }


def render(rig: str, survey: RigSurvey, *, all_objects: bool) -> Group:
    """Draw the bus with a column per node, the lines with a row per unit, and the verdict."""
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), ": devices on its wires\n")]
    parts += [_bus_text(survey.can)]
    if not survey.can.trouble:
        parts.append(_node_table(survey.can))
        if survey.can.unexpected_nodes:
            numbers = ", ".join(map(str, survey.can.unexpected_nodes))
            parts.append(Text(f"\nalso on the bus, not in the rig file: node {numbers}", "yellow"))
    parts.append(Text(""))
    parts += [part for line in survey.lines for part in render_line(line, survey.at)]
    if all_objects:
        parts += [_unset_objects_text(node) for node in survey.can.nodes if node.unset]
    parts.append(render_verdict(survey.trouble))
    return Group(*parts)


def heard_as_dict(rig: str, heard: BusActivity) -> dict[str, Any]:
    """Return the nodes heard without sending as JSON values."""
    nodes = [
        {
            "name": node.name,
            "node": node.node,
            "sends": node.sends,
            "nmt": None if node.nmt is None else NmtState(node.nmt).name,
            "heartbeat_age": node.heartbeat_age,
            "emergency": node.emergency,
        }
        for node in heard.nodes
    ]
    return {
        "status": "trouble" if heard.trouble else "ok",
        "rig": rig,
        "listened_only": True,
        "trouble": list(heard.trouble),
        "can": {"nodes": nodes, "unlisted_nodes": list(heard.unexpected_nodes)},
    }


def render_heard(rig: str, heard: BusActivity) -> Group:
    """Draw a row per node heard without sending, and the verdict."""
    title = Text.assemble(
        (rig, "bold"), ": devices that send by themselves; this command sent nothing\n"
    )
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
    for name in ("node", "", "state", "heartbeat", "emergency"):
        table.add_column(name)
    for node in heard.nodes:
        age = "none" if node.heartbeat_age is None else f"{1e3 * node.heartbeat_age:.0f} ms ago"
        state = "-" if node.nmt is None else NmtState(node.nmt).name.lower().replace("_", "-")
        code = emcy.meaning(node.emergency) if node.emergency else "none"
        table.add_row(str(node.node), node.name, state, age, code)
    parts: list[Table | Text] = [title, table] if heard.nodes else [title]
    if heard.unexpected_nodes:
        numbers = ", ".join(map(str, heard.unexpected_nodes))
        parts.append(Text(f"\nalso on the bus, not in the rig file: node {numbers}", "yellow"))
    return Group(*parts, Text(""), render_verdict(heard.trouble))


def _bus_text(can: BusSurvey) -> Text:
    bus = can.bus
    text_line = (
        f"{bus.interface} {bus.channel}, {bus.bit_rate / 1e3:g} kbit/s, "
        f"{100 * can.load:.0f} % full while a campaign runs"
    )
    text = Text.assemble(("CAN  ", "bold cyan"), text_line)
    return text.append(f"\n  {can.trouble}", BAD_STYLE) if can.trouble else text


def _node_table(can: BusSurvey) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0), expand=True)
    table.add_column("", width=18, style="dim")
    for node in can.nodes:
        table.add_column(f"node {node.node}: {node.name}", ratio=1, overflow="fold")
    for name, text_of in _ROWS:
        table.add_row(
            f"  {name}",
            *(
                text_of(node) if node.answers or name == "answers" else Text("")
                for node in can.nodes
            ),
        )
    return table


def _text_or_dash(value: str | None) -> Text:
    return Text("-", NOTE_STYLE) if value is None else Text(value)


def _hex_text(value: int | None) -> Text:
    return _text_or_dash(None if value is None else f"{value:#010x}")


def _nmt_text(node: NodeSurvey) -> Text:
    if node.nmt is None:
        return Text("not known: no heartbeat", NOTE_STYLE)
    return Text(NmtState(node.nmt).name.lower().replace("_", "-"))


def _heartbeat_text(node: NodeSurvey) -> Text:
    if node.heartbeat_age is not None:
        interval = f" (every {node.heartbeat_every:g} s)" if node.heartbeat_every else ""
        return Text(f"{node.heartbeat_age:.2f} s ago{interval}")
    return (
        Text("none received", BAD_STYLE)
        if node.heartbeat_every
        else Text("off until a run", NOTE_STYLE)
    )


def _status_text(node: NodeSurvey) -> Text:
    if node.statusword is None:
        return Text("-", BAD_STYLE)
    bad = statusword.decode(node.statusword) in (statusword.FAULT, statusword.FAULT_REACTION)
    return Text(statusword.describe(node.statusword), BAD_STYLE if bad else "")


def _error_register_text(node: NodeSurvey) -> Text:
    value = node.identity.error_register
    if not value:
        return _text_or_dash("clear" if value == 0 else None)
    text = f"{value:#04x} {error_register_text(value)}"
    if node.waits_for_master:
        return Text(f"{text}: no heartbeat of its master", "yellow")
    return Text(text, BAD_STYLE)


def _error_code_text(code: int | None) -> Text:
    if not code:
        return _text_or_dash("none" if code == 0 else None)
    return Text(f"{code:#06x} {emcy.meaning(code)}", BAD_STYLE)


def _settings_text(node: NodeSurvey) -> Text:
    if not node.wrong:
        return Text("all correct", "green")
    return Text("\n".join(f"not {mismatch.name}" for mismatch in node.wrong), BAD_STYLE)


def _unset_text(node: NodeSurvey) -> Text:
    return Text(
        f"{len(node.unset)} of {node.checked} objects" if node.unset else "nothing", NOTE_STYLE
    )


# Label and text function of each row of the node table.
_ROWS: tuple[tuple[str, Callable[[NodeSurvey], Text]], ...] = (
    ("answers", lambda node: Text("yes", "green") if node.answers else Text("no", BAD_STYLE)),
    ("device name", lambda node: _text_or_dash(node.identity.name)),
    ("device type", lambda node: _hex_text(node.identity.device_type)),
    ("vendor", lambda node: _hex_text(node.identity.vendor)),
    ("product", lambda node: _hex_text(node.identity.product)),
    ("revision", lambda node: _hex_text(node.identity.revision)),
    ("NMT state", _nmt_text),
    ("heartbeat", _heartbeat_text),
    ("statusword", _status_text),
    ("error register", _error_register_text),
    ("error code", lambda node: _error_code_text(node.error_code)),
    ("fixed settings", _settings_text),
    ("a run will set", _unset_text),
)


def _unset_objects_text(node: NodeSurvey) -> Text:
    heading = f"{node.name} (node {node.node}): objects that a run will set before it arms\n"
    return Text.assemble((heading, "bold"), *map(_unset_object_text, node.unset))


def _unset_object_text(mismatch: arming.Mismatch) -> str:
    actual = "no answer" if mismatch.actual is None else f"is {_count_text(mismatch.actual)}"
    index = f"{mismatch.object:#06x}:{mismatch.sub:02x}"
    return f"  {index} {mismatch.name}: set to {_count_text(mismatch.expected)}, {actual}\n"


def _count_text(value: int) -> str:
    return f"{value}" if -1000 < value < 1000 else f"{value} ({value:#x})"


def render_line(line: LineSurvey, at: float) -> list[Table | Text]:
    """Draw a line with a row per unit; ``at``: time of the survey, monotonic (s)."""
    kind = "Modbus TCP" if line.kind == "tcp" else "Modbus RTU"
    head = Text.assemble((f"line {line.name}  ", "bold cyan"), f"{kind} at {line.address}")
    if line.trouble:
        return [head.append(f"\n  {line.trouble}", BAD_STYLE), Text("")]
    table = Table(box=None, header_style=NOTE_STYLE, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("  unit", no_wrap=True)
    table.add_column("", style="bold", no_wrap=True, min_width=9)
    table.add_column("answered in", justify="right", no_wrap=True)
    table.add_column("age", justify="right", no_wrap=True)
    table.add_column("")
    for unit in line.units:
        took, age = Text("no answer", BAD_STYLE), Text("-", NOTE_STYLE)
        if unit.answers:
            took, age = Text(f"{1e3 * unit.took:.1f} ms"), Text(f"{at - unit.request_time:.2f} s")
        table.add_row(f"  {unit.unit}", unit.name, took, age, _unit_values(unit))
    return [head, table, Text("")]


def _unit_values(unit: UnitSurvey) -> Table | Text:
    """Draw names and values in columns; a number and its unit stay on one line."""
    if not unit.answers:
        return Text(unit.trouble, BAD_STYLE)
    if unit.written:
        return Text("written by a run, not read", NOTE_STYLE)
    return render_values(unit.values)


def render_values(values: tuple[SurveyedValue, ...]) -> Table:
    """Draw values in one row, each with its name and unit."""
    table = Table.grid(padding=(0, 3, 0, 0))
    cells = []
    for value in values:
        table.add_column(no_wrap=True, overflow="fold")
        digits = ".0f" if value.unit == "count" else ".4g"
        number = f"{value.value:{digits}}" + (f" {value.unit}" if value.unit != "flag" else "")
        style = "" if value.plausible else BAD_STYLE
        cells.append(Text.assemble((f"{value.name} ", NOTE_STYLE), (number, style)))
    table.add_row(*cells)
    return table


def render_verdict(trouble: tuple[str, ...]) -> Text:
    """Draw the verdict: all correct, or the list of troubles."""
    if not trouble:
        return Text("All devices answer, and their settings are correct.", "bold green")
    head = "One thing is wrong:" if len(trouble) == 1 else f"{len(trouble)} things are wrong:"
    return Text("\n  ".join((head, *trouble)), "bold red")
