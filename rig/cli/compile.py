"""`rig compile FILE`: compile the tick of a campaign or session ahead of its runs."""

import time
from pathlib import Path
from typing import Annotated

import typer

from rig.api.campaign_run import examine
from rig.cli.check import print_problems
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import TASK_HELP, Json, Rig
from rig.cli.output import FAILED, OK, fail, input_errors, print_json
from rig.kinds.interface import Tasks
from rig.kinds.rig_file import kind_of_task


def command(
    task: Annotated[Path, typer.Argument(metavar="FILE", help=TASK_HELP)],
    rig: Rig = None,
    as_json: Json = False,
) -> int:
    """Compile the ticks of a campaign or session, and remove old compiled code.

    One code is the tick for wires and the real clock, the other one is that of a
    rehearsal: many ticks together with the simulated plant.

    A run does so by itself, beside its first ticks. On a rig, compile ahead:
    then the run is compiled from its first tick on. Changes of numbers in the
    files need no new code; another kind of rig, law or processor does.
    """
    with input_errors("compile", as_json=as_json):
        path, rig = input_file(task, CAMPAIGNS, SESSIONS), rig_file(rig)
        tasks: Tasks = kind_of_task(path, rig).room("tasks")
    report = examine(tasks, path, rig)
    if report.checked is None or report.plan is None:
        return print_problems(report, as_json=as_json)
    from rig.compilation.cache_folder import remove_unused_code
    from rig.compilation.tick_code import CompilationError, compile_tick
    from rig.processes.tick_compiler import compile_job, source_of

    planned = tasks.execution_task(report.checked, report.plan)
    mode = tasks.rehearsal_mode(report.checked, real_clock=False)
    jobs = {"tick": compile_job(planned)}
    if mode.coupled:
        jobs["rehearsal"] = compile_job(planned, mode)
    began, folders = time.monotonic(), dict[str, str | None](rehearsal=None)
    try:
        for name, job in jobs.items():
            folders[name] = str(compile_tick(source_of(planned.tick, job)))
    except (CompilationError, ValueError, OSError) as error:
        message = f"{path}: the tick cannot be compiled, so it runs interpreted: {error}"
        return fail("compile", CompilationError(message), as_json=as_json, code=FAILED)
    seconds, removed = time.monotonic() - began, remove_unused_code()
    if as_json:
        print_json({**folders, "seconds": seconds, "removed": removed})
    else:
        print(f"compiled in {seconds:.1f} s")
        print(f"tick       {folders['tick']}")
        alone_only = "as the tick: its simulated plant is not compiled with the loop"
        print(f"rehearsal  {folders['rehearsal'] or alone_only}")
        if removed:
            print(f"removed    {removed} folders of code that nothing used for 90 days")
    return OK
