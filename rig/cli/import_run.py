"""`rig import FILE`."""

import json
import sys
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from rig.cli import options

if TYPE_CHECKING:
    from rig.interop.exchange.mask4_windows import Timing


class Drive(StrEnum):
    """Whose DC power counts."""

    COTS = "cots"
    CUSTOM = "custom"


class Zero(StrEnum):
    """From what load cells are counted."""

    WINDOW = "window"
    RUN = "run"
    NONE = "none"


class ImportOptions(NamedTuple):
    """What a person said of the file."""

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
    zeros: Zero
    started: str | None
    name: str | None


def command(
    file: Annotated[Path, typer.Argument(help="MATLAB file (5 or 7.3) with the MASK4 structure.")],
    frequency: Annotated[
        float | None, typer.Option("--frequency-hz", min=0.05, max=2, help="Of regular waves.")
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option("--amplitude-m", min=0, help="Of regular waves.")
    ] = None,
    irregular: Annotated[
        bool, typer.Option("--irregular", help="Waves that repeat after 300 s.")
    ] = False,
    hs: Annotated[float | None, typer.Option("--hs-m", min=0, help="Of irregular waves.")] = None,
    tp: Annotated[float | None, typer.Option("--tp-s", min=0.1, help="Likewise.")] = None,
    periods: Annotated[
        int | None, typer.Option(min=1, help="Waves in a window (as many as fit).")
    ] = None,
    interval: Annotated[
        float | None, typer.Option("--interval-s", min=1, help="From row to row (20; 300).")
    ] = None,
    settle: Annotated[
        float | None, typer.Option("--settle-s", min=0, help="Of it, left out (5; 2).")
    ] = None,
    measure: Annotated[
        float | None, typer.Option("--measure-s", min=0.1, help="Of irregular waves (298).")
    ] = None,
    drive: Annotated[Drive | None, typer.Option(help="Where DC power of both is there.")] = None,
    zeros: Annotated[
        Zero, typer.Option(help="Mean force taken out: of each window, of the run, or none.")
    ] = Zero.WINDOW,
    started: Annotated[
        str | None, typer.Option(help="When it began, ISO 8601 (else the date in its name).")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Of the run (else that of the file).")] = None,
    runs: options.Runs = options.RUNS,
    as_json: options.Json = False,
) -> None:
    """Make a run of a downloaded MASK4 file, for `rig show`, `plot`, `compare` and `merge`."""
    asked = ImportOptions(
        frequency, amplitude, irregular, hs, tp, periods, interval, settle, measure, drive, zeros,
        started, name,
    )  # fmt: skip
    sys.exit(main(file, asked, runs, as_json=as_json))


def main(file: Path, asked: ImportOptions, runs: Path, *, as_json: bool) -> int:
    """Import a file and say where its run is and what was remarkable about it."""
    from rig.cli.file_problems import REFUSED, refuse
    from rig.interop.basin.merge import Source, merge
    from rig.interop.basin.merge import SyncChannels as MergeAsked
    from rig.interop.basin.products import write
    from rig.interop.exchange.mask4_import import FileDescription, write_run
    from rig.interop.exchange.mask4_signals import read_signals
    from rig.interop.exchange.mask4_waves import write_sync, write_waves

    try:
        when = _started(file, asked)
        timing, repeat = _timing(asked)
        name = asked.name or file.stem.partition("_")[0]
        said = FileDescription(name, when, _sea(asked), repeat, timing, asked.zeros.value)
        signals = read_signals(file, asked.drive.value if asked.drive else None)
        made = write_run(signals, file, runs, said)
        written = [made.folder]
        written += [path for path in (write_sync(signals, made.folder),) if path]
        if waves := write_waves(signals, made.folder):
            merged = merge(made.folder, [Source("waves", waves, "m", 0.0)], MergeAsked())
            written += [waves, *write(merged, made.folder)]
    except REFUSED as error:
        return refuse("import", error, as_json=as_json)
    if as_json:
        told = {"run": str(made.folder), "rows": made.rows, "remarks": list(made.remarks)}
        print(json.dumps({**told, "written": [str(path) for path in written]}))
    else:
        print(f"{made.folder}: {made.rows} rows")
        for remark in made.remarks:
            print(f"  {remark}")
    return options.OK


def _started(file: Path, asked: ImportOptions) -> datetime:
    from rig.interop.exchange.mask4_import import started_by_name

    if asked.started is not None:
        when = datetime.fromisoformat(asked.started)
        return when if when.tzinfo else when.replace(tzinfo=UTC)
    found = started_by_name(file)
    if found is None:
        raise ValueError(f"{file.name}: no date in the name; say it: --started 2023-09-26T12:08:43")
    return found


def _timing(asked: ImportOptions) -> "tuple[Timing | None, float | None]":
    """Length of rows by the kind of sea, as in MASK4 report (Sandia), 3.2.3, and its repeat, s."""
    from rig.interop.exchange.mask4_windows import Timing

    if asked.frequency is not None and asked.irregular:
        raise ValueError("--frequency-hz is of regular waves, --irregular says they are not")
    if asked.irregular:
        interval, settle = asked.interval or 300.0, 2.0 if asked.settle is None else asked.settle
        length = asked.measure or interval - settle
        return _fitting(Timing(interval, settle, length)), 300.0
    if asked.frequency is None:
        return None, None
    interval, settle = asked.interval or 20.0, 5.0 if asked.settle is None else asked.settle
    periods = asked.periods or int((interval - settle) * asked.frequency + 1e-9)
    return _fitting(Timing(interval, settle, periods / asked.frequency)), 1.0 / asked.frequency


def _fitting(timing: "Timing") -> "Timing":
    room = timing.interval - timing.settle
    if not 0.0 < timing.measure <= room + 1e-9:
        raise ValueError(
            f"a window of {timing.measure:g} s does not fit into the {room:g} s that "
            f"{timing.interval:g} s a row leave after {timing.settle:g} s"
        )
    return timing


def _sea(asked: ImportOptions) -> dict[str, Any]:
    """The sea as a plan has it; what was not said is not there."""
    if asked.frequency is not None:
        size = "amplitude not said" if asked.amplitude is None else f"{asked.amplitude:g} m"
        words = f"regular, {size}, {asked.frequency:g} Hz"
        told = {"kind": "regular", "frequency_hz": asked.frequency, "words": words}
        return told | ({} if asked.amplitude is None else {"amplitude_m": asked.amplitude})
    if asked.irregular:
        parts = {"hs_m": asked.hs, "tp_s": asked.tp}
        known = {key: value for key, value in parts.items() if value is not None}
        units = {"hs_m": "Hs {:g} m", "tp_s": "Tp {:g} s"}
        said = [units[key].format(value) for key, value in known.items()]
        return {"kind": "irregular", "words": ", ".join(["irregular", *said])} | known
    return {"kind": "not recorded", "words": "not recorded"}
