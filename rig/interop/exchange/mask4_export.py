"""A run as the MASK4 MATLAB structure: one variable a bus, read by the test's own scripts."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.windows import find_incomplete_windows
from rig.interop.basin.merge import FREQUENCY
from rig.interop.exchange.mask4_fields import FIELDS, KT_N, OWN, PLACE, RATE, TIMED, TTL_HIGH
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import RunInfo, run_info

Structure = dict[str, dict[str, Any]]

START_S = 120.0  # s from runCounter's 1 to the first row, as their scripts count
PROBES = ("probes.probe_1", "probes.probe_2", "probes.probe_3")
_CLOCK = "plan.wave_clock"


class Exported(NamedTuple):
    """A structure, and what does not quite fit into it."""

    buses: Structure
    remarks: tuple[str, ...]


def structure(run: Path, rate: float = RATE) -> Exported:
    """The buses of a run, each field a column over samples; ``rate`` (Hz) divides the run's.

    Every n-th tick is taken, as a slow scope does. RunError for a rate that does not divide the
    run's, and for a run of another kind of rig. ``rigSignals.incomplete`` is 1 in measured windows
    of which the record lacks ticks.
    """
    opened = reader.open_files(run)
    there = {leaf.name for leaf in opened.leaves}
    wanted = {field.leaf for field in FIELDS} | {*PLACE, _CLOCK, *PROBES}
    if absent := sorted(wanted - there):
        raise RunError(f"{run}: no MASK4 structure without {', '.join(absent)}")
    data = reader.columns(opened, ["time", "tick", *sorted(wanted)])
    known = run_info(run, opened.contents)
    ticks = data["tick"]
    step = _every(run, data["time"], ticks, rate)
    kept = np.flatnonzero((ticks - ticks[0]) % step == 0)
    data = {name: values[kept] for name, values in data.items()}
    made = _structure(data, known)
    lacking = find_incomplete_windows(run)
    made.buses[OWN]["incomplete"] = column(lacking.mask(data["time"]))
    return made._replace(remarks=(*made.remarks, *lacking.messages))


def _every(run: Path, time: Any, ticks: Any, rate: float) -> int:
    """How many ticks are one sample."""
    own = float(ticks[-1] - ticks[0]) / float(time[-1] - time[0])  # rows may be missing between
    step = round(own / rate)
    if step < 1 or abs(own / step - rate) > 1e-6 * rate:
        fits = ", ".join(f"{own / n:g}" for n in (1, 2, 5, 10, 20))
        raise RunError(f"{run}: {rate:g} Hz does not divide its {own:g} Hz; allowed {fits}, ...")
    return step


def _structure(data: dict[str, Any], known: RunInfo) -> Exported:
    drive = str(((known.config.get("rig") or {}).get("drive") or {}).get("kind") or "cots")
    ampere = _newtons_per_ampere(known)
    time = np.asarray(data["time"], dtype=np.float64)
    made: Structure = {bus: {"time": column(time)} for bus in TIMED}
    for field in FIELDS:
        if field.drive not in ("", drive):
            continue
        factor = ampere if field.factor == KT_N else field.factor
        value = factor * np.asarray(data[field.leaf], dtype=np.float64) + field.offset
        made.setdefault(field.bus, {})[field.name] = column(value)
    if drive != "custom":
        del made["toDriveSGSignals"], made["fromDriveSGSignals"]
    on = np.asarray(data[_CLOCK]) >= 0.0
    made["setpointSignals"] = {
        "time": column(time),
        "trigger": column(np.where(on, TTL_HIGH, 0.0)),
        "syncSine": column(np.sin(2.0 * np.pi * FREQUENCY * time)),
    }
    counter, remarks = _run_counter(time, data)
    made["expCtrl"] = {"runCounter": column(counter)}
    made["waveData"] = {"ElapsedTime": column(time), "syncTimeSine": column(time)} | {
        name.rpartition(".")[2]: column(data[name]) for name in PROBES
    }
    made[OWN] = {name.rpartition(".")[2]: column(data[name]) for name in PLACE}
    made[OWN]["time"] = column(time)
    return Exported(made, tuple(remarks))


def _newtons_per_ampere(known: RunInfo) -> float:
    """The run's own Kt N, N/A; MASK4's where its configuration does not say."""
    torque = known.config_number("rig", "heave", "torque_constant_n_m_per_a")
    gear = known.config_number("rig", "heave", "gear_ratio_rad_per_m")
    return torque * gear if torque and gear else KT_N


def _run_counter(time: Any, data: dict[str, Any]) -> tuple[Any, list[str]]:
    """1 from 120 s before the first row's interval on, where the record goes back so far."""
    counter = np.zeros(len(time))
    rows = (data["plan.row"] >= 0) & (data["plan.phase"] != Phase.MOVING)
    if not rows.any():
        return counter, ["no row: runCounter stays 0"]
    start = float(time[np.argmax(rows)]) - START_S
    counter[time >= start - 1e-9] = 1.0
    if start < time[0] - 1e-9:
        said = f"the first row begins {START_S + start - time[0]:.0f} s into the record"
        return counter, [
            f"{said}, not after {START_S:g} s or more: go by {OWN}.row and .phase, not by time"
        ]
    return counter, []


def column(values: Any) -> npt.NDArray[np.float64]:
    """As MATLAB has a signal: one column of doubles."""
    return np.asarray(values, dtype=np.float64).reshape(-1, 1)


def write_mat(exported: Exported, path: Path) -> Path:
    """Write the structure as a MATLAB 5 file, a variable a bus: load() and importdata() take it."""
    from scipy.io import savemat  # noqa: PLC0415 - half a second that other formats need not pay

    with path.open("wb") as file:
        savemat(file, dict(exported.buses), do_compression=True, long_field_names=True)
    return path
