"""Export a run as the MASK4 MATLAB structure: one variable per bus, for the test's own scripts."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.interop.basin.merge import SINE_FREQUENCY
from rig.interop.tables import ticks_per_sample
from rig.kinds.wavebot.mask4.fields import (
    FIELDS,
    NEWTONS_PER_AMPERE,
    PLAN_FIELDS,
    RIG_BUS,
    SAMPLE_RATE,
    TIMED_BUSES,
    TTL_HIGH,
)
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import find_incomplete_windows

Structure = dict[str, dict[str, Any]]

LEAD_S = 120.0  # s from runCounter's 1 to the first row, as the MASK4 scripts count
PROBES = ("probes.probe_1", "probes.probe_2", "probes.probe_3")
_WAVE_CLOCK = "plan.wave_clock"


class Mask4Export(NamedTuple):
    """A MASK4 structure, and remarks on features of the run that do not fit into it."""

    buses: Structure
    remarks: tuple[str, ...]


def export_structure(run: Path, rate: float | None = None) -> Mask4Export:
    """Return the buses of a run, each field a column at ``rate`` (Hz; None: that of MASK4).

    The function takes every n-th tick, as a slow scope does. Raises RunError for a rate that does
    not divide the run's, and for a run of another kind of rig. ``rigSignals.incomplete`` is 1 in
    measured windows with ticks missing from the record.
    """
    source = reader.open_files(run)
    available = {leaf.name for leaf in source.leaves}
    fields = {field.log_field for field in FIELDS} | {*PLAN_FIELDS, _WAVE_CLOCK, *PROBES}
    if absent := sorted(fields - available):
        raise RunError(f"{run}: no MASK4 structure without {', '.join(absent)}")
    data = reader.columns(source, ["time", "tick", *sorted(fields)])
    run_facts = run_info(run, source.contents)
    ticks = data["tick"]
    # By ticks, because rows may be missing in between.
    run_rate = float(ticks[-1] - ticks[0]) / float(data["time"][-1] - data["time"][0])
    step = ticks_per_sample(run, run_rate, rate or SAMPLE_RATE)
    samples = np.flatnonzero((ticks - ticks[0]) % step == 0)
    data = {name: values[samples] for name, values in data.items()}
    exported = _build_structure(data, run_facts)
    gaps = find_incomplete_windows(run)
    exported.buses[RIG_BUS]["incomplete"] = to_column(gaps.mask(data["time"]))
    return exported._replace(remarks=(*exported.remarks, *gaps.messages))


def _build_structure(data: dict[str, Any], run_facts: RunInfo) -> Mask4Export:
    drive = str(((run_facts.config.get("rig") or {}).get("drive") or {}).get("kind") or "cots")
    newtons_per_ampere = _newtons_per_ampere(run_facts)
    time = np.asarray(data["time"], dtype=np.float64)
    buses: Structure = {bus: {"time": to_column(time)} for bus in TIMED_BUSES}
    for field in FIELDS:
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


def to_column(values: Any) -> npt.NDArray[np.float64]:
    """Return values as one column of doubles, the shape of a MATLAB signal."""
    return np.asarray(values, dtype=np.float64).reshape(-1, 1)


def write_mat(exported: Mask4Export, path: Path) -> Path:
    """Write the structure as a MATLAB 5 file, one variable per bus, for load() and importdata()."""
    from scipy.io import savemat  # noqa: PLC0415 - half a second; the other formats do not need it

    with path.open("wb") as file:
        savemat(file, dict(exported.buses), do_compression=True, long_field_names=True)
    return path
