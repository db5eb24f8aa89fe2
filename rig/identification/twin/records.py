"""Measured rows of runs as a twin needs them: lines of motion and force, and power beside current.

Rows and windows are those that the log says. Sensor readings are put back to when they were taken
by the ages in the log. Complex amplitudes are those of e^{+i omega t}; forces are on the body.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.windows import Window, read_windows
from rig.identification import periods
from rig.identification.periods import (
    Complexes,
    Flags,
    Floats,
    amplitudes,
    angular,
    filled,
    whole_ticks,
)
from rig.recording.runs import reader
from rig.recording.runs.folder import RunInfo, run_info

HIGHEST = 2.5  # Hz, of the lines that are kept: five times the usual wave
BLOCK = 0.1  # s, over which power and current are averaged beside each other

COUNTS, ENCODER_AGE = "heave.sense.counts", "heave.sense.encoder_age"
LOADS, LOAD_AGE = {"trs": "load.trs", "lcb": "load.lcb"}, "load.age"
CURRENT, CLOCK, REFERENCE = "heave.sense.current", "plan.wave_clock", "reference.force"
AC, DC, VOLTAGE = "power_sense.ac", "power_sense.dc", "power_sense.bus_voltage"
CONDUCTS = "drive_command.conducting"
FIELDS = (
    COUNTS, ENCODER_AGE, *LOADS.values(), LOAD_AGE, CURRENT, CLOCK, REFERENCE, AC, DC, VOLTAGE,
    CONDUCTS,
)  # fmt: skip


class Power(NamedTuple):
    """Means over blocks of `BLOCK` in which the power stage switched all the time."""

    size: Floats  # A, mean |i| of the drive current
    square: Floats  # A^2
    loss: Floats  # W, DC less AC
    voltage: Floats  # V, of the bus


class Record(NamedTuple):
    """One measured row over its whole repeat periods."""

    place: str  # run and row
    setting: dict[str, float]  # of the row, by the names of `rig.config.columns`
    sea: dict[str, Any] | None  # lines asked of the wave maker; None in calm water
    has_excitation: bool  # an open-loop reference was on
    period: float  # s
    velocity: Complexes  # m/s, by line from 1 on, mean over the periods
    trs: Complexes  # N
    lcb: Complexes  # N
    excited: Flags  # lines that reference or sea have
    ac: float  # W, mean
    dc: float
    current_square: float  # A^2, mean
    power: Power

    @property
    def omega(self) -> Floats:
        """rad/s of each line."""
        return angular(self.period, len(self.velocity))

    @property
    def amplitudes(self) -> dict[str, float]:
        """How far and how fast it moved, by the names of the row table: m, m/s."""
        position = synthesised(self, self.velocity / (1j * self.omega))
        rms = float(np.sqrt(0.5 * np.sum(np.abs(self.velocity) ** 2)))
        return {"velocity_rms": rms, "stroke": float(np.ptp(position))}

    @property
    def shaft(self) -> float:
        """Mean mechanical power at the torque sensor, W, absorbed negative."""
        return 0.5 * float(np.sum((self.trs * np.conj(self.velocity)).real))

    @property
    def column(self) -> float:
        """Mean mechanical power at the column load cell, W."""
        return 0.5 * float(np.sum((self.lcb * np.conj(self.velocity)).real))


class Read(NamedTuple):
    """What a run gives."""

    facts: RunInfo
    records: tuple[Record, ...]
    left_out: tuple[str, ...]  # rows that cannot be used, and why


def read(run: Path, *, incomplete_rows: bool = False) -> Read:
    """The records of a run, the last whole attempt at each row.

    Raises RunError where the run cannot be read, KeyError where it did not log what is needed.
    """
    source = reader.open_files(run)
    known = run_info(run, source.contents)
    rows = {int(row["row"]): row for row in known.plan.get("rows", [])}
    made: dict[int, Record] = {}
    left: dict[int, str] = {}
    for window in read_windows(source, list(FIELDS), known.plan, incomplete_rows=incomplete_rows):
        if window.row not in rows:
            continue
        try:
            made[window.row] = _record(window, rows[window.row], known)
            left.pop(window.row, None)
        except ValueError as error:
            left[window.row] = f"{known.run}, row {window.row}: {error}"
    return Read(known, tuple(made.values()), tuple(left.values()))


def synthesised(record: Record, lines: Complexes) -> Floats:
    """One repeat period of a signal from as many lines as the record has."""
    assert len(lines) == len(record.velocity)
    return periods.synthesised(lines)


def analysed(record: Record, samples: Floats) -> Complexes:
    """The record's lines of a signal over one repeat period."""
    return periods.analysed(samples, len(record.velocity))


def _record(window: Window, row: dict[str, Any], known: RunInfo) -> Record:
    if window.incomplete_reason:
        raise ValueError(window.incomplete_reason)
    data, plan = window.data, known.plan
    dt, sea = float(plan["dt"]), plan.get("asked_sea")
    pushed = bool(np.any(data[REFERENCE] != 0.0))
    repeats = [float(sea["repeat_s"])] if sea else []
    if pushed:
        repeats.append(float(plan["reference"]["period_s"]))
    if sea is None and (plan.get("sea") or {}).get("kind") != "calm":
        raise ValueError("its plan does not say the lines of its sea")
    if not repeats:
        raise ValueError("neither sea nor reference: nothing moves")
    period = whole_ticks(repeats, dt, window.span)
    lines = min(period // 2 - 1, max(3, int(HIGHEST * period * dt)))
    count = window.span // period * period
    start = float(data[CLOCK][0])

    def lines_of(field: str, age: str, scale: Any) -> Complexes:
        values = filled(data["tick"], data[field].astype(np.float64))
        late = float(data[age].mean()) if age else 0.0
        turned = np.exp(1j * angular(period * dt, lines) * late) * scale
        mean = amplitudes(values, start, dt, period, lines).mean(axis=0)
        return np.asarray(mean * turned, dtype=np.complex128)

    force = lines_of(REFERENCE, "", 1.0) if pushed else np.zeros(lines, dtype=np.complex128)
    excited = np.abs(force) > 0.1 * np.abs(force).max(initial=1e-9)
    if sea:
        excited |= _waves(sea, period * dt, lines)
    whole = slice(0, count)
    current = data[CURRENT][whole]
    return Record(
        f"{known.run}, row {window.row}",
        {key: float(value) for key, value in row.items() if isinstance(value, int | float)},
        sea,
        pushed,
        period * dt,
        lines_of(COUNTS, ENCODER_AGE, 1j * angular(period * dt, lines) * _metres(known)),
        lines_of(LOADS["trs"], LOAD_AGE, 1.0),
        lines_of(LOADS["lcb"], LOAD_AGE, 1.0),
        excited,
        float(data[AC][whole].mean()),
        float(data[DC][whole].mean()),
        float(np.mean(current * current)),
        _power(data, round(BLOCK / dt)),
    )


def _waves(sea: dict[str, Any], period: float, lines: int) -> Flags:
    """Which lines of a period the sea has, of those that matter in it."""
    size = np.array(sea["amplitude_m"])
    strong = size > 0.1 * size.max(initial=1e-9)
    number = np.rint(np.array(sea["cycles"])[strong] * period / sea["repeat_s"]).astype(int)
    found = np.zeros(lines, dtype=np.bool_)
    found[number[(number >= 1) & (number <= lines)] - 1] = True
    return found


def _metres(known: RunInfo) -> float:
    """Heave of an encoder count, m."""
    ratio = known.config_number("rig", "heave", "gear_ratio_rad_per_m")
    counts = known.config_number("rig", "heave", "counts_per_revolution")
    if ratio is None or counts is None:
        raise ValueError("its configuration does not say what an encoder count is")
    return 2.0 * np.pi / ratio / counts


def _power(data: Any, block: int) -> Power:
    count = len(data) // block

    def means(values: Any) -> Floats:
        whole = np.asarray(values[: count * block], dtype=np.float64)
        return np.asarray(whole.reshape(count, block).mean(axis=1))

    current = data[CURRENT]
    on = means(data[CONDUCTS]) == 1.0
    columns = (np.abs(current), current * current, data[DC] - data[AC], data[VOLTAGE])
    return Power(*(means(column)[on] for column in columns))
