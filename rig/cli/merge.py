"""`rig merge RUN FILE...`."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.input_files import find_run, run_folder
from rig.cli.options import RUNS, Json, PictureFormat, PictureStyle, Run, Runs
from rig.cli.output import FAILED, input_errors, print_result
from rig.config.problems import parse_number
from rig.interop.basin.align import format_alignment
from rig.interop.basin.merge import MergeSource, SyncChannels, merge, to_json, write_products
from rig.recording.channel_file import METRES_PER_UNIT

EXIT_CODES = """\
Exit codes: 0 merged; 1 merged, but clocks disagree, slip or drift too fast (see the alarms); \
2 bad input."""


def command(
    run: Run,
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
    style: PictureStyle = None,
    picture_format: PictureFormat = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Align wave data, power-analyser and other records with a run's time, by trigger and sine."""
    with input_errors("merge", as_json=as_json):
        record = find_run(run, runs)
        sources = _parse_sources(files, unit or [], offset or [], match or [])
        merged = merge(record, sources, SyncChannels(ttl, sine, run_sine, frequency, rate))
        written = write_products(merged, run_folder(record))
    lines = []
    for source, _, alignment in merged.records:
        lines.append(f"{source.name}: {format_alignment(alignment)}")
        lines += [f"  {remark}" for remark in alignment.remarks]
    values = {"records": to_json(merged), "alarms": merged.alarms}
    code = print_result(values, "\n".join(lines), written, as_json=as_json)
    for alarm in () if as_json else merged.alarms:
        print(f"!! {alarm}", file=sys.stderr)
    return FAILED if merged.alarms else code


def _parse_sources(
    files: list[str], units: list[str], offsets: list[str], matches: list[str]
) -> list[MergeSource]:
    """Return the files with the options of each; ValueError for a malformed argument."""
    sources: dict[str, MergeSource] = {}
    for argument in files:
        name, equals, path = argument.partition("=")
        if not equals:
            name, path = Path(argument).stem, argument
        if name in sources:
            raise ValueError(f"{argument}: a second record named {name!r}; write NAME=FILE")
        sources[name] = MergeSource(name, Path(path))

    def parse(argument: str) -> tuple[str, str, str]:
        """Return the name of a file, its channel if one is given, and the value."""
        key, _, value = argument.partition("=")
        for name in sources:
            if key == name or key.startswith(f"{name}."):
                return name, key[len(name) + 1 :], value
        raise ValueError(f"{argument}: write NAME=..., NAME one of {', '.join(sources)}")

    for name, _, unit in map(parse, units):
        if unit not in METRES_PER_UNIT:
            raise ValueError(
                f"{name}={unit}: {unit!r} is not a unit; allowed {', '.join(METRES_PER_UNIT)}"
            )
        sources[name] = sources[name]._replace(unit=unit)
    for name, _, text in map(parse, offsets):
        seconds = parse_number(text)
        if seconds is None:
            raise ValueError(f"{name}={text}: {text!r} is not a number of seconds")
        sources[name] = sources[name]._replace(offset=seconds)
    for argument in matches:
        name, channel, field = parse(argument)
        if not (channel and field):
            raise ValueError(f"{argument}: write NAME.CHANNEL=FIELD")
        sources[name] = sources[name]._replace(match=(channel, field))
    return list(sources.values())
