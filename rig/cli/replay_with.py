"""`rig replay RUN --with CAMPAIGN`: other rows in the waves of a run."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from rig import cli
from rig.analysis.rows import COMPLETE
from rig.cli.console import table_console
from rig.cli.file_problems import REFUSED, refuse
from rig.cli.find_run import find_run
from rig.execution.rehearsal.job import problems
from rig.planning.campaign import open_campaign
from rig.recording.runs import RunError
from rig.sweep.counterfactual import CounterfactualRow, Span, foretell

_SHOWN = {"mechanical_1": "mech. (LCB)", "ac": "AC", "dc": "DC"}
_HEADINGS = {"spring_rate": "spring", "kp": "Kp", "ki": "Ki", "km": "Km"}
_MILLI = 1000.0  # mm in a metre
_LARGE = 0.1  # share of gross power: a model that errs so much is asked about another device


class ReplayOptions(NamedTuple):
    """What the command line asks for beside the run."""

    campaign: Path
    model: Path | None
    by: str | None
    runs: Path


def main(named: Path, wanted: ReplayOptions, *, as_json: bool) -> int:
    """Recover the waves, check the model on the logged rows, run the others; the exit code."""
    console = Console(stderr=True, highlight=False)
    try:
        run = find_run(named, wanted.runs)
        campaign = open_campaign(wanted.campaign, problems)
        model = open_campaign(wanted.model, problems) if wanted.model else None
        with console.status("compiling or reading the compiled loop ...") as status:

            def see(done: int, of: int) -> None:
                status.update(f"simulated {done} of {of} rows ...")

            found = foretell(run, campaign, model=model, by=wanted.by, see=see)
    except (*REFUSED, RunError) as error:
        return refuse("replay", error, as_json=as_json)
    if as_json:
        print(json.dumps(_plain(found)))
    else:
        _say(found, table_console())
    return cli.OK if all(row.state == COMPLETE for row in found.rows) else cli.FAILED


def _plain(found: CounterfactualRow) -> dict[str, Any]:
    """As JSON values; what is unknown is null."""
    waves = found.waves
    told = {
        "run": found.run,
        "campaign": found.campaign,
        "waves": {
            "by": waves.by,
            "rows": waves.rows,
            "periods": waves.periods,
            "scatter_m": waves.scatter.tolist(),
            "left_out": list(waves.left_out),
            **waves.description(),
        },
        "checked": [one._asdict() for one in found.checked],
        "shares": {name: share._asdict() for name, share in found.shares.items()},
        "spans": {name: span._asdict() for name, span in found.spans.items()},
        "identified": {name: span._asdict() for name, span in found.identified.items()},
        "rows": [row._asdict() for row in found.rows],
    }
    plain: dict[str, Any] = _finite(told)
    return plain


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inside) for key, inside in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inside) for inside in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _say(found: CounterfactualRow, console: Console) -> None:
    waves = found.waves
    console.print(
        f"waves of {found.run}: {_counted(len(waves.asked.cycles), 'line')} by {waves.by}, from "
        f"{_counted(waves.periods, 'period')} of {_counted(waves.rows, 'row')}"
    )
    for why in waves.left_out:
        console.print(f"  left out: {why}")
    console.print("\nLogged rows, and the model with the same gains in these waves; W")
    console.print(_checked(found))
    _say_error(found, console)
    console.print(f"\n{found.campaign} in these waves; W, 95 % interval from the errors above")
    console.print(_foretold(found))
    for row in found.rows:
        if row.state != COMPLETE:
            console.print(f"row {row.row} does not get through: {row.why}")
    if any(row.outside for row in found.rows):
        console.print(
            f"beyond: greater than what was logged ({_spans(found.spans)}); the model was not "
            "checked there"
        )
    if any(row.unidentified for row in found.rows):
        console.print(
            f"beyond the twin: greater than what it was identified with "
            f"({_spans(found.identified)}); it is a guess there"
        )
    if len(found.checked) < 2:
        console.print("one logged row tells no scatter, so there are no intervals")


def _say_error(found: CounterfactualRow, console: Console) -> None:
    """How far the model is off in the mean, and by how much rows differ in that."""
    told = []
    for name, words in _SHOWN.items():
        share = found.shares[name]
        scatter = "" if math.isnan(share.scatter) else f" ± {100.0 * share.scatter:.1f}"
        told.append(f"{words} {round(100.0 * share.mean, 1) + 0.0:+.1f}{scatter}")  # no -0.0
    console.print(
        f"logged less model, % of gross power: {', '.join(told)}; the mean is added below"
    )
    if any(abs(found.shares[name].mean) > _LARGE for name in _SHOWN):
        console.print("that is much: look at the model before the rows below are believed")


def _spans(spans: dict[str, Span]) -> str:
    stroke, velocity = spans["stroke"], spans["velocity_rms"]
    return (
        f"stroke {stroke.least * _MILLI:.0f} .. {stroke.greatest * _MILLI:.0f} mm, rms velocity "
        f"{velocity.least:.3g} .. {velocity.greatest:.3g} m/s"
    )


def _counted(count: int, word: str) -> str:
    """So many of something."""
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def _table(settings: list[str]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("row", justify="right")
    for name in settings:
        table.add_column(_HEADINGS.get(name, name.replace("_", " ")), justify="right")
    return table


def _settings(rows: list[dict[str, float]]) -> list[str]:
    """The settings to show: the usual ones, and what differs from row to row."""
    names = [name for name in rows[0] if all(name in row for row in rows)]
    several = {name for name in names if len({row[name] for row in rows}) > 1}
    usual = ("spring_rate", "kp", "ki")
    return [n for n in names if n in usual or (n in several and n != "stator")]


def _checked(found: CounterfactualRow) -> Table:
    settings = _settings([one.setting for one in found.checked])
    table = _table(settings)
    for heading in _SHOWN.values():
        table.add_column(heading, justify="right")
        table.add_column("model", justify="right")
    for one in found.checked:
        cells = [f"{one.setting[name]:g}" for name in settings]
        for name in _SHOWN:
            cells += [f"{one.logged[name]:.2f}", f"{one.modelled[name]:.2f}"]
        table.add_row(str(one.row), *cells)
    return table


def _foretold(found: CounterfactualRow) -> Table:
    settings = _settings([row.setting for row in found.rows])
    table = _table(settings)
    for heading in _SHOWN.values():
        table.add_column(heading, justify="right")
    table.add_column("stroke mm", justify="right")
    flagged = any(row.outside or row.unidentified for row in found.rows)
    if flagged:
        table.add_column("beyond")
    for row in found.rows:
        cells = [f"{row.setting[name]:g}" for name in settings]
        cells += [_interval(row.power[name], row.half_width[name]) for name in _SHOWN]
        stroke = row.amplitude["stroke"]
        cells.append("" if math.isnan(stroke) else f"{stroke * _MILLI:.0f}")
        if flagged:
            beyond = [name.partition("_")[0] for name in row.outside]
            beyond += ["the twin"] if row.unidentified else []
            cells.append(", ".join(beyond))
        table.add_row(str(row.row), *cells)
    return table


def _interval(value: float, half: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isnan(half):
        return f"{value:.2f}"
    return f"{value:.2f} ± {'<0.01' if half < 0.005 else f'{half:.2f}'}"
