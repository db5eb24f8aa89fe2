"""`rig surge-damping RUN`: damping of the surge station keeping."""

import json
import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Run, Runs

EXIT_CODES = """\
Exit codes: 0 found a damping; 1 no damping of the range keeps stroke and heave power; 2 bad \
input."""


def command(
    run: Run,
    stroke: Annotated[
        float | None,
        typer.Option(
            "--stroke-m", min=0.001, max=2,
            help="Allowed surge stroke to either side, m (default: half of the smallest limit).",
        ),
    ] = None,
    keep: Annotated[
        float, typer.Option(min=0.5, max=1.0, help="Share of the best heave power to keep.")
    ] = 0.98,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:  # fmt: skip
    """Determine the surge damping: the least drive force that keeps stroke and heave power.

    The run must have rows that differ in surge_kp_n_s_per_m alone, in a
    regular sea near the surge resonance.
    """
    sys.exit(main(run, runs, stroke, keep, incomplete_rows=incomplete_rows, as_json=json))


def main(
    run_name: Path,
    runs: Path,
    stroke: float | None,
    keep: float,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Choose the damping from a run, write the result, and return the exit code."""
    from rig import cli
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.kinds.wavebot.products import surge_damping
    from rig.kinds.wavebot.products.surge_damping_picture import write_picture
    from rig.recording.runs import RunError
    from rig.recording.runs.folder import run_info

    try:
        run = find_run(run_name, runs)
        measurement = surge_damping.measure_rows(run, incomplete_rows=incomplete_rows)
        run_facts = run_info(run)
        allowed = surge_damping.allowed_stroke(run_facts) if stroke is None else stroke
        choice = surge_damping.choose_damping(measurement.rows, allowed, keep)._replace(
            notes=measurement.notes
        )
        folder = run if run.is_dir() else run.parent
        picture = folder / "surge_damping.png"
        written = [
            *surge_damping.write_results(choice, folder),
            write_picture(choice, run_facts.attributes(), picture),
        ]
    except (*INPUT_ERRORS, RunError) as error:
        return refuse("surge-damping", error, as_json=as_json)
    if as_json:
        data = surge_damping.as_dict(choice) | {"written": [str(path) for path in written]}
        print(json.dumps(data))
    else:
        print(surge_damping.as_text(choice))
        if math.isfinite(choice.damping):
            print(f"in the rig file:   station_keeping: {{kp_n_s_per_m: {choice.kp:.0f}}}")
        print("\n" + "\n".join(str(path) for path in written))
    return cli.FAILED if math.isnan(choice.damping) else cli.OK
