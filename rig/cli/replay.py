"""`rig replay RUN [--with CAMPAIGN]`."""

import math
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from rig.analysis.rows import COMPLETE
from rig.campaign import AnyCampaign, open_campaign
from rig.cli.input_files import CAMPAIGNS, find_run, input_file
from rig.cli.options import RUNS, Interpreted, Json, Runs
from rig.cli.output import FAILED, OK, input_errors, print_json
from rig.execution.replay import ReplayReport, replay
from rig.presentation.console import plain_table, table_console, whole_table
from rig.presentation.json_values import json_value
from rig.presentation.phrases import count_text
from rig.row_contents import Column, main_columns
from rig.stations import in_tables

if TYPE_CHECKING:
    from rig.sweeps.counterfactual import AmplitudeRange, CounterfactualResult

EXIT_CODES = """\
Exit codes: 0 today's cycle reproduces every command and mode to the bit (--with: every row \
completes); 1 it does not; 2 no such run or file, or one that cannot be replayed."""
_MAX_FIELDS = 40  # fields shown
_MM_PER_M = 1000.0  # mm in a metre
_LARGE_ERROR = 0.1  # share of gross power; such a model describes another device


class Waves(Enum):
    """Ways to recover the waves of a run (`rig.identification.incident_waves`)."""

    ELEVATION = "elevation"
    FORCES = "forces"


def command(
    run: Annotated[Path, typer.Argument(help="A run's folder or MCAP file, its id, or 'last'.")],
    runs: Runs = RUNS,
    as_json: Json = False,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--with", metavar="CAMPAIGN", help="Campaign whose rows to simulate in the run's waves."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="CAMPAIGN", help="With --with: campaign whose plant models the rig."
        ),
    ] = None,
    interpreted: Interpreted = False,
    waves: Annotated[
        Waves | None,
        typer.Option("--waves", help="With --with: signal from which to recover the waves."),
    ] = None,
) -> int:
    """Replay a run's logged sensors through today's cycle; compare commands and modes per tick.

    With --with CAMPAIGN, the command predicts the power of the campaign's
    rows in the waves of the run, with a 95 % interval.
    """
    if campaign is None and (model is not None or waves is not None):
        raise typer.BadParameter("--model and --waves need --with")
    if campaign is not None:
        method = waves.value if waves else None
        return _replay_with(run, runs, campaign, model, method, as_json=as_json)
    console = Console(stderr=True, highlight=False)
    with input_errors("replay", as_json=as_json):
        path = find_run(run, runs)
        if as_json or not console.is_terminal:
            comparison = replay(path, interpreted=interpreted)
        else:
            with console.status("replaying ...") as status:
                comparison = replay(
                    path,
                    lambda ticks: status.update(f"replaying, {ticks} ticks ..."),
                    interpreted=interpreted,
                )
    if as_json:
        report = comparison._asdict() | {"same": comparison.identical}
        print_json(json_value(report))
    else:
        _print_report(comparison)
    return OK if comparison.identical else FAILED


def _print_report(comparison: ReplayReport) -> None:
    if comparison.notice:
        print(comparison.notice)
    for request in comparison.requests:
        print(f"tick {request.tick}: the log shows a request, {request.name}; applied again")
    if not comparison.finished:
        print("the record was not finished: ticks after its last one are not compared; "
              "`rig recover` lists what is missing")  # fmt: skip
    if comparison.absent:
        print(f"the run has no {', '.join(comparison.absent)}: not compared")
    compared = f"{comparison.fields} fields of {comparison.ticks} ticks"
    if comparison.identical:
        print(f"no diff: {compared} are the same to the bit")
        return
    first = comparison.differences[0]
    logged, replayed = _number_text(first.logged), _number_text(first.replayed)
    print(
        f"first difference in tick {first.first}: "
        f"{first.field} was {logged}, is {replayed} {first.unit}"
    )
    print(f"{len(comparison.differences)} of {compared} differ\n")
    table = plain_table("field", "unit", ">ticks", ">first", ">logged", ">replayed", ">largest")
    for each in comparison.differences[:_MAX_FIELDS]:
        numbers = map(_number_text, (each.logged, each.replayed, each.largest))
        table.add_row(each.field, each.unit, str(each.ticks), str(each.first), *numbers)
    table_console().print(whole_table(table), soft_wrap=True)
    if len(comparison.differences) > _MAX_FIELDS:
        print(f"and {len(comparison.differences) - _MAX_FIELDS} more fields; --json lists all")


def _number_text(value: float | None) -> str:
    return "no number" if value is None else f"{value:.6g}"


def _replay_with(
    run_name: Path,
    runs: Path,
    campaign_name: Path,
    model_name: Path | None,
    method: str | None,
    *,
    as_json: bool,
) -> int:
    """Recover the waves, check the model on the logged rows, and simulate the campaign's rows.

    Returns the exit code.
    """
    console = Console(stderr=True, highlight=False)
    from rig.kinds.rig_file import kind_of_task
    from rig.sweeps.counterfactual import counterfactual_for_run  # numba
    from rig.sweeps.simulator import campaign_kind, problems, simulation_of

    with (
        input_errors("replay", as_json=as_json),
        console.status("compiling or reading the compiled loop ...") as status,
    ):
        run = find_run(run_name, runs)

        def open_checked(name: Path) -> AnyCampaign:
            path = input_file(name, CAMPAIGNS)
            return open_campaign(campaign_kind(kind_of_task(path)), path, problems)

        campaign = open_checked(campaign_name)
        model = open_checked(model_name) if model_name else None

        def show_progress(done: int, of: int) -> None:
            status.update(f"simulated {done} of {of} rows ...")

        result = counterfactual_for_run(
            run, campaign, model=model, method=method, on_progress=show_progress
        )
    if as_json:
        print_json(_as_dict(result))
    else:
        contents = simulation_of(campaign).row_contents(campaign)
        headings = {station.name: station.heading for station in in_tables(contents.stations)}
        _print_prediction(result, headings, contents.columns, table_console())
    return OK if all(row.state == COMPLETE for row in result.rows) else FAILED


def _as_dict(result: "CounterfactualResult") -> dict[str, Any]:
    """Return the result as JSON values; null for unknown values."""
    waves = result.waves
    values: dict[str, Any] = json_value(
        {
            "run": result.run,
            "campaign": result.campaign,
            "waves": {
                "by": waves.method,
                "rows": waves.rows,
                "periods": waves.periods,
                "scatter_m": waves.scatter.tolist(),
                "left_out": list(waves.skipped_rows),
                **waves.description(),
            },
            "checked": result.comparisons,
            "shares": result.shares,
            "spans": result.logged_ranges,
            "identified": result.identified_ranges,
            "rows": result.rows,
        }
    )
    return values


def _print_prediction(
    result: "CounterfactualResult",
    headings: dict[str, str],
    columns: tuple[Column, ...],
    console: Console,
) -> None:
    waves = result.waves
    lines = count_text(len(waves.wave_maker.cycles), "line")
    periods, rows = count_text(waves.periods, "period"), count_text(waves.rows, "row")
    console.print(f"waves of {result.run}: {lines} by {waves.method}, from {periods} of {rows}")
    for why in waves.skipped_rows:
        console.print(f"  left out: {why}")
    console.print("\nLogged rows, and the model with the same gains in these waves; W")
    console.print(_logged_rows_table(result, headings, columns))
    _print_model_error(result, headings, console)
    console.print(f"\n{result.campaign} in these waves; W, 95 % interval from the errors above")
    console.print(_predicted_rows_table(result, headings, columns))
    for row in result.rows:
        if row.state != COMPLETE:
            console.print(f"row {row.row} does not complete: {row.incomplete_reason}")
    if any(row.beyond_logged for row in result.rows):
        console.print(
            f"beyond: greater than in the logged rows ({_span_text(result.logged_ranges)}); "
            "the model was not checked there"
        )
    if any(row.beyond_identified for row in result.rows):
        console.print(
            f"beyond the twin: greater than in the data of its identification "
            f"({_span_text(result.identified_ranges)}); the twin extrapolates there"
        )
    if len(result.comparisons) < 2:
        console.print("one logged row gives no scatter, so there are no intervals")


def _print_model_error(
    result: "CounterfactualResult", headings: dict[str, str], console: Console
) -> None:
    """Print the model's mean error and its scatter between rows."""
    texts = []
    for name, label in headings.items():
        share = result.shares[name]
        scatter = "" if math.isnan(share.scatter) else f" ± {100.0 * share.scatter:.1f}"
        texts.append(f"{label} {round(100.0 * share.mean, 1) + 0.0:+.1f}{scatter}")  # no -0.0
    console.print(
        f"logged minus model, % of gross power: {', '.join(texts)}; the mean is added below"
    )
    if any(abs(result.shares[name].mean) > _LARGE_ERROR for name in headings):
        console.print("this error is large: check the model before you use the rows below")


def _span_text(spans: "dict[str, AmplitudeRange]") -> str:
    stroke, velocity = spans["stroke"], spans["velocity_rms"]
    least, greatest = stroke.least * _MM_PER_M, stroke.greatest * _MM_PER_M
    return (
        f"stroke {least:.0f} .. {greatest:.0f} mm, "
        f"rms velocity {velocity.least:.3g} .. {velocity.greatest:.3g} m/s"
    )


def _settings_table(
    columns: tuple[Column, ...], rows: list[dict[str, float]], *headings: str
) -> tuple[Table, list[list[str]]]:
    """Return a table of row number, settings and ``headings``, and each row's settings as cells.

    The settings are those of the main columns, and all that differ between rows.
    """
    always_shown, chosen = main_columns(columns), []
    for column in columns:
        values = {row.get(column.name) for row in rows}
        if None not in values and (column in always_shown or len(values) > 1):
            chosen.append(column)
    settings = (f">{column.heading or column.label}" for column in chosen)
    cells = [[f"{row[column.name]:g}" for column in chosen] for row in rows]
    return plain_table(">row", *settings, *headings), cells


def _logged_rows_table(
    result: "CounterfactualResult", headings: dict[str, str], columns: tuple[Column, ...]
) -> Table:
    powers = [text for heading in headings.values() for text in (f">{heading}", ">model")]
    rows = [row.setting for row in result.comparisons]
    table, settings = _settings_table(columns, rows, *powers)
    for row, cells in zip(result.comparisons, settings, strict=True):
        for name in headings:
            cells += [f"{row.logged[name]:.2f}", f"{row.modelled[name]:.2f}"]
        table.add_row(str(row.row), *cells)
    return table


def _predicted_rows_table(
    result: "CounterfactualResult", headings: dict[str, str], columns: tuple[Column, ...]
) -> Table:
    any_beyond = any(row.beyond_logged or row.beyond_identified for row in result.rows)
    further = [*(f">{heading}" for heading in headings.values()), ">stroke mm"]
    further += ["beyond"] if any_beyond else []
    table, settings = _settings_table(columns, [row.setting for row in result.rows], *further)
    for row, cells in zip(result.rows, settings, strict=True):
        cells += [_interval_text(row.power[name], row.half_width[name]) for name in headings]
        stroke = row.amplitude["stroke"]
        cells.append("" if math.isnan(stroke) else f"{stroke * _MM_PER_M:.0f}")
        if any_beyond:
            beyond = [name.partition("_")[0] for name in row.beyond_logged]
            beyond += ["the twin"] if row.beyond_identified else []
            cells.append(", ".join(beyond))
        table.add_row(str(row.row), *cells)
    return table


def _interval_text(value: float, half: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isnan(half):
        return f"{value:.2f}"
    return f"{value:.2f} ± {'<0.01' if half < 0.005 else f'{half:.2f}'}"
