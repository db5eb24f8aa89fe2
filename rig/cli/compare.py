"""`rig compare A B`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.analysis import comparison
from rig.analysis.comparison_picture import write_comparison
from rig.analysis.comparison_text import as_text
from rig.cli.input_files import find_run, run_folder
from rig.cli.options import RUNS, WHICH_RUN, IncompleteRows, Json, PictureFormat, PictureStyle, Runs
from rig.cli.output import input_errors, print_result
from rig.config.problems import error_text, parse_number
from rig.recording.runs import run_info
from rig.row_contents import Column, find_column, union


def command(
    a: Annotated[Path, typer.Argument(help=WHICH_RUN)],
    b: Annotated[Path, typer.Argument(help="The run to compare with it.")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): largest difference of matched set points."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): value of a column that is no axis of the picture."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="PNG to write, with a CSV (default: in run B)."),
    ] = None,
    incomplete_rows: IncompleteRows = False,
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Compare two runs of one matrix: differing settings, then power point by point, B minus A."""
    with input_errors("compare", as_json=as_json):
        first, second = find_run(a, runs), find_run(b, runs)
        columns = union(*(run_info(run).row_contents.columns for run in (first, second)))
        limits, fixed = (_parse_values(each or [], columns) for each in (tolerance, left_out))
        found = comparison.compare(first, second, limits, incomplete_rows=incomplete_rows)
        picture = output or run_folder(second) / f"compared_with_{found.a.run}.png"
        written = [comparison.write_csv(found, picture.with_suffix(".csv"))]
        if found.matched.pairs:
            written.append(write_comparison(found, picture, fixed))
    text = as_text(found).rstrip()
    code = print_result(comparison.as_json(found), text, written, as_json=as_json)
    for warning in () if as_json else found.warnings:
        print(f"\n!! {warning}", file=sys.stderr)
    return code


def _parse_values(arguments: list[str], columns: tuple[Column, ...]) -> dict[str, float]:
    """Parse COLUMN=VALUE arguments into values by column name.

    Raises ValueError if an argument has no finite number or names an unknown column.
    """
    values = {}
    for argument in arguments:
        name, _, text = argument.partition("=")
        value = parse_number(text)
        if value is None:
            raise ValueError(f"{argument}: write COLUMN=VALUE, the value in SI units")
        try:
            values[find_column(columns, name).name] = value
        except KeyError as error:
            raise ValueError(f"{argument}: {error_text(error)}") from None
    return values
