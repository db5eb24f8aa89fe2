"""`rig plot RUN`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rig.analysis.run_products import DrawOptions
from rig.cli.input_files import find_calibrations, find_run, products_of, run_folder
from rig.cli.options import (
    RUNS,
    IncompleteRows,
    Json,
    PictureFormat,
    PictureStyle,
    ReadBy,
    Run,
    Runs,
)
from rig.cli.output import OK, input_errors
from rig.recording.runs import run_info


def command(
    run: Run,
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", "-f", help="Log field or pattern to draw over time; repeatable."),
    ] = None,
    rows: Annotated[
        list[int] | None,
        typer.Option("--row", "-r", help="Draw only this campaign row; repeatable."),
    ] = None,
    surface: Annotated[
        tuple[str, str] | None,
        typer.Option("--surface", metavar="X Y", help="Draw sliced power over these two columns."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(
            help="Column to slice at each station's optimum (the default for every column that is "
            "not an axis); COLUMN=VALUE (SI) slices it at that value; repeatable."
        ),
    ] = None,
    station: Annotated[
        list[str] | None,
        typer.Option(
            help="Station of a surface or of bars, by id or label; repeatable. The first one "
            "orders the bars."
        ),
    ] = None,
    sort: Annotated[
        str | None,
        typer.Option(help="Draw bars of all rows and settings, in order of 'run' or 'power'."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="PNG to write (default: in the run).")
    ] = None,
    calibration: ReadBy = None,
    incomplete_rows: IncompleteRows = False,
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Draw a run: its products, one surface, bars, or log fields over time.

    Of a run that tripped, the products include trip.png: the last seconds
    before the trip, and the first one after it.
    """
    with input_errors("plot", as_json=as_json):
        path = find_run(run, runs)
        options = DrawOptions(
            surface,
            tuple(left_out or ()),
            tuple(station or ()),
            sort,
            output,
            tuple(find_calibrations(calibration or [])),
            incomplete_rows,
        )
        written = _draw(path, options, fields or [], rows or [])
    names = [str(each) for each in written]
    none = "no pictures: the kind of this run draws none; --field draws log fields over time"
    print(json.dumps(names) if as_json else "\n".join(names) or none)
    return OK


def _draw(run: Path, options: DrawOptions, fields: list[str], rows: list[int]) -> list[Path]:
    traces = bool(fields or rows)
    if traces + options.selects_surface + bool(options.sort) > 1:
        raise ValueError("draw fields over time, a surface or bars; give options of one of them")
    if options.sort not in (None, "run", "power"):
        raise ValueError(f"--sort {options.sort}: allowed run, power")
    if not traces and (options.selects_surface or options.sort or not options.output):
        trip = [] if options.selects_surface or options.sort else _draw_trip(run)
        return [*products_of(run).draw(run, options), *trip]
    if options.calibrations:
        raise ValueError("fields over time show recorded values; leave out --calibration")
    from rig.analysis.traces import write_traces  # matplotlib

    folder = run if run.is_dir() else run.parent
    return [write_traces(run, options.output or folder / "traces.png", fields, rows or None)]


def _draw_trip(run: Path) -> list[Path]:
    """Draw the last seconds of a run that tripped, and return the picture; of others, none."""
    from rig.analysis.stop_reason import find_stop
    from rig.analysis.traces import write_trip  # matplotlib

    status = run_info(run).status
    trip_time = find_stop(run, status).trip_time if status.get("status") == "fault" else None
    if trip_time is None:
        return []
    return [write_trip(run, trip_time, run_folder(run) / "trip.png")]
