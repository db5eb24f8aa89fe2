"""`rig devices RIG`."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Group
from rich.table import Table
from rich.text import Text

from drivers.canopen.heartbeat import NmtState
from drivers.cia402 import error_codes, statusword
from drivers.cia402.arming import Mismatch
from rig.cli.input_files import RIGS, input_file
from rig.cli.options import WIRED_RIG_HELP, Json
from rig.cli.output import FAILED, OK, fail, input_errors, print_json, waiting
from rig.kinds.rig_file import load_rig
from rig.presentation.console import plain_table, table_console
from rig.presentation.json_values import json_value
from rig.processes import wire_locks
from rig.recording.runs.create import BusyError
from rig.wires.scan import BusActivity, listen
from rig.wires.segment_survey import SegmentSurvey, SlaveSurvey
from rig.wires.survey import (
    BusSurvey,
    LineSurvey,
    NodeSurvey,
    RigSurvey,
    StreamSurvey,
    SurveyedValue,
    UnitSurvey,
    error_register_text,
    survey,
)

EXIT_CODES = """\
Exit codes: 0 all devices answer and agree with the rig file; 1 a device does not, or one of the \
rig's wires is in use; 2 bad input."""
_SURVEYING = "surveying the rig's wires ..."


def command(
    path: Annotated[Path, typer.Argument(metavar="RIG", help=WIRED_RIG_HELP)],
    objects: Annotated[
        bool, typer.Option("--objects", help="Also list every object that a run will set.")
    ] = False,
    only_listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; works while a run uses the rig.")
    ] = False,
    as_json: Json = False,
) -> int:
    """List the devices that answer on a rig's wires, and check their settings. It only reads."""
    with input_errors("devices", as_json=as_json):
        rig, _, kind = load_rig(input_file(path, RIGS))
        job = kind.room("hardware.job").build_job(rig)
    console = table_console()
    if only_listen:
        with waiting(console, _SURVEYING, quiet=as_json):
            heard = listen(rig)
        data, rendered = heard_as_dict(rig.name, heard), render_heard(rig.name, heard)
    else:
        try:
            with (
                wire_locks.acquire(wire_locks.wires_in(rig), "rig devices"),
                waiting(console, _SURVEYING, quiet=as_json),
            ):
                found = survey(job)
        except BusyError as error:
            text = str(error)
            if rig.wiring is not None and rig.wiring.can_bus() is not None:
                text += "\n--listen sends nothing: it shows what nodes on the CAN bus send"
            return fail("devices", RuntimeError(text), as_json=as_json, code=FAILED)
        data = as_dict(rig.name, found)
        rendered = render(rig.name, found, all_objects=objects)
    if as_json:
        print_json(data)
    else:
        console.print(rendered)
    return FAILED if data["trouble"] else OK


BAD_STYLE, NOTE_STYLE = "bold red", "dim"


def as_dict(rig: str, survey: RigSurvey) -> dict[str, Any]:
    """Return the survey as JSON values; null for a value that no device sent."""
    wires = {key: value for key, value in json_value(survey).items() if value is not None}
    if survey.can is not None:
        wires["can"]["nodes"] = [_node_as_dict(node) for node in survey.can.nodes]
    return {**_head_as_dict(rig, survey.trouble), **wires}


def heard_as_dict(rig: str, heard: BusActivity) -> dict[str, Any]:
    """Return the nodes heard without sending as JSON values."""
    nodes = [{**json_value(node), "nmt": _nmt_name(node.nmt)} for node in heard.nodes]
    can = {"nodes": nodes, "unlisted_nodes": list(heard.unlisted_nodes)}
    return {**_head_as_dict(rig, heard.trouble), "listened_only": True, "can": can}


def _head_as_dict(rig: str, trouble: tuple[str, ...]) -> dict[str, Any]:
    return {"status": "trouble" if trouble else "ok", "rig": rig, "trouble": list(trouble)}


def _node_as_dict(node: NodeSurvey) -> dict[str, Any]:
    code, status = node.error_code, node.statusword
    return {
        **json_value(node),
        "nmt": _nmt_name(node.nmt),
        "error_text": error_codes.meaning(code) if code else None if code is None else "none",
        "status_text": None if status is None else statusword.describe(status),
    }


def _nmt_name(state: int | None) -> str | None:
    return None if state is None else NmtState(state).name


def render(rig: str, survey: RigSurvey, *, all_objects: bool) -> Group:
    """Draw the bus with a column per node, devices of own wires, lines, and the verdict."""
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), ": devices on its wires\n")]
    nodes = survey.can.nodes if survey.can is not None else ()
    if survey.can is not None:
        parts.append(_bus_text(survey.can))
        if not survey.can.trouble:
            parts += [_node_table(nodes), *_unlisted_text(survey.can.unlisted_nodes)]
        parts.append(Text(""))
    if survey.ethercat is not None:
        parts += _render_segment(survey.ethercat)
    for stream in survey.streams:
        parts += _render_stream(stream)
    for line in survey.lines:
        parts += _render_line(line)
    if all_objects:
        parts += [
            _unset_objects_text(f"{node.name} (node {node.node})", node.unset)
            for node in nodes
            if node.unset
        ]
        slaves = survey.ethercat.slaves if survey.ethercat is not None else ()
        parts += [
            _unset_objects_text(f"{slave.name} (slave {slave.place})", slave.unset)
            for slave in slaves
            if slave.unset
        ]
    return Group(*parts, _render_verdict(survey.trouble))


def render_heard(rig: str, heard: BusActivity) -> Group:
    """Draw a row per node heard without sending, and the verdict."""
    text = ": devices that send by themselves; this command sent nothing\n"
    parts: list[Table | Text] = [Text.assemble((rig, "bold"), text)]
    table = plain_table("node", "", "state", "heartbeat", "emergency…", padding=(0, 2, 0, 0))
    for node in heard.nodes:
        age = "none" if node.heartbeat_age is None else f"{1e3 * node.heartbeat_age:.0f} ms ago"
        code = error_codes.meaning(node.emergency) if node.emergency else "none"
        table.add_row(str(node.node), node.name, _nmt_label(node.nmt) or "-", age, code)
    if heard.nodes:
        parts.append(table)
    parts += _unlisted_text(heard.unlisted_nodes)
    return Group(*parts, Text(""), _render_verdict(heard.trouble))


def _unlisted_text(nodes: tuple[int, ...]) -> list[Text]:
    if not nodes:
        return []
    numbers = ", ".join(map(str, nodes))
    return [Text(f"\nalso on the bus, not in the rig file: node {numbers}", "yellow")]


def _nmt_label(state: int | None) -> str:
    return "" if state is None else NmtState(state).name.lower().replace("_", "-")


def _bus_text(can: BusSurvey) -> Text:
    text_line = (
        f"{can.interface} {can.channel}, {can.bit_rate / 1e3:g} kbit/s, "
        f"{100 * can.planned_load:.0f} % full while a campaign runs"
    )
    text = Text.assemble(("CAN  ", "bold cyan"), text_line)
    return text.append(f"\n  {can.trouble}", BAD_STYLE) if can.trouble else text


def _node_table(nodes: tuple[NodeSurvey, ...]) -> Table:
    table = plain_table(padding=(0, 2, 0, 0), expand=True)
    table.add_column("", width=18, style="dim")
    for node in nodes:
        table.add_column(f"node {node.node}: {node.name}", ratio=1, overflow="fold")
    for name, text_of in _ROWS:
        table.add_row(
            f"  {name}",
            *(text_of(node) if node.answers or name == "answers" else Text("") for node in nodes),
        )
    return table


def _text_or_dash(value: str | None) -> Text:
    return Text("-", NOTE_STYLE) if value is None else Text(value)


def _hex_text(value: int | None) -> Text:
    return _text_or_dash(None if value is None else f"{value:#010x}")


def _nmt_text(node: NodeSurvey) -> Text:
    if node.nmt is None:
        return Text("not known: no heartbeat", NOTE_STYLE)
    return Text(_nmt_label(node.nmt))


def _heartbeat_text(node: NodeSurvey) -> Text:
    every = node.heartbeat_every
    if node.heartbeat_age is not None:
        return Text(f"{node.heartbeat_age:.2f} s ago" + (f" (every {every:g} s)" if every else ""))
    return Text("none received", BAD_STYLE) if every else Text("off until a run", NOTE_STYLE)


def _status_text(node: NodeSurvey) -> Text:
    if node.statusword is None:
        return Text("-", BAD_STYLE)
    return _statusword_text(node.statusword)


def _state_text(status: int) -> Text:
    state = statusword.decode(status)
    bad = state in (statusword.FAULT, statusword.FAULT_REACTION)
    text = statusword.describe(status).split(",")[0].partition(" ")[2]  # without the number
    return Text(text, BAD_STYLE if bad else "")


def _statusword_text(status: int) -> Text:
    bad = statusword.decode(status) in (statusword.FAULT, statusword.FAULT_REACTION)
    return Text(statusword.describe(status), BAD_STYLE if bad else "")


def _error_register_text(node: NodeSurvey) -> Text:
    value = node.identity.error_register
    if not value:
        return _text_or_dash("clear" if value == 0 else None)
    text = f"{value:#04x} {error_register_text(value)}"
    if node.waits_for_master:
        return Text(f"{text}: no heartbeat of its master", "yellow")
    return Text(text, BAD_STYLE)


def _error_code_text(node: NodeSurvey) -> Text:
    code = node.error_code
    if not code:
        return _text_or_dash("none" if code == 0 else None)
    return Text(f"{code:#06x} {error_codes.meaning(code)}", BAD_STYLE)


def _settings_text(node: NodeSurvey) -> Text:
    if not node.wrong:
        return Text("all correct", "green")
    return Text("\n".join(f"not {mismatch.name}" for mismatch in node.wrong), BAD_STYLE)


def _unset_text(node: NodeSurvey) -> Text:
    count = f"{len(node.unset)} of {node.checked} objects"
    return Text(count if node.unset else "nothing", NOTE_STYLE)


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
    ("error code", _error_code_text),
    ("fixed settings", _settings_text),
    ("a run will set", _unset_text),
)


def _unset_objects_text(device: str, unset: tuple[Mismatch, ...]) -> Text:
    text = Text.assemble((f"{device}: objects that a run will set before it arms\n", "bold"))
    for each in unset:
        actual = "no answer" if each.actual is None else f"is {_count_text(each.actual)}"
        index, expected = f"{each.object:#06x}:{each.sub:02x}", _count_text(each.expected)
        text.append(f"  {index} {each.name}: set to {expected}, {actual}\n")
    return text


def _count_text(value: int) -> str:
    return f"{value}" if -1000 < value < 1000 else f"{value} ({value:#x})"


def _render_segment(segment: SegmentSurvey) -> list[Table | Text]:
    """Draw a segment with a row per slave, in the order of the line."""
    head = Text.assemble(("EtherCAT  ", "bold cyan"), f"on {segment.interface}")
    for line in (text for each in segment.trouble for text in each.splitlines()):
        head.append(f"\n  {line}", BAD_STYLE)
    if not segment.slaves:
        return [head, Text("")]
    headings = (">slave", "", "device", "product", "settings", "state…")
    table = plain_table(*headings, header_style=NOTE_STYLE, padding=(0, 2, 0, 0))
    table.columns[1].style = "bold"
    for one in segment.slaves:
        state = Text("") if one.statusword is None else _state_text(one.statusword)
        table.add_row(
            str(one.place),
            one.name,
            Text(one.device),
            f"{one.product:#x}",
            _slave_settings_text(one),
            state,
        )
    return [head, table, Text("")]


def _slave_settings_text(slave: SlaveSurvey) -> Text:
    if slave.wrong:
        return Text("\n".join(f"not {mismatch.name}" for mismatch in slave.wrong), BAD_STYLE)
    if not slave.checked:
        return Text("-", NOTE_STYLE)
    unset = f", {len(slave.unset)} to set" if slave.unset else ""
    return Text.assemble(("correct", "green"), (unset, NOTE_STYLE))


def _render_stream(stream: StreamSurvey) -> list[Table | Text]:
    """Draw a device that has a wire of its own."""
    head = Text.assemble((f"{stream.name}  ", "bold cyan"), f"at {stream.address}")
    if not stream.answers:
        return [head.append(f"\n  {stream.trouble}", BAD_STYLE), Text("")]
    table = Table.grid(padding=(0, 2, 0, 0))
    age = Text("") if stream.age is None else Text(f"{1e3 * stream.age:.0f} ms", NOTE_STYLE)
    table.add_row(Text("  "), Text(stream.identity), age, _render_values(stream.values))
    return [head, table, Text("")]


def _render_line(line: LineSurvey) -> list[Table | Text]:
    """Draw a line with a row per unit."""
    kind = "Modbus TCP" if line.kind == "tcp" else "Modbus RTU"
    head = Text.assemble((f"line {line.name}  ", "bold cyan"), f"{kind} at {line.address}")
    if line.trouble:
        return [head.append(f"\n  {line.trouble}", BAD_STYLE), Text("")]
    headings = ("  unit", "", ">answered in", ">age", "…")
    table = plain_table(*headings, header_style=NOTE_STYLE, padding=(0, 2, 0, 0))
    table.columns[1].style, table.columns[1].min_width = "bold", 9
    for unit in line.units:
        took, age = Text("no answer", BAD_STYLE), Text("-", NOTE_STYLE)
        if unit.age is not None:
            took, age = Text(f"{1e3 * unit.answered_in_s:.1f} ms"), Text(f"{unit.age:.2f} s")
        table.add_row(f"  {unit.unit}", unit.name, took, age, _unit_values(unit))
    return [head, table, Text("")]


def _unit_values(unit: UnitSurvey) -> Table | Text:
    """Draw names and values in columns; a number and its unit stay on one line."""
    if not unit.answers:
        return Text(unit.trouble, BAD_STYLE)
    if unit.written_by_run:
        return Text("written by a run, not read", NOTE_STYLE)
    return _render_values(unit.values)


def _render_values(values: tuple[SurveyedValue, ...]) -> Table:
    """Draw values in one row, each with its name and unit."""
    table = Table.grid(padding=(0, 3, 0, 0))
    cells = []
    for value in values:
        table.add_column(no_wrap=True, overflow="fold")
        digits = ".0f" if value.unit == "count" else ".4g"
        unit = "" if value.unit in ("flag", "1") else f" {value.unit}"
        number = f"{value.value:{digits}}{unit}"
        style = "" if value.plausible else BAD_STYLE
        cells.append(Text.assemble((f"{value.name} ", NOTE_STYLE), (number, style)))
    table.add_row(*cells)
    return table


def _render_verdict(trouble: tuple[str, ...]) -> Text:
    """Draw the verdict: all correct, or the list of troubles."""
    if not trouble:
        return Text("All devices answer, and their settings are correct.", "bold green")
    head = "One thing is wrong:" if len(trouble) == 1 else f"{len(trouble)} things are wrong:"
    return Text("\n  ".join((head, *trouble)), "bold red")
