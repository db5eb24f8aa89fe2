"""Options and default folders that the commands share."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
WHICH_RUN = "A run's folder or MCAP file, its id, its campaign (the newest run of it), or 'last'."
Run = Annotated[Path, typer.Argument(help=WHICH_RUN)]
Runs = Annotated[Path, typer.Option("--runs", help="Folder that holds the runs.")]
RUNS: Path = Path("runs")
TASK_HELP = "Campaign or session: file (YAML), or the name of a shipped one."
WIRED_RIG_HELP = "Rig with wiring: file (YAML), or the name of a shipped rig."
Rig = Annotated[
    Path | None,
    typer.Option("--rig", help="Rig file (YAML) or shipped rig, replaces that of the file."),
]
Realtime = Annotated[
    bool, typer.Option("--realtime", help="Use the real clock, not the fastest possible pace.")
]
Sim = Annotated[
    bool, typer.Option("--sim", help="Emulate the devices at the far end of the rig's wires.")
]
Interpreted = Annotated[
    bool, typer.Option("--interpreted", help="Run the tick as plain Python, never compiled.")
]
WithPage = Annotated[
    bool, typer.Option("--page", help="Serve the operator's page, too, and print its address.")
]
CALIBRATIONS = Path("configs/calibrations")


def calibrations_folder(folder: Path) -> Path:
    """Return the folder of calibration files; the shipped one where the default does not exist."""
    if folder != CALIBRATIONS or folder.exists():
        return folder
    from rig.config.shipped_files import shipped_folder

    return shipped_folder() / "calibrations"


Calibrations = Annotated[
    Path,
    typer.Option(
        "--calibrations",
        callback=calibrations_folder,
        help="Folder of calibration files; where the default does not exist, the shipped ones.",
    ),
]
OutputFolder = Annotated[
    Path | None, typer.Option("--output", "-o", help="Folder to write to (default: the run's).")
]
_READ_BY = "Apply this calibration: NAME, NAME@VERSION or a file; one per quantity."
ReadBy = Annotated[list[str] | None, typer.Option("--calibration", help=_READ_BY)]

_STYLES = {"screen": (False, 2), "paper": (True, 2), "paper-single": (True, 1)}
FORMATS = ("png", "pdf", "svg")


def _require(value: str, allowed: Iterable[str]) -> None:
    """Refuse a value of an option that is not one of those allowed."""
    if value not in allowed:
        raise typer.BadParameter(f"{value} is not known; allowed {', '.join(allowed)}")


def _set_style(context: typer.Context, value: str | None) -> str | None:
    """Draw the pictures of a command in a style, until the command ends."""
    if value is not None:
        _require(value, _STYLES)
        from rig.presentation import picture  # matplotlib

        paper, columns = _STYLES[value]
        style = picture.current_style()._replace(paper=paper, columns=columns)
        context.with_resource(picture.drawn_as(style))
    return value


def _set_format(context: typer.Context, value: str | None) -> str | None:
    """Write the pictures of a command in a format, until the command ends."""
    if value is not None:
        _require(value, FORMATS)
        from rig.presentation import picture  # matplotlib

        format_ = next(each for each in picture.FORMATS if each == value)
        context.with_resource(picture.drawn_as(picture.current_style()._replace(format=format_)))
    return value


PictureStyle = Annotated[
    str | None,
    typer.Option(
        "--style",
        metavar="|".join(_STYLES),
        callback=_set_style,
        help="Pictures for screens (default), or for papers: no run header and captions, 8 pt, as "
        "wide as two columns of a page (paper) or one (paper-single).",
    ),
]
PictureFormat = Annotated[
    str | None,
    typer.Option(
        "--format",
        metavar="|".join(FORMATS),
        callback=_set_format,
        help="Format of the pictures (default: that of the file's name, else png).",
    ),
]

IncompleteRows = Annotated[
    bool,
    typer.Option("--incomplete-rows", help="Include means of rows whose record lacks ticks."),
]
