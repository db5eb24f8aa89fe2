"""`rig replay RUN [--with CAMPAIGN]`."""

import json
import math
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from rig import cli

CODES = """\
Exit codes: 0 today's cycle decides what was decided then, to the bit (--with: every row gets \
through); 1 it does not; 2 no such run or file, or one that cannot be replayed."""
_MOST = 40  # fields shown


class Waves(Enum):
    """Ways to recover the waves of a run (`rig.sweep.counterfactual.waves`)."""

    ELEVATION = "elevation"
    FORCES = "forces"


def command(
    run: Annotated[Path, typer.Argument(help="A run's folder or MCAP file, its id, or 'last'.")],
    runs: Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")] = Path(
        "runs"
    ),
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
    other: Annotated[
        Path | None,
        typer.Option("--with", metavar="CAMPAIGN", help="Rows to run in the waves of the run."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="CAMPAIGN", help="With --with: whose plant stands for the rig then."
        ),
    ] = None,
    waves: Annotated[
        Waves | None,
        typer.Option("--waves", help="With --with: how the waves are recovered."),
    ] = None,
) -> None:
    """Feed what a run sensed to today's cycle and compare every command and mode, tick by tick.

    With a campaign: what its rows would have given in the waves of the run, with an interval.
    """
    if other is None and (model is not None or waves is not None):
        raise typer.BadParameter("--model and --waves go with --with")
    if other is None:
        sys.exit(main(run, runs, as_json=json))
    from rig.cli import replay_with

    wanted = replay_with.ReplayOptions(other, model, waves.value if waves else None, runs)
    sys.exit(replay_with.main(run, wanted, as_json=json))


def main(named: Path, runs: Path, *, as_json: bool) -> int:
    """Replay and say what differs; gives the exit code."""
    from rich.console import Console

    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.execution.replay import replay

    console = Console(stderr=True, highlight=False)
    try:
        run = find_run(named, runs)
        if as_json or not console.is_terminal:
            found = replay(run)
        else:
            with console.status("replaying ...") as status:
                found = replay(run, lambda ticks: status.update(f"replaying, {ticks} ticks ..."))
    except REFUSED as error:
        return refuse("replay", error, as_json=as_json)
    told = found._asdict() | {
        "same": found.same,
        "differences": [_plain(each._asdict()) for each in found.differences],
        "requests": [each._asdict() for each in found.requests],
    }
    if as_json:
        print(json.dumps(told))
    else:
        _say(told)
    return cli.OK if found.same else cli.FAILED


def _plain(found: dict[str, Any]) -> dict[str, Any]:
    """For JSON, which knows no NaN."""
    return {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in found.items()
    }


def _say(told: dict[str, Any]) -> None:
    for request in told["requests"]:
        print(f"tick {request['tick']}: the log shows a request, {request['name']}; given again")
    if not told["finished"]:
        print("the record was not ended: what came after its last tick is not compared; "
              "`rig recover` says what is missing")  # fmt: skip
    if told["absent"]:
        print(f"the run has no {', '.join(told['absent'])}: not compared")
    compared = f"{told['fields']} fields of {told['ticks']} ticks"
    if told["same"]:
        print(f"no diff: {compared} are the same to the bit")
        return
    first = told["differences"][0]
    was, now = _number(first["logged"]), _number(first["replayed"])
    field = f"{first['field']} was {was}, is {now} {first['unit']}"
    print(f"first difference in tick {first['first']}: {field}")
    print(f"{len(told['differences'])} of {compared} differ\n")
    print(f"{'field':<36} {'unit':<8} {'ticks':>8} {'first':>8} {'logged':>12} {'replayed':>12} "
          f"{'largest':>10}")  # fmt: skip
    for each in told["differences"][:_MOST]:
        numbers = (_number(each[name]) for name in ("logged", "replayed", "largest"))
        one, other, largest = numbers
        print(f"{each['field']:<36} {each['unit']:<8} {each['ticks']:>8} {each['first']:>8} "
              f"{one:>12} {other:>12} {largest:>10}")  # fmt: skip
    if len(told["differences"]) > _MOST:
        print(f"and {len(told['differences']) - _MOST} more fields; --json has all")


def _number(value: float | None) -> str:
    return "no number" if value is None else f"{value:.6g}"
