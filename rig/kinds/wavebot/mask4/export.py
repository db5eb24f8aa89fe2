"""Export a run as the MASK4 MATLAB structure: one variable per bus, for the test's own scripts."""

from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.row_ends import END_REASON, WORSE
from rig.analysis.rows import COMPLETE, columns_of, row_table, stations_of
from rig.analysis.uncertainty import UNCERTAIN
from rig.config.matrix import END_MARK
from rig.interop.basin.merge import SINE_FREQUENCY
from rig.interop.export_size import ExportSize, packed_size
from rig.interop.tables import run_rate, ticks_per_sample
from rig.kinds.wavebot.mask4.fields import (
    FIELDS,
    LEFT_OUT,
    NEWTONS_PER_AMPERE,
    PLAN_FIELDS,
    RIG_BUS,
    ROW_BUS,
    SAMPLE_RATE,
    STARTED,
    TIMED_BUSES,
    TTL_HIGH,
    FieldMapping,
    ScriptUnits,
    script_fields,
)
from rig.kinds.wavebot.mask4.script_samples import (
    LEAD_S,
    ScriptSamples,
    newest_index,
    select_samples,
)
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import find_incomplete_windows
from rig.regular_file import replacing

Structure = dict[str, dict[str, Any]]

PROBES = ("probes.probe_1", "probes.probe_2", "probes.probe_3")
_WAVE_CLOCK = "plan.wave_clock"
_CURRENT = "heave.sense.current"
_EVEN_BUSES = ("setpointSignals", "waveData")
"""Buses that always have the run's even time: the basin's records are aligned by the first."""
_FAST_RATIO = 5  # samples of the fast scope (1 kHz) per sample of the slow one


class Mask4Export(NamedTuple):
    """A MASK4 structure, and remarks on features of the run that do not fit into it."""

    buses: Structure
    remarks: tuple[str, ...]


def export_structure(
    run: Path, rate: float | None = None, *, for_scripts: bool = False
) -> Mask4Export:
    """Return the buses of a run, each field a column at ``rate`` (Hz; None: that of MASK4).

    The function takes every n-th tick, as a slow scope does. ``for_scripts`` adds the signals that
    the test's scripts look for, and leaves out the samples that they would take for rows
    (`script_samples`). Raises RunError for a rate that does not divide the run's, for a run of
    another kind of rig, and if the scripts would find no row. ``rigSignals.incomplete`` is 1 in
    measured windows with ticks missing from the record. ``rigRows`` has the complete rows, with the
    uncertainties of their powers; a run without any lacks it.
    """
    source = _open_run(run, rate, for_scripts=for_scripts)
    log = reader.columns(source, ["time", "tick", *sorted(_LOG_FIELDS)])
    run_facts = run_info(run, source.contents)
    ticks = log["tick"]
    # By ticks, because rows may be missing in between.
    own_rate = float(ticks[-1] - ticks[0]) / float(log["time"][-1] - log["time"][0])
    step = ticks_per_sample(run, own_rate, rate or SAMPLE_RATE)
    samples = np.flatnonzero((ticks - ticks[0]) % step == 0)
    data = {name: values[samples] for name, values in log.items()}
    exported = _build_structure(data, run_facts, FIELDS)
    if for_scripts:
        selected = select_samples(run, source, log, run_facts.plan, step)
        data = {name: selected.take(values) for name, values in log.items()}
        data["time"] = log["time"][0] + (selected.tick - ticks[0]) / own_rate
        even = {bus: exported.buses[bus] for bus in _EVEN_BUSES}
        exported = _build_for_scripts(data, selected, run_facts)
        exported.buses.update(even | _fast_bus(log, selected, step))
    gaps = find_incomplete_windows(run)
    exported.buses[RIG_BUS]["incomplete"] = to_column(gaps.mask(data["time"]))
    exported.buses.update(_row_bus(run))
    return exported._replace(remarks=(*exported.remarks, *gaps.messages))


def size(run: Path, rate: float | None, *, for_scripts: bool = False) -> ExportSize:
    """Return the size of the file of `export_structure`; raises the same errors of fields, rate."""
    source = _open_run(run, rate, for_scripts=for_scripts)
    step = ticks_per_sample(run, run_rate(run), rate or SAMPLE_RATE)
    fields = [field.log_field for field in FIELDS]
    if for_scripts:
        added = (field.log_field for field in script_fields(ScriptUnits()))
        fields += [*added, *(_CURRENT for _ in range(_FAST_RATIO))]
    fields += [*PLAN_FIELDS, *PROBES, *("time" for _ in TIMED_BUSES)]
    return packed_size(source, fields, -(-source.max_rows // step))


def write(
    run: Path, rate: float | None, path: Path, *, for_scripts: bool = False
) -> tuple[str, ...]:
    """Write the structure of `export_structure` into a file; return its remarks."""
    exported = export_structure(run, rate, for_scripts=for_scripts)
    write_mat(exported, path)
    return exported.remarks


_LOG_FIELDS = {field.log_field for field in FIELDS} | {*PLAN_FIELDS, _WAVE_CLOCK, *PROBES}


def _open_run(run: Path, rate: float | None, *, for_scripts: bool) -> reader.RunFiles:
    """Return a run that has the fields and may have the rate."""
    if for_scripts and rate not in (None, SAMPLE_RATE):
        raise RunError(
            f"{run}: {rate:g} Hz, but the scripts of the test count samples at {SAMPLE_RATE:g} Hz"
        )
    source = reader.open_files(run)
    if absent := sorted(_LOG_FIELDS - {leaf.name for leaf in source.leaves}):
        raise RunError(f"{run}: no MASK4 structure without {', '.join(absent)}")
    return source


def _build_structure(
    data: dict[str, Any], run_facts: RunInfo, fields: tuple[FieldMapping, ...]
) -> Mask4Export:
    drive = str(((run_facts.config.get("rig") or {}).get("drive") or {}).get("kind") or "cots")
    newtons_per_ampere = _newtons_per_ampere(run_facts)
    time = np.asarray(data["time"], dtype=np.float64)
    buses: Structure = {bus: {"time": to_column(time)} for bus in TIMED_BUSES}
    for field in fields:
        if field.drive not in ("", drive):
            continue
        factor = newtons_per_ampere if field.factor == NEWTONS_PER_AMPERE else field.factor
        value = factor * np.asarray(data[field.log_field], dtype=np.float64) + field.offset
        buses.setdefault(field.bus, {})[field.name] = to_column(value)
    if drive != "custom":
        del buses["toDriveSGSignals"], buses["fromDriveSGSignals"]
    waves_on = np.asarray(data[_WAVE_CLOCK]) >= 0.0
    buses["setpointSignals"] = {
        "time": to_column(time),
        "trigger": to_column(np.where(waves_on, TTL_HIGH, 0.0)),
        "syncSine": to_column(np.sin(2.0 * np.pi * SINE_FREQUENCY * time)),
    }
    counter, remarks = _run_counter(time, data)
    buses["expCtrl"] = {"runCounter": to_column(counter)}
    buses["waveData"] = {"ElapsedTime": to_column(time), "syncTimeSine": to_column(time)} | {
        name.rpartition(".")[2]: to_column(data[name]) for name in PROBES
    }
    buses[RIG_BUS] = {name.rpartition(".")[2]: to_column(data[name]) for name in PLAN_FIELDS}
    buses[RIG_BUS]["time"] = to_column(time)
    if run_facts.started_utc:
        started = datetime.fromisoformat(run_facts.started_utc).timestamp()
        buses[RIG_BUS][STARTED] = to_column(started)
    return Mask4Export(buses, tuple(remarks))


def _newtons_per_ampere(run_facts: RunInfo) -> float:
    """Return the run's Kt N, N/A; the MASK4 value if its configuration gives none."""
    torque = run_facts.config_number("rig", "heave", "torque_constant_n_m_per_a")
    gear = run_facts.config_number("rig", "heave", "gear_ratio_rad_per_m")
    return torque * gear if torque and gear else NEWTONS_PER_AMPERE


def _run_counter(time: Any, data: dict[str, Any]) -> tuple[Any, list[str]]:
    """Return runCounter, 1 from 120 s before the first row, and remarks on a later start."""
    counter = np.zeros(len(time))
    rows = (data["plan.row"] >= 0) & (data["plan.phase"] != Phase.MOVING)
    if not rows.any():
        return counter, ["no row: runCounter stays 0"]
    start = float(time[np.argmax(rows)]) - LEAD_S
    counter[time >= start - 1e-9] = 1.0
    if start < time[0] - 1e-9:
        finding = f"the first row begins {LEAD_S + start - time[0]:.0f} s into the record"
        return counter, [
            f"{finding}, not after {LEAD_S:g} s or more: use {RIG_BUS}.row and .phase, not time"
        ]
    return counter, []


def _build_for_scripts(
    data: dict[str, Any], selected: ScriptSamples, run_facts: RunInfo
) -> Mask4Export:
    """Return the buses of the samples that the scripts count, and remarks on them."""
    phase: Any = np.where(selected.ended, Phase.DONE, Phase.LEAD_IN)
    for name, absent in zip(PLAN_FIELDS, (NO_ROW, phase, 0), strict=True):
        data[name] = np.where(selected.has_sample, data[name], absent)
    fields = (*FIELDS, *script_fields(_script_units(run_facts)))
    buses = _build_structure(data, run_facts, fields).buses
    buses["expCtrl"]["runCounter"] = to_column(selected.counter)
    buses[RIG_BUS][LEFT_OUT] = to_column(selected.left_out)
    for bus in ("expParamSignals", "heaveSignals"):
        buses[bus]["heaveKpUsed"][selected.ended] = END_MARK
    return Mask4Export(buses, (*selected.remarks, *_nan_remarks(data, selected)))


def _script_units(run_facts: RunInfo) -> ScriptUnits:
    """Return the factors of the run's rig; those of `ScriptUnits` that its files do not have."""

    def number(default: float, *keys: str) -> float:
        return run_facts.config_number(*keys) or default

    units, stator = ScriptUnits(), ("rig", "wiring", "stator")
    increments = number(0.0, *stator, "objects", "encoder_increments")
    counts = number(0.0, *stator, "counts_per_percent")
    return ScriptUnits(
        number(units.gear_ratio, "rig", "heave", "gear_ratio_rad_per_m"),
        counts / increments if counts and increments else units.turns_per_percent,
        number(100.0 * units.metres_per_percent, "plant", "stator", "travel", "value") / 100.0,
    )


def _nan_remarks(data: dict[str, Any], selected: ScriptSamples) -> list[str]:
    """Return a remark for each field that is NaN within rows, where there is a sample."""
    inside = selected.in_rows & selected.has_sample
    remarks = []
    for name in sorted({field.log_field for field in FIELDS}):
        absent = inside & np.isnan(data[name])
        if absent.any():
            rows = ", ".join(f"{row:.0f}" for row in np.unique(data["plan.row"][absent]))
            remarks.append(
                f"{name} is NaN in {absent.sum()} samples of rows {rows}, and so will be results"
            )
    return remarks


def _fast_bus(log: dict[str, Any], selected: ScriptSamples, step: int) -> Structure:
    """Return the bus of the fast scope, five samples per slow one; none for a slow run."""
    if step % _FAST_RATIO:
        return {}
    fast_step = step // _FAST_RATIO
    ticks = np.add.outer(selected.tick, fast_step * np.arange(_FAST_RATIO)).ravel()
    fast = selected._replace(log_index=newest_index(log["tick"], ticks, fast_step))
    return {"fastLogBus": {"heaveCurrent_A": to_column(fast.take(log[_CURRENT]))}}


def _row_bus(run: Path) -> Structure:
    """Return the bus of the complete rows; none without any."""
    table = row_table(run)
    complete = table["state"].values == COMPLETE if "state" in table else np.zeros(0, np.bool_)
    if not complete.any():
        return {}
    parts = ("", "_se", "_dof", *(f"_{part}" for part in UNCERTAIN))
    powers = [f"power_{station.name}{part}" for station in stations_of(table) for part in parts]
    settings = [column.name for column in columns_of(table)]
    names = [name for name in ("row", "periods", *settings, *powers) if name in table]
    values = {name: table[name].values for name in names}
    if END_REASON in table:
        values["ended_early"] = table[END_REASON].values == WORSE
    return {ROW_BUS: {name: to_column(each[complete]) for name, each in values.items()}}


def to_column(values: Any) -> npt.NDArray[np.float64]:
    """Return values as one column of doubles, the shape of a MATLAB signal."""
    return np.asarray(values, dtype=np.float64).reshape(-1, 1)


def write_mat(exported: Mask4Export, path: Path) -> Path:
    """Write the structure as a MATLAB 5 file, one variable per bus, for load() and importdata()."""
    from scipy.io import savemat  # noqa: PLC0415 - half a second; the other formats do not need it

    with replacing(path) as part, part.open("wb") as file:
        savemat(file, dict(exported.buses), do_compression=True, long_field_names=True)
    return path
