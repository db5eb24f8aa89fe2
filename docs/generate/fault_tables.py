"""The pages of faults: each fault with the expected and the measured reaction of the rig."""

from benchmarks.faults import read_results
from benchmarks.support.fault_page import format_page
from benchmarks.support.fault_rigs import RIGS
from docs.generate.markdown import code, table

_HEAD = """# Faults

Each table lists the faults of a rig's devices, wires and processes, with the required reaction and
the measured one. `configs/faults/` holds the requirements; tests inject each fault into an emulated
device and compare.

"""


def page(name: str) -> str:
    """Return the page of a rig's table."""
    rig = RIGS[name]
    return format_page(rig, rig.rows(), read_results(rig))


def index() -> str:
    """Return the page that lists the tables, with the number of their measured rows."""
    lines = []
    for name, rig in RIGS.items():
        rows, results = rig.rows(), read_results(rig)
        names = {row.name for row in rows} & results.keys()
        expected = sum(bool(results[each]["as_expected"]) for each in names)
        link = f"[{rig.title.partition(':')[0]}](faults_{name}.md)"
        lines.append([link, code(f"configs/faults/{name}.yaml"), len(rows), len(names), expected])
    return _HEAD + table(["table", "requirements", "faults", "measured", "as required"], lines)
