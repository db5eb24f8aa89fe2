"""`rig matrix FILE --style mask4|lupa|foswec`."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer


class Style(StrEnum):
    """Whose gain matrices."""

    MASK4 = "mask4"
    LUPA = "lupa"
    FOSWEC = "foswec"


class Damping(StrEnum):
    """What a positive damping gain does in the other rig."""

    ABSORBS = "absorbs"
    DRIVES = "drives"


_STEPS = "Other rigs' gains in house signs"


def _said(name: str, text: str) -> Any:
    """An option that says something of the other rig."""
    return typer.Option(name, help=text, rich_help_panel=_STEPS)


Option = typer.Option


def command(
    file: Annotated[Path, typer.Argument(help="Gain matrix of the old style: csv, xlsx, mat.")],
    style: Annotated[Style, Option("--style", help="Whose file it is.")],
    columns: Annotated[
        str | None,
        Option("--columns", help="Names in file order: Kp,Ki,springK; - leaves one out."),
    ] = None,
    lead_rows: Annotated[
        int | None, Option("--lead-rows", min=0, help="Rows before the first measured one (mask4).")
    ] = None,
    sheet: Annotated[str | None, Option("--sheet", help="Sheet of a workbook.")] = None,
    variable: Annotated[str | None, Option("--variable", help="Matrix of a .mat file.")] = None,
    to: Annotated[
        Path | None, Option("--to", help="Write today's matrix (.csv) or a campaign (.yaml).")
    ] = None,
    base: Annotated[
        Path | None, Option("--campaign", help="Campaign that a .yaml of --to extends.")
    ] = None,
    source: Annotated[
        Path | None, Option("--from", help="Today's CSV matrix: write FILE from it (mask4).")
    ] = None,
    header: Annotated[bool, Option(help="Column names in the file that is written.")] = True,
    force: Annotated[bool, Option("--force", help="Overwrite what is there.")] = False,
    calibration: Annotated[
        str | None, Option("--calibration", help="Correct spring rates: NAME, NAME@VERSION, file.")
    ] = None,
    run: Annotated[
        str | None, Option("--run", help="Run the matrix was used in, for --calibration.")
    ] = None,
    calibrations: Annotated[
        Path, Option("--calibrations", help="Folder of calibration files.")
    ] = Path("configs/calibrations"),
    step: Annotated[
        float | None, Option("--step-s", help="GainTstep = numPeriods * wavePeriod, s.")
    ] = None,
    lever: Annotated[
        float | None,
        Option(
            "--lever-m",
            help="Body travel per rad of the output shaft, m.",
            rich_help_panel=_STEPS,
        ),
    ] = None,
    gear: Annotated[
        float | None,
        _said("--gear", "Motor rad per rad of the output shaft."),
    ] = None,
    damping: Annotated[
        Damping | None,
        _said("--positive-damping", "What B > 0 does there."),
    ] = None,
    spring: Annotated[
        float | None,
        _said("--spring-n-per-m", "Rate of a spring beside the feedback."),
    ] = None,
    flap: Annotated[str | None, _said("--flap", "aft or bow (foswec).")] = None,
    torque_constant_ratio: Annotated[
        float,
        _said("--torque-constant-ratio", "True torque constant over the one the controller used."),
    ] = 1.0,
    json: Annotated[bool, Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Read a gain matrix of an earlier rig, say what was found, and turn it into today's."""
    from rig.cli import matrix_commands as commands

    if source is not None:
        sys.exit(commands.write(file, style, source, header=header, force=force, as_json=json))
    asked = commands.MatrixOptions(
        file, style, columns, lead_rows, sheet, variable, to, base, force, step,
        (calibration, run, calibrations),
    )  # fmt: skip
    said = {
        "lever": lever,
        "gear": gear,
        "positive_damping": damping.value if damping is not None else None,
        "spring_rate": spring,
        "flap": flap,
        "torque_constant_ratio": torque_constant_ratio,
    }
    sys.exit(commands.read(asked, said, as_json=json))
