"""Experiments of a run: each measured row with an open-loop reference, as lines of its periods.

Rows and windows come from row id and phase in the log, not from times. The reader holds one row in
memory at a time and keeps only its lines. Sensor readings are shifted to their sampling time by the
ages in the log, and each force by the delays that its channel states (`channels.ForceChannel`).
"""

import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rig.identification.channels import (
    COMMAND,
    AxisChannels,
    ForceChannel,
    force_channels,
    is_commanded,
    position_fields,
    recorded_channels,
    second_reading,
)
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
from rig.spectra.rounding import shared_rounding

LINE_HEADROOM = 1.25  # lines are kept up to this multiple of the highest excited frequency
MAX_FREQUENCY = 5.0  # Hz, highest frequency of a reference
REFERENCE = "reference.force"
VELOCITY = "velocity"
BODY = "body"
"""Channel of the force on the body alone; the others besides `VELOCITY` are the forces on body and
drivetrain in series (`channels.force_channels`)."""
SECOND = "second"
"""Channel of another reading of the motor's force (`channels.second_reading`)."""


class Experiment(NamedTuple):
    """Lines of one row of a run."""

    run: str
    row: int
    axis: str
    spring_rate: float  # N/m
    gains: tuple[float, ...]  # of feedback, in the order of their columns
    realisation: int
    peak: float  # N, peak magnitude of the reference
    peak_a: float  # A, the same as drive current
    period: float  # s
    lines: tuple[int, ...]  # cycles of each line in a repeat period
    reference: Complexes  # N, by line
    excited: Flags  # by line
    channels: dict[str, Complexes]  # periods by lines; N, m/s; the most direct force last
    sea: Mapping[str, Any] | None  # commanded wave lines; None in calm water
    labels: Mapping[str, str] = {}  # of channels, in pictures
    rotates: bool = False  # N m for N and rad for m
    rounding: Floats | None = None
    """Standard deviation of the mean velocity by the encoder, m/s, by line; None: unknown."""
    sprung: bool = True  # the drivetrain has a spring, whose rate is known

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


def _forces(declared: AxisChannels, axis: str, logged_fields: set[str]) -> dict[str, ForceChannel]:
    forces = {channel.name: channel for channel in force_channels(axis, declared)}
    if declared.body is not None:
        forces[BODY] = declared.body
    second = second_reading(axis, declared)
    if second is not None:
        forces[SECOND] = second
    return {name: channel for name, channel in forces.items() if channel.field in logged_fields}


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
    axis, declared = reference["axis"], recorded_channels(reference)
    forces = _forces(declared, axis, {leaf.name for leaf in source.leaves})
    fields = {REFERENCE, WAVE_CLOCK, *position_fields(axis), declared.saturated}
    fields |= {name for each in forces.values() for name in (each.field, each.age)}
    rows = {int(row["row"]): row for row in run_facts.plan.get("rows", [])}
    experiments_by_row: dict[int, Experiment] = {}
    failures: dict[int, str] = {}
    saturation_notes: dict[int, str] = {}
    for window in read_windows(
        source, sorted(fields - {""}), run_facts.plan, incomplete_rows=incomplete_rows
    ):
        if window.row not in rows:
            continue
        try:
            experiments_by_row[window.row] = _cut_experiment(
                window, rows[window.row], run_facts, declared, forces
            )
            failures.pop(window.row, None)
        except ValueError as error:
            failures[window.row] = f"{run_facts.run}, row {window.row}: {error}"
            continue
        note = _saturation_message(window, declared, forces)
        saturation_notes[window.row] = f"{run_facts.run}, row {window.row}: {note}" if note else ""
    excluded = tuple(message for row, message in failures.items() if row not in experiments_by_row)
    notes = (_command_note(run_facts.run, axis, declared), *saturation_notes.values())
    return RunExperiments(tuple(experiments_by_row.values()), (*excluded, *filter(None, notes)))


def _command_note(run: str, axis: str, declared: AxisChannels) -> str:
    """Return a note on a force that is the command, or ""."""
    if declared.body is None or not is_commanded(axis, declared):
        return ""
    if not declared.body.hold_s:
        return f"{run}: the force on {axis} is the command, whose delay is not corrected"
    if not declared.body.time_constant_s:
        return (
            f"{run}: the force on {axis} is the command, and no current_bandwidth_hz of its drive "
            "is given: the lag of the current is only in the band"
        )
    return (
        f"{run}: the force on {axis} is the command, corrected for its hold and the drive's "
        "bandwidth; the band contains its difference from the current"
    )


def _saturation_message(
    window: Window, declared: AxisChannels, forces: Mapping[str, ForceChannel]
) -> str:
    """Return a note on a row in which the drive saturated, or ""."""
    share = float(np.mean(window.data[declared.saturated] != 0)) if declared.saturated else 0.0
    if share == 0.0:
        return ""
    *first, last = (each.label for name, each in forces.items() if name != COMMAND)
    return (
        f"the drive saturated in {100.0 * share:.2g} % of its ticks: the command is not the force, "
        f"so Y_id from command is wrong; {', '.join(first)} and {last} are not affected"
    )


def _cut_experiment(
    window: Window,
    row: dict[str, Any],
    run_facts: RunInfo,
    declared: AxisChannels,
    forces: Mapping[str, ForceChannel],
) -> Experiment:
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    data, reference, dt = window.data, run_facts.plan["reference"], float(run_facts.plan["dt"])
    sea = run_facts.requested_sea(row)
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
    newtons_per_ampere = float(reference["newtons_per_ampere"])
    position, age = position_fields(reference["axis"])
    counts = field_lines(data, position, age, dt, period, lines)
    rounding = shared_rounding(
        fill_lost_ticks(data["tick"], data[position].astype(np.float64)), period, lines
    )
    scale, rotates = motion_per_count(run_facts, reference["axis"])
    channels = {VELOCITY: counts * (1j * omega * scale)}
    for name, channel in forces.items():
        found = field_lines(data, channel.field, channel.age, dt, period, lines)
        found = found * channel.force_per_reading(omega)
        channels[name] = found * (newtons_per_ampere if channel.per_ampere else 1.0)
    return Experiment(
        run_facts.run,
        window.row,
        reference["axis"],
        float(row[declared.spring]) if declared.spring else 0.0,
        tuple(float(row[name]) for name in declared.gains),
        int(row.get("realisation", 1)),
        float(np.abs(force).max()),
        float(np.abs(force).max()) / newtons_per_ampere,
        period * dt,
        tuple(range(1, lines + 1)),
        reference_lines[:lines],
        is_excited[:lines],
        channels,
        sea,
        {name: channel.label for name, channel in forces.items()},
        rotates,
        rounding * omega * scale,
        bool(declared.spring),
    )


def motion_per_count(run_facts: RunInfo, axis: str) -> tuple[float, bool]:
    """Return the motion of an axis per encoder count (m or rad), and whether it rotates.

    ValueError for a configuration without gear ratio or encoder resolution.
    """
    ratio = run_facts.axis_number(axis, "gear_ratio_rad_per_m")
    rotary_ratio = run_facts.axis_number(axis, "gear_ratio")
    counts = run_facts.axis_number(axis, "counts_per_revolution")
    found = rotary_ratio if ratio is None else ratio
    if found is None or counts is None:
        raise ValueError(
            f"its configuration has no gear ratio or encoder resolution of {axis}, so its motion "
            "is not known"
        )
    return 2.0 * np.pi / found / counts, ratio is None
