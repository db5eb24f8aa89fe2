"""The row table: means of each row of the gain matrix over its measurement window.

Absorbed power is negative. Rows whose window was cut short are listed with their state and excluded
from surfaces. So are rows whose window lacks ticks in the record (`INCOMPLETE`); their means are
withheld (NaN) unless requested. The standard error of a mean comes from the means over whole wave
periods. It is unknown (NaN) where a window holds only one repeat period of an irregular sea, unless
the point was repeated. The powers of rows that ended before that period are those over the whole of
it, from a comparison with another row (`rig.analysis.compared_rows`). What else the table holds is
the `RowContents` of the run.
"""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.analysis import calibrated
from rig.analysis.calibrated import RECORDED
from rig.analysis.compared_rows import NOT_COMPARED, WAVE_CLOCK, compared_rows
from rig.analysis.row_ends import END_REASON, END_STATION, row_ends
from rig.analysis.scatter import UNKNOWN, period_means, successive_error
from rig.analysis.uncertainty import (
    BUDGET_ATTRIBUTE,
    SOURCE,
    UNCERTAIN,
    Budget,
    add_expanded,
    budget_of,
    contributions_by_station,
    type_b,
)
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs import reader
from rig.recording.runs.folder import RunInfo, earlier_contents, run_info
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.state import RecordCheck, RecordState
from rig.recording.runs.windows import (
    SKIPPED_ROW,
    JoinedRows,
    Window,
    missing_rows,
    planned_ticks,
    read_windows,
)
from rig.recording.table_file import write_table
from rig.row_contents import (
    MATCH,
    Check,
    Column,
    RowContents,
    column_records,
    columns_from_records,
    is_lacking,
)
from rig.stations import Station, as_records, from_records

if TYPE_CHECKING:
    import xarray

MEAN_POSITION_ALARM = 0.005  # m; an encoder bias adds a constant force of Ki times the bias

COMPLETE, INTERRUPTED, NOT_RUN = "complete", "cut short", "not run"
INCOMPLETE = "record incomplete"  # fully measured, but the record lacks ticks
STATIONS_ATTRIBUTE = "stations"  # of the dataset: the run's power stations, as JSON
COLUMNS_ATTRIBUTE = "columns"  # its matrix columns, as JSON; absent: those of earlier runs

_MOTION = {  # quantity: log field of the axis, unit
    "position": ("estimate.position", "m"),
    "velocity": ("estimate.velocity", "m/s"),
    "current": ("sense.current", "A"),
    "force": ("command.force", "N"),
}

STATISTICS: dict[str, Callable[[Any], Any]] = {
    "mean": np.mean,
    "min": np.min,
    "range": np.ptp,
    "rms": lambda values: np.sqrt(np.mean(values * values)),
    "share on": lambda values: np.mean(values != 0),
    "share off": lambda values: np.mean(values == 0),
    **{f"p{p:02d}": partial(np.percentile, q=float(p)) for p in (1, 2, 98, 99)},
}
"""The functions that reduce the values of a `Check` over a window."""


def stations_of(table: "xarray.Dataset") -> tuple[Station, ...]:
    """Return the power stations of a row table or of a sweep, in the order of the flow of power."""
    return from_records(json.loads(table.attrs.get(STATIONS_ATTRIBUTE, "[]")))


def columns_of(table: "xarray.Dataset") -> tuple[Column, ...]:
    """Return the matrix columns of a row table or of a sweep."""
    text, earlier = table.attrs.get(COLUMNS_ATTRIBUTE), earlier_contents().columns
    return columns_from_records(json.loads(text), earlier) if text else earlier


def values_of_laws(table: "xarray.Dataset") -> dict[str, NDArray[np.float64]]:
    """Return the columns of laws, NaN in each row whose law lacks the column."""
    columns = columns_of(table)
    chosen = {c.name: table[c.name].values for c in columns if c.choices and c.name in table}
    settings = [
        {name: float(numbers[i]) for name, numbers in chosen.items() if np.isfinite(numbers[i])}
        for i in range(table.sizes.get("row", 0))
    ]
    return {
        column.name: np.where(
            [is_lacking(column, columns, setting) for setting in settings],
            np.nan,
            table[column.name].values,
        )
        for column in columns
        if column.laws and column.name in table
    }


def contents_attributes(contents: RowContents) -> dict[str, str]:
    """Return the attributes of a dataset that `stations_of` and `columns_of` read."""
    attributes = {STATIONS_ATTRIBUTE: json.dumps(as_records(contents.stations))}
    if contents.columns != earlier_contents().columns:
        attributes[COLUMNS_ATTRIBUTE] = json.dumps(column_records(contents.columns))
    return attributes


def motion_fields(axis: str) -> dict[str, str]:
    """Return the log fields of an axis' motion and force by quantity."""
    return {name: f"{axis}.{field}" for name, (field, _) in _MOTION.items()}


def table_fields(contents: RowContents, available: Iterable[str]) -> list[str]:
    """Return the log fields that a table needs; those of settings and checks if ``available``."""
    optional = {column.field for column in contents.settings}
    optional.update(name for check in contents.checks for name in _check_fields(check))
    return [
        "time",
        *(f"power.{station.name}" for station in contents.stations),
        *motion_fields(contents.axis).values(),
        *(station.force for station in contents.stations if station.force),
        f"{contents.axis}.command.limited",
        f"{contents.axis}.warned",
        "tare.samples",
        *sorted(optional & set(available)),
    ]


def _check_fields(check: Check) -> list[str]:
    return [*check.fields, *filter(None, [check.zero])]


def column_units(contents: RowContents) -> dict[str, str]:
    """Return the units of the table's numbers by column, those of powers by station."""
    return {
        **{f"power_{station.name}": "W" for station in contents.stations},
        **{f"power_{station.name}_se": "W" for station in contents.stations},
        **{f"power_{station.name}_dof": "1" for station in contents.stations},
        **{f"power_{station.name}_demeaned": "W" for station in contents.stations if station.force},
        **{
            f"{name}_{kind}": unit
            for name, (_, unit) in _MOTION.items()
            for kind in ("mean", "rms", "peak")
        },
        **{column.name: column.unit for column in contents.settings},
        "stroke": "m",
        "start": "s",
        **{check.name: check.unit for check in contents.checks},
    }


def wave_period(plan: dict[str, Any]) -> float | None:
    """Return the repeat period of a plan's sea in s; None if the sea does not repeat."""
    sea = plan.get("sea") or {}
    if sea.get("frequency_hz"):
        return 1.0 / float(sea["frequency_hz"])
    period = sea.get("period_s") or plan.get("repeat_s") or sea.get("repeat_s")
    return float(period) if period else None


def flag_names(kind: type[LimitFlag] | type[WarningFlag], values: Any) -> str:
    """Return the names of all flags raised in ``values``, separated by spaces."""
    raised = int(np.bitwise_or.reduce(values)) if len(values) else 0
    return " ".join(str(flag.name) for flag in kind if raised & flag)


def reduce_window(
    window: Window, period_ticks: float | None, contents: RowContents
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
        "limits": flag_names(LimitFlag, data[f"{contents.axis}.command.limited"]),
        "warned": flag_names(WarningFlag, data[f"{contents.axis}.warned"]),
        "periods": 0,
    }
    for station in contents.stations:
        values = data[f"power.{station.name}"]
        scatter = UNKNOWN
        if period_ticks is not None:
            means = period_means(values, data["tick"], period_ticks)
            entry["periods"], scatter = len(means), successive_error(means)
        entry[f"power_{station.name}"] = float(values.mean())
        entry[f"power_{station.name}_se"] = scatter.error
        entry[f"power_{station.name}_dof"] = scatter.dof
    motion = motion_fields(contents.axis)
    velocity = data[motion["velocity"]]
    for station in contents.stations:
        if station.force:
            force = data[station.force]
            mean = (force * velocity).mean() - force.mean() * velocity.mean()
            entry[f"power_{station.name}_demeaned"] = float(mean)
    for name, field in motion.items():
        values = data[field]
        entry[f"{name}_mean"] = float(values.mean())
        entry[f"{name}_rms"] = float(np.sqrt((values * values).mean()))
        entry[f"{name}_peak"] = float(np.abs(values).max())
    entry["stroke"] = float(np.ptp(data[motion["position"]]))
    logged = set(data.dtype.names or ())
    for column in contents.settings:  # a value in the plan replaces it later
        known = column.field in logged
        entry[column.name] = float(data[column.field].mean()) if known else float("nan")
    for check in contents.checks:
        known = logged.issuperset(_check_fields(check))
        entry[check.name] = _evaluate(check, data) if known else float("nan")
    return entry


def _evaluate(check: Check, data: Records) -> float:
    values = data[check.fields[0]]
    for name in check.fields[1:]:
        values = values + data[name]
    if check.zero:
        values = values - data[check.zero]
    return float(STATISTICS[check.statistic](values))


def _add_repetition_errors(table: list[dict[str, Any]], stations: Iterable[Station]) -> None:
    """Fill unknown standard errors of rows with the standard deviation over repetitions.

    Those in seas of other seeds are other rows.
    """
    for station in stations:
        name = f"power_{station.name}"
        by_point: dict[tuple[int, int], list[dict[str, Any]]] = {}
        for row in table:
            if row["state"] == COMPLETE and np.isnan(row[f"{name}_se"]):
                by_point.setdefault((row["point"], row.get("seed", 0)), []).append(row)
        for rows in by_point.values():
            if len(rows) > 1:
                scatter = float(np.std([row[name] for row in rows], ddof=1))
                for row in rows:
                    row[f"{name}_se"], row[f"{name}_dof"] = scatter, len(rows) - 1.0


def _add_alarms(table: list[dict[str, Any]], bound: float) -> None:
    """Flag the complete rows with a mean position farther from zero than ``bound`` (m)."""
    for row in table:
        for name in [name for name in row if name.endswith("position_mean")]:
            off_zero = abs(row[name]) > bound
            row[name.replace("_mean", "_alarm")] = int(off_zero and row["state"] == COMPLETE)


def row_table(
    run: str | os.PathLike[str],
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
    mean_position_alarm: float = MEAN_POSITION_ALARM,
) -> "xarray.Dataset":
    """Return the row table of a finished or unfinished run, with one entry per row in order of id.

    The table covers all planned and measured rows. Values that the run did not log are NaN. Where
    rows end by their power, `end_reason` gives why each did (`rig.analysis.row_ends`). The
    units of the variables are in ``attrs``. ``samples`` counts the recorded ticks of a window,
    ``ticks_expected`` the executed ones, ``ticks_missing`` the lost ones. ``stroke`` is peak to
    peak. ``power_*_demeaned`` is mean(F v) - mean(F) mean(v). ``power_*_se`` is the standard error
    of the mean of that row, ``power_*_dof`` its degrees of freedom (`rig.analysis.scatter`).

    Rows with a mean position of an axis farther from zero than ``mean_position_alarm`` (m) are
    flagged. ``calibrations`` correct the rows, at most one for each quantity; errors are those
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
    contents = run_facts.row_contents
    contents = contents._replace(
        stations=tuple(s for s in contents.stations if f"power.{s.name}" in available)
    )
    units, settings = column_units(contents), [column.name for column in contents.settings]
    budget = budget_of(run_facts.config, run_facts.row_contents, available)
    shares: dict[int, Any] = {}  # contributions of the sources of the budget, by row
    compared = compared_rows(run_facts.plan, run_facts.config, contents.stations, period_ticks)
    ends = row_ends(run_facts.plan, run_facts.config, contents.stations, period_ticks)
    fields = [*table_fields(contents, available), *([] if compared is None else [WAVE_CLOCK])]
    if budget is not None:
        fields = list(dict.fromkeys([*fields, *budget.log_fields]))
        units |= {
            f"power_{each.name}_{part}": "W" for each in budget.stations for part in UNCERTAIN
        }
    reading = RecordCheck(source.contents, source.damage)
    joined = JoinedRows(period_ticks)
    for raw_window in read_windows(
        source,
        fields,
        run_facts.plan,
        incomplete_rows=True,
        reading=reading,
    ):
        if raw_window.row < 0:
            continue
        whole = joined.add(
            raw_window, planned_ticks(planned.get(raw_window.row, {}), dt, least=True)
        )
        window = whole._replace(data=calibrated.correct_ticks(corrections, whole.data))
        entry = reduce_window(window, period_ticks, contents)
        entry = entry if compared is None else compared.complete(entry, window)
        entry = entry if ends is None else ends.complete(entry, whole)
        if budget is not None:
            shares[window.row] = budget.contributions(window.data)
            entry |= type_b(budget, shares[window.row])
        # A later attempt replaces an earlier one.
        measured[window.row] = (
            entry if incomplete_rows else _withhold_means(entry, window, units, settings)
        )
    state = reading.state(run)
    lost_rows = missing_rows(run_facts.plan, measured, state)
    added: dict[str, Any] = ({} if compared is None else NOT_COMPARED) | (
        {} if ends is None else {END_REASON: ""}
    )
    table = [
        added
        | calibrated.correct_row(
            corrections,
            _merge_plan(
                measured.get(row),
                planned.get(row, {}),
                row,
                units,
                lost_rows.get(row, ""),
                settings,
            ),
        )
        for row in sorted({*planned, *measured})
    ]
    _add_alarms(table, mean_position_alarm)
    _add_repetition_errors(table, contents.stations)
    if budget is not None:
        complete = [row_entry for row_entry in table if row_entry["state"] == COMPLETE]
        add_expanded(budget, complete, shares)
        shares = {each["row"]: shares[each["row"]] for each in complete}
    dataset = _build_dataset(table, run_facts, units, period, settings)
    attributes = {
        "record": state.description,
        "record_state": json.dumps(state.as_dict()),
        **contents_attributes(contents),
        **({} if ends is None else {END_STATION: ends.station}),
        MATCH: json.dumps(run_facts.plan.get(MATCH, {})),
    }
    if budget is not None:
        attributes[BUDGET_ATTRIBUTE] = budget.describe(complete, shares)
        dataset = dataset.assign(_source_variables(budget, table, shares))
    return dataset.assign_attrs(
        attributes | corrections.attributes, mean_position_alarm_m=mean_position_alarm
    )


def _source_variables(
    budget: Budget, table: list[dict[str, Any]], shares: dict[int, Any]
) -> dict[str, Any]:
    """Return the variables over the sources of a budget, and their names as a coordinate."""
    import xarray  # noqa: PLC0415 - see `_build_dataset`

    names = np.array([source.name for source in budget.budget.sources])
    return {SOURCE: xarray.Variable(SOURCE, names, fastpath=True)} | {
        name: xarray.Variable(("row", SOURCE), values, {"units": "W"}, fastpath=True)
        for name, values in contributions_by_station(budget, table, shares).items()
    }


def _withhold_means(
    entry: dict[str, Any], window: Window, units: Iterable[str], settings: Iterable[str]
) -> dict[str, Any]:
    """Return the entry without its means if the record lacks ticks of the window."""
    if not window.missing or entry["state"] != COMPLETE:
        return entry
    state = {"state": INCOMPLETE, "incomplete_reason": window.missing_text}
    kept = {"start", *settings}
    return {**entry, **state, **{name: float("nan") for name in units if name not in kept}}


def _merge_plan(
    measured: dict[str, Any] | None,
    planned: dict[str, Any],
    row: int,
    units: Iterable[str],
    lost: str,
    settings: Iterable[str],
) -> dict[str, Any]:
    if measured is None:
        texts = {"state": NOT_RUN, "incomplete_reason": ""}
        if lost:
            state = INTERRUPTED if lost == SKIPPED_ROW else INCOMPLETE
            texts = {"state": state, "incomplete_reason": lost}
        texts |= {"limits": "", "warned": ""}
        counts = dict.fromkeys(_COUNTS, 0)
        measured = {"row": row, **counts, **texts, **dict.fromkeys(units, float("nan"))}
    entry = measured | {"point": int(planned.get("point", row))}
    entry["repetition"] = int(planned.get("repetition", 0))
    if "seed" in planned:  # of the sea, where a run has rows in several
        entry["seed"] = int(planned["seed"])
    for name in settings:
        value = planned.get(name, planned.get(f"{name}_position"))
        if value is not None:
            entry[name] = float(value)
    return entry


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


def _build_dataset(
    table: list[dict[str, Any]],
    run_facts: RunInfo,
    units: dict[str, str],
    period: float | None,
    settings: Sequence[str],
) -> "xarray.Dataset":
    import xarray  # noqa: PLC0415 - a second that sweeps and lists need not pay

    names = list(table[0]) if table else ["row"]
    order = ["row", "point", "repetition", "seed", "state", *settings]
    names = [n for n in order if n in names] + [n for n in names if n not in order]
    variables = {
        name: xarray.Variable(
            "row",
            np.array([row[name] for row in table]),
            {"units": unit} if (unit := units.get(name.removesuffix(RECORDED))) else {},
            fastpath=True,  # the check of other arrays imports dask where it is installed: 0.5 s
        )
        for name in names
    }
    attributes = run_facts.attributes() | _modulation(run_facts.config)
    if period:
        attributes["wave_period_s"] = period
    return xarray.Dataset(variables, attrs=attributes)


def write_rows(table: "xarray.Dataset", folder: Path) -> list[Path]:
    """Write ``rows.csv`` (units in the header) and ``rows.nc`` (units in the attributes).

    In ``rows.csv``, columns that a row's law lacks are NaN; ``rows.nc`` has them as they were run.
    """
    of_laws = values_of_laws(table)
    columns = {
        f"{name} [{unit}]" if (unit := variable.attrs.get("units")) else str(name): (
            of_laws.get(str(name), variable.values).tolist()
        )
        for name, variable in table.variables.items()
        if SOURCE not in variable.dims  # a table has one number in a row and column
    }
    binary = folder / "rows.nc"
    _write_netcdf(table, binary)
    return [write_table(columns, folder / "rows.csv"), binary]


def _write_netcdf(table: "xarray.Dataset", path: Path) -> None:
    """Write the file that `to_netcdf` would, which imports dask where it is installed: 0.8 s."""
    import h5netcdf  # noqa: PLC0415 - only this function needs it
    import h5py  # noqa: PLC0415

    with h5netcdf.File(path, "w") as file:
        file.dimensions = dict(table.sizes)
        file.attrs.update(table.attrs)
        for name, variable in table.variables.items():
            values, kind = variable.values, variable.dtype
            if kind.kind == "U":
                values, kind = values.astype(object), h5py.string_dtype()
            fill = np.nan if kind.kind == "f" else None
            stored = file.create_variable(str(name), variable.dims, kind, values, fillvalue=fill)
            stored.attrs.update(variable.attrs)


def record_of(table: "xarray.Dataset") -> RecordState:
    """Return the state of the record from which a row table was computed."""
    return RecordState.from_dict(json.loads(table.attrs["record_state"]))


def rig_time(record: RecordState, run_facts: RunInfo) -> float:
    """Return the duration of a run on the rig's clock without interruptions, s; NaN if unknown."""
    dt = run_facts.plan.get("dt")
    return record.ticks * float(dt) if dt else float("nan")
