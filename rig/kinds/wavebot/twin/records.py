"""Measured rows of runs for the twin: lines of motion and force, and power against current.

Rows and windows come from the log. Sensor readings are shifted to their sampling time by the ages
in the log. Complex amplitudes are those of e^{+i omega t}; forces act on the body.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.identification.experiments import motion_per_count
from rig.recording.runs import RunInfo, reader, run_info
from rig.recording.runs.windows import Window, read_windows
from rig.spectra.periods import (
    WAVE_CLOCK,
    Complexes,
    Flags,
    Floats,
    angular_frequencies,
    common_period_ticks,
    field_lines,
    synthesise,
)

MAX_FREQUENCY = 2.5  # Hz, highest line kept: five times the usual wave frequency
BLOCK = 0.1  # s, over which power and current are averaged

COUNTS, ENCODER_AGE = "heave.sense.counts", "heave.sense.encoder_age"
LOADS, LOAD_AGE = {"trs": "load.trs", "lcb": "load.lcb"}, "load.age"
CURRENT, REFERENCE = "heave.sense.current", "reference.force"
AC, DC, VOLTAGE = "power_sense.ac", "power_sense.dc", "power_sense.bus_voltage"
CONDUCTS = "drive_command.conducting"
FIELDS = (
    COUNTS, ENCODER_AGE, *LOADS.values(), LOAD_AGE, CURRENT, WAVE_CLOCK, REFERENCE, AC, DC, VOLTAGE,
    CONDUCTS,
)  # fmt: skip


class PowerBlocks(NamedTuple):
    """Means over blocks of `BLOCK` seconds in which the power stage switched throughout."""

    current_magnitude: Floats  # A, mean |i| of the drive current
    current_square: Floats  # A^2
    loss: Floats  # W, DC minus AC
    voltage: Floats  # V, of the bus


class Record(NamedTuple):
    """One measured row over its whole repeat periods."""

    row_label: str  # run and row
    setting: dict[str, float]  # of the row, by the names of its columns
    sea: dict[str, Any] | None  # commanded wave lines; None in calm water
    has_excitation: bool  # an open-loop reference was on
    period: float  # s
    velocity: Complexes  # m/s, by line from 1 on, mean over the periods
    trs: Complexes  # N
    lcb: Complexes  # N
    excited: Flags  # lines that reference or sea excite
    ac: float  # W, mean
    dc: float
    current_square: float  # A^2, mean
    power: PowerBlocks

    @property
    def omega(self) -> Floats:
        """Angular frequency of each line, rad/s."""
        return angular_frequencies(self.period, len(self.velocity))

    def without_lag(self, lag: float) -> "Record":
        """Return the record with the forces ahead of an amplifier's lag (s, of first order)."""
        ahead = 1.0 + 1j * self.omega * lag
        return self._replace(trs=ahead * self.trs, lcb=ahead * self.lcb)

    @property
    def amplitudes(self) -> dict[str, float]:
        """Stroke (m) and rms velocity (m/s), by the names of the row table."""
        position = synthesise(self.velocity / (1j * self.omega))
        rms = float(np.sqrt(0.5 * np.sum(np.abs(self.velocity) ** 2)))
        return {"velocity_rms": rms, "stroke": float(np.ptp(position))}

    @property
    def shaft(self) -> float:
        """Mean mechanical power at the torque sensor, W; absorbed power is negative."""
        return 0.5 * float(np.sum((self.trs * np.conj(self.velocity)).real))

    @property
    def column(self) -> float:
        """Mean mechanical power at the column load cell, W."""
        return 0.5 * float(np.sum((self.lcb * np.conj(self.velocity)).real))


class RunRecords(NamedTuple):
    """Records of a run, and excluded rows."""

    facts: RunInfo
    records: tuple[Record, ...]
    excluded: tuple[str, ...]  # excluded rows, with reasons


def read_records(run: Path, *, incomplete_rows: bool = False) -> RunRecords:
    """Read the records of a run, from the last complete attempt at each row.

    Raises RunError if the run cannot be read, KeyError if a needed field was not logged.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    rows = {int(row["row"]): row for row in run_facts.plan.get("rows", [])}
    records: dict[int, Record] = {}
    excluded: dict[int, str] = {}
    for window in read_windows(
        source, list(FIELDS), run_facts.plan, incomplete_rows=incomplete_rows
    ):
        if window.row not in rows:
            continue
        try:
            records[window.row] = _read_record(window, rows[window.row], run_facts)
            excluded.pop(window.row, None)
        except ValueError as error:
            excluded[window.row] = f"{run_facts.run}, row {window.row}: {error}"
    return RunRecords(run_facts, tuple(records.values()), tuple(excluded.values()))


def _read_record(window: Window, row: dict[str, Any], run_facts: RunInfo) -> Record:
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    data, plan = window.data, run_facts.plan
    dt, sea = float(plan["dt"]), run_facts.requested_sea(row)
    has_excitation = bool(np.any(data[REFERENCE] != 0.0))
    repeats = [float(sea["repeat_s"])] if sea else []
    if has_excitation:
        repeats.append(float(plan["reference"]["period_s"]))
    if sea is None and (plan.get("sea") or {}).get("kind") != "calm":
        raise ValueError("its plan does not list the lines of its sea")
    if not repeats:
        raise ValueError("neither sea nor reference: there is no motion")
    period = common_period_ticks(repeats, dt, window.span)
    lines = min(period // 2 - 1, max(3, int(MAX_FREQUENCY * period * dt)))

    def lines_of(field: str, age: str) -> Complexes:
        mean = field_lines(data, field, age, dt, period, lines).mean(axis=0)
        return np.asarray(mean, dtype=np.complex128)

    force = lines_of(REFERENCE, "") if has_excitation else np.zeros(lines, dtype=np.complex128)
    excited = np.abs(force) > 0.1 * np.abs(force).max(initial=1e-9)
    if sea:
        number, amplitude = sea_lines(sea, period * dt, lines)
        strong = amplitude > 0.1 * max(sea["amplitude_m"], default=1e-9)
        excited[number[strong] - 1] = True  # lines in which the sea has significant energy
    omega = angular_frequencies(period * dt, lines)
    scale, _ = motion_per_count(run_facts, "heave")
    velocity = lines_of(COUNTS, ENCODER_AGE) * (1j * omega * scale)
    whole_periods = slice(0, window.span // period * period)
    current = data[CURRENT][whole_periods]
    return Record(
        f"{run_facts.run}, row {window.row}",
        {key: float(value) for key, value in row.items() if isinstance(value, int | float)},
        sea,
        has_excitation,
        period * dt,
        velocity,
        lines_of(LOADS["trs"], LOAD_AGE),
        lines_of(LOADS["lcb"], LOAD_AGE),
        excited,
        float(data[AC][whole_periods].mean()),
        float(data[DC][whole_periods].mean()),
        float(np.mean(current * current)),
        _power_blocks(data, round(BLOCK / dt)),
    )


def sea_lines(sea: dict[str, Any], period: float, lines: int) -> tuple[NDArray[np.int64], Floats]:
    """Return number (from 1) and amplitude (m) of the sea's lines among those of a period (s)."""
    number = np.rint(np.array(sea["cycles"]) * period / sea["repeat_s"]).astype(np.int64)
    present = (number >= 1) & (number <= lines)
    return number[present], np.array(sea["amplitude_m"])[present]


def _power_blocks(data: Any, block: int) -> PowerBlocks:
    count = len(data) // block

    def means(values: Any) -> Floats:
        trimmed = np.asarray(values[: count * block], dtype=np.float64)
        return np.asarray(trimmed.reshape(count, block).mean(axis=1))

    current = data[CURRENT]
    on = means(data[CONDUCTS]) == 1.0
    columns = (np.abs(current), current * current, data[DC] - data[AC], data[VOLTAGE])
    return PowerBlocks(*(means(column)[on] for column in columns))
