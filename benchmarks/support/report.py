"""Stored results: one JSON file per measurement, and one page with the tables of all of them."""

import json
from pathlib import Path
from typing import Any

from benchmarks.support.result import HEADINGS, Figure, table_cells

_HEAD = """\
# Measured

Written by `make bench` (`python -m benchmarks`); not edited by hand. Medians, followed by the least
and the greatest of all repetitions. "Other work" is the load by other processes during the
measurement, in cores; "stolen" is the time that other virtual machines on the host took. Targets
apply to ratios measured side by side in one run where the host's speed matters; the raw figures
stand above them.
"""


def store(folder: Path, name: str, result: dict[str, Any], order: list[str]) -> None:
    """Write a result, and the page with all stored results in this order."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(result, indent=2, ensure_ascii=False)
    (folder / f"{name}.json").write_text(text + "\n")
    paths = [folder / f"{each}.json" for each in order if (folder / f"{each}.json").exists()]
    results = [json.loads(path.read_text()) for path in paths]
    (folder / "README.md").write_text(_HEAD + "".join(_section(one) for one in results))


def format_missed(missed: list[str]) -> str:
    """Return the last lines of a run: the targets that were missed."""
    if not missed:
        return "every target was met"
    return "\n".join(["targets missed:", *(f"  {line}" for line in missed)])


def _section(result: dict[str, Any]) -> str:
    figures = [Figure(**figure) for figure in result["figures"]]
    rows = [HEADINGS, ("---",) * len(HEADINGS), *(table_cells(figure) for figure in figures)]
    table = "\n".join(f"| {' | '.join(cell.strip() for cell in row)} |" for row in rows)
    host, load = result["host"], result["load"]
    where = (
        f"{host['date']}, {host['processor']}, {host['cores']} cores"
        f"{', virtual machine' if host['virtual_machine'] else ''}, Linux {host['kernel']}, "
        f"Python {host['python']}; other work {load['other_work_cores']:g}, "
        f"stolen {load['stolen_cores']:g}; {result['took_s']:g} s"
    )
    notes = "".join(f"- {note}\n" for note in result["notes"])
    return (
        f"\n## {result['name']}\n\n{result['description'][0].upper()}{result['description'][1:]}; "
        f"{result['repetitions']}.\n\n{table}\n\n{notes}- {where}\n"
    )
