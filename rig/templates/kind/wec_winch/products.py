"""The products of a hold test: the mean height and force of every row."""

from pathlib import Path
from typing import Any

from rig.analysis.run_products import RunProducts, RunSummary
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, open_run

PROGRESS = "averaging the holds"
NO_PRODUCTS = RunProducts((), {"holds": []})


def _holds(run: Path) -> list[dict[str, float]]:
    fields = ["plan.row", "plan.phase", "axis.estimate.position", "axis.command.force"]
    data = open_run(run, fields=fields)
    rows, position, force = (data[name].values for name in (fields[0], *fields[2:]))
    measured = data["plan.phase"].values == Phase.MEASURE
    holds = []
    for row in sorted(set(rows[measured].tolist())):
        window = measured & (rows == row)
        means = {
            "position_m": float(position[window].mean()),
            "force_n": float(force[window].mean()),
        }
        holds.append({"row": int(row), **means})
    return holds


def after_run(folder: Path, outcome: Any) -> RunProducts:
    try:
        holds = _holds(folder)
    except RunError as error:
        return NO_PRODUCTS._replace(trouble=str(error))
    return RunProducts((), {"holds": holds}, _text(holds), len(holds))


def summarise(run: Path, calibrations: Any, *, incomplete_rows: bool) -> RunSummary:
    holds = _holds(run)
    return RunSummary(_text(holds), {"holds": holds})


def draw(run: Path, options: Any) -> list[Path]:
    return []


def _text(holds: list[dict[str, float]]) -> str:
    return "\n".join(
        f"row {hold['row']}: {hold['position_m']:.4f} m, {hold['force_n']:.1f} N" for hold in holds
    )
