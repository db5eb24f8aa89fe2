"""`rig import FILE`."""

import json
import sys
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rig import cli
from rig.cli.options import RUNS, Json, Runs

if TYPE_CHECKING:
    from rig.kinds.wavebot.mask4.windows import RowTiming


class Drive(StrEnum):
    """Drive whose DC power is imported."""

    COTS = "cots"
    CUSTOM = "custom"


class ZeroForce(StrEnum):
    """Samples whose mean is subtracted from the load-cell force."""

    WINDOW = "window"
    RUN = "run"
    NONE = "none"


class ImportOptions(NamedTuple):
    """Options of `rig import`: what the file itself does not hold."""

    frequency: float | None
    amplitude: float | None
    irregular: bool
    hs: float | None
    tp: float | None
    periods: int | None
    interval: float | None
    settle: float | None
    measure: float | None
    drive: Drive | None
    zeros: ZeroForce
    started: str | None
    name: str | None


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
        typer.Option(help="Start of the run, ISO 8601 (default: the date in the file's name)."),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Name of the run (default: that of the file).")
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> None:
    """Convert a downloaded MASK4 file to a run for `rig show`, `plot`, `compare` and `merge`."""
    options = ImportOptions(
        frequency, amplitude, irregular, hs, tp, periods, interval, settle, measure, drive, zeros,
        started, name,
    )  # fmt: skip
    sys.exit(main(file, options, runs, as_json=as_json))


def main(file: Path, options: ImportOptions, runs: Path, *, as_json: bool) -> int:
    """Import a file, and print the run's folder, its number of rows and any remarks."""
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.interop.basin.merge import MergeSource, SyncChannels, merge
    from rig.interop.basin.products import write_products
    from rig.kinds.wavebot.mask4.import_run import FileDescription, write_run
    from rig.kinds.wavebot.mask4.signals import read_signals
    from rig.kinds.wavebot.mask4.waves import write_sync, write_waves

    try:
        started = _start_time(file, options)
        timing, repeat = _timing(options)
        name = options.name or file.stem.partition("_")[0]
        description = FileDescription(
            name, started, _sea(options), repeat, timing, options.zeros.value
        )
        signals = read_signals(file, options.drive.value if options.drive else None)
        imported = write_run(signals, file, runs, description)
        written = [imported.folder]
        written += [path for path in (write_sync(signals, imported.folder),) if path]
        if waves := write_waves(signals, imported.folder):
            merged = merge(imported.folder, [MergeSource("waves", waves, "m", 0.0)], SyncChannels())
            written += [waves, *write_products(merged, imported.folder)]
    except INPUT_ERRORS as error:
        return refuse("import", error, as_json=as_json)
    if as_json:
        summary = {
            "run": str(imported.folder),
            "rows": imported.rows,
            "remarks": list(imported.remarks),
        }
        print(json.dumps({**summary, "written": [str(path) for path in written]}))
    else:
        print(f"{imported.folder}: {imported.rows} rows")
        for remark in imported.remarks:
            print(f"  {remark}")
    return cli.OK


def _start_time(file: Path, options: ImportOptions) -> datetime:
    from rig.kinds.wavebot.mask4.import_run import start_from_name

    if options.started is not None:
        when = datetime.fromisoformat(options.started)
        return when if when.tzinfo else when.replace(tzinfo=UTC)
    started = start_from_name(file)
    if started is None:
        raise ValueError(
            f"{file.name}: no date in the file's name; give --started 2023-09-26T12:08:43"
        )
    return started


def _timing(options: ImportOptions) -> "tuple[RowTiming | None, float | None]":
    """Return the row timing for the kind of sea, and the repeat period of the sea (s).

    Default timings are those of the MASK4 report (Sandia), 3.2.3.
    """
    from rig.kinds.wavebot.mask4.windows import RowTiming

    if options.frequency is not None and options.irregular:
        raise ValueError(
            "--frequency-hz is for regular waves, --irregular for irregular ones; give one of them"
        )
    if options.irregular:
        interval, settle = (
            options.interval or 300.0,
            2.0 if options.settle is None else options.settle,
        )
        length = options.measure or interval - settle
        return _checked_timing(RowTiming(interval, settle, length)), 300.0
    if options.frequency is None:
        return None, None
    interval, settle = options.interval or 20.0, 5.0 if options.settle is None else options.settle
    periods = options.periods or int((interval - settle) * options.frequency + 1e-9)
    return _checked_timing(
        RowTiming(interval, settle, periods / options.frequency)
    ), 1.0 / options.frequency


def _checked_timing(timing: "RowTiming") -> "RowTiming":
    available = timing.interval - timing.settle
    if not 0.0 < timing.measure <= available + 1e-9:
        raise ValueError(
            f"a window of {timing.measure:g} s does not fit into the {available:g} s that "
            f"{timing.interval:g} s a row leave after {timing.settle:g} s"
        )
    return timing


def _sea(options: ImportOptions) -> dict[str, Any]:
    """Return the sea in the form of a plan; options that were not given are absent."""
    if options.frequency is not None:
        size = "amplitude not given" if options.amplitude is None else f"{options.amplitude:g} m"
        label = f"regular, {size}, {options.frequency:g} Hz"
        sea = {"kind": "regular", "frequency_hz": options.frequency, "words": label}
        return sea | ({} if options.amplitude is None else {"amplitude_m": options.amplitude})
    if options.irregular:
        parts = {"hs_m": options.hs, "tp_s": options.tp}
        given = {key: value for key, value in parts.items() if value is not None}
        units = {"hs_m": "Hs {:g} m", "tp_s": "Tp {:g} s"}
        texts = [units[key].format(value) for key, value in given.items()]
        return {"kind": "irregular", "words": ", ".join(["irregular", *texts])} | given
    return {"kind": "not recorded", "words": "not recorded"}
