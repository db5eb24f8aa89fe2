"""`rig identify RUNS`, and `rig identify --compare A B`."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import find_run, run_folder
from rig.cli.options import (
    RUNS,
    IncompleteRows,
    Json,
    OutputFolder,
    PictureFormat,
    PictureStyle,
    Runs,
)
from rig.cli.output import input_errors, print_result
from rig.identification import comparison, report
from rig.identification.identify import IdentificationOptions, identify

_RUN = (
    "A run's folder, MCAP file, id, campaign, or 'last'. Give several to combine runs in calm "
    "water, in waves, and of the waves without the device."
)


def command(
    run_names: Annotated[list[Path] | None, typer.Argument(metavar="[RUNS]...", help=_RUN)] = None,
    compare: Annotated[
        tuple[Path, Path] | None,
        typer.Option(metavar="A B", help="Compare two identifications: JSON files or runs."),
    ] = None,
    order: Annotated[
        int, typer.Option(help="Order of the parametric models: 2, or also 4, 6 or 8.")
    ] = 2,
    probe: Annotated[
        str, typer.Option(help="Probe of the wave calibration at the position of the device.")
    ] = "",
    bem: Annotated[
        Path | None, typer.Option(help="BEM file to compare impedance and excitation with.")
    ] = None,
    output: OutputFolder = None,
    pictures: Annotated[bool, typer.Option(help="Also draw the figures and the page.")] = True,
    incomplete_rows: IncompleteRows = False,
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Identify impedances and wave excitation from runs with an open-loop reference."""
    if compare is not None:
        if run_names:
            raise typer.BadParameter("--compare takes two identifications; leave out RUNS")
        return _compare(compare, runs, output, as_json=as_json)
    with input_errors("identify", as_json=as_json):
        if not run_names:
            raise ValueError("no run given; name RUNS, or two identifications with --compare A B")
        paths = [find_run(name, runs) for name in run_names]
        options = IdentificationOptions(order, probe, None, incomplete_rows, bem)
        result = identify(paths, options)
        folder = output or _products_folder(paths)
        folder.mkdir(parents=True, exist_ok=True)
        written = report.write(result, folder)
        if pictures:
            from rig.identification.pictures import write_page, write_pictures  # matplotlib

            written += [*write_pictures(result, folder), *write_page(result, folder)]
    return print_result(report.as_dict(result), report.as_text(result), written, as_json=as_json)


def _compare(pair: tuple[Path, Path], runs: Path, output: Path | None, *, as_json: bool) -> int:
    """Print how two identifications differ; write a picture and JSON beside the second one."""
    from rig.identification.pictures import write_comparison  # matplotlib

    with input_errors("identify", as_json=as_json):
        a, b = (_identification_file(name, runs) for name in pair)
        result = comparison.compare(
            comparison.read_identification(a), comparison.read_identification(b)
        )
        folder = output or b.parent
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "identification_compared"
        written = [
            report.write_json(comparison.as_dict(result), path.with_suffix(".json")),
            write_comparison(result, path.with_suffix(".png")),
        ]
    values, text = comparison.as_dict(result), comparison.as_text(result)
    return print_result(values, text, written, as_json=as_json)


def _products_folder(paths: list[Path]) -> Path:
    """Return the run's folder or, for several runs, a subfolder of the first run's folder."""
    first = run_folder(paths[0])
    return first if len(paths) == 1 else first / f"identification_of_{len(paths)}_runs"


def _identification_file(name: Path, runs: Path) -> Path:
    """Return the path of an identification.json; identify the run first if it has none.

    ``name`` is the file itself, a folder that holds it, or a run.
    """
    if name.is_file() and name.suffix == ".json":
        return name
    if (name / report.JSON).exists():
        return name / report.JSON
    run = find_run(name, runs)
    folder = _products_folder([run])
    if not (folder / report.JSON).exists():
        report.write(identify([run]), folder)
    return folder / report.JSON
