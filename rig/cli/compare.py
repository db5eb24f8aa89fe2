"""`rig compare A B`."""

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig import cli
from rig.cli.options import RUNS, WHICH_RUN, IncompleteRows, Json, Runs

if TYPE_CHECKING:
    from rig.row_contents import Column


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
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Compare two runs of one matrix: differing settings, then power point by point, B minus A."""
    columns = tolerance or [], left_out or []
    sys.exit(main(a, b, runs, *columns, output, incomplete_rows=incomplete_rows, as_json=json))


def main(
    a: Path,
    b: Path,
    runs: Path,
    tolerances: list[str],
    left_out: list[str],
    output: Path | None,
    *,
    incomplete_rows: bool,
    as_json: bool,
) -> int:
    """Print how two runs differ; write a picture and a table into the second run's folder."""
    from rig.analysis.comparison import compare
    from rig.analysis.comparison_picture import write_comparison
    from rig.analysis.comparison_table import as_json as in_json
    from rig.analysis.comparison_table import as_text, write_csv
    from rig.cli.command_error import fail
    from rig.cli.find_run import find_run
    from rig.recording.runs import run_info
    from rig.row_contents import union

    try:
        first, second = find_run(a, runs), find_run(b, runs)
        columns = union(*(run_info(run).row_contents.columns for run in (first, second)))
        limits, fixed = (_parse_values(given, columns) for given in (tolerances, left_out))
        comparison = compare(first, second, limits, incomplete_rows=incomplete_rows)
        folder = second if second.is_dir() else second.parent
        picture = output or folder / f"compared_with_{comparison.a.run}.png"
        paths = [write_csv(comparison, picture.with_suffix(".csv"))]
        if comparison.matched.pairs:
            paths.append(write_comparison(comparison, picture, fixed))
    except (KeyError, ValueError, OSError) as error:
        return fail("compare", error, as_json=as_json)
    files = [str(path) for path in paths]
    if as_json:
        print(json.dumps({**in_json(comparison), "written": files}))
    else:
        print(as_text(comparison))
        print("\n".join(files))
        for warning in comparison.warnings:
            print(f"\n!! {warning}", file=sys.stderr)
    return cli.OK


def _parse_values(arguments: list[str], columns: "tuple[Column, ...]") -> dict[str, float]:
    """Parse COLUMN=VALUE arguments into values by column name.

    Raises ValueError if an argument has no finite number or names an unknown column.
    """
    from rig.cli.command_error import error_text
    from rig.row_contents import find_column

    values = {}
    for argument in arguments:
        name, _, text = argument.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{argument}: write COLUMN=VALUE, the value in SI units")
        try:
            values[find_column(columns, name).name] = value
        except KeyError as error:
            raise ValueError(f"{argument}: {error_text(error)}") from None
    return values
