"""The row table: means of each row of the gain matrix over its measurement window.

Absorbed power is negative. Rows whose window was cut short are listed with their state and excluded
from surfaces. So are rows whose window lacks ticks in the record (`INCOMPLETE`); their means are
withheld (NaN) unless requested. The standard error of a mean comes from the means over whole wave
periods. It is unknown (NaN) where a window holds only one repeat period of an irregular sea, unless
the point was repeated. The table also holds the checks of `rig.analysis.quality`.
"""

import json
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis import calibrated, quality, run_columns
from rig.analysis.calibrated import RECORDED
from rig.analysis.run_columns import plan_columns
from rig.config.columns import COLUMNS, Column
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import reader
from rig.recording.runs.folder import RunInfo, run_info
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.state import RecordCheck
from rig.recording.runs.windows import (
    ALL_TICKS_MISSING,
    Window,
    missing_rows,
    planned_ticks,
    read_windows,
)
from rig.stations import Station, as_records, station_names

if TYPE_CHECKING:
    import xarray

MEAN_POSITION_ALARM = 0.005  # m; an encoder bias adds a constant force of Ki times the bias

COMPLETE, INTERRUPTED, NOT_RUN = "complete", "cut short", "not run"
INCOMPLETE = "record incomplete"  # fully measured, but the record lacks ticks
STATIONS_ATTRIBUTE = "stations"  # of the dataset: the run's power stations, as JSON

MOTION_FIELDS = {
    "position": "heave.estimate.position",
    "velocity": "heave.estimate.velocity",
    "current": "heave.sense.current",
    "force": "heave.command.force",
}
LOGGED_SETTINGS = {  # log fields that give the set point of a run without a plan
    "spring_rate": "spring_command.rate",
    "stator": "spring_command.target",
    "kp": "heave.demand.kp",
    "ki": "heave.demand.ki",
    "km": "heave.demand.km",
    "reference_scale": "reference.scale",
    "surge_kp": "surge.demand.kp",
    "surge_ki": "surge.demand.ki",
    "bus_voltage": "drive_command.settings.bus_voltage",
    "switching_period": "drive_command.settings.switching_period",
    "hysteresis_tolerance": "drive_command.settings.hysteresis_tolerance",
    "velocity_threshold": "drive_command.settings.velocity_threshold",
    "discharge_level": "drive_command.settings.discharge_level",
}
SETTINGS = {"spring_rate": "N/m", "stator": "%"} | {c.name: c.unit for c in COLUMNS}


def required_fields(stations: Iterable[Station]) -> list[str]:
    """Return the log fields that the table needs, besides ``time`` and those of the windows."""
    return [
        *(f"power.{station.name}" for station in stations),
        *MOTION_FIELDS.values(),
        *(station.force for station in stations if station.force),
        "heave.command.limited",
        "heave.warned",
        "tare.samples",
    ]


def column_units(stations: Iterable[Station]) -> dict[str, str]:
    """Return the units of the table's numbers by column, those of powers by station."""
    return {
        **{f"power_{station.name}": "W" for station in stations},
        **{f"power_{station.name}_se": "W" for station in stations},
        **{f"power_{station.name}_demeaned": "W" for station in stations if station.force},
        **{
            f"{name}_{kind}": unit
            for name, unit in zip(MOTION_FIELDS, ("m", "m/s", "A", "N"), strict=True)
            for kind in ("mean", "rms", "peak")
        },
        **SETTINGS,
        "stroke": "m",
        "start": "s",
        **quality.UNITS,
    }


def wave_period(plan: dict[str, Any]) -> float | None:
    """Return the repeat period of a plan's sea in s; None if the sea does not repeat."""
    sea = plan.get("sea") or {}
    if sea.get("frequency_hz"):
        return 1.0 / float(sea["frequency_hz"])
    period = sea.get("period_s") or plan.get("repeat_s") or sea.get("repeat_s")
    return float(period) if period else None


def period_means(values: Any, ticks: Any, period_ticks: float) -> Any:
    """Return the means of ``values`` over each whole period of ``period_ticks`` ticks."""
    elapsed = ticks - ticks[0]
    # Windows end on the nearest sample, so the last period may lack half a tick.
    periods = int((elapsed[-1] + 1.5) / period_ticks)
    edges = np.searchsorted(elapsed, np.round(np.arange(periods + 1) * period_ticks))
    nonempty = np.flatnonzero(np.diff(edges))
    return np.array([values[edges[i] : edges[i + 1]].mean() for i in nonempty])


def standard_error(means: Any) -> float:
    """Return the standard error of the mean of equally weighted means; NaN for fewer than two."""
    count = len(means)
    return float(np.std(means, ddof=1) / np.sqrt(count)) if count > 1 else float("nan")


def flag_names(kind: type[LimitFlag] | type[WarningFlag], values: Any) -> str:
    """Return the names of all flags raised in ``values``, separated by spaces."""
    raised = int(np.bitwise_or.reduce(values)) if len(values) else 0
    return " ".join(str(flag.name) for flag in kind if raised & flag)


def reduce_window(
    window: Window, period_ticks: float | None, stations: Iterable[Station]
) -> dict[str, Any]:
    """Return the row-table entry of one window by column name, in SI units.

    ``period_ticks`` is the repeat period of the sea in ticks; None if the sea does not repeat.
    """
    data: Records = window.data
    entry: dict[str, Any] = {
        "row": window.row,
        "attempt": window.attempt,
        "state": INTERRUPTED if window.incomplete_reason else COMPLETE,
        "incomplete_reason": window.incomplete_reason,
        "samples": len(data),
        "lost_ticks": window.span - len(data),
        "ticks_expected": window.expected,
        "ticks_missing": window.missing,
        "tare_samples": int(data["tare.samples"].min()),
        "start": float(data["time"][0]),
        "limits": flag_names(LimitFlag, data["heave.command.limited"]),
        "warned": flag_names(WarningFlag, data["heave.warned"]),
        "periods": 0,
    }
    for name in station_names(stations):
        values = data[f"power.{name}"]
        entry[f"power_{name}"] = float(values.mean())
        entry[f"power_{name}_se"] = float("nan")
        if period_ticks is not None:
            means = period_means(values, data["tick"], period_ticks)
            entry["periods"] = len(means)
            entry[f"power_{name}_se"] = standard_error(means)
    velocity = data[MOTION_FIELDS["velocity"]]
    for station in stations:
        if station.force:
            force = data[station.force]
            mean = (force * velocity).mean() - force.mean() * velocity.mean()
            entry[f"power_{station.name}_demeaned"] = float(mean)
    for name, field in MOTION_FIELDS.items():
        values = data[field]
        entry[f"{name}_mean"] = float(values.mean())
        entry[f"{name}_rms"] = float(np.sqrt((values * values).mean()))
        entry[f"{name}_peak"] = float(np.abs(values).max())
    entry["stroke"] = float(np.ptp(data[MOTION_FIELDS["position"]]))
    for name, field in LOGGED_SETTINGS.items():  # a value in the plan replaces it later
        logged = field in (data.dtype.names or ())
        entry[name] = float(data[field].mean()) if logged else float("nan")
    entry["realisation"] = float("nan")  # only the plan gives it
    return {**entry, **quality.quality_columns(data)}


def _add_repetition_errors(table: list[dict[str, Any]], stations: Iterable[Station]) -> None:
    """Fill unknown standard errors of rows with the standard deviation over repetitions."""
    for name in station_names(stations):
        by_point: dict[int, list[dict[str, Any]]] = {}
        for row in table:
            if row["state"] == COMPLETE and np.isnan(row[f"power_{name}_se"]):
                by_point.setdefault(row["point"], []).append(row)
        for rows in by_point.values():
            if len(rows) > 1:
                scatter = float(np.std([row[f"power_{name}"] for row in rows], ddof=1))
                for row in rows:
                    row[f"power_{name}_se"] = scatter


def row_table(
    run: str | os.PathLike[str],
    mean_position_alarm: float = MEAN_POSITION_ALARM,
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> "xarray.Dataset":
    """Return the row table of a finished or unfinished run, with one entry per row in order of id.

    The table covers all planned and measured rows. Values that the run did not log are NaN. The
    units of the variables are in ``attrs``. ``samples`` counts the recorded ticks of a window,
    ``ticks_expected`` the executed ones, ``ticks_missing`` the lost ones. ``stroke`` is peak to
    peak. ``power_*_demeaned`` is mean(F v) - mean(F) mean(v). ``power_*_se`` is the standard error
    of the mean of that row.

    Rows whose mean heave or surge position is farther from zero than ``mean_position_alarm`` (m)
    are flagged. ``calibrations`` correct the rows, at most one for each quantity; errors are those
    of `rig.analysis.calibrated.build_corrections`. With ``incomplete_rows`` rows that lack ticks in
    the record keep their means.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    corrections = calibrated.build_corrections(calibrations, run_facts)
    dt = run_facts.plan.get("dt")
    period = wave_period(run_facts.plan)
    period_ticks = period / float(dt) if period and dt else None
    planned = {int(row["row"]): row for row in run_facts.plan.get("rows", [])}
    measured: dict[int, dict[str, Any]] = {}
    available = [leaf.name for leaf in source.leaves]
    stations = tuple(each for each in run_facts.stations if f"power.{each.name}" in available)
    units = column_units(stations)
    logged = set(available) & set(LOGGED_SETTINGS.values()) | set(
        quality.required_fields(available)
    )
    fields = ["time", *required_fields(stations), *sorted(logged)]
    reading = RecordCheck(source.contents, source.damage)
    for raw_window in read_windows(
        source, fields, run_facts.plan, incomplete_rows=True, reading=reading
    ):
        if raw_window.row < 0:
            continue
        length = planned_ticks(planned.get(raw_window.row, {}), dt)
        too_short = raw_window.span + raw_window.lost_at_edges < 0.99 * length - 1.0
        reason = raw_window.incomplete_reason or ("shorter than planned" if too_short else "")
        window = raw_window._replace(
            incomplete_reason=reason, data=calibrated.correct_ticks(corrections, raw_window.data)
        )
        entry = reduce_window(window, period_ticks, stations)
        # A later attempt replaces an earlier one.
        measured[window.row] = entry if incomplete_rows else _withhold_means(entry, window, units)
    columns = plan_columns(run_facts.plan)
    setting_names = ("stator", *(column.name for column in columns))
    state = reading.state(run)
    lost_rows = missing_rows(run_facts.plan, measured, state)
    table = [
        calibrated.correct_row(
            corrections,
            _merge_plan(
                measured.get(row), planned.get(row, {}), row, units, row in lost_rows, setting_names
            ),
        )
        for row in sorted({*planned, *measured})
    ]
    for row_entry in table:
        for axis in ("", "surge_"):
            off_zero = abs(row_entry[f"{axis}position_mean"]) > mean_position_alarm
            row_entry[f"{axis}position_alarm"] = int(off_zero and row_entry["state"] == COMPLETE)
    _add_repetition_errors(table, stations)
    dataset = _build_dataset(table, run_facts, units, period, columns)
    attributes = {
        "record": state.description,
        "record_state": json.dumps(state.as_dict()),
        STATIONS_ATTRIBUTE: json.dumps(as_records(stations)),
    }
    return dataset.assign_attrs(
        attributes | corrections.attributes, mean_position_alarm_m=mean_position_alarm
    )


def _withhold_means(entry: dict[str, Any], window: Window, units: dict[str, str]) -> dict[str, Any]:
    """Return the entry without its means if the record lacks ticks of the window."""
    if not window.missing or entry["state"] != COMPLETE:
        return entry
    state = {"state": INCOMPLETE, "incomplete_reason": window.missing_text}
    kept = {"start", *SETTINGS}
    return {**entry, **state, **{name: float("nan") for name in units if name not in kept}}


def _merge_plan(
    measured: dict[str, Any] | None,
    planned: dict[str, Any],
    row: int,
    units: dict[str, str],
    lost: bool,
    setting_names: Sequence[str],
) -> dict[str, Any]:
    if measured is None:
        texts = {"state": NOT_RUN, "incomplete_reason": ""}
        texts = {"state": INCOMPLETE, "incomplete_reason": ALL_TICKS_MISSING} if lost else texts
        texts |= {"limits": "", "warned": ""}
        counts = dict.fromkeys(_COUNTS, 0)
        measured = {"row": row, **counts, **texts, **dict.fromkeys(units, float("nan"))}
    entry = own_settings(measured, setting_names) | {"point": int(planned.get("point", row))}
    entry["repetition"] = int(planned.get("repetition", 0))
    for name in setting_names:
        value = planned.get(name, planned.get(f"{name}_position"))
        if value is not None:
            entry[name] = float(value)
    return entry


def own_settings(entry: dict[str, Any], setting_names: Sequence[str]) -> dict[str, Any]:
    """Return a row without the settings that its run does not have, and with those it has.

    A log has gains of every law; they are set points of the impedance law only.
    """
    kept = {name: value for name, value in entry.items() if name not in SETTINGS}
    return kept | {name: entry.get(name, float("nan")) for name in setting_names}


def _modulation(config: dict[str, Any]) -> dict[str, str]:
    """Return the modulation of a custom drive as an attribute; empty for other drives.

    The campaign overrides the rig file.
    """
    drives = [(config.get(file) or {}).get("drive") or {} for file in ("campaign", "rig")]
    if drives[1].get("kind") != "custom":
        return {}
    return {"modulation": str(drives[0].get("modulation") or drives[1].get("modulation"))}


_COUNTS = ("attempt", "samples", "lost_ticks", "ticks_expected", "ticks_missing", "tare_samples",
           "periods")  # fmt: skip
_ORDER = ["row", "point", "repetition", "state", "spring_rate", "stator"]


def _build_dataset(
    table: list[dict[str, Any]],
    run_facts: RunInfo,
    units: dict[str, str],
    period: float | None,
    columns: tuple[Column, ...],
) -> "xarray.Dataset":
    import xarray  # noqa: PLC0415 - a second that sweeps and lists need not pay

    names = list(table[0]) if table else ["row"]
    units = units | {column.name: column.unit for column in columns}
    order = [*_ORDER, *(column.name for column in columns)]
    order = list(dict.fromkeys(order))
    names = [n for n in order if n in names] + [n for n in names if n not in order]
    variables = {
        name: xarray.Variable(
            "row",
            np.array([row[name] for row in table]),
            {"units": unit} if (unit := units.get(name.removesuffix(RECORDED))) else {},
        )
        for name in names
    }
    attributes = run_facts.attributes() | _modulation(run_facts.config)
    attributes |= run_columns.attributes(columns)
    if period:
        attributes["wave_period_s"] = period
    return xarray.Dataset(variables, attrs=attributes)
