"""`rig import FILE`."""

from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import OK, input_errors, print_json
from rig.kinds.wavebot.mask4.import_run import (
    FileDescription,
    RowTiming,
    import_file,
)


class Drive(StrEnum):
    """Drive whose DC power is imported."""

    COTS = "cots"
    CUSTOM = "custom"


class ZeroForce(StrEnum):
    """Samples whose mean is subtracted from the load-cell force."""

    WINDOW = "window"
    RUN = "run"
    NONE = "none"


def command(
    file: Annotated[Path, typer.Argument(help="MATLAB file (5 or 7.3) with the MASK4 structure.")],
    frequency: Annotated[
        float | None,
        typer.Option("--frequency-hz", min=0.05, max=2, help="Frequency of regular waves."),
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option("--amplitude-m", min=0, help="Amplitude of regular waves.")
    ] = None,
    irregular: Annotated[
        bool, typer.Option("--irregular", help="The waves are irregular and repeat after 300 s.")
    ] = False,
    hs: Annotated[
        float | None,
        typer.Option("--hs-m", min=0, help="Significant wave height of irregular waves."),
    ] = None,
    tp: Annotated[
        float | None, typer.Option("--tp-s", min=0.1, help="Peak period of irregular waves.")
    ] = None,
    periods: Annotated[
        int | None,
        typer.Option(min=1, help="Wave periods in a measured window (default: as many as fit)."),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(
            "--interval-s", min=1, help="Time per row (default: 20; in irregular waves 300)."
        ),
    ] = None,
    settle: Annotated[
        float | None,
        typer.Option(
            "--settle-s",
            min=0,
            help="Start of each row that is left out (default: 5; in irregular waves 2).",
        ),
    ] = None,
    measure: Annotated[
        float | None,
        typer.Option(
            "--measure-s", min=0.1, help="Measured window in irregular waves (default: 298)."
        ),
    ] = None,
    drive: Annotated[
        Drive | None,
        typer.Option(help="Drive whose DC power to import, where the file has that of both."),
    ] = None,
    zeros: Annotated[
        ZeroForce, typer.Option(help="Subtract the mean force of each window, of the run, or none.")
    ] = ZeroForce.WINDOW,
    started: Annotated[
        str | None,
        typer.Option(
            help="Start of the run, ISO 8601 (default: that in the file, or the date in its name)."
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the run (default: that of the file).")
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Convert a downloaded MASK4 file to a run for `rig show`, `plot`, `compare` and `merge`."""
    with input_errors("import", as_json=as_json):
        start = None if started is None else datetime.fromisoformat(started)
        timing, repeat = _timing(frequency, periods, interval, settle, measure, irregular=irregular)
        description = FileDescription(
            name or file.stem.partition("_")[0],
            start.replace(tzinfo=UTC) if start and not start.tzinfo else start,
            _sea(frequency, amplitude, hs, tp, irregular=irregular),
            repeat,
            timing,
            zeros.value,
        )
        imported = import_file(file, runs, description, drive.value if drive else None)
    if as_json:
        summary = {"run": str(imported.folder), "rows": imported.rows, "remarks": imported.remarks}
        return print_json({**summary, "written": [str(path) for path in imported.written]})
    print(f"{imported.folder}: {imported.rows} rows")
    for remark in imported.remarks:
        print(f"  {remark}")
    return OK


def _timing(
    frequency: float | None,
    periods: int | None,
    interval: float | None,
    settle: float | None,
    measure: float | None,
    *,
    irregular: bool,
) -> tuple[RowTiming | None, float | None]:
    """Return the row timing for the kind of sea, and the repeat period of the sea (s).

    Default timings are those of the MASK4 report (Sandia), 3.2.3.
    """
    if frequency is not None and irregular:
        raise ValueError(
            "--frequency-hz is for regular waves, --irregular for irregular ones; give one of them"
        )
    if frequency is None and not irregular:
        return None, None
    interval = interval or (300.0 if irregular else 20.0)
    if settle is None:
        settle = 2.0 if irregular else 5.0
    available = interval - settle
    if frequency is None:
        window, repeat = measure or available, 300.0
    else:
        repeat = 1.0 / frequency
        window = (periods or int(available * frequency + 1e-9)) / frequency
    if not 0.0 < window <= available + 1e-9:
        raise ValueError(
            f"a window of {window:g} s does not fit into the {available:g} s that "
            f"{interval:g} s a row leave after {settle:g} s"
        )
    return RowTiming(interval, settle, window), repeat


def _sea(
    frequency: float | None,
    amplitude: float | None,
    hs: float | None,
    tp: float | None,
    *,
    irregular: bool,
) -> dict[str, Any]:
    """Return the sea in the form of a plan; options that were not given are absent."""
    if frequency is not None:
        size = "amplitude not given" if amplitude is None else f"{amplitude:g} m"
        label = f"regular, {size}, {frequency:g} Hz"
        sea = {"kind": "regular", "frequency_hz": frequency, "words": label}
        return sea | ({} if amplitude is None else {"amplitude_m": amplitude})
    if irregular:
        given = {k: v for k, v in (("hs_m", hs), ("tp_s", tp)) if v is not None}
        units = {"hs_m": "Hs {:g} m", "tp_s": "Tp {:g} s"}
        texts = [units[key].format(value) for key, value in given.items()]
        return {"kind": "irregular", "words": ", ".join(["irregular", *texts])} | given
    return {"kind": "not recorded", "words": "not recorded"}
