"""`rig replay RUN [--with CAMPAIGN]`."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rig.cli.errors import input_errors
from rig.cli.exit_codes import FAILED, OK
from rig.cli.find_run import find_run
from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import print_json
from rig.execution.replay import ReplayReport, replay
from rig.presentation.json_values import json_value

EXIT_CODES = """\
Exit codes: 0 today's cycle reproduces every command and mode to the bit (--with: every row \
completes); 1 it does not; 2 no such run or file, or one that cannot be replayed."""
_MAX_FIELDS = 40  # fields shown


class Waves(Enum):
    """Ways to recover the waves of a run (`rig.identification.incident_waves`)."""

    ELEVATION = "elevation"
    FORCES = "forces"


def command(
    run: Annotated[Path, typer.Argument(help="A run's folder or MCAP file, its id, or 'last'.")],
    runs: Runs = RUNS,
    as_json: Json = False,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--with", metavar="CAMPAIGN", help="Campaign whose rows to simulate in the run's waves."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="CAMPAIGN", help="With --with: campaign whose plant models the rig."
        ),
    ] = None,
    waves: Annotated[
        Waves | None,
        typer.Option("--waves", help="With --with: signal from which to recover the waves."),
    ] = None,
) -> int:
    """Replay a run's logged sensors through today's cycle; compare commands and modes per tick.

    With --with CAMPAIGN, the command predicts the power of the campaign's
    rows in the waves of the run, with a 95 % interval.
    """
    if campaign is None and (model is not None or waves is not None):
        raise typer.BadParameter("--model and --waves need --with")
    if campaign is not None:
        from rig.cli import replay_with  # numba

        return replay_with.main(
            run, runs, campaign, model, waves.value if waves else None, as_json=as_json
        )
    console = Console(stderr=True, highlight=False)
    with input_errors("replay", as_json=as_json):
        path = find_run(run, runs)
        if as_json or not console.is_terminal:
            comparison = replay(path)
        else:
            with console.status("replaying ...") as status:
                comparison = replay(
                    path, lambda ticks: status.update(f"replaying, {ticks} ticks ...")
                )
    if as_json:
        report = comparison._asdict() | {"same": comparison.identical}
        print_json(json_value(report))
    else:
        _print_report(comparison)
    return OK if comparison.identical else FAILED


def _print_report(comparison: ReplayReport) -> None:
    if comparison.notice:
        print(comparison.notice)
    for request in comparison.requests:
        print(f"tick {request.tick}: the log shows a request, {request.name}; applied again")
    if not comparison.finished:
        print("the record was not finished: ticks after its last one are not compared; "
              "`rig recover` lists what is missing")  # fmt: skip
    if comparison.absent:
        print(f"the run has no {', '.join(comparison.absent)}: not compared")
    compared = f"{comparison.fields} fields of {comparison.ticks} ticks"
    if comparison.identical:
        print(f"no diff: {compared} are the same to the bit")
        return
    first = comparison.differences[0]
    logged, replayed = _number_text(first.logged), _number_text(first.replayed)
    print(
        f"first difference in tick {first.first}: "
        f"{first.field} was {logged}, is {replayed} {first.unit}"
    )
    print(f"{len(comparison.differences)} of {compared} differ\n")
    print(f"{'field':<36} {'unit':<8} {'ticks':>8} {'first':>8} {'logged':>12} {'replayed':>12} "
          f"{'largest':>10}")  # fmt: skip
    for difference in comparison.differences[:_MAX_FIELDS]:
        logged, replayed = _number_text(difference.logged), _number_text(difference.replayed)
        largest = _number_text(difference.largest)
        print(
            f"{difference.field:<36} {difference.unit:<8} {difference.ticks:>8} "
            f"{difference.first:>8} {logged:>12} {replayed:>12} {largest:>10}"
        )
    if len(comparison.differences) > _MAX_FIELDS:
        print(f"and {len(comparison.differences) - _MAX_FIELDS} more fields; --json lists all")


def _number_text(value: float | None) -> str:
    return "no number" if value is None else f"{value:.6g}"
