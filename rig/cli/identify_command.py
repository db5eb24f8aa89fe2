"""`rig identify RUNS`."""

import json
from pathlib import Path
from typing import NamedTuple

from rig import cli
from rig.cli.file_problems import INPUT_ERRORS, refuse
from rig.cli.find_run import find_run


class IdentifyOptions(NamedTuple):
    """Options of `rig identify` apart from the runs."""

    order: int
    probe: str
    bem: Path | None
    output: Path | None
    pictures: bool
    incomplete_rows: bool = False


def main(run_names: list[Path], runs: Path, options: IdentifyOptions, *, as_json: bool) -> int:
    """Identify the models, write files and pictures, print tables, and return the exit code."""
    from rig.identification import report
    from rig.identification.bem import read_bem
    from rig.identification.identify import IdentificationOptions, identify

    try:
        if not run_names:
            raise ValueError("no run given; name RUNS, or two identifications with --compare A B")
        paths = [find_run(name, runs) for name in run_names]
        bem = read_bem(options.bem) if options.bem else None
        result = identify(
            paths, IdentificationOptions(options.order, options.probe, bem, options.incomplete_rows)
        )
        folder = options.output or products_folder(paths)
        folder.mkdir(parents=True, exist_ok=True)
        written = report.write(result, folder)
        if options.pictures:
            from rig.identification.page import write_page
            from rig.identification.pictures import write_pictures

            written += [*write_pictures(result, folder), *write_page(result, folder)]
    except INPUT_ERRORS as error:
        return refuse("identify", error, as_json=as_json)
    if as_json:
        print(json.dumps({**report.as_dict(result), "written": [str(path) for path in written]}))
    else:
        print(report.as_text(result))
        print("\n" + "\n".join(str(path) for path in written))
    return cli.OK


def compare(pair: tuple[Path, Path], runs: Path, output: Path | None, *, as_json: bool) -> int:
    """Print how two identifications differ; write a picture and JSON beside the second one."""
    from rig.identification import comparison, report
    from rig.identification.pictures import write_comparison

    try:
        a, b = (identification_file(name, runs) for name in pair)
        result = comparison.compare(
            comparison.read_identification(a), comparison.read_identification(b)
        )
        folder = output or b.parent
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "identification_compared"
        written = [
            report.write_json(comparison.as_dict(result), path.with_suffix(".json")),
            write_comparison(result, path.with_suffix(".png")),
        ]
    except INPUT_ERRORS as error:
        return refuse("identify", error, as_json=as_json)
    if as_json:
        report_values = {**comparison.as_dict(result), "written": [str(p) for p in written]}
        print(json.dumps(report_values))
    else:
        print(comparison.as_text(result))
        print("\n" + "\n".join(str(path) for path in written))
    return cli.OK


def products_folder(paths: list[Path]) -> Path:
    """Return the run's folder or, for several runs, a subfolder of the first run's folder."""
    first = paths[0] if paths[0].is_dir() else paths[0].parent
    return first if len(paths) == 1 else first / f"identification_of_{len(paths)}_runs"


def identification_file(name: Path, runs: Path) -> Path:
    """Return the path of an identification.json; identify the run first if it has none.

    ``name`` is the file itself, a folder that holds it, or a run.
    """
    from rig.identification import report
    from rig.identification.identify import identify

    if name.is_file() and name.suffix == ".json":
        return name
    if (name / report.JSON).exists():
        return name / report.JSON
    run = find_run(name, runs)
    folder = products_folder([run])
    if not (folder / report.JSON).exists():
        report.write(identify([run]), folder)
    return folder / report.JSON
