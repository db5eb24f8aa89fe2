"""`rig identify RUNS`."""

import json
from pathlib import Path
from typing import NamedTuple

from rig import cli
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.find_run import find_run


class IdentifyOptions(NamedTuple):
    """What is asked beside the runs."""

    order: int
    probe: str
    bem: Path | None
    output: Path | None
    pictures: bool
    incomplete_rows: bool = False


def main(named: list[Path], runs: Path, wanted: IdentifyOptions, *, as_json: bool) -> int:
    """Identify, write files and pictures, print the tables."""
    from rig.identification import report
    from rig.identification.bem import read_bem
    from rig.identification.identify import IdentificationOptions, identify

    try:
        if not named:
            raise ValueError("no run named, and nothing to compare")
        paths = [find_run(each, runs) for each in named]
        bem = read_bem(wanted.bem) if wanted.bem else None
        found = identify(
            paths, IdentificationOptions(wanted.order, wanted.probe, bem, wanted.incomplete_rows)
        )
        folder = wanted.output or products_folder(paths)
        folder.mkdir(parents=True, exist_ok=True)
        written = report.write(found, folder)
        if wanted.pictures:
            from rig.identification.page import write_page
            from rig.identification.pictures import write_pictures

            written += [*write_pictures(found, folder), *write_page(found, folder)]
    except REFUSED as error:
        return refuse("identify", error, as_json=as_json)
    if as_json:
        print(json.dumps({**report.as_dict(found), "written": [str(path) for path in written]}))
    else:
        print(report.as_text(found))
        print("\n" + "\n".join(str(path) for path in written))
    return cli.OK


def compare(pair: tuple[Path, Path], runs: Path, output: Path | None, *, as_json: bool) -> int:
    """Print how two identifications differ; a picture and JSON go beside the second."""
    from rig.identification import comparison

    try:
        a, b = (_identified(each, runs) for each in pair)
        told = comparison.compare(comparison.read(a), comparison.read(b))
        folder = output or b.parent
        folder.mkdir(parents=True, exist_ok=True)
        written = comparison.write(told, folder)
    except REFUSED as error:
        return refuse("identify", error, as_json=as_json)
    if as_json:
        print(json.dumps({**comparison.as_dict(told), "written": [str(p) for p in written]}))
    else:
        print(comparison.as_text(told))
        print("\n" + "\n".join(str(path) for path in written))
    return cli.OK


def products_folder(paths: list[Path]) -> Path:
    """The run's own folder; of several runs a folder of their own in that of the first."""
    first = paths[0] if paths[0].is_dir() else paths[0].parent
    return first if len(paths) == 1 else first / f"identification_of_{len(paths)}_runs"


def _identified(named: Path, runs: Path) -> Path:
    """The identification.json that is meant: itself, or in a folder or a run; made if missing."""
    from rig.identification import report
    from rig.identification.identify import identify

    if named.is_file() and named.suffix == ".json":
        return named
    if (named / report.JSON).exists():
        return named / report.JSON
    run = find_run(named, runs)
    folder = products_folder([run])
    if not (folder / report.JSON).exists():
        report.write(identify([run]), folder)
    return folder / report.JSON
