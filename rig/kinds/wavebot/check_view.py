"""Output of `rig check`: the campaign, predictions of its rows, warnings and refused rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from rich.console import Console
from rich.table import Table
from rich.text import Text

from controllers.law import Column as LawColumn
from rig.campaign import CheckReport
from rig.campaign.check import duration_text, wave_clock_text
from rig.campaign.simulated_rows import show_equal_rows
from rig.config.law_settings import AxisLaw, shown_columns, value_text
from rig.config.problems import Problem
from rig.design.margin import tightest
from rig.kinds.wavebot.predictions.prediction import (
    PREDICTED_STATIONS,
    Prediction,
    RowPrediction,
)
from rig.kinds.wavebot.predictions.travel import Travel
from rig.presentation.console import WIDTH, plain_table, table_console
from rig.presentation.phrases import count_text, format_duration, unit_text
from rig.stations import in_tables

ROWS_SHOWN = 8  # without --rows
MAX_SPRING_RATES = 12
MAX_WARNINGS = 10
_HIGH_SHARE = 0.75  # of a limit; the view colours values from here on
_LEADING_COLUMNS = (("row", ""), ("spring", "N/m"))  # then those of the law
_RESULT_COLUMNS = (
    ("x", "m"), ("i", "A"), ("rms", "A"), ("surge", "m"),
    *((station.heading, "W") for station in PREDICTED_STATIONS),
)  # fmt: skip
_OPTIONAL_COLUMNS = ("surge", "rms", *(s.heading for s in reversed(PREDICTED_STATIONS) if s.force))
"""Dropped in this order until all fits; the electrical stations stay."""
_UNLIMITED_WIDTH = 10_000  # columns
_VARYING_COLUMNS = {  # shown only where their values change from row to row
    "km": ("Km", "kg"),
    "surge_kp": ("surge Kp", "N s/m"),
    "surge_ki": ("surge Ki", "N/m"),
    "bus_voltage": ("bus", "V"),
    "switching_period": ("period", "s"),
    "hysteresis_tolerance": ("hyst", "A"),
    "velocity_threshold": ("v min", "m/s"),
    "discharge_level": ("dump", ""),
}


class CheckView:
    """Prints a report with predictions: coloured on a terminal, as plain text into a pipe."""

    def __init__(self, *, every_row: bool, console: Console | None = None) -> None:
        self._console = console or table_console()
        self._every_row = every_row

    def show(self, report: CheckReport) -> None:
        """Print the whole report."""
        forecast = report.prediction
        assert isinstance(forecast, Prediction)
        self._print_facts(report, forecast)
        refused = self._print_spring_rates(forecast)
        self._print_rows(forecast, refused)
        self._print_problems("warnings", report.warnings, "yellow")
        self._print_problems("refused", forecast.refused, "red")
        for line in report.prediction_lines():
            self._console.print(line, soft_wrap=True)

    def _print_facts(self, report: CheckReport, forecast: Prediction) -> None:
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", no_wrap=True)
        table.add_column(overflow="fold")
        planned = forecast.travel[0]
        for label, text in report.summary_lines():
            value = _duration_text(planned, forecast) if label == "duration" else Text(text)
            if label == "campaign":
                value.stylize("bold")
            table.add_row(label, value)
        moves = f"{count_text(planned.moves, 'move')} between rows"
        time = f"{planned.moving_time:.3g} s to cover {planned.distance:.3g} % of its travel"
        table.add_row("stator", Text(f"{moves}; {time}"))
        for saving in _order_texts(planned, forecast.travel[1:]):
            table.add_row("order", saving)
        files = ", ".join(f"{role} {path}" for role, path in report.input_files())
        table.add_row("files", Text(files))
        self._console.print(table)

    def _print_spring_rates(self, forecast: Prediction) -> set[int]:
        """Print a line for each spring rate, and return the points that are refused."""
        refused = {row.row.point for row in forecast.rows if any(row.blocking())}
        law, columns = forecast.campaign.axis_laws["heave"], _law_columns(forecast)
        stations = in_tables(PREDICTED_STATIONS)
        stations = stations if self._console.width >= WIDTH else stations[1:]
        table = _table(
            "Predicted, by spring rate",
            f"mean W at {'/'.join(c.label for c in columns)} or row; negative power is absorbed",
            (
                *(("spring", "N/m"), ("rows", ""), ("x peak", "m"), ("i peak", "A")),
                *((f"best {station.heading}", "") for station in stations),
            ),
        )
        groups = _by_spring_rate(forecast.rows)
        for rate, rows in groups[:MAX_SPRING_RATES]:
            allowed = [row for row in rows if row.row.point not in refused]
            table.add_row(
                f"{rate:g}",
                str(len(rows)),
                _range_text([row.predicted.position_peak for row in rows], ".3f"),
                _range_text([row.predicted.current_peak for row in rows], ".1f"),
                *(
                    _best_text(allowed, f"power_{station.name}", law, columns)
                    for station in stations
                ),
            )
        self._console.print()
        self._console.print(table)
        if len(groups) > MAX_SPRING_RATES:
            self._console.print(
                f"  and {len(groups) - MAX_SPRING_RATES} more spring rates", style="dim"
            )
        return refused

    def _print_rows(self, forecast: Prediction, refused: set[int]) -> None:
        rows: Sequence[RowPrediction] = forecast.rows
        title = f"All {len(rows)} rows"
        lead_in = [forecast.lead_in] if forecast.lead_in is not None else []
        if not self._every_row and len(rows) > ROWS_SHOWN:
            rows = sorted(rows, key=lambda row: -tightest(row.margins).used)[:ROWS_SHOWN]
            title = f"The {ROWS_SHOWN} of {len(forecast.rows)} rows nearest to a limit"
        caption = "--rows shows all" if len(rows) < len(forecast.rows) else ""
        law, law_columns = forecast.campaign.axis_laws["heave"], _law_columns(forecast)
        columns = [
            *_LEADING_COLUMNS,
            *((each.label, unit_text(each.unit)) for each in law_columns),
            *_varying_columns(forecast.rows),
            *_RESULT_COLUMNS,
        ]
        shown_rows = [*(lead_in if self._every_row else []), *rows]

        def build_table(left_out: Sequence[str]) -> Table:
            kept = [(name, unit) for name, unit in columns if name not in left_out]
            table = _table(title, caption, kept, "most used\n")
            for row in shown_rows:
                cells = _cells(row, law, law_columns)
                style = "red" if row.row.point in refused else ""
                table.add_row(*(cells[name] for name, _ in kept), _most_used_text(row), style=style)
            return table

        unlimited = self._console.options.update(width=_UNLIMITED_WIDTH)
        tables = (
            build_table(_OPTIONAL_COLUMNS[:count]) for count in range(len(_OPTIONAL_COLUMNS) + 1)
        )
        for table in tables:  # print the first table that fits, or the last one
            if self._console.measure(table, options=unlimited).maximum <= self._console.width:
                break
        self._console.print()
        self._console.print(table)
        show_equal_rows(forecast.equal_rows, every_row=self._every_row, console=self._console)
        self._console.print()

    def _print_problems(self, heading: str, problems: tuple[Problem, ...], style: str) -> None:
        if not problems:
            return
        self._console.print(f"{heading}: {len(problems)}", style=f"bold {style}")
        shown = problems if self._every_row or heading == "refused" else problems[:MAX_WARNINGS]
        for problem in shown:
            self._console.print(Text(problem.text(), style=style), soft_wrap=True)
        if len(shown) < len(problems):
            hidden = len(problems) - len(shown)
            self._console.print(f"and {hidden} more; --rows shows all", style=style)
        self._console.print()


def _table(title: str, caption: str, columns: Iterable[tuple[str, str]], *last: str) -> Table:
    """Return a table of columns with name and unit, aligned to the right, and of the last ones."""
    text = Text(title, style="bold")
    if caption:
        text.append(f"   {caption}", style="dim not bold")
    headings = (f">{name}\n{unit}" for name, unit in columns)
    style = {"title_justify": "left", "title_style": "", "header_style": "dim"}
    return plain_table(*headings, *last, title=text, padding=(0, 1, 0, 0), **style)


def _law_columns(forecast: Prediction) -> tuple[LawColumn, ...]:
    """Return the columns that rows of the law need; of several laws those that any row has."""
    settings = [each.row.setting._asdict() for each in forecast.rows]
    return shown_columns([forecast.campaign.axis_laws["heave"]], settings)


def _varying_columns(rows: Iterable[RowPrediction]) -> list[tuple[str, str]]:
    """Return the columns besides spring, Kp and Ki whose values differ between rows."""
    settings = [row.row.setting for row in rows]
    return [
        column
        for name, column in _VARYING_COLUMNS.items()
        if len({getattr(setting, name, 0.0) for setting in settings}) > 1
    ]


def _cells(prediction: RowPrediction, law: AxisLaw, columns: Iterable[LawColumn]) -> dict[str, str]:
    """Return the cells of a row by column name."""
    predicted, setting = prediction.predicted, prediction.row.setting
    return {
        "row": str(prediction.row.row) if prediction.row.row >= 0 else "lead-in",
        "spring": f"{setting.spring_rate:g}",
        **{each.label: value_text([law], each, setting._asdict()) for each in columns},
        **{
            label: f"{getattr(setting, name, 0.0):g}"
            for name, (label, _) in _VARYING_COLUMNS.items()
        },
        "x": f"{predicted.position_peak:.3f}",
        "i": f"{predicted.current_peak:.1f}",
        "rms": f"{predicted.current_rms:.1f}",
        "surge": f"{predicted.surge_position_peak:.3f}",
        **{s.heading: f"{getattr(predicted, f'power_{s.name}'):.1f}" for s in PREDICTED_STATIONS},
    }


def _most_used_text(prediction: RowPrediction) -> Text:
    margin = tightest(prediction.margins)
    style = "red" if margin.exceeded else "yellow" if margin.used >= _HIGH_SHARE else ""
    return Text(f"{margin.limit.name} {100.0 * min(margin.used, 99.0):.0f} %", style=style)


def _by_spring_rate(rows: Iterable[RowPrediction]) -> list[tuple[float, list[RowPrediction]]]:
    def spring_rate(prediction: RowPrediction) -> float:
        return prediction.row.setting.spring_rate

    ordered = sorted(rows, key=spring_rate, reverse=True)
    return [(rate, list(group)) for rate, group in groupby(ordered, key=spring_rate)]


def _range_text(values: list[float], digits: str) -> str:
    low, high = f"{min(values):{digits}}", f"{max(values):{digits}}"
    return low if low == high else f"{low}-{high}"


def _best_text(
    rows: list[RowPrediction], field: str, law: AxisLaw, columns: Iterable[LawColumn]
) -> str:
    if not rows:
        return "-"
    best = min(rows, key=lambda row: float(getattr(row.predicted, field)))
    power = getattr(best.predicted, field)

    def gains_text(row: RowPrediction) -> str:
        values = row.row.setting._asdict()
        return "/".join(value_text([law], each, values) for each in columns)

    gains = {gains_text(row) for row in rows}
    label = [gains_text(best)]
    if len({row.row.point for row in rows}) > len(gains):  # other settings vary, too
        label = [*(label if len(gains) > 1 else []), f"row {best.row.row}"]
    return f"{power:.1f} at {', '.join(label)}"


def _duration_text(planned: Travel, forecast: Prediction) -> Text:
    text = duration_text(forecast.plan)
    if forecast.plan.least_duration == forecast.plan.duration:
        text = format_duration(planned.duration)  # with the wait for the stator
    if planned.waiting_time > 0.05:
        text += f", {planned.waiting_time:.3g} s of it waits for the stator"
    return Text(f"{text}; {wave_clock_text(forecast.campaign, forecast.plan)}")


def _order_texts(planned: Travel, alternatives: Sequence[Travel]) -> list[Text]:
    """Return a line for each other order with its saving; orders that save nothing share one."""
    texts, equal = [], []
    for travel in alternatives:
        moves, seconds = planned.moves - travel.moves, planned.duration - travel.duration
        if moves == 0 and abs(seconds) < 0.05:
            equal.append(travel.order)
            continue
        verb, style = ("saves", "yellow") if seconds > 0.0 or moves > 0 else ("costs", "")
        saving = f"{count_text(abs(moves), 'move')} and {format_duration(abs(seconds))}"
        texts.append(Text(f"{travel.order}: {verb} {saving}", style=style))
    if equal:
        texts.append(Text(f"{', '.join(equal)}: nothing to save"))
    return texts
