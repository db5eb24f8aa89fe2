"""`rig surge-damping RUN`: the damping to keep surge on station with."""

import json
import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Run, Runs

CODES = """\
Exit codes: 0 a damping was found; 1 none of the range keeps stroke and heave power; 2 bad input."""


def command(
    run: Run,
    stroke: Annotated[
        float | None,
        typer.Option(
            "--stroke-m", min=0.001, max=2,
            help="Stroke either way that surge may use, m (half of the rig's least bound).",
        ),
    ] = None,
    keep: Annotated[
        float, typer.Option(min=0.5, max=1.0, help="Share of heave's best power to be kept.")
    ] = 0.98,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:  # fmt: skip
    """Determine the surge damping: least drive force with stroke and heave power kept.

    For a run whose rows differ in surge_kp_n_s_per_m alone, in a regular sea near the surge
    resonance.
    """
    sys.exit(main(run, runs, stroke, keep, incomplete_rows=incomplete_rows, as_json=json))


def main(
    named: Path,
    runs: Path,
    stroke: float | None,
    keep: float,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Reduce the run, choose, write; gives the exit code."""
    from rig import cli
    from rig.analysis import surge_damping
    from rig.analysis.surge_damping_picture import write_picture
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.recording.runs import RunError
    from rig.recording.runs.folder import facts

    try:
        run = find_run(named, runs)
        found = surge_damping.measured(run, incomplete_rows=incomplete_rows)
        known = facts(run)
        allowed = surge_damping.allowed_stroke(known) if stroke is None else stroke
        choice = surge_damping.choose(found.rows, allowed, keep)._replace(notes=found.notes)
        folder = run if run.is_dir() else run.parent
        picture = folder / "surge_damping.png"
        written = [
            *surge_damping.write(choice, folder),
            write_picture(choice, known.attributes(), picture),
        ]
    except (*REFUSED, RunError) as error:
        return refuse("surge-damping", error, as_json=as_json)
    if as_json:
        told = surge_damping.as_dict(choice) | {"written": [str(path) for path in written]}
        print(json.dumps(told))
    else:
        print(surge_damping.as_text(choice))
        if math.isfinite(choice.damping):
            print(f"in the rig file:   station_keeping: {{kp_n_s_per_m: {choice.kp:.0f}}}")
        print("\n" + "\n".join(str(path) for path in written))
    return cli.FAILED if math.isnan(choice.damping) else cli.OK
