"""`rig page [RUN]`: the operator's page of a run in a browser."""

import socket
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import find_run, running_runs
from rig.cli.options import RUNS, WHICH_RUN, Json, Runs
from rig.cli.output import FAILED, OK, fail, print_json
from rig.recording.runs import RunError

EXIT_CODES = "Exit codes: 0 ended by Ctrl-C; 1 the page cannot be served; 2 bad input."


def command(
    run: Annotated[
        str, typer.Argument(metavar="[RUN]", help=f"{WHICH_RUN} Default: the one running.")
    ] = "",
    host: Annotated[
        str, typer.Option("--host", help="Address to serve; others than 127.0.0.1 need a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Port; 0: 8765, or a free one.")] = 0,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", help="A further host name by which browsers call this page."),
    ] = None,
    token: Annotated[
        bool, typer.Option("--token", help="Require a token on the loopback address, too.")
    ] = False,
    valid_h: Annotated[
        float, typer.Option("--valid-hours", help="Hours until the tokens expire.", min=0.01)
    ] = 12.0,
    plotjuggler: Annotated[
        str,
        typer.Option("--plotjuggler", help="Send rows to HOST:PORT for PlotJuggler (UDP, JSON)."),
    ] = "",
    stream_rate: Annotated[
        float, typer.Option("--stream-rate", help="Rows a second for PlotJuggler.", min=1, max=5000)
    ] = 100.0,
    foxglove: Annotated[
        int | None,
        typer.Option(
            "--foxglove", help="Port on this computer to which Foxglove connects; 0: any."
        ),
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
    of_process: Annotated[
        int,
        typer.Option(
            "--of-process",
            hidden=True,
            help="Process of a run with --page; its folder comes by the input.",
        ),
    ] = 0,
    listener: Annotated[
        int, typer.Option("--listener", hidden=True, help="Open socket, with --page of a run.")
    ] = -1,
) -> int:
    """Serve the operator's page of a run, or replay a recorded one.

    The page is a process of its own that can only read the run and ask of it;
    its end changes nothing of the run. Without --host only this computer
    reaches it. With --host it prints one address for the operator and one for
    viewers, each with a token.
    """
    from rig.page import process
    from rig.page.access import LOOPBACK, Access, local_names, new_tokens
    from rig.page.subject import attach, replay
    from rig.realtime.scheduling import leave_the_loops_core

    core = leave_the_loops_core()
    try:
        if of_process:
            folder, running = process.wait_for_run(sys.stdin.buffer), True
        else:
            folder, running = _find(run, runs)
    except (RunError, OSError) as error:
        return fail("page", error, as_json=as_json)
    remote = host not in LOOPBACK
    tokens = new_tokens(3600.0 * valid_h) if remote or token else ()
    access = Access({*local_names(host), *(names or ())}, tokens)
    try:
        socket_ = socket.socket(fileno=listener) if listener >= 0 else process.listen(host, port)
        subject = attach(folder, core) if running else replay(folder)
        streams = subject.stream_to(plotjuggler, stream_rate, foxglove)
    except (RunError, OSError, ValueError) as error:
        return fail("page", error, as_json=as_json, code=FAILED)
    url = process.address(socket_)
    addresses = {each.role: f"{url}#token={each.secret}" for each in tokens} or {"page": url}
    addresses |= streams
    if as_json:
        print_json({"run": str(folder), "running": running, "addresses": addresses})
    elif listener < 0:
        print(f"{folder.name}{'' if running else ', replayed'}")
        for role, text in addresses.items():
            print(f"  {role:11} {text}", flush=True)
        if remote:
            note = "docs/tutorials/operators_page.md"
            print(f"  Without TLS others on the network read along: {note}", flush=True)
    try:
        process.serve(subject, access, socket_, ends=listener >= 0)
    except KeyboardInterrupt:
        pass
    finally:
        subject.close()
    return OK


def _find(run: str, runs: Path) -> tuple[Path, bool]:
    """Return the folder of a run, and whether it runs; RunError if there is none."""
    running = running_runs(runs)
    if not run and not running:
        raise RunError(f"{runs}: no run is running; name one to replay it")
    path = find_run(Path(run), runs) if run else running[-1]
    return path, path.resolve() in {each.resolve() for each in running}
