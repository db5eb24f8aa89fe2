"""Experiments of a run: each measured row with an open-loop reference, as lines of its periods.

Rows and windows come from row id and phase in the log, not from times. The reader holds one row in
memory at a time and keeps only its lines. Sensor readings are shifted to their sampling time by the
ages in the log; the command is not shifted.
"""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import Window, read_windows
from rig.spectra.periods import (
    WAVE_CLOCK,
    Complexes,
    Flags,
    Floats,
    amplitudes,
    angular_frequencies,
    common_period_ticks,
    excited_lines,
    field_lines,
    fill_lost_ticks,
)

LINE_HEADROOM = 1.25  # lines are kept up to this multiple of the highest excited frequency
MAX_FREQUENCY = 5.0  # Hz, highest frequency of a reference
GAINS = ("kp", "ki", "km", "surge_kp", "surge_ki")

REFERENCE = "reference.force"
SATURATED = "drive_sense.saturated"
VELOCITY, COMMAND, CURRENT, TRS, LCB = "velocity", "command", "current", "trs", "lcb"


class Sensor(NamedTuple):
    """Log fields of a channel."""

    field: str
    age: str  # field of its age; empty: no age


class Experiment(NamedTuple):
    """Lines of one row of a run."""

    run: str
    row: int
    axis: str
    spring_rate: float  # N/m
    gains: tuple[float, ...]  # `GAINS`
    realisation: int
    peak: float  # N, peak magnitude of the reference
    peak_a: float  # A, the same as drive current
    period: float  # s
    lines: tuple[int, ...]  # cycles of each line in a repeat period
    reference: Complexes  # N, by line
    excited: Flags  # by line
    channels: dict[str, Complexes]  # periods by lines; N, m/s
    sea: Mapping[str, Any] | None  # commanded wave lines; None in calm water

    @property
    def frequency(self) -> Floats:
        """Frequency of each line, Hz."""
        return np.array(self.lines) / self.period

    @property
    def row_label(self) -> str:
        """Run and row as text."""
        return f"{self.run}, row {self.row}"


class RunExperiments(NamedTuple):
    """Experiments of a run, and notes."""

    experiments: tuple[Experiment, ...]
    notes: tuple[str, ...]  # excluded rows and doubtful rows, with reasons


def sensors(axis: str, logged_fields: set[str]) -> dict[str, Sensor]:
    """Return the channels of an axis that a run has logged."""
    drive = f"{axis}.sense.drive_age"
    channels = {
        VELOCITY: Sensor(f"{axis}.sense.counts", f"{axis}.sense.encoder_age"),
        COMMAND: Sensor(f"{axis}.command.force", ""),
        CURRENT: Sensor(f"{axis}.sense.current", drive),
    }
    if axis == "heave":
        channels |= {
            TRS: Sensor("load.trs", "load.age"),
            LCB: Sensor("load.lcb", "load.age"),
        }
    return {name: sensor for name, sensor in channels.items() if sensor.field in logged_fields}


def read_experiments(
    run: str | os.PathLike[str], *, incomplete_rows: bool = False
) -> RunExperiments:
    """Read the experiments of a run with an open-loop reference.

    ``incomplete_rows`` includes rows with missing ticks, interpolated. Raises RunError if the run
    cannot be read or has no reference.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    reference = run_facts.plan.get("reference")
    if not isinstance(reference, dict):
        raise RunError(
            f"{run}: no open-loop reference in its plan, so there is nothing to identify"
        )
    logged_fields = {leaf.name for leaf in source.leaves}
    channel_sensors = sensors(reference["axis"], logged_fields)
    fields = {REFERENCE, WAVE_CLOCK, *(sensor.field for sensor in channel_sensors.values())}
    fields |= {sensor.age for sensor in channel_sensors.values()} - {""}
    fields |= {SATURATED} & logged_fields
    rows = {int(row["row"]): row for row in run_facts.plan.get("rows", [])}
    experiments_by_row: dict[int, Experiment] = {}
    failures: dict[int, str] = {}
    saturation_notes: dict[int, str] = {}
    for window in read_windows(
        source, sorted(fields), run_facts.plan, incomplete_rows=incomplete_rows
    ):
        if window.row not in rows:
            continue
        try:
            experiments_by_row[window.row] = _cut_experiment(
                window, rows[window.row], run_facts, channel_sensors
            )
            failures.pop(window.row, None)
        except ValueError as error:
            failures[window.row] = f"{run_facts.run}, row {window.row}: {error}"
            continue
        note = _saturation_message(window, channel_sensors)
        saturation_notes[window.row] = f"{run_facts.run}, row {window.row}: {note}" if note else ""
    excluded = tuple(message for row, message in failures.items() if row not in experiments_by_row)
    return RunExperiments(
        tuple(experiments_by_row.values()), (*excluded, *filter(None, saturation_notes.values()))
    )


def _saturation_message(window: Window, channel_sensors: dict[str, Sensor]) -> str:
    """Return a note on a heave row in which the drive saturated, or ""."""
    if SATURATED not in (window.data.dtype.names or ()) or TRS not in channel_sensors:
        return ""
    share = float(np.mean(window.data[SATURATED] != 0))
    if share == 0.0:
        return ""
    return (
        f"the drive saturated in {100.0 * share:.2g} % of its ticks: the command is not the force, "
        "so Y_id from command is wrong; current, torque sensor and load cell are not affected"
    )


def _cut_experiment(
    window: Window, row: dict[str, Any], run_facts: RunInfo, channel_sensors: dict[str, Sensor]
) -> Experiment:
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    data, reference, dt = window.data, run_facts.plan["reference"], float(run_facts.plan["dt"])
    sea = run_facts.plan.get("asked_sea")
    repeats = [float(reference["period_s"]), *([float(sea["repeat_s"])] if sea else [])]
    period = common_period_ticks(repeats, dt, window.span)
    start = float(data[WAVE_CLOCK][0])
    force = fill_lost_ticks(data["tick"], data[REFERENCE])
    if not force.any():
        raise ValueError("the reference is zero")
    line_limit = min(period // 2 - 1, int(MAX_FREQUENCY * period * dt))
    reference_lines = amplitudes(force, start, dt, period, line_limit).mean(axis=0)
    is_excited = excited_lines(reference_lines)
    max_line = int(np.flatnonzero(is_excited)[-1]) + 1
    if sea:
        max_line = max(max_line, round(max(sea["cycles"]) * period * dt / sea["repeat_s"]))
    lines = min(line_limit, int(LINE_HEADROOM * max_line) + 1)
    omega = angular_frequencies(period * dt, lines)
    channels = {}
    for name, sensor in channel_sensors.items():
        found = field_lines(data, sensor.field, sensor.age, dt, period, lines)
        channels[name] = found * _to_si(name, run_facts, reference["axis"], omega)
    newtons_per_ampere = float(reference["newtons_per_ampere"])
    return Experiment(
        run_facts.run,
        window.row,
        reference["axis"],
        float(row["spring_rate"]),
        tuple(float(row[name]) for name in GAINS),
        int(row.get("realisation", 1)),
        float(np.abs(force).max()),
        float(np.abs(force).max()) / newtons_per_ampere,
        period * dt,
        tuple(range(1, lines + 1)),
        reference_lines[:lines],
        is_excited[:lines],
        channels,
        sea,
    )


def _to_si(name: str, run_facts: RunInfo, axis: str, omega: Floats) -> Complexes:
    """Return the factor from the logged unit to newtons or metres per second, by line."""
    unity = np.ones(omega.size, dtype=np.complex128)
    if name == CURRENT:
        return unity * float(run_facts.plan["reference"]["newtons_per_ampere"])
    if name != VELOCITY:
        return unity
    return velocity_per_count(run_facts, axis, omega)


def velocity_per_count(run_facts: RunInfo, axis: str, omega: Floats) -> Complexes:
    """Return the factor from encoder counts to velocity (m/s) of an axis, by line."""
    ratio = run_facts.config_number("rig", axis, "gear_ratio_rad_per_m")
    counts = run_facts.config_number("rig", axis, "counts_per_revolution")
    if ratio is None or counts is None:
        raise ValueError("its configuration has no gear ratio or encoder resolution")
    return np.asarray(1j * omega * (2.0 * np.pi / ratio / counts), dtype=np.complex128)
