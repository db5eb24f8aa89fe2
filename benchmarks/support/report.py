"""The kept results: one JSON file a measurement, and a table of all of them for people."""

import json
from pathlib import Path
from typing import Any

from benchmarks.support.result import HEADINGS, Figure, cells

_HEAD = """\
# Measured

Written by `make bench` (`python -m benchmarks`); not edited by hand. Medians, with the least and
the greatest of all repetitions beside them. "Other work" is what else kept the machine busy
meanwhile, in cores, "stolen" what other guests of the same host took.
"""


def keep(folder: Path, name: str, told: dict[str, Any], order: list[str]) -> None:
    """Write a result and the table of all kept ones, in this order."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(told, indent=2, ensure_ascii=False)
    (folder / f"{name}.json").write_text(text + "\n")
    kept = [folder / f"{each}.json" for each in order if (folder / f"{each}.json").exists()]
    results = [json.loads(path.read_text()) for path in kept]
    (folder / "README.md").write_text(_HEAD + "".join(_section(one) for one in results))


def closing(missed: list[str]) -> str:
    """The last word of a run: which numbers are not held."""
    if not missed:
        return "every number that was measured is held"
    return "\n".join(["not held:", *(f"  {line}" for line in missed)])


def _section(told: dict[str, Any]) -> str:
    figures = [Figure(**figure) for figure in told["figures"]]
    rows = [HEADINGS, ("---",) * len(HEADINGS), *(cells(figure) for figure in figures)]
    table = "\n".join(f"| {' | '.join(cell.strip() for cell in row)} |" for row in rows)
    host, load = told["host"], told["load"]
    where = (
        f"{host['date']}, {host['processor']}, {host['cores']} cores"
        f"{', virtual machine' if host['virtual_machine'] else ''}, Linux {host['kernel']}, "
        f"Python {host['python']}; other work {load['other_work_cores']:g}, "
        f"stolen {load['stolen_cores']:g}; {told['took_s']:g} s"
    )
    notes = "".join(f"- {note}\n" for note in told["notes"])
    return (
        f"\n## {told['name']}\n\n{told['what'][0].upper()}{told['what'][1:]}; "
        f"{told['repetitions']}.\n\n{table}\n\n{notes}- {where}\n"
    )
