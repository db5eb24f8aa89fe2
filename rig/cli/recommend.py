"""`rig recommend RUNS`: the next gain matrix."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Runs
from rig.cli.twin import PLANT_HELP, PROBE_HELP
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.stations import find, option_names, shown

_RUNS = (
    "A run in calm water with an open-loop reference, then later runs in waves and wave "
    "calibrations. Each as folder, MCAP file, id, campaign, or 'last'."
)


_NAMES = ", ".join(option_names(shown(STATIONS)))


def command(
    run_names: Annotated[list[Path], typer.Argument(metavar="RUNS...", help=_RUNS)],
    campaign: Annotated[
        Path | None,
        typer.Option(help="Campaign with sea and rig (default: of the last run in waves)."),
    ] = None,
    best: Annotated[
        str, typer.Option("--for", help=f"Station whose power to maximise, e.g. {_NAMES}.")
    ] = STATIONS[-1].name,
    rows: Annotated[int, typer.Option(min=1, max=200, help="Largest number of rows.")] = 12,
    spring: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="FROM TO", help="Range of spring rates, N/m (default: whole map)."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Campaign file to write (default: in the first run)."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help=PLANT_HELP)] = None,
    probe: Annotated[str, typer.Option(help=PROBE_HELP)] = "",
    pictures: Annotated[bool, typer.Option(help="Draw the predicted power.")] = True,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Recommend gains: best settings for a sea, and a campaign file of the rows to run next.

    Run this campaign and add its run to RUNS: the next recommendation then
    uses its rows.
    """
    from rig.kinds.wavebot.recommend.recommendation import RecommendOptions
    from rig.kinds.wavebot.recommend.set_points import STATIONS as PREDICTED

    try:
        station = find(PREDICTED, best)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--for") from None
    options = RecommendOptions(campaign, station, rows, spring, plant, probe, incomplete_rows)
    sys.exit(main(run_names, runs, options, output, pictures=pictures, as_json=json))


def main(
    run_names: list[Path],
    runs: Path,
    options: object,
    output: Path | None,
    *,
    pictures: bool,
    as_json: bool,
) -> int:
    """Recommend gains, write campaign, JSON, twin and picture, print the tables."""
    from rig import cli
    from rig.cli import calibration_dates
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.cli.input_files import CAMPAIGNS, input_file
    from rig.kinds.wavebot.recommend import report
    from rig.kinds.wavebot.recommend.recommendation import RecommendOptions, recommend

    assert isinstance(options, RecommendOptions)
    try:
        paths = [find_run(name, runs) for name in run_names]
        if options.campaign is not None:
            options = options._replace(campaign=input_file(options.campaign, CAMPAIGNS))
        first_run = paths[0] if paths[0].is_dir() else paths[0].parent
        folder = output.parent if output else first_run / "recommendation"
        recommendation = recommend(paths, options, folder)
        written = report.write(recommendation, folder, output)
        if pictures:
            from rig.kinds.wavebot.recommend.picture import write_surfaces

            written.append(write_surfaces(recommendation, folder / "recommendation.png"))
    except INPUT_ERRORS as error:
        return refuse("recommend", error, as_json=as_json)
    warnings = calibration_dates.warn_of_expired(recommendation.campaign, quiet=as_json)
    if as_json:
        written_to = [str(path) for path in written]
        print(
            json.dumps(
                {**report.as_dict(recommendation), "written": written_to, "warnings": warnings}
            )
        )
        return cli.OK
    print(report.as_text(recommendation))
    print("\n" + "\n".join(str(path) for path in written))
    return cli.OK
