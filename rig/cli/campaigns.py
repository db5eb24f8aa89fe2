"""`rig campaigns`: the shipped campaigns, bench sessions and rigs."""

import json
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from rig import cli
from rig.cli.console import table_console
from rig.config.problems import ConfigError
from rig.config.shipped_files import (
    CAMPAIGNS,
    RIGS,
    SESSIONS,
    ShippedFile,
    shipped_files,
    shipped_folder,
    title,
)
from rig.kinds.oswec_bench.sessions import check_session
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.campaign.check import format_duration

_HEADINGS = {
    CAMPAIGNS: "campaigns: rig run NAME, rig check NAME, rig sweep NAME",
    SESSIONS: "sessions of the bench: rig bench NAME, rig check NAME",
    RIGS: "rigs: --rig NAME; those with wiring also rig sim NAME, rig devices NAME",
}


def main(*, as_json: bool) -> int:
    """Print every shipped campaign, session and rig, and return the exit code."""
    described = {kind: [_describe(one) for one in shipped_files(kind)] for kind in _HEADINGS}
    if as_json:
        print(json.dumps({"folder": str(shipped_folder()), **described}, ensure_ascii=False))
        return cli.OK
    console = table_console()
    for kind, heading in _HEADINGS.items():
        console.print(Text(heading, style="bold"))
        console.print(_table(kind, described[kind]))
        console.print()
    print("rig copy NAME writes one and its input files into the current folder, for you to edit")
    return cli.OK


def _describe(shipped: ShippedFile) -> dict[str, Any]:
    """Return name, title, and what `rig check` finds: rows and duration, or a rig's wiring."""
    described = {
        "name": shipped.name,
        "title": title(shipped.path),
        "file": str(shipped.path),
        "problem": "",
    }
    try:
        return described | _FACTS[shipped.kind](shipped.path)
    except ConfigError as error:
        return described | {"problem": error.problems[0].text()}


def _campaign_facts(path: Path) -> dict[str, Any]:
    report = check_campaign(path)
    if report.campaign is None or report.plan is None:
        raise ConfigError(report.problems)
    return {
        "rig": report.campaign.rig.name,
        "rows": len(report.plan.rows),
        "duration_s": report.plan.duration,
    }


def _session_facts(path: Path) -> dict[str, Any]:
    report = check_session(path)
    if report.session is None or report.plan is None:
        raise ConfigError(report.problems)
    return {
        "rig": report.session.rig.name,
        "rows": len(report.plan.rows),
        "duration_s": report.plan.duration,
    }


def _rig_facts(path: Path) -> dict[str, Any]:
    rig, _, _ = load_rig(path)
    return {"rig": rig.name, "wired": rig.wiring is not None}


_FACTS = {CAMPAIGNS: _campaign_facts, SESSIONS: _session_facts, RIGS: _rig_facts}


def _table(kind: str, described: list[dict[str, Any]]) -> Table:
    table = Table(box=None, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("name", no_wrap=True)
    if kind == RIGS:
        table.add_column("wiring", no_wrap=True)
    else:
        table.add_column("rows", no_wrap=True, justify="right")
        table.add_column("duration", no_wrap=True)
    table.add_column("title", overflow="fold")
    for one in described:
        if one["problem"]:
            cells = ["-", "-"] if kind != RIGS else ["-"]
            table.add_row(one["name"], *cells, Text(one["problem"], style="red"))
            continue
        cells = (
            ["yes" if one["wired"] else "none"]
            if kind == RIGS
            else [str(one["rows"]), format_duration(round(one["duration_s"]))]
        )
        table.add_row(one["name"], *cells, Text(one["title"]))
    return table
