"""`rig surge-damping RUN`: damping of the surge station keeping."""

import math
from typing import Annotated

import typer

from rig.cli.input_files import find_run_of_kind, run_folder
from rig.cli.options import RUNS, IncompleteRows, Json, PictureFormat, PictureStyle, Run, Runs
from rig.cli.output import FAILED, OK, input_errors, print_result
from rig.kinds.wavebot.commands import KIND
from rig.kinds.wavebot.products import surge_damping
from rig.kinds.wavebot.products.surge_damping import write_picture
from rig.recording.runs.folder import run_info

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
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:  # fmt: skip
    """Determine the surge damping: the least drive force that keeps stroke and heave power.

    The run must have rows that differ in surge_kp_n_s_per_m alone, in a
    regular sea near the surge resonance.
    """
    with input_errors("surge-damping", as_json=as_json):
        path = find_run_of_kind(KIND, run, runs)
        rows, notes = surge_damping.measure_rows(path, incomplete_rows=incomplete_rows)
        run_facts = run_info(path)
        allowed = surge_damping.allowed_stroke(run_facts) if stroke is None else stroke
        choice = surge_damping.choose_damping(rows, allowed, keep)._replace(notes=notes)
        folder = run_folder(path)
        picture = folder / "surge_damping.png"
        written = [
            *surge_damping.write_results(choice, folder),
            write_picture(choice, run_facts.attributes(), picture),
        ]
    text = surge_damping.as_text(choice)
    if math.isfinite(choice.damping):
        text += f"\nin the rig file:   station_keeping: {{kp_n_s_per_m: {choice.kp:.0f}}}"
    print_result(surge_damping.as_dict(choice), text, written, as_json=as_json)
    return FAILED if math.isnan(choice.damping) else OK
