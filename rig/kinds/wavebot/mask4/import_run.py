"""Import a MASK4 file as a run: write the record that the rig itself would have written.

The signals of the file become log fields on one common time; fields that the file does not hold
are NaN (0 for integers). Means of F v use forces relative to a zero: by default the mean of each
row's own window, as in the test's scripts.

Rows are found by time, as the test's scripts do. The first row begins 120 s after runCounter's
first 1. Rows follow each other in equal intervals until the gain that marks the end (MASK4 report
(Sandia), 3.2.3). Where the spring rate changes, a row occurs twice, the first time while the stator
moves. Files exported by this package hold row and phase as labels.
"""

import hashlib
import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from rig.config.matrix import END_MARK
from rig.interop.basin.merge import SYNC_FILE, MergeSource, SyncChannels, merge, write_products
from rig.interop.legacy import matlab
from rig.interop.legacy.mask4 import RowRoles, classify_rows
from rig.interop.legacy.table import file_error
from rig.kinds.wavebot.mask4.fields import (
    ALTERNATIVE_PATHS,
    FIELDS,
    LEFT_OUT,
    REQUIRED,
    RIG_BUS,
    STARTED,
    FieldMapping,
)
from rig.kinds.wavebot.tick.signals import WaveBotRow
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording import provenance, row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs import create
from rig.recording.runs.folder import CONFIG, MCAP, STATUS
from rig.recording.runs.mcap_file import Records, row_dtype
from rig.recording.table_file import write_table
from rig.regular_file import MAX_RECORD_BYTES, read_regular
from rig.spectra.periods import Floats, Ticks

ZeroReference = Literal["window", "run", "none"]

IMPORTED_MODE = "imported"
_DATE = re.compile(r"(\d{4})_(\d\d)_(\d\d)_(\d\d)_(\d\d)_(\d\d)")
WAVES_FILE = "waves.csv"
# The first present channel is used; files with lag 0 lack syncTimeSine.
_TIME_CHANNELS = ("syncTimeSine", "syncTimeTTL")
_CLOCK_CHANNELS = (
    *("time", "elapsedtime", "utctime", "taitime"),
    *("synctimettl", "synctimesine", "synctimegps"),
)
_SETTING_FIELDS = {
    "kp": "heave.demand.kp",
    "ki": "heave.demand.ki",
    "spring_rate": "spring_command.rate",
    "bus_voltage": "drive_command.settings.bus_voltage",
    "switching_period": "drive_command.settings.switching_period",
    "velocity_threshold": "drive_command.settings.velocity_threshold",
}
DRIVE_BY_CHANNEL = {"hbmSignals.heaveDriveInP": "cots", "hbmSignals.expDriveInP": "custom"}
"""Drive of each channel of DC power: the custom drive has its own channel."""


class Mask4Signals(NamedTuple):
    """The signals of a file, with log field names and house signs."""

    time: Floats  # s, as recorded
    log_fields: dict[str, Floats]  # by log field, at ``time``
    variables: dict[str, Any]  # all numeric variables of the file, by MATLAB's path
    drive: str  # cots or custom
    missing: tuple[str, ...]  # fields of the table that the file lacks


def read_signals(path: Path, drive: str | None = None) -> Mask4Signals:
    """Return the signals of a file (MATLAB 5 or 7.3).

    ``drive`` (`cots` or `custom`) is required if the file has the DC power of both drives. Raises
    `ConfigError` with every problem.
    """
    try:
        variables = matlab.load_signals(path)
    except OSError as error:
        raise file_error(path, f"cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise file_error(path, str(error)) from None
    for name, other in ALTERNATIVE_PATHS.items():
        if name not in variables and other in variables:
            variables[name] = variables[other]
    problems = [f"no {name}: not the MASK4 structure" for name in REQUIRED if name not in variables]
    drives = [kind for name, kind in DRIVE_BY_CHANNEL.items() if name in variables]
    if drive is None and len(drives) > 1:
        problems.append(
            "the file has DC power of both drives; name the drive of the run: cots, custom"
        )
    if drive is not None and drives and drive not in drives:
        problems.append(f"no DC power of the {drive} drive is in the file, only of {drives[0]}")
    if problems:
        raise file_error(path, *problems)
    kind = drive or (drives[0] if drives else "cots")
    time = np.asarray(variables["heaveSignals.time"], dtype=np.float64)
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise file_error(path, "heaveSignals.time does not rise")
    log_fields: dict[str, Floats] = {}
    expected = [field for field in FIELDS if field.drive in ("", kind)]
    for field in expected:
        if field.path in variables and field.log_field not in log_fields:
            value, field_problems = _at_heave_time(field, variables, time)
            problems += field_problems
            log_fields[field.log_field] = (value - field.offset) / field.factor
    if problems:
        raise file_error(path, *problems)
    missing = tuple(field.path for field in expected if field.path not in variables)
    return Mask4Signals(time, log_fields, variables, kind, missing)


def _at_heave_time(
    field: FieldMapping, variables: dict[str, Any], time: Floats
) -> tuple[Floats, list[str]]:
    """Return a field at the heave signals' time, interpolated linearly from its bus's own time."""
    value = np.asarray(variables[field.path], dtype=np.float64)
    own_time = variables.get(f"{field.bus}.time", time)
    if len(own_time) != len(value):
        message = f"{field.path} has {len(value)} samples, its time {len(own_time)}"
        return np.full(len(time), np.nan), [message]
    if len(own_time) == len(time) and np.array_equal(own_time, time):
        return value, []
    return np.interp(time, own_time, value, left=np.nan, right=np.nan), []


class RowTiming(NamedTuple):
    """Timing of a test's rows, s."""

    interval: float  # from row to row: 20 for regular waves, 300 for irregular ones
    settle: float  # from the start of the interval to the window
    measure: float  # length of the window
    lead: float = 120.0  # from runCounter's 1 to the first row


class RowWindows(NamedTuple):
    """Row, phase and attempt of every sample."""

    row: Ticks
    phase: Ticks
    attempt: Ticks
    remarks: tuple[str, ...]


def from_labels(variables: dict[str, Any]) -> RowWindows | None:
    """Return the windows that the labels of the file give; None without labels."""
    names = [f"{RIG_BUS}.{name}" for name in ("row", "phase", "attempt")]
    if not all(name in variables for name in names):
        return None
    row, phase, attempt = (np.asarray(variables[name]).astype(np.int64) for name in names)
    return RowWindows(row, phase, attempt, ())


def find_by_time(
    time: Floats, counter: Floats, settings: Floats, columns: tuple[str, ...], timing: RowTiming
) -> RowWindows:
    """Return the windows of rows of equal intervals.

    ``settings`` (samples by columns) are constant within a row; ``columns`` contains kp, ki and
    spring_rate, with kp first. A window in which a setting changes ends there, so that it counts as
    cut short. Raises ValueError if no row is found.
    """
    first, count = _extent(time, counter, settings[:, 0], timing)
    starts = np.asarray(first + timing.interval * np.arange(count + 1), dtype=np.float64)
    edges = _sample_index(time, starts)
    window_starts = _sample_index(time, starts[:-1] + timing.settle)
    window_ends = _sample_index(time, starts[:-1] + timing.settle + timing.measure)
    set_points = [tuple(settings[i].tolist()) for i in window_starts]
    roles = classify_rows(set_points, columns.index("kp"), columns.index("spring_rate"), 0)
    row, attempt = np.full(len(time), NO_ROW, np.int64), np.zeros(len(time), np.int64)
    phase = np.full(len(time), int(Phase.DONE), np.int64)
    phase[: edges[0]] = Phase.LEAD_IN
    remarks = _remarks(settings[:, 0], roles)
    number = 0
    for k in range(count):
        row[edges[k] : edges[k + 1]] = number
        if k in roles.doubled:
            phase[edges[k] : edges[k + 1]] = Phase.MOVING
            continue
        window = settings[window_starts[k] : window_ends[k]]
        changed = np.flatnonzero((window != window[0]).any(axis=1))
        if changed.size:
            remarks.append(f"row {number}: a setting changes {changed[0]} samples into its window")
        last = window_starts[k] + int(changed[0]) if changed.size else window_ends[k]
        phase[edges[k] : window_starts[k]] = Phase.SETTLE
        phase[window_starts[k] : last] = Phase.MEASURE
        phase[last : edges[k + 1]] = Phase.TAIL
        number += 1
    return RowWindows(row, phase, attempt, tuple(remarks))


def _extent(time: Floats, counter: Floats, kp: Floats, timing: RowTiming) -> tuple[float, int]:
    """Return the start of the first row's interval (s) and the number of whole intervals."""
    ones = np.flatnonzero(counter == 1.0)
    if ones.size == 0:
        raise ValueError("expCtrl.runCounter is never 1: the run did not start")
    start = float(time[ones[0]]) + timing.lead
    ended = np.flatnonzero(kp == END_MARK)
    end = float(time[ended[0]]) if ended.size else float(time[-1])
    count = int((end - start) / timing.interval + 1e-6)
    if count < 1:
        raise ValueError(
            f"no row of {timing.interval:g} s between {start:.1f} s, where rows begin, and "
            f"{end:.1f} s, where the gains end"
        )
    return start, count


def _remarks(kp: Floats, roles: RowRoles) -> list[str]:
    """Return remarks on the end mark and the auxiliary rows."""
    remarks = []
    if not (kp == END_MARK).any():
        remarks.append("no end mark (Kp = -999): rows go on to the end of the record")
    if roles.doubled:
        remarks.append(f"{len(roles.doubled)} intervals during which the spring moved are left out")
    if roles.not_doubled:
        remarks.append(
            f"the spring changes {len(roles.not_doubled)} times without an interval for it"
        )
    return remarks


def _sample_index(time: Floats, moments: Floats) -> Ticks:
    """Return the index of the first sample at or after each moment (half a sample tolerance)."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    return np.searchsorted(time, moments - 0.5 * step).astype(np.int64)


class FileDescription(NamedTuple):
    """Properties of a file that it does not contain, from the command line."""

    name: str  # name of the campaign
    started: datetime | None  # start of its time; None: as `find_start` finds it
    sea: dict[str, Any]  # as in a plan: kind, words, frequency_hz, ...
    repeat: float | None  # s, repeat period of the waves
    timing: RowTiming | None  # None for files with row labels
    zeros: ZeroReference = "window"


class ImportedRun(NamedTuple):
    """The run folder made from a file."""

    folder: Path
    rows: int
    remarks: tuple[str, ...]
    written: tuple[Path, ...]  # the folder, and its files besides the record


def start_from_name(path: Path) -> datetime | None:
    """Return the date in a file's name; None if absent.

    An example is waveBotCtrlMdl_2023_09_26_12_08_43full.mat. The date is that of the recorder's
    clock and is taken as UTC.
    """
    match = _DATE.search(path.name)
    if match is None:
        return None
    return datetime.strptime(match[0], "%Y_%m_%d_%H_%M_%S").replace(tzinfo=UTC)


def find_start(path: Path, signals: Mask4Signals) -> datetime:
    """Return the UTC of the first sample: that in the file, else the date in its name.

    Files of `rig export` contain it. Raises ValueError if there is neither.
    """
    recorded = signals.variables.get(f"{RIG_BUS}.{STARTED}")
    advice = "give --started 2023-09-26T12:08:43"
    if recorded is not None:
        seconds = float(recorded[0])
        try:
            return datetime.fromtimestamp(seconds, UTC) + timedelta(seconds=float(signals.time[0]))
        except (OverflowError, ValueError, OSError):
            message = f"{RIG_BUS}.{STARTED} is {seconds:g}, no time in s since 1970; {advice}"
            raise ValueError(f"{path.name}: {message}") from None
    named = start_from_name(path)
    if named is None:
        raise ValueError(f"{path.name}: no date in the file or its name; {advice}")
    return named


def import_file(
    path: Path, runs_folder: Path, description: FileDescription, drive: str | None = None
) -> ImportedRun:
    """Write a run folder in ``runs_folder``, with the waves of the file merged into the run.

    ``drive`` is that of `read_signals`. Raises `ConfigError` for a file that cannot be read,
    ValueError if its start is unknown or no rows can be found.
    """
    signals = read_signals(path, drive)
    started = description.started or find_start(path, signals)
    windows, columns = _find_windows(signals, description)
    time = signals.time - signals.time[0]
    dt = float(np.median(np.diff(time)))
    log_rows = _log_rows(signals, windows, time, dt)
    _set_zeros(log_rows, description.zeros)
    plan_rows = _plan_rows(
        log_rows, columns, description.timing if from_labels(signals.variables) is None else None
    )
    remarks = list(windows.remarks)
    if signals.missing:
        remarks.append(f"not in the file: {', '.join(signals.missing)}")
    folder = create.create_folder(runs_folder, description.name, started)
    source = {
        "file": path.name,
        "sha256": hashlib.sha256(read_regular(path, MAX_RECORD_BYTES)).hexdigest(),
        "zeros": description.zeros,
        "timing": description.timing._asdict() if description.timing else "labels of the file",
        "remarks": remarks,
    }
    plan = {"dt": dt, "rows": plan_rows, "repeat_s": description.repeat, "sea": description.sea}
    drive_config = {"kind": signals.drive}
    if signals.drive == "custom":
        drive_config["modulation"] = "not recorded"
    heave = {"torque_constant_n_m_per_a": 6.1745, "gear_ratio_rad_per_m": 12.4666}
    config = {
        "name": description.name,
        "rig": {
            "name": "WaveBot (MASK4)",
            "kind": "wavebot",
            "drive": drive_config,
            "heave": heave,
        },
        "campaign": {"name": description.name},
        "imported": source,
    }
    _write_folder(folder, log_rows, plan, config, started)
    written = [folder, *_write_sync(signals, folder)]
    if waves := _write_waves(signals, folder):
        merged = merge(folder, [MergeSource("waves", waves, "m", 0.0)], SyncChannels())
        written += [waves, *write_products(merged, folder)]
    return ImportedRun(folder, len(plan_rows), tuple(remarks), tuple(written))


def _find_windows(
    signals: Mask4Signals, description: FileDescription
) -> tuple[RowWindows, tuple[str, ...]]:
    """Return the rows of the file, and the settings that it holds."""
    columns = tuple(name for name, leaf in _SETTING_FIELDS.items() if leaf in signals.log_fields)
    labelled = from_labels(signals.variables)
    if labelled is not None:
        return labelled, columns
    if description.timing is None:
        raise ValueError("the file does not hold the length of its rows; give their timing")
    if "spring_rate" not in columns:
        raise ValueError("no magSpringSetpointSignals.targetSpring_N_m in the file")
    counter = signals.variables.get("expCtrl.runCounter")
    if counter is None or len(counter) != len(signals.time):
        raise ValueError("no expCtrl.runCounter in the file, so its first row cannot be found")
    settings = np.stack([signals.log_fields[_SETTING_FIELDS[name]] for name in columns], axis=1)
    return find_by_time(
        signals.time, np.asarray(counter), settings, columns, description.timing
    ), columns


def _log_rows(signals: Mask4Signals, windows: RowWindows, time: Floats, dt: float) -> Records:
    leaves = row_layout.leaves(WaveBotRow)
    data: Records = np.zeros(len(time), row_dtype(leaves))
    for leaf in leaves:
        if leaf.code == "d":
            data[leaf.name] = np.nan
    for name, value in signals.log_fields.items():
        data[name] = value
    data["tick"] = data["tick_end"] = np.rint(time / dt).astype(np.int64)
    data["time"] = time
    data["plan.row"], data["plan.phase"] = windows.row, windows.phase
    data["plan.attempt"] = windows.attempt
    if (left_out := signals.variables.get(f"{RIG_BUS}.{LEFT_OUT}")) is not None:
        data["timing.skipped"] = left_out
    data["safety.mode"] = Mode.RUN
    data["heave.sense.enabled"] = 1
    if "heave.demand.force" in signals.log_fields:
        data["heave.command.force"] = signals.log_fields["heave.demand.force"]
    trigger = signals.variables.get("setpointSignals.trigger")
    wave_clock = np.full(len(time), -1.0)
    if trigger is not None and len(trigger) == len(time) and (trigger > 5.0).any():
        start = int(np.argmax(trigger > 5.0))
        wave_clock[start:] = time[start:] - time[start]
    data["plan.wave_clock"] = wave_clock
    return data


def _set_zeros(data: Records, reference: ZeroReference) -> None:
    """Set the zeros of the load cells, and the power of the forces relative to them."""
    measured = data["plan.phase"] == Phase.MEASURE
    for station in STATIONS:
        if not station.force:
            continue
        cell = station.force.removeprefix("load.")
        force: Floats = data[f"load.{cell}"]
        zero = np.zeros(len(data))
        if reference != "none" and measured.any():
            zero[:] = force[measured].mean()
        if reference == "window":
            for row in np.unique(data["plan.row"][measured]):
                inside = measured & (data["plan.row"] == row)
                zero[inside] = force[inside].mean()
        data[f"tare.{cell}"] = zero
        data[f"power.{station.name}"] = (force - zero) * data["heave.estimate.velocity"]
    data["tare.slew"] = 0.0
    data["tare.samples"] = 0 if reference == "none" else int(measured.sum())


def _plan_rows(
    data: Records, columns: tuple[str, ...], timing: RowTiming | None
) -> list[dict[str, Any]]:
    """Return the rows of the plan; the first sample of each window gives its set point."""
    points: dict[tuple[float, ...], int] = {}
    repetitions: dict[int, int] = {}
    rows = []
    measured = data["plan.phase"] == Phase.MEASURE
    for row in np.unique(data["plan.row"][measured & (data["plan.row"] >= 0)]).tolist():
        window = data[measured & (data["plan.row"] == row)]
        # Nine digits, so that rounding errors do not split one point into two.
        setting = {name: float(f"{window[_SETTING_FIELDS[name]][0]:.9g}") for name in columns}
        point = points.setdefault(tuple(setting.values()), len(points))
        repetitions[point] = repetitions.get(point, -1) + 1
        entry = {"row": row, "point": point, "repetition": repetitions[point]}
        entry |= setting | ({"measure_s": timing.measure} if timing else {})
        stator = float(window["spring_sense.position"].mean())
        rows.append(entry | ({"stator": stator} if np.isfinite(stator) else {}))
    return rows


def _write_folder(
    folder: Path,
    data: Records,
    plan: dict[str, Any],
    config: dict[str, Any],
    started: datetime,
) -> None:
    status = {
        "run": folder.name,
        "status": "complete",
        "reason": Reason.PLAN_END.name,
        "mode": IMPORTED_MODE,
        "campaign": config["name"],
        "rows_planned": len(plan["rows"]),
        "rows_done": len(plan["rows"]),
        "started_utc": started.isoformat(),
    }
    rate = 1.0 / plan["dt"]
    timing = {"summary": f"Recorded by another system at {rate:g} Hz: no timing certificate."}
    texts = {CONFIG: config, "plan.json": plan, "code.json": provenance.describe_code()}
    writer = RowWriter(
        folder / MCAP,
        row_layout.schema(WaveBotRow),
        {name: json.dumps(value).encode() for name, value in texts.items()},
        {"run": {"run": folder.name, "mode": IMPORTED_MODE}},
        start_utc_ns=round(started.timestamp() * 1e9),
    )
    for begin in range(0, len(data), 1000):
        writer.append(data[begin : begin + 1000].tobytes())
    writer.attach("timing.json", json.dumps(timing).encode())
    writer.attach("status.json", json.dumps(status).encode())
    writer.finish()
    for name, value in {**texts, STATUS: status}.items():
        create.write_json(folder, name, value)


def _write_sync(signals: Mask4Signals, folder: Path) -> list[Path]:
    """Write ``sync.csv`` for `rig merge`, the rig's own trigger and sine, if the file has them."""
    bus = "setpointSignals."
    names = [name for name in ("trigger", "syncSine") if bus + name in signals.variables]
    time = signals.variables.get(f"{bus}time")
    if not names or time is None:
        return []
    columns = {"time_s": (np.asarray(time) - signals.time[0]).tolist()}
    columns |= {name: np.asarray(signals.variables[bus + name]).tolist() for name in names}
    return [write_table(columns, folder / SYNC_FILE, "\n")]


def _write_waves(signals: Mask4Signals, folder: Path) -> Path | None:
    """Write ``waves.csv``: basin data (m) on the run's time, as in the file; None if absent."""
    bus = "waveData."
    data = {n.removeprefix(bus): v for n, v in signals.variables.items() if n.startswith(bus)}
    time = next((data[name] for name in _TIME_CHANNELS if name in data), None)
    waves = {
        name: np.asarray(value).tolist()
        for name, value in data.items()
        if name.lower() not in _CLOCK_CHANNELS and time is not None and len(value) == len(time)
    }
    if time is None or not waves:
        return None
    columns = {"time_s": (np.asarray(time) - signals.time[0]).tolist()} | waves
    return write_table(columns, folder / WAVES_FILE, "\n")
