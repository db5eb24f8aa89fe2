"""`rig request NAME`: ask something of a running run."""

import os
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.input_files import find_run, running_runs
from rig.cli.options import RUNS, WHICH_RUN, Json, Runs
from rig.cli.output import FAILED, OK, fail, print_json
from rig.people.orders import REQUESTS
from rig.people.request_client import RequestClient, RequestError
from rig.people.seat import BEAT_S
from rig.recording.runs import RunError

EXIT_CODES = "Exit codes: 0 accepted; 1 refused, or the run does not answer; 2 bad input."
_NAMES = ("state", "columns", *REQUESTS)
_HELP = f"One of {', '.join(_NAMES)}."


def command(
    name: Annotated[str, typer.Argument(metavar="REQUEST", help=_HELP)],
    values: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[KEY=VALUE]...",
            help="Of `set`: columns, and signal.KEY; of `next_row`: row=N.",
        ),
    ] = None,
    run: Annotated[str, typer.Option("--run", help=f"{WHICH_RUN} Default: the one running.")] = "",
    text: Annotated[str, typer.Option("--text", help="Of `annotate` and `keep`.")] = "",
    take_over: Annotated[
        bool, typer.Option("--take-over", help="Take the seat from a present operator first.")
    ] = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Ask something of a running run, as the operator's page does.

    A command may act while nobody has the operator's seat; `stop` and `abort`
    always. `take_seat` keeps the seat until Ctrl-C: in the background of a
    terminal it lets all commands of that terminal act. Every request is in the
    run's journal, with the answer.
    """
    if name not in _NAMES:
        return fail("request", ValueError(f"{name}: no such request; {_HELP}"), as_json=as_json)
    try:
        arguments = _arguments(name, values or [], text)
        folder = _running(runs) if not run else find_run(Path(run), runs)
    except (ValueError, RunError, OSError) as error:
        return fail("request", error, as_json=as_json)
    try:
        client = RequestClient(folder, session=f"terminal {os.getsid(0)}")
        try:
            if take_over:
                client.ask("take_seat", take_over=True)
            answer = client.ask(name, **arguments)
            if name == "take_seat" and answer.get("accepted"):
                print("take_seat: you are the operator; Ctrl-C leaves the seat", flush=True)
                answer = _keep_seat(client)
        finally:
            client.close()
    except RequestError as error:
        return fail("request", error, as_json=as_json, code=FAILED)
    accepted = bool(answer.get("accepted"))
    if as_json:
        print_json(answer)
    elif name in ("state", "columns"):
        print(_table(answer))
    elif accepted:
        print(f"{name}: {answer.get('reason') or 'accepted'}")
    else:
        return fail(
            "request", ValueError(f"refused: {answer.get('reason')}"), as_json=False, code=1
        )
    return OK if accepted else FAILED


def _keep_seat(client: RequestClient) -> dict[str, Any]:
    """Renew the seat until Ctrl-C, or until it is lost; return the last answer."""
    try:
        while (answer := client.ask("beat")).get("accepted"):
            time.sleep(BEAT_S)
    except KeyboardInterrupt:
        return client.ask("leave_seat")
    return answer


def _arguments(name: str, values: list[str], text: str) -> dict[str, Any]:
    """Return the arguments of a request; ValueError for what it does not take."""
    if name == "next_row":
        column, _, number = (values[0] if len(values) == 1 else "").partition("=")
        if column != "row" or not number.isdecimal():
            raise ValueError("next_row: give row=N, N the number of a candidate")
        return {"row": int(number)}
    if name != "set":
        if values:
            raise ValueError(f"{name} takes no values; `set` does")
        key = {"annotate": "text", "keep": "comment", "acknowledge": "alarm"}.get(name)
        return {key: text} if key and text else {}
    found: dict[str, dict[str, Any]] = {"values": {}, "signal": {}}
    for each in values:
        key, equals, value = each.partition("=")
        if not equals:
            raise ValueError(f"{each}: not KEY=VALUE")
        part, _, inner = key.rpartition(".")
        if part not in ("", "signal"):
            raise ValueError(f"{key}: not a column, and not signal.KEY")
        found["signal" if part else "values"][inner] = _number_or_text(value)
    if not (found["values"] or found["signal"]):
        raise ValueError("set: no values; give KEY=VALUE, `rig request columns` lists the keys")
    return found


def _number_or_text(value: str) -> float | str:
    try:
        return float(value)
    except ValueError:
        return value


def _running(runs: Path) -> Path:
    """Return the folder of the newest run that runs; RunError if there is none."""
    running = running_runs(runs)
    if not running:
        raise RunError(f"{runs}: no run is running; name one with --run")
    return running[-1]


def _table(answer: dict[str, Any]) -> str:
    """Return the state or the columns as lines of text."""
    if "columns" not in answer:
        left_out = ("v", "accepted", "request", "operator_session")
        return "\n".join(
            f"{key:14} {value}" for key, value in answer.items() if key not in left_out
        )
    lines = []
    for each in answer["columns"]:
        key = each["key"] if each["part"] == "values" else f"signal.{each['key']}"
        if "choices" in each:
            lines.append(f"{key:28} {' | '.join(each['choices'])}")
        else:
            low, high = (
                f"{each[end]:g}" if each[end] is not None else "" for end in ("low", "high")
            )
            lines.append(f"{key:28} {low} .. {high} {each['unit']}")
    return "\n".join(lines)
