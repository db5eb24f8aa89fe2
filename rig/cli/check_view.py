"""What `rig check` shows: the campaign, its rows as predicted, warnings, what is refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from rich.console import Console
from rich.table import Table
from rich.text import Text

from rig.cli.console import WIDTH, table_console
from rig.config.problems import Problem
from rig.design.predictions import Prediction, RowPrediction, Travel, tightest
from rig.planning.campaign import CheckReport
from rig.planning.campaign.check import format_duration

FEW = 8  # rows shown unless all are asked for
MOST_SPRINGS = 12
MOST_TOLD = 10
_STATIONS = (("mech 1", "power_mechanical_1"), ("AC", "power_ac"), ("DC", "power_dc"))
_HIGH = 0.75  # share of a limit from which it is coloured
_BEFORE = (("row", ""), ("spring", "N/m"), ("Kp", "N s/m"), ("Ki", "N/m"))
_AFTER = (
    ("x", "m"), ("i", "A"), ("rms", "A"), ("surge", "m"), ("mech 1", "W"), ("mech 2", "W"),
    ("AC", "W"), ("DC", "W"),
)  # fmt: skip
_LEFT_OUT = ("surge", "rms", "mech 2", "mech 1")  # one after the other, until the rest fits
_ENDLESS = 10_000  # columns
_ALSO = {  # columns shown where they change from row to row
    "km": ("Km", "kg"),
    "surge_kp": ("surge Kp", "N s/m"),
    "surge_ki": ("surge Ki", "N/m"),
    "bus_voltage": ("bus", "V"),
    "switching_period": ("period", "s"),
    "hysteresis_tolerance": ("hyst", "A"),
    "velocity_threshold": ("v min", "m/s"),
    "discharge_level": ("dump", ""),
}


class View:
    """Draws a report with a prediction on the terminal, or as plain text into a pipe."""

    def __init__(self, *, every_row: bool, console: Console | None = None) -> None:
        self._out = console or table_console()
        self._every_row = every_row

    def show(self, report: CheckReport) -> None:
        """Everything there is to say."""
        forecast = report.prediction
        assert isinstance(forecast, Prediction)
        self._facts(report, forecast)
        refused = self._by_spring(forecast)
        self._rows(forecast, refused)
        self._told("warnings", report.warnings, "yellow")
        self._told("refused", forecast.refused, "red")
        self._verdict(forecast)

    def _facts(self, report: CheckReport, forecast: Prediction) -> None:
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", no_wrap=True)
        table.add_column(overflow="fold")
        now = forecast.travel[0]
        for label, text in report.summary_lines():
            told = _duration(now, forecast) if label == "duration" else Text(text)
            if label == "campaign":
                told.stylize("bold")
            table.add_row(label, told)
        table.add_row("stator", _stator(now))
        for told in _savings(now, forecast.travel[1:]):
            table.add_row("order", told)
        files = ", ".join(f"{role} {path}" for role, path in report.input_files())
        table.add_row("files", Text(files))
        self._out.print(table)

    def _by_spring(self, forecast: Prediction) -> set[int]:
        """A line for each spring rate; gives the points that are refused."""
        refused = {one.row.point for one in forecast.rows if any(one.broken())}
        table = _table("Predicted, by spring rate", "mean W at Kp/Ki or row; absorbed is negative")
        for name, unit in (("spring", "N/m"), ("rows", ""), ("x peak", "m"), ("i peak", "A")):
            table.add_column(f"{name}\n{unit}", justify="right", no_wrap=True)
        stations = _STATIONS if self._out.width >= WIDTH else _STATIONS[1:]
        for name, _ in stations:
            table.add_column(f"best {name}\n", justify="right", no_wrap=True)
        groups = _springs(forecast.rows)
        for rate, rows in groups[:MOST_SPRINGS]:
            allowed = [one for one in rows if one.row.point not in refused]
            table.add_row(
                f"{rate:g}",
                str(len(rows)),
                _range([one.predicted.position_peak for one in rows], ".3f"),
                _range([one.predicted.current_peak for one in rows], ".1f"),
                *(_best(allowed, field) for _, field in stations),
            )
        self._out.print()
        self._out.print(table)
        if len(groups) > MOST_SPRINGS:
            self._out.print(f"  and {len(groups) - MOST_SPRINGS} more spring rates", style="dim")
        return refused

    def _rows(self, forecast: Prediction, refused: set[int]) -> None:
        rows: Sequence[RowPrediction] = forecast.rows
        title = f"All {len(rows)} rows"
        lead_in = [forecast.lead_in] if forecast.lead_in is not None else []
        if not self._every_row and len(rows) > FEW:
            rows = sorted(rows, key=lambda one: -tightest(one.margins).used)[:FEW]
            title = f"The {FEW} of {len(forecast.rows)} rows nearest to a limit"
        caption = "--rows shows all" if len(rows) < len(forecast.rows) else ""
        columns = [*_BEFORE, *_changing(forecast.rows), *_AFTER]
        shown = [*(lead_in if self._every_row else []), *rows]

        def drawn(left_out: Sequence[str]) -> Table:
            table = _table(title, caption)
            kept = [(name, unit) for name, unit in columns if name not in left_out]
            for name, unit in kept:
                table.add_column(f"{name}\n{unit}", justify="right", no_wrap=True)
            table.add_column("most used\n", no_wrap=True)
            for one in shown:
                cells = _cells(one)
                style = "red" if one.row.point in refused else ""
                table.add_row(*(cells[name] for name, _ in kept), _most_used(one), style=style)
            return table

        endless = self._out.options.update(width=_ENDLESS)
        tables = (drawn(_LEFT_OUT[:count]) for count in range(len(_LEFT_OUT) + 1))
        for table in tables:  # the first that fits, or the last
            if self._out.measure(table, options=endless).maximum <= self._out.width:
                break
        self._out.print()
        self._out.print(table)
        self._out.print()

    def _told(self, what: str, problems: tuple[Problem, ...], style: str) -> None:
        if not problems:
            return
        self._out.print(f"{what}: {len(problems)}", style=f"bold {style}")
        shown = problems if self._every_row or what == "refused" else problems[:MOST_TOLD]
        for problem in shown:
            self._out.print(Text(problem.text(), style=style), soft_wrap=True)
        if len(shown) < len(problems):
            left = len(problems) - len(shown)
            self._out.print(f"and {left} more; --rows shows all", style=style)
        self._out.print()

    def _verdict(self, forecast: Prediction) -> None:
        if forecast.refused:
            self._out.print("the campaign cannot be run", style="bold red")
        else:
            self._out.print("the campaign can be run", style="bold green")


def _table(title: str, caption: str) -> Table:
    text = Text(title, style="bold")
    if caption:
        text.append(f"   {caption}", style="dim not bold")
    return Table(
        title=text,
        title_justify="left",
        box=None,
        padding=(0, 1, 0, 0),
        header_style="dim",
        title_style="",
        pad_edge=False,
    )


def _changing(rows: Iterable[RowPrediction]) -> list[tuple[str, str]]:
    """The columns beside spring, Kp and Ki that are not the same in all rows."""
    settings = [one.row.setting for one in rows]
    return [
        told
        for name, told in _ALSO.items()
        if len({getattr(setting, name) for setting in settings}) > 1
    ]


def _cells(one: RowPrediction) -> dict[str, str]:
    """What a row's line says, by column."""
    found, setting = one.predicted, one.row.setting
    return {
        "row": str(one.row.row) if one.row.row >= 0 else "lead-in",
        "spring": f"{setting.spring_rate:g}",
        "Kp": f"{setting.kp:g}",
        "Ki": f"{setting.ki:g}",
        **{told: f"{getattr(setting, name):g}" for name, (told, _) in _ALSO.items()},
        "x": f"{found.position_peak:.3f}",
        "i": f"{found.current_peak:.1f}",
        "rms": f"{found.current_rms:.1f}",
        "surge": f"{found.surge_position_peak:.3f}",
        "mech 1": f"{found.power_mechanical_1:.1f}",
        "mech 2": f"{found.power_mechanical_2:.1f}",
        "AC": f"{found.power_ac:.1f}",
        "DC": f"{found.power_dc:.1f}",
    }


def _most_used(one: RowPrediction) -> Text:
    most = tightest(one.margins)
    style = "red" if most.broken else "yellow" if most.used >= _HIGH else ""
    return Text(f"{most.limit.name} {100.0 * min(most.used, 99.0):.0f} %", style=style)


def _springs(rows: Iterable[RowPrediction]) -> list[tuple[float, list[RowPrediction]]]:
    def rate(one: RowPrediction) -> float:
        return one.row.spring_rate

    ordered = sorted(rows, key=rate, reverse=True)
    return [(found, list(group)) for found, group in groupby(ordered, key=rate)]


def _range(values: list[float], digits: str) -> str:
    low, high = f"{min(values):{digits}}", f"{max(values):{digits}}"
    return low if low == high else f"{low}-{high}"


def _best(rows: list[RowPrediction], field: str) -> str:
    if not rows:
        return "-"
    best = min(rows, key=lambda one: float(getattr(one.predicted, field)))
    power, setting = getattr(best.predicted, field), best.row.setting
    gains = {(one.row.setting.kp, one.row.setting.ki) for one in rows}
    at = [f"{setting.kp:g}/{setting.ki:g}"]
    if len({one.row.point for one in rows}) > len(gains):  # something else varies, too
        at = [*(at if len(gains) > 1 else []), f"row {best.row.row}"]
    return f"{power:.1f} at {', '.join(at)}"


def _duration(now: Travel, forecast: Prediction) -> Text:
    waits = f", {now.waiting:.3g} s of it waiting for the stator" if now.waiting > 0.05 else ""
    return Text(
        f"{format_duration(now.duration)}{waits}; wave clock {forecast.plan.wave_seconds:.6g} s"
    )


def _stator(now: Travel) -> Text:
    moves = f"{now.moves} move{'s' if now.moves != 1 else ''} between rows"
    return Text(f"{moves}; {now.moving:.3g} s on its way over {now.way:.3g} % of its travel")


def _savings(now: Travel, others: Sequence[Travel]) -> list[Text]:
    """What other orders would save, a line each; those that save nothing share one."""
    same = [one for one in others if one.moves == now.moves and abs(_gain(now, one)) < 0.05]
    told = [_saving(now, one) for one in others if one not in same]
    if same:
        told.append(Text(f"{', '.join(one.order for one in same)}: nothing to save"))
    return told


def _gain(now: Travel, other: Travel) -> float:
    return now.duration - other.duration


def _saving(now: Travel, other: Travel) -> Text:
    moves, seconds = now.moves - other.moves, _gain(now, other)
    verb = "saves" if seconds > 0.0 or moves > 0 else "costs"
    return Text(
        f"{other.order}: {verb} {abs(moves)} move{'s' if abs(moves) != 1 else ''} and "
        f"{format_duration(abs(seconds))}",
        style="yellow" if verb == "saves" else "",
    )
