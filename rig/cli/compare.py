"""`rig compare A B`."""

import json
import math
import sys
from pathlib import Path
from typing import Annotated

import typer

from rig import cli
from rig.cli.options import RUNS, WHICH_RUN, IncompleteRows, Json, Runs


def command(
    a: Annotated[Path, typer.Argument(help=WHICH_RUN)],
    b: Annotated[Path, typer.Argument(help="The run to compare with it.")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): how far matched set points may be apart."),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE (SI): where the picture's left-out column stands."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="PNG to write, a CSV beside it (default: in run B)."),
    ] = None,
    incomplete_rows: IncompleteRows = False,
    runs: Runs = RUNS,
    json: Json = False,
) -> None:
    """Compare two runs of one matrix: settings that differ, then power point by point, B less A."""
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
    """Print what differs between two runs; a picture and a table go beside the second."""
    from rig.analysis.comparison import compare
    from rig.analysis.comparison_picture import write_comparison
    from rig.analysis.comparison_table import as_json as in_json
    from rig.analysis.comparison_table import as_text, write_csv
    from rig.cli.command_error import fail
    from rig.cli.find_run import find_run

    try:
        one, other = find_run(a, runs), find_run(b, runs)
        told = compare(one, other, _values(tolerances), incomplete_rows=incomplete_rows)
        folder = other if other.is_dir() else other.parent
        picture = output or folder / f"compared_with_{told.a.run}.png"
        written = [write_csv(told, picture.with_suffix(".csv"))]
        if told.matched.pairs:
            written.append(write_comparison(told, picture, _values(left_out)))
    except (KeyError, ValueError, OSError) as error:
        return fail("compare", error, as_json=as_json)
    files = [str(path) for path in written]
    if as_json:
        print(json.dumps({**in_json(told), "written": files}))
    else:
        print(as_text(told))
        print("\n".join(files))
        for warning in told.warnings:
            print(f"\n!! {warning}", file=sys.stderr)
    return cli.OK


def _values(given: list[str]) -> dict[str, float]:
    """COLUMN=VALUE words by the column's name."""
    from rig.analysis.labels import column
    from rig.cli.command_error import in_words

    found = {}
    for words in given:
        name, _, text = words.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ValueError(f"{words}: write COLUMN=VALUE, the value in SI units")
        try:
            found[column(name).name] = value
        except KeyError as error:
            raise ValueError(f"{words}: {in_words(error)}") from None
    return found
