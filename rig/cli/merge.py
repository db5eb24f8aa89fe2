"""`rig merge RUN FILE...`."""

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from rig.cli import options

if TYPE_CHECKING:
    from rig.interop.basin.merge import MergeSource, SyncChannels

EXIT_CODES = """\
Exit codes: 0 merged; 1 merged, but clocks disagree, slip or drift too fast (see the alarms); \
2 bad input."""


class MergeOptions(NamedTuple):
    """Options that describe the files, as typed."""

    files: list[str]
    units: list[str]
    offsets: list[str]
    matches: list[str]


def command(
    run: options.Run,
    files: Annotated[
        list[str],
        typer.Argument(help="Records (.twe, .csv), each as FILE or NAME=FILE.", metavar="FILE..."),
    ],
    unit: Annotated[
        list[str] | None,
        typer.Option(help="NAME=inch, m, mm or cm: unit of a file's channels; repeatable."),
    ] = None,
    offset: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=SECONDS: run time minus recorder time, replaces a trigger; repeatable."
        ),
    ] = None,
    match: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME.CHANNEL=FIELD: a signal in both file and run, replaces the sine.",
        ),
    ] = None,
    ttl: Annotated[str | None, typer.Option(help="Channel with the trigger.")] = None,
    sine: Annotated[str | None, typer.Option(help="Channel with the common sine.")] = None,
    run_sine: Annotated[
        str | None,
        typer.Option(help="Log field with the run's sine; 'clock': computed from the run's clock."),
    ] = None,
    frequency: Annotated[
        float, typer.Option(min=0.01, max=100, help="Frequency of the sine, Hz.")
    ] = 1.0,
    rate: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=10_000, help="Rate of the product, Hz (default: that of the fastest file)."
        ),
    ] = None,
    runs: options.Runs = options.RUNS,
    as_json: options.Json = False,
) -> None:
    """Align wave data, power-analyser and other records with a run's time, by trigger and sine."""
    from rig.interop.basin.merge import SyncChannels

    sync_channels = SyncChannels(ttl, sine, run_sine, frequency, rate)
    file_options = MergeOptions(files, unit or [], offset or [], match or [])
    sys.exit(main(run, file_options, sync_channels, runs, as_json=as_json))


def main(
    run_name: Path,
    file_options: MergeOptions,
    sync_channels: "SyncChannels",
    runs: Path,
    *,
    as_json: bool,
) -> int:
    """Merge files into a run, print each clock against the run's, and return the exit code."""
    from rig.cli.file_problems import INPUT_ERRORS, refuse
    from rig.cli.find_run import find_run
    from rig.interop.basin.align import format_alignment
    from rig.interop.basin.merge import merge
    from rig.interop.basin.merge import to_json as in_json
    from rig.interop.basin.products import write_products

    try:
        run = find_run(run_name, runs)
        merged = merge(run, _parse_sources(file_options), sync_channels)
        written = write_products(merged, run if run.is_dir() else run.parent)
    except INPUT_ERRORS as error:
        return refuse("merge", error, as_json=as_json)
    if as_json:
        report = {"records": in_json(merged), "alarms": merged.alarms}
        print(json.dumps({**report, "written": [str(path) for path in written]}))
    else:
        for source, alignment in zip(merged.sources, merged.alignments, strict=True):
            print(f"{source.name}: {format_alignment(alignment)}")
            for remark in alignment.remarks:
                print(f"  {remark}")
        print("\n".join(str(path) for path in written))
        for alarm in merged.alarms:
            print(f"!! {alarm}", file=sys.stderr)
    return options.FAILED if merged.alarms else options.OK


def _parse_sources(file_options: MergeOptions) -> "list[MergeSource]":
    """Return the files with the options of each; ValueError for a malformed argument."""
    from rig.interop.basin.merge import MergeSource
    from rig.recording.channel_file import METRES_PER_UNIT

    sources: dict[str, MergeSource] = {}
    for argument in file_options.files:
        name, _, path = (
            argument.partition("=") if "=" in argument else (Path(argument).stem, "", argument)
        )
        if name in sources:
            raise ValueError(f"{argument}: a second record named {name!r}; write NAME=FILE")
        sources[name] = MergeSource(name, Path(path))
    for argument in (*file_options.units, *file_options.offsets, *file_options.matches):
        if not _source_name(argument, sources):
            raise ValueError(f"{argument}: write NAME=..., NAME one of {', '.join(sources)}")
    for name, unit in (
        (_source_name(text, sources), _argument_value(text)) for text in file_options.units
    ):
        if unit not in METRES_PER_UNIT:
            raise ValueError(
                f"{name}={unit}: {unit!r} is not a unit; allowed {', '.join(METRES_PER_UNIT)}"
            )
        sources[name] = sources[name]._replace(unit=unit)
    for name, text in (
        (_source_name(text, sources), _argument_value(text)) for text in file_options.offsets
    ):
        try:
            seconds = float(text)
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds):
            raise ValueError(f"{name}={text}: {text!r} is not a number of seconds")
        sources[name] = sources[name]._replace(offset=seconds)
    for argument in file_options.matches:
        name = _source_name(argument, sources)
        channel = argument.partition("=")[0][len(name) + 1 :]
        if not (channel and _argument_value(argument)):
            raise ValueError(f"{argument}: write NAME.CHANNEL=FIELD")
        sources[name] = sources[name]._replace(match=(channel, _argument_value(argument)))
    return list(sources.values())


def _source_name(argument: str, sources: "dict[str, MergeSource]") -> str:
    """Return the file's name in NAME=... or NAME.CHANNEL=...; empty if no file has this name."""
    key = argument.partition("=")[0]
    return next((name for name in sources if key == name or key.startswith(f"{name}.")), "")


def _argument_value(argument: str) -> str:
    return argument.partition("=")[2]
