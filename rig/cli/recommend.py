"""`rig recommend RUNS`: the next gain matrix."""

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import RUNS, IncompleteRows, Json, Runs
from rig.cli.twin import PLANT_HELP, PROBE_HELP

_RUNS = (
    "A run in calm water with an open-loop reference; then rows in waves that were run since, "
    "and wave calibrations. Folder, MCAP file, id, campaign, or 'last'."
)


class For(StrEnum):
    """The station whose power is to be best."""

    DC = "dc"
    AC = "ac"
    MECHANICAL = "mechanical"


def command(
    named: Annotated[list[Path], typer.Argument(metavar="RUNS...", help=_RUNS)],
    campaign: Annotated[
        Path | None,
        typer.Option(help="Campaign with sea and rig (default: that of the last run in waves)."),
    ] = None,
    best: Annotated[For, typer.Option("--for", help="Station whose power is to be best.")] = For.DC,
    rows: Annotated[int, typer.Option(min=1, max=200, help="Rows at most.")] = 12,
    spring: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="FROM TO", help="Range of spring rates, N/m (all of the map)."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Campaign file to write (default: in the first run)."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help=PLANT_HELP)] = None,
    probe: Annotated[str, typer.Option(help=PROBE_HELP)] = "",
    pictures: Annotated[bool, typer.Option(help="Also draw the predicted power.")] = True,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Recommend gains: best settings for a sea, and a campaign file of the rows to run next.

    Run it, give its run beside the first one, and the next recommendation knows its rows.
    """
    from rig.design.recommend.recommendation import RecommendOptions

    station = "mechanical_1" if best is For.MECHANICAL else best.value
    asked = RecommendOptions(campaign, station, rows, spring, plant, probe, incomplete_rows)  # type: ignore[arg-type]
    sys.exit(main(named, runs, asked, output, pictures=pictures, as_json=json))


def main(
    named: list[Path],
    runs: Path,
    asked: object,
    output: Path | None,
    *,
    pictures: bool,
    as_json: bool,
) -> int:
    """Recommend, write campaign, JSON, twin and picture, print the tables."""
    from rig import cli
    from rig.cli import calibration_dates
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.design.recommend import report
    from rig.design.recommend.recommendation import RecommendOptions, advise

    assert isinstance(asked, RecommendOptions)
    try:
        paths = [find_run(each, runs) for each in named]
        first = paths[0] if paths[0].is_dir() else paths[0].parent
        folder = output.parent if output else first / "recommendation"
        found = advise(paths, asked, folder)
        written = report.write(found, folder, output)
        if pictures:
            from rig.design.recommend.picture import write_surfaces

            written.append(write_surfaces(found, folder / "recommendation.png"))
    except REFUSED as error:
        return refuse("recommend", error, as_json=as_json)
    warnings = calibration_dates.warn(found.campaign, quiet=as_json)
    if as_json:
        written_to = [str(path) for path in written]
        print(json.dumps({**report.as_dict(found), "written": written_to, "warnings": warnings}))
        return cli.OK
    print(report.as_text(found))
    print("\n" + "\n".join(str(path) for path in written))
    return cli.OK
