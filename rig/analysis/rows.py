"""The row table: what each row of the gain matrix gave, from its measured ticks alone.

Power is negative when absorbed. Rows whose window was cut short are listed with their state and
enter no surface. So are rows of whose window the record lacks ticks (`INCOMPLETE`), and their means
are withheld (NaN) unless asked for. A mean's standard error comes from the means over whole wave
periods; where a window holds only one repeat period of an irregular sea it is unknown (NaN) unless
the point was run again. Beside power and motion stand the checks of `rig.analysis.quality`.
"""

import json
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis import calibrated, quality
from rig.analysis.calibrated import RECORDED
from rig.analysis.windows import GONE, Window, gone, planned_ticks, windows
from rig.config.columns import COLUMNS
from rig.realtime.limits import Limited, Warned
from rig.recording.calibration import Known
from rig.recording.runs import reader
from rig.recording.runs.folder import Facts, facts
from rig.recording.runs.mcap_file import Records
from rig.recording.runs.state import Reading

if TYPE_CHECKING:
    import xarray

MEAN_POSITION_ALARM = 0.005  # m; a biased encoder pushes with Ki times its bias

COMPLETE, INTERRUPTED, NOT_RUN = "complete", "cut short", "not run"
INCOMPLETE = "record incomplete"  # measured whole, but rows of it are lost

POWERS = ("mechanical_1", "mechanical_2", "ac", "dc")
MOTIONS = {
    "position": "heave.estimate.position",
    "velocity": "heave.estimate.velocity",
    "current": "heave.sense.current",
    "force": "heave.command.force",
}
DEMEANED = {"mechanical_1": "load.lcb", "mechanical_2": "load.trs"}
LOGGED = {  # what the log says of a set point, for a run without a plan
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
FIELDS = [
    *(f"power.{name}" for name in POWERS),
    *MOTIONS.values(),
    *DEMEANED.values(),
    "heave.command.limited",
    "heave.warned",
    "tare.samples",
]

UNITS = {
    **{f"power_{name}": "W" for name in POWERS},
    **{f"power_{name}_se": "W" for name in POWERS},
    **{f"power_{name}_demeaned": "W" for name in DEMEANED},
    **{
        f"{name}_{kind}": unit
        for name, unit in zip(MOTIONS, ("m", "m/s", "A", "N"), strict=True)
        for kind in ("mean", "rms", "peak")
    },
    **SETTINGS,
    "stroke": "m",
    "start": "s",
    **quality.UNITS,
}


def wave_period(plan: dict[str, Any]) -> float | None:
    """Seconds after which the sea of a plan repeats; None if it does not."""
    sea = plan.get("sea") or {}
    if sea.get("frequency_hz"):
        return 1.0 / float(sea["frequency_hz"])
    period = sea.get("period_s") or plan.get("repeat_s") or sea.get("repeat_s")
    return float(period) if period else None


def period_means(values: Any, ticks: Any, period_ticks: float) -> Any:
    """Means of ``values`` over each whole period (length in ticks) from the first tick on."""
    since = ticks - ticks[0]
    # Windows end on the nearest sample, so the last period may lack half a tick.
    whole = int((since[-1] + 1.5) / period_ticks)
    edges = np.searchsorted(since, np.round(np.arange(whole + 1) * period_ticks))
    full = np.flatnonzero(np.diff(edges))
    return np.array([values[edges[i] : edges[i + 1]].mean() for i in full])


def standard_error(means: Any) -> float:
    """Standard error of the mean of equally good means; NaN for fewer than two."""
    count = len(means)
    return float(np.std(means, ddof=1) / np.sqrt(count)) if count > 1 else float("nan")


def flags(kind: type[Limited] | type[Warned], values: Any) -> str:
    """Names of all flags seen, joined by spaces."""
    seen = int(np.bitwise_or.reduce(values)) if len(values) else 0
    return " ".join(str(flag.name) for flag in kind if seen & flag)


def reduced(window: Window, period_ticks: float | None) -> dict[str, Any]:
    """What one window gave, by the names of the row table; SI.

    ``period_ticks`` is the sea's repeat period, None if it has none.
    """
    data: Records = window.data
    out: dict[str, Any] = {
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
        "limits": flags(Limited, data["heave.command.limited"]),
        "warned": flags(Warned, data["heave.warned"]),
        "periods": 0,
    }
    for name in POWERS:
        values = data[f"power.{name}"]
        out[f"power_{name}"] = float(values.mean())
        out[f"power_{name}_se"] = float("nan")
        if period_ticks is not None:
            means = period_means(values, data["tick"], period_ticks)
            out["periods"] = len(means)
            out[f"power_{name}_se"] = standard_error(means)
    velocity = data[MOTIONS["velocity"]]
    for name, field in DEMEANED.items():
        force = data[field]
        mean = (force * velocity).mean() - force.mean() * velocity.mean()
        out[f"power_{name}_demeaned"] = float(mean)
    for name, field in MOTIONS.items():
        values = data[field]
        out[f"{name}_mean"] = float(values.mean())
        out[f"{name}_rms"] = float(np.sqrt((values * values).mean()))
        out[f"{name}_peak"] = float(np.abs(values).max())
    out["stroke"] = float(np.ptp(data[MOTIONS["position"]]))
    for name, field in LOGGED.items():  # the plan's value replaces it where there is one
        here = field in (data.dtype.names or ())
        out[name] = float(data[field].mean()) if here else float("nan")
    out["realisation"] = float("nan")  # only the plan tells
    return {**out, **quality.columns(data)}


def _repeat_errors(table: list[dict[str, Any]]) -> None:
    """Where a row alone cannot tell its error, take the scatter of its repetitions."""
    for name in POWERS:
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
    calibrations: Sequence[Known] = (),
    *,
    incomplete_rows: bool = False,
) -> "xarray.Dataset":
    """The row table of a run, finished or not: one entry a planned or measured row, by row id.

    ``mean_position_alarm`` (m): a row whose mean position, of heave or surge, is farther from zero
    is flagged. What the run did not log is NaN. ``calibrations``: to read the run with, at most one
    a quantity; raises as `rig.analysis.calibrated.reading` does. ``incomplete_rows``: give the
    means also of rows of which the record lacks ticks. ``samples`` counts a window's ticks that are
    there, ``ticks_expected`` those that were executed, ``ticks_missing`` those that are lost.
    Variables carry their unit in ``attrs``; ``stroke`` is peak to peak; ``power_*_demeaned`` is
    mean(F v) - mean(F) mean(v); ``power_*_se`` is the standard error of that row's mean.
    """
    source = reader.source(run)
    known = facts(run, source.contents)
    read = calibrated.reading(calibrations, known)
    dt = known.plan.get("dt")
    period = wave_period(known.plan)
    period_ticks = period / float(dt) if period and dt else None
    planned = {int(row["row"]): row for row in known.plan.get("rows", [])}
    found: dict[int, dict[str, Any]] = {}
    there = [leaf.name for leaf in source.leaves]
    logged = set(there) & set(LOGGED.values()) | set(quality.fields(there))
    wanted = ["time", *FIELDS, *sorted(logged)]
    seen = Reading(source.contents, source.damage)
    for each in windows(source, wanted, known.plan, incomplete_rows=True, reading=seen):
        if each.row < 0:
            continue
        length = planned_ticks(planned.get(each.row, {}), dt)
        short = each.span + each.edge < 0.99 * length - 1.0
        why = each.incomplete_reason or ("shorter than planned" if short else "")
        window = each._replace(incomplete_reason=why, data=calibrated.ticks(read, each.data))
        made = reduced(window, period_ticks)
        # the last attempt counts
        found[window.row] = made if incomplete_rows else _withheld(made, window)
    state = seen.state(run)
    absent = gone(known.plan, found, state)
    table = [
        calibrated.row(read, _with_plan(found.get(row), planned.get(row, {}), row, row in absent))
        for row in sorted({*planned, *found})
    ]
    for entry in table:
        for axis in ("", "surge_"):
            far = abs(entry[f"{axis}position_mean"]) > mean_position_alarm
            entry[f"{axis}position_alarm"] = int(far and entry["state"] == COMPLETE)
    _repeat_errors(table)
    out = _dataset(table, known, period)
    attributes = {"record": state.description, "record_state": json.dumps(state.as_dict())}
    return out.assign_attrs(attributes | read.attributes, mean_position_alarm_m=mean_position_alarm)


def _withheld(made: dict[str, Any], window: Window) -> dict[str, Any]:
    """A row without its means if the record lacks ticks of its window."""
    if not window.missing or made["state"] != COMPLETE:
        return made
    told = {"state": INCOMPLETE, "incomplete_reason": window.missing_words}
    kept = {"start", *SETTINGS}
    return {**made, **told, **{name: float("nan") for name in UNITS if name not in kept}}


def _with_plan(
    measured: dict[str, Any] | None, planned: dict[str, Any], row: int, absent: bool
) -> dict[str, Any]:
    if measured is None:
        texts = {"state": NOT_RUN, "incomplete_reason": ""}
        texts = {"state": INCOMPLETE, "incomplete_reason": GONE} if absent else texts
        texts |= {"limits": "", "warned": ""}
        counts = dict.fromkeys(_COUNTS, 0)
        measured = {"row": row, **counts, **texts, **dict.fromkeys(UNITS, float("nan"))}
    out = {**measured, "point": int(planned.get("point", row))}
    out["repetition"] = int(planned.get("repetition", 0))
    for name in SETTINGS:
        value = planned.get(name, planned.get(f"{name}_position"))
        if value is not None:
            out[name] = float(value)
    return out


def _modulation(config: dict[str, Any]) -> dict[str, str]:
    """How a custom drive switches: the campaign's choice or else the rig's; empty for others."""
    asked = [(config.get(file) or {}).get("drive") or {} for file in ("campaign", "rig")]
    if asked[1].get("kind") != "custom":
        return {}
    return {"modulation": str(asked[0].get("modulation") or asked[1].get("modulation"))}


_COUNTS = ("attempt", "samples", "lost_ticks", "ticks_expected", "ticks_missing", "tare_samples",
           "periods")  # fmt: skip
_ORDER = ["row", "point", "repetition", "state", *SETTINGS]


def _dataset(table: list[dict[str, Any]], known: Facts, period: float | None) -> "xarray.Dataset":
    import xarray  # noqa: PLC0415 - a second that sweeps and lists need not pay

    names = list(table[0]) if table else ["row"]
    names = [n for n in _ORDER if n in names] + [n for n in names if n not in _ORDER]
    columns = {
        name: xarray.Variable(
            "row",
            np.array([row[name] for row in table]),
            {"units": unit} if (unit := UNITS.get(name.removesuffix(RECORDED))) else {},
        )
        for name in names
    }
    attributes = known.attributes() | _modulation(known.config)
    if period:
        attributes["wave_period_s"] = period
    return xarray.Dataset(columns, attrs=attributes)
