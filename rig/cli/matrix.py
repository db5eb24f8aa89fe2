"""`rig matrix FILE --style mask4|lupa|foswec`."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import CALIBRATIONS, Calibrations


class Style(StrEnum):
    """Rig family whose gain-matrix format the file has."""

    MASK4 = "mask4"
    LUPA = "lupa"
    FOSWEC = "foswec"


class Damping(StrEnum):
    """Effect of a positive damping gain in the other rig."""

    ABSORBS = "absorbs"
    DRIVES = "drives"


_STATEMENT_PANEL = "Conversion of another rig's gains to the sign convention of wec-rig"


def _statement_option(name: str, text: str) -> Any:
    """Return an option that describes the other rig."""
    return typer.Option(name, help=text, rich_help_panel=_STATEMENT_PANEL)


Option = typer.Option


def command(
    file: Annotated[Path, typer.Argument(help="Gain matrix of an earlier rig: csv, xlsx, mat.")],
    style: Annotated[Style, Option("--style", help="Rig family of the file.")],
    columns: Annotated[
        str | None,
        Option("--columns", help="Column names in file order: Kp,Ki,springK; - skips a column."),
    ] = None,
    lead_rows: Annotated[
        int | None, Option("--lead-rows", min=0, help="Rows before the first measured one (mask4).")
    ] = None,
    sheet: Annotated[str | None, Option("--sheet", help="Sheet of a workbook.")] = None,
    variable: Annotated[str | None, Option("--variable", help="Matrix of a .mat file.")] = None,
    to: Annotated[
        Path | None,
        Option("--to", help="File to write: a wec-rig matrix (.csv) or campaign (.yaml)."),
    ] = None,
    base: Annotated[
        Path | None, Option("--campaign", help="Campaign that the .yaml file of --to extends.")
    ] = None,
    source: Annotated[
        Path | None,
        Option("--from", help="CSV matrix of wec-rig from which to write FILE (mask4)."),
    ] = None,
    header: Annotated[bool, Option(help="Write column names into FILE.")] = True,
    force: Annotated[bool, Option("--force", help="Overwrite an existing file.")] = False,
    calibration: Annotated[
        str | None, Option("--calibration", help="Correct spring rates: NAME, NAME@VERSION, file.")
    ] = None,
    run: Annotated[
        str | None, Option("--run", help="Run that used the matrix, for --calibration.")
    ] = None,
    calibrations: Calibrations = CALIBRATIONS,
    step: Annotated[
        float | None, Option("--step-s", help="GainTstep = numPeriods * wavePeriod, s.")
    ] = None,
    lever: Annotated[
        float | None,
        Option(
            "--lever-m",
            help="Body travel per rad of the output shaft, m.",
            rich_help_panel=_STATEMENT_PANEL,
        ),
    ] = None,
    gear: Annotated[
        float | None,
        _statement_option("--gear", "Motor rad per rad of the output shaft."),
    ] = None,
    damping: Annotated[
        Damping | None,
        _statement_option("--positive-damping", "Effect of B > 0 in that rig."),
    ] = None,
    spring: Annotated[
        float | None,
        _statement_option(
            "--spring-n-per-m", "Rate of a spring in parallel with the feedback, N/m."
        ),
    ] = None,
    flap: Annotated[str | None, _statement_option("--flap", "aft or bow (foswec).")] = None,
    torque_constant_ratio: Annotated[
        float,
        _statement_option(
            "--torque-constant-ratio", "True torque constant divided by that of the controller."
        ),
    ] = 1.0,
    json: Annotated[bool, Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Read a gain matrix of an earlier rig, report its contents, and convert it for wec-rig."""
    from rig.cli import matrix_commands as commands

    if source is not None:
        sys.exit(commands.write(file, style, source, header=header, force=force, as_json=json))
    options = commands.MatrixOptions(
        file, style, columns, lead_rows, sheet, variable, to, base, force, step,
        (calibration, run, calibrations),
    )  # fmt: skip
    statement = {
        "lever": lever,
        "gear": gear,
        "positive_damping": damping.value if damping is not None else None,
        "spring_rate": spring,
        "flap": flap,
        "torque_constant_ratio": torque_constant_ratio,
    }
    sys.exit(commands.read(options, statement, as_json=json))
