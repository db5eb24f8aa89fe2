"""`rig optimum FILE`."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rig.campaign.derived_file import derived_name, derived_text
from rig.cli.input_files import CAMPAIGNS, input_file
from rig.cli.options import Json
from rig.cli.output import FAILED, STOPPED, fail, input_errors, print_result
from rig.cli.sweep import compile_loop
from rig.config.problems import display_path, error_text
from rig.presentation.console import plain_table, table_console, whole_table
from rig.presentation.json_values import json_value
from rig.presentation.phrases import format_power
from rig.stations import find, shown
from rig.sweeps.campaigns import LEAD_IN, CampaignTasks
from rig.sweeps.executors import available_processors
from rig.sweeps.optimum import Optimum, Search, open_search, rejection, search
from rig.sweeps.sweep import open_tasks

EXIT_CODES = """\
Exit codes: 0 found, and the campaign is written; 1 no row can be the best, or the campaign could \
not be written; 2 bad input; 3 interrupted."""
_MARK = "Written by rig optimum"


def command(
    campaign: Annotated[
        Path, typer.Argument(metavar="FILE", help="Campaign whose matrix varies the gains.")
    ],
    best: Annotated[
        list[str] | None,
        typer.Option(
            "--for",
            help="Station whose power to maximise, by id or label; repeatable (default: all).",
        ),
    ] = None,
    lead_in: Annotated[
        float,
        typer.Option(
            "--lead-in", min=5, max=3600, help="Waves before each row, s; more until it settles."
        ),
    ] = LEAD_IN,
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", min=1, max=1024, help="Threads (default: one per core)."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Campaign to write (default: NAME_optimum.yaml here)."),
    ] = None,
    as_json: Json = False,
) -> int:
    """Find the best set points of a campaign on its simulated plant, for each power station.

    The search starts from the matrix and varies the columns of the control
    law that the matrix varies, within the ranges of the law. It writes a
    campaign of the best row for the first station given (without: the last
    of the rig), of rows around it, and of the best rows for the others.
    """
    with input_errors("optimum", as_json=as_json):
        path = input_file(campaign, CAMPAIGNS)
        if not math.isfinite(lead_in):
            raise ValueError(f"--lead-in {lead_in}: allowed 5 .. 3600 s")
        tasks = open_tasks(path, sequential=False, lead_in=lead_in)
        if not isinstance(tasks, CampaignTasks):
            raise ValueError(f"{path}: a session has no gain matrix; name a campaign")
        opened = open_search(tasks, path, jobs or available_processors())
        stations = [find(opened.task.contents.stations, name) for name in best or ()]
        stations = stations or [*reversed(shown(opened.task.contents.stations))]
        written = output or Path(f"{_name(opened)}.yaml")
        _check_output(written, path)
    try:
        compile_loop(opened.task.simulator)
        found = search(opened, stations, _progress(quiet=as_json))
        around = opened.around([found[0].values[column.name] for column in opened.columns])
        rows = opened.simulate(around, lambda count: None)
        around = around[[not rejection(row) for row in rows]]
        written.write_text(_campaign_text(path, written, opened, found, around), encoding="utf-8")
    except KeyboardInterrupt:
        return fail("optimum", RuntimeError("interrupted"), as_json=as_json, code=STOPPED)
    except (OSError, ValueError, ArithmeticError) as error:
        return fail("optimum", RuntimeError(error_text(error)), as_json=as_json, code=FAILED)
    return print_result(
        {"campaign": display_path(path), "simulated_rows": len(opened.rows),
         "rejected": opened.rejected,
         "optima": [_as_dict(each) for each in found]},
        _text(opened, found), [written], as_json=as_json,
    )  # fmt: skip


def _check_output(path: Path, base: Path) -> None:
    """Raise ValueError unless the campaign may be written to ``path``, and extend ``base``."""
    if path.suffix != ".yaml":
        raise ValueError(f"--output {path}: a campaign is YAML; give a name ending in .yaml")
    if not path.parent.is_dir():
        raise ValueError(f"--output {path}: there is no folder {path.parent}; make it first")
    if path.exists() and path.samefile(base):
        raise ValueError(f"--output {path}: is the campaign itself; name another file")
    if path.is_dir() or (path.exists() and not path.read_text("utf-8").startswith(f"# {_MARK}")):
        raise ValueError(f"--output {path}: exists and is not of this command; name another file")


def _name(opened: Search) -> str:
    return derived_name(opened.task.name, "_optimum")


def _progress(*, quiet: bool) -> Any:
    terminal = sys.stderr.isatty() and not quiet

    def show(count: int) -> None:
        if terminal:
            print(f"\r{count} rows simulated", end="", file=sys.stderr, flush=True)

    return show


def _as_dict(optimum: Optimum) -> dict[str, Any]:
    return {
        "station": optimum.station.name,
        "power_w": optimum.power,
        "values": optimum.values,
        "at_limit": list(optimum.at_limit),
        "far": list(optimum.far),
        "row": json_value(optimum.row),
    }


def _text(opened: Search, found: Sequence[Optimum]) -> str:
    stations = shown(opened.task.contents.stations)
    settings = (f">{column.label} {column.unit}" for column in opened.columns)
    powers = (f">{station.heading}" for station in stations)
    title = f"Best set points by {len(opened.rows)} simulated rows (negative is absorbed)"
    table = plain_table("for", *settings, *powers, "", title=title, title_justify="left")
    for each in found:
        limits = f"at the end of {', '.join(each.at_limit)}" if each.at_limit else ""
        if each.far:
            limits = f"far from the matrix in {', '.join(each.far)}: search again from here"
        table.add_row(
            each.station.label,
            *(f"{each.values[column.name]:.4g}" for column in opened.columns),
            *(format_power(each.row[f"power_{station.name}"]) for station in stations),
            limits,
        )
    console = table_console()
    with console.capture() as capture:
        console.print(whole_table(table), soft_wrap=True)
    rejected = [
        f"{n} row{'s' if n > 1 else ''} cannot be the best: {reason}"
        for reason, n in opened.rejected.items()
    ]
    return "\n".join([capture.get().rstrip(), *rejected])


def _campaign_text(
    base: Path, path: Path, opened: Search, found: Sequence[Optimum], around: np.ndarray
) -> str:
    """Return the campaign of the rows to run: the base's, with another matrix."""
    first = found[0]
    best = tuple(first.values[column.name] for column in opened.columns)
    reasons = {best: f"best for {first.station.heading}"}
    for point in around.tolist():
        reasons.setdefault(tuple(point), "around it")
    for other in found[1:]:
        values = tuple(other.values[column.name] for column in opened.columns)
        reasons.setdefault(values, f"best for {other.station.heading}")
    campaign = opened.task.campaign
    names = {column.name: column.key for column in campaign.file.columns()}
    fixed = campaign.points[0].values
    searched = [column.name for column in opened.columns]
    rows = []
    for values, reason in reasons.items():
        row = fixed | dict(zip(searched, values, strict=True))
        power = opened.rows.get(values, {}).get(f"power_{first.station.name}")
        shown_power = "" if power is None else f", {first.station.heading} {power:.3g} W"
        columns = {names[name]: float(f"{value:.6g}") for name, value in row.items()}
        rows.append((columns, f"{reason}{shown_power}"))
    header = (
        f"{_MARK} from {display_path(base)}: {len(opened.rows)} simulated rows.",
        f"Sea: {campaign.file.sea.description()}",
    )
    return derived_text(base, path, header, (f"name: {_name(opened)}", "repeat: 1"), rows)
