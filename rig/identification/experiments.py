"""The experiments of a run: each measured row with an open-loop reference, as lines of its periods.

Rows and windows are those that the log says (row id and phase); nothing is found by time. One row
is held in memory at a time, and only its lines are kept. Sensor readings are put back to when they
were taken by the ages in the log; the command stands where it was given.
"""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.windows import Window, read_windows
from rig.identification.periods import (
    Complexes,
    Flags,
    Floats,
    amplitudes,
    angular,
    excited,
    filled,
    whole_ticks,
)
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import RunInfo, run_info

BEYOND = 1.25  # lines are kept up to so many times the highest excited frequency
HIGHEST = 5.0  # Hz, of a reference
GAINS = ("kp", "ki", "km", "surge_kp", "surge_ki")

REFERENCE, CLOCK = "reference.force", "plan.wave_clock"
SATURATED = "drive_sense.saturated"
VELOCITY, COMMAND, CURRENT, TRS, LCB = "velocity", "command", "current", "trs", "lcb"


class Sensor(NamedTuple):
    """Where a channel comes from."""

    field: str
    age: str  # field of its age; empty: none


class Experiment(NamedTuple):
    """One row of a run."""

    run: str
    row: int
    axis: str
    spring_rate: float  # N/m
    gains: tuple[float, ...]  # `GAINS`
    realisation: int
    peak: float  # N, greatest magnitude of the reference
    peak_a: float  # A, the same as drive current
    period: float  # s
    lines: tuple[int, ...]  # whole periods of each line in a repeat period
    reference: Complexes  # N, by line
    excited: Flags  # by line
    channels: dict[str, Complexes]  # periods by lines; N, m/s
    sea: Mapping[str, Any] | None  # lines asked of the wave maker; None in calm water

    @property
    def frequency(self) -> Floats:
        """Of each line, Hz."""
        return np.array(self.lines) / self.period

    @property
    def place(self) -> str:
        """Run and row in words."""
        return f"{self.run}, row {self.row}"


class Read(NamedTuple):
    """What a run gives."""

    experiments: tuple[Experiment, ...]
    notes: tuple[str, ...]  # rows that cannot be used, and why; rows that are to be doubted


def sensors(axis: str, there: set[str]) -> dict[str, Sensor]:
    """The channels of an axis that a run's record has."""
    drive = f"{axis}.sense.drive_age"
    wanted = {
        VELOCITY: Sensor(f"{axis}.sense.counts", f"{axis}.sense.encoder_age"),
        COMMAND: Sensor(f"{axis}.command.force", ""),
        CURRENT: Sensor(f"{axis}.sense.current", drive),
    }
    if axis == "heave":
        wanted |= {
            TRS: Sensor("load.trs", "load.age"),
            LCB: Sensor("load.lcb", "load.age"),
        }
    return {name: sensor for name, sensor in wanted.items() if sensor.field in there}


def experiments(run: str | os.PathLike[str], *, incomplete_rows: bool = False) -> Read:
    """The experiments of a run with an open-loop reference.

    ``incomplete_rows``: also those of rows of which the record lacks ticks, interpolated.

    Raises RunError where the run cannot be read or has no reference.
    """
    source = reader.open_files(run)
    known = run_info(run, source.contents)
    told = known.plan.get("reference")
    if not isinstance(told, dict):
        raise RunError(f"{run}: no open-loop reference in its plan, so nothing to identify by")
    there = {leaf.name for leaf in source.leaves}
    found = sensors(told["axis"], there)
    fields = {REFERENCE, CLOCK, *(s.field for s in found.values())}
    fields |= {s.age for s in found.values()} - {""}
    fields |= {SATURATED} & there
    rows = {int(row["row"]): row for row in known.plan.get("rows", [])}
    made: dict[int, Experiment] = {}
    left: dict[int, str] = {}
    cut: dict[int, str] = {}
    for window in read_windows(source, sorted(fields), known.plan, incomplete_rows=incomplete_rows):
        if window.row not in rows:
            continue
        try:
            made[window.row] = _experiment(window, rows[window.row], known, found)
            left.pop(window.row, None)
        except ValueError as error:
            left[window.row] = f"{known.run}, row {window.row}: {error}"
            continue
        said = _saturated(window, found)
        cut[window.row] = f"{known.run}, row {window.row}: {said}" if said else ""
    lost = tuple(why for row, why in left.items() if row not in made)
    return Read(tuple(made.values()), (*lost, *filter(None, cut.values())))


def _saturated(window: Window, found: dict[str, Sensor]) -> str:
    """What is to be said of a heave row in which the drive could not give what was asked of it."""
    if SATURATED not in (window.data.dtype.names or ()) or TRS not in found:
        return ""
    share = float(np.mean(window.data[SATURATED] != 0))
    if share == 0.0:
        return ""
    return (
        f"the drive saturated in {100.0 * share:.2g} % of its ticks: the command is not the force, "
        "so Y_id from command is off; from current, torque sensor and load cell it is not"
    )


def _experiment(
    window: Window, row: dict[str, Any], known: RunInfo, found: dict[str, Sensor]
) -> Experiment:
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    data, told, dt = window.data, known.plan["reference"], float(known.plan["dt"])
    sea = known.plan.get("asked_sea")
    repeats = [float(told["period_s"]), *([float(sea["repeat_s"])] if sea else [])]
    period = whole_ticks(repeats, dt, window.span)
    start = float(data[CLOCK][0])
    force = filled(data["tick"], data[REFERENCE])
    if not force.any():
        raise ValueError("the reference is zero")
    top = min(period // 2 - 1, int(HIGHEST * period * dt))
    whole = amplitudes(force, start, dt, period, top).mean(axis=0)
    used = excited(whole)
    highest = int(np.flatnonzero(used)[-1]) + 1
    if sea:
        highest = max(highest, round(max(sea["cycles"]) * period * dt / sea["repeat_s"]))
    lines = min(top, int(BEYOND * highest) + 1)
    omega = angular(period * dt, lines)
    channels = {}
    for name, sensor in found.items():
        values = filled(data["tick"], data[sensor.field].astype(np.float64))
        made = amplitudes(values, start, dt, period, lines)
        age = float(data[sensor.age].mean()) if sensor.age else 0.0
        channels[name] = made * np.exp(1j * omega * age) * _scale(name, known, told["axis"], omega)
    per_ampere = float(told["newtons_per_ampere"])
    return Experiment(
        known.run,
        window.row,
        told["axis"],
        float(row["spring_rate"]),
        tuple(float(row[name]) for name in GAINS),
        int(row.get("realisation", 1)),
        float(np.abs(force).max()),
        float(np.abs(force).max()) / per_ampere,
        period * dt,
        tuple(range(1, lines + 1)),
        whole[:lines],
        used[:lines],
        channels,
        sea,
    )


def _scale(name: str, known: RunInfo, axis: str, omega: Floats) -> Complexes:
    """From the record's unit to newtons or metres per second, by line."""
    one = np.ones(omega.size, dtype=np.complex128)
    if name == CURRENT:
        return one * float(known.plan["reference"]["newtons_per_ampere"])
    if name != VELOCITY:
        return one
    ratio = known.config_number("rig", axis, "gear_ratio_rad_per_m")
    counts = known.config_number("rig", axis, "counts_per_revolution")
    if ratio is None or counts is None:
        raise ValueError("its configuration does not say what an encoder count is")
    return one * 1j * omega * (2.0 * np.pi / ratio / counts)
