"""Import a MASK4 file as a run: write the record that the rig itself would have written.

Log fields that the file does not hold are NaN (0 for integers). Means of F v use forces relative to
a zero: by default the mean of each row's own window, as in the test's scripts.
"""

import hashlib
import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from rig.interop.basin.merge import SYNC_FILE, MergeSource, SyncChannels, merge, write_products
from rig.interop.tables import write_columns
from rig.kinds.wavebot.mask4.signals import Mask4Signals, read_signals
from rig.kinds.wavebot.mask4.windows import RowTiming, RowWindows, find_by_time, from_labels
from rig.kinds.wavebot.tick.signals import WaveBotRow
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording import provenance, row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs import create
from rig.recording.runs.folder import CONFIG, MCAP, STATUS
from rig.recording.runs.mcap_file import Records, row_dtype
from rig.regular_file import MAX_RECORD_BYTES, read_regular
from rig.spectra.periods import Floats

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


class FileDescription(NamedTuple):
    """Properties of a file that it does not contain, from the command line."""

    name: str  # name of the campaign
    started: datetime  # start of its time
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


def import_file(
    path: Path, runs_folder: Path, description: FileDescription, drive: str | None = None
) -> ImportedRun:
    """Write a run folder in ``runs_folder``, with the waves of the file merged into the run.

    ``drive`` is that of `read_signals`. Raises `ConfigError` for a file that cannot be read,
    ValueError if no rows can be found.
    """
    signals = read_signals(path, drive)
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
    folder = create.create_folder(runs_folder, description.name, description.started)
    source = {
        "file": path.name,
        "sha256": hashlib.sha256(read_regular(path, MAX_RECORD_BYTES)).hexdigest(),
        "zeros": description.zeros,
        "timing": description.timing._asdict() if description.timing else "labels of the file",
        "remarks": remarks,
    }
    plan = {"dt": dt, "rows": plan_rows, "repeat_s": description.repeat, "sea": description.sea}
    _write_folder(folder, log_rows, plan, _config(signals, description, source), description)
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
        force, zero = data[f"load.{cell}"], np.zeros(len(data))
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


def _config(
    signals: Mask4Signals, description: FileDescription, source: dict[str, Any]
) -> dict[str, Any]:
    drive = {"kind": signals.drive}
    if signals.drive == "custom":
        drive["modulation"] = "not recorded"
    heave = {"torque_constant_n_m_per_a": 6.1745, "gear_ratio_rad_per_m": 12.4666}
    rig = {"name": "WaveBot (MASK4)", "kind": "wavebot", "drive": drive, "heave": heave}
    return {
        "name": description.name,
        "rig": rig,
        "campaign": {"name": description.name},
        "imported": source,
    }


def _write_folder(
    folder: Path,
    data: Records,
    plan: dict[str, Any],
    config: dict[str, Any],
    description: FileDescription,
) -> None:
    status = {
        "run": folder.name,
        "status": "complete",
        "reason": Reason.PLAN_END.name,
        "mode": IMPORTED_MODE,
        "campaign": description.name,
        "rows_planned": len(plan["rows"]),
        "rows_done": len(plan["rows"]),
        "started_utc": description.started.isoformat(),
    }
    rate = 1.0 / plan["dt"]
    timing = {"summary": f"Recorded by another system at {rate:g} Hz: no timing certificate."}
    texts = {CONFIG: config, "plan.json": plan, "code.json": provenance.describe_code()}
    writer = RowWriter(
        folder / MCAP,
        row_layout.schema(WaveBotRow),
        {name: json.dumps(value).encode() for name, value in texts.items()},
        {"run": {"run": folder.name, "mode": IMPORTED_MODE}},
        start_utc_ns=round(description.started.timestamp() * 1e9),
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
    columns = {"time_s": np.asarray(time) - signals.time[0]}
    columns |= {name: np.asarray(signals.variables[bus + name]) for name in names}
    return [write_columns(columns, folder / SYNC_FILE)]


def _write_waves(signals: Mask4Signals, folder: Path) -> Path | None:
    """Write ``waves.csv``: basin data (m) on the run's time, as in the file; None if absent."""
    bus = "waveData."
    data = {n.removeprefix(bus): v for n, v in signals.variables.items() if n.startswith(bus)}
    time = next((data[name] for name in _TIME_CHANNELS if name in data), None)
    waves = {
        name: np.asarray(value)
        for name, value in data.items()
        if name.lower() not in _CLOCK_CHANNELS and time is not None and len(value) == len(time)
    }
    if time is None or not waves:
        return None
    columns = {"time_s": np.asarray(time) - signals.time[0]} | waves
    return write_columns(columns, folder / WAVES_FILE)
