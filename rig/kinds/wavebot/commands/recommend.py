"""`rig recommend RUNS`: the next gain matrix."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.calibration_dates import warn_of_expired
from rig.cli.input_files import CAMPAIGNS, find_run_of_kind, input_file, run_folder
from rig.cli.options import RUNS, IncompleteRows, Json, PictureFormat, PictureStyle, Runs
from rig.cli.output import input_errors, print_result
from rig.kinds.wavebot.commands import KIND
from rig.kinds.wavebot.commands.twin import PLANT_HELP, PROBE_HELP
from rig.kinds.wavebot.recommend import report
from rig.kinds.wavebot.recommend.picture import write_surfaces
from rig.kinds.wavebot.recommend.recommendation import RecommendOptions, recommend
from rig.kinds.wavebot.recommend.set_points import STATIONS as PREDICTED
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.stations import find, shown, station_names

_RUNS = (
    "A run in calm water with an open-loop reference, then later runs in waves and wave "
    "calibrations. Each as folder, MCAP file, id, campaign, or 'last'."
)
_OTHER_KINDS = (
    "on any rig with power stations, a campaign with `adaptive:` looks for the best row itself: "
    "`rig copy adaptive` has an example"
)
_NAMES = ", ".join(station_names(shown(STATIONS)))


def command(
    run_names: Annotated[list[Path], typer.Argument(metavar="RUNS...", help=_RUNS)],
    campaign: Annotated[
        Path | None,
        typer.Option(help="Campaign with sea and rig (default: of the last run in waves)."),
    ] = None,
    best: Annotated[
        str,
        typer.Option("--for", help=f"Station whose power to maximise, by id ({_NAMES}) or label."),
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
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Recommend gains: best settings for a sea, and a campaign file of the rows to run next.

    Run this campaign and add its run to RUNS: the next recommendation then
    uses its rows.
    """
    try:
        station = find(PREDICTED, best)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--for") from None
    with input_errors("recommend", as_json=as_json):
        paths = [find_run_of_kind(KIND, name, runs, _OTHER_KINDS) for name in run_names]
        if campaign is not None:
            campaign = input_file(campaign, CAMPAIGNS)
        options = RecommendOptions(campaign, station, rows, spring, plant, probe, incomplete_rows)
        folder = output.parent if output else run_folder(paths[0]) / "recommendation"
        recommendation = recommend(paths, options, folder)
        written = report.write(recommendation, folder, output)
        if pictures:
            written.append(write_surfaces(recommendation, folder / "recommendation.png"))
    warnings = warn_of_expired(recommendation.campaign, quiet=as_json)
    values = report.as_dict(recommendation) | {"warnings": warnings}
    return print_result(values, report.as_text(recommendation), written, as_json=as_json)
