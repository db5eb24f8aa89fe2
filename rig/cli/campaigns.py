"""`rig campaigns`: the shipped campaigns, sessions, rigs, plants and tables of faults."""

from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from rig.cli.options import Json
from rig.cli.output import OK, print_json
from rig.config.problems import ConfigError
from rig.config.shipped_files import (
    CAMPAIGNS,
    FAULTS,
    PLANTS,
    RIGS,
    SESSIONS,
    ShippedFile,
    shipped_files,
    shipped_folder,
    title,
)
from rig.config.yaml_source import load_mapping
from rig.execution.fault_table import load_table
from rig.kinds.rig_file import kind_of_task, load_rig
from rig.presentation.console import plain_table, table_console
from rig.presentation.phrases import format_duration

_HEADINGS = {
    CAMPAIGNS: "campaigns: rig run NAME, rig check NAME, rig sweep NAME",
    SESSIONS: "sessions: rig run NAME, rig check NAME, rig sweep NAME",
    RIGS: "rigs: --rig NAME, in files rig: NAME; with wiring also rig sim NAME, rig devices NAME",
    PLANTS: "plants, simulated: in files plant: NAME",
    FAULTS: "tables of faults: rig faults NAME",
}


def command(as_json: Json = False) -> int:
    """List the shipped campaigns, sessions, rigs, plants and tables of faults."""
    described = {kind: [_describe(one) for one in shipped_files(kind)] for kind in _HEADINGS}
    if as_json:
        return print_json({"folder": str(shipped_folder()), **described})
    console = table_console()
    for kind, heading in _HEADINGS.items():
        console.print(Text(heading, style="bold"))
        console.print(_table(kind, described[kind]))
        console.print()
    print("rig copy NAME writes one and its input files into the current folder, for you to edit")
    return OK


def _describe(shipped: ShippedFile) -> dict[str, Any]:
    """Return name and title, of a task what `rig check` finds, and whether a rig has wiring."""
    described = {
        "name": shipped.name,
        "title": title(shipped.path),
        "file": str(shipped.path),
        "problem": "",
        "why": "",  # the same without its place in the file
    }
    try:
        return described | _FACTS[shipped.kind](shipped.path)
    except ConfigError as error:
        problem = error.problems[0]
        why = f"{problem.key}: {problem.message}" if problem.key else problem.message
        return described | {"problem": problem.text(), "why": why}


def _task_facts(path: Path) -> dict[str, Any]:
    report = kind_of_task(path).room("tasks").examine(path, predict=False)
    if report.problems:
        raise ConfigError(report.problems)
    return {
        "rig": report.checked.rig.name,
        "rows": len(report.plan.rows),
        "duration_s": report.plan.duration,
    }


def _rig_facts(path: Path) -> dict[str, Any]:
    rig, _, _ = load_rig(path)
    return {"rig": rig.name, "wired": rig.wiring is not None}


def _plant_facts(path: Path) -> dict[str, Any]:
    mapping, _ = load_mapping(path, kinds=(PLANTS,))
    return {"plant": mapping.get("name")}


def _fault_facts(path: Path) -> dict[str, Any]:
    table = load_table(path)
    return {"rig": table.kind.name, "rows": len(table.rows)}


_FACTS = {
    CAMPAIGNS: _task_facts,
    SESSIONS: _task_facts,
    RIGS: _rig_facts,
    PLANTS: _plant_facts,
    FAULTS: _fault_facts,
}
_COLUMNS = {RIGS: ("wiring",), PLANTS: (), FAULTS: (">rows",)}  # of others: rows and duration


def _table(kind: str, described: list[dict[str, Any]]) -> Table:
    facts = _COLUMNS.get(kind, (">rows", "duration"))
    table = plain_table("name", *facts, "title…", header_style="dim", padding=(0, 1, 0, 0))
    for one in described:
        if one["problem"]:
            table.add_row(
                one["name"],
                *"-" * len(facts),
                Text.assemble(one["title"], (f" ({one['why']})", "red")),
            )
            continue
        table.add_row(one["name"], *_cells(kind, one), Text(one["title"]))
    return table


def _cells(kind: str, one: dict[str, Any]) -> list[str]:
    """Return the facts about a file as the cells of its line."""
    if kind == PLANTS:
        return []
    if kind == RIGS:
        return ["yes" if one["wired"] else "none"]
    if kind == FAULTS:
        return [str(one["rows"])]
    return [str(one["rows"]), format_duration(round(one["duration_s"]))]
