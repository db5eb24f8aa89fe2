"""`rig merge RUN FILE...`."""

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from rig.cli import options

if TYPE_CHECKING:
    from rig.interop.basin.merge import Source, SyncChannels

CODES = """\
Exit codes: 0 merged; 1 merged, but clocks disagree, slip or drift too fast: see the alarms; \
2 bad input."""


class MergeOptions(NamedTuple):
    """What was said of the files, as it was typed."""

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
        typer.Option(help="NAME=SECONDS, run less recorder: in place of a trigger; repeatable."),
    ] = None,
    match: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME.CHANNEL=FIELD: what file and run both recorded, in place of a sine.",
        ),
    ] = None,
    ttl: Annotated[str | None, typer.Option(help="Channel of the trigger.")] = None,
    sine: Annotated[str | None, typer.Option(help="Channel of the common sine.")] = None,
    run_sine: Annotated[
        str | None,
        typer.Option(help="Log field with the run's sine; 'clock': made from the run's own clock."),
    ] = None,
    frequency: Annotated[float, typer.Option(min=0.01, max=100, help="Of the sine, Hz.")] = 1.0,
    rate: Annotated[
        float | None,
        typer.Option(min=0.1, max=10_000, help="Of the product, Hz (the fastest file's)."),
    ] = None,
    runs: options.Runs = options.RUNS,
    as_json: options.Json = False,
) -> None:
    """Bring wave data, power analyser and other records onto a run's time, by trigger and sine."""
    from rig.interop.basin.merge import SyncChannels

    asked = SyncChannels(ttl, sine, run_sine, frequency, rate)
    told = MergeOptions(files, unit or [], offset or [], match or [])
    sys.exit(main(run, told, asked, runs, as_json=as_json))


def main(
    named: Path, told: MergeOptions, asked: "SyncChannels", runs: Path, *, as_json: bool
) -> int:
    """Merge files into a run and say how their clocks stand to its clock."""
    from rig.cli.file_problems import REFUSED, refuse
    from rig.cli.find_run import find_run
    from rig.interop.basin.align import in_words
    from rig.interop.basin.merge import as_json as in_json
    from rig.interop.basin.merge import merge
    from rig.interop.basin.products import write

    try:
        run = find_run(named, runs)
        merged = merge(run, _sources(told), asked)
        written = write(merged, run if run.is_dir() else run.parent)
    except REFUSED as error:
        return refuse("merge", error, as_json=as_json)
    if as_json:
        whole = {"records": in_json(merged), "alarms": merged.alarms}
        print(json.dumps({**whole, "written": [str(path) for path in written]}))
    else:
        for source, one in zip(merged.sources, merged.alignments, strict=True):
            print(f"{source.name}: {in_words(one)}")
            for remark in one.remarks:
                print(f"  {remark}")
        print("\n".join(str(path) for path in written))
        for alarm in merged.alarms:
            print(f"!! {alarm}", file=sys.stderr)
    return options.FAILED if merged.alarms else options.OK


def _sources(told: MergeOptions) -> "list[Source]":
    """The files with what was said of each; ValueError for a word that is not understood."""
    from rig.interop.basin.merge import Source
    from rig.interop.basin.recording import METRES

    found: dict[str, Source] = {}
    for word in told.files:
        name, _, path = word.partition("=") if "=" in word else (Path(word).stem, "", word)
        if name in found:
            raise ValueError(f"{word}: a second record named {name!r}; write NAME=FILE")
        found[name] = Source(name, Path(path))
    for word in (*told.units, *told.offsets, *told.matches):
        if not _name(word, found):
            raise ValueError(f"{word}: write NAME=..., NAME one of {', '.join(found)}")
    for name, unit in ((_name(word, found), _value(word)) for word in told.units):
        if unit not in METRES:
            raise ValueError(f"{name}={unit}: {unit!r} is no unit; allowed {', '.join(METRES)}")
        found[name] = found[name]._replace(unit=unit)
    for name, text in ((_name(word, found), _value(word)) for word in told.offsets):
        try:
            seconds = float(text)
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds):
            raise ValueError(f"{name}={text}: {text!r} is not a number of seconds")
        found[name] = found[name]._replace(offset=seconds)
    for word in told.matches:
        name = _name(word, found)
        channel = word.partition("=")[0][len(name) + 1 :]
        if not (channel and _value(word)):
            raise ValueError(f"{word}: write NAME.CHANNEL=FIELD")
        found[name] = found[name]._replace(match=(channel, _value(word)))
    return list(found.values())


def _name(word: str, found: "dict[str, Source]") -> str:
    """The file's name in NAME=... or NAME.CHANNEL=...; empty if no file is called so."""
    left = word.partition("=")[0]
    return next((name for name in found if left == name or left.startswith(f"{name}.")), "")


def _value(word: str) -> str:
    return word.partition("=")[2]
