"""A MASK4 file as a run: the record that the rig itself would have left, as far as it is known.

What the file does not hold is NaN (0 where the record has whole numbers). Means of F v are taken
of forces from a zero: by default that of each row's own window, as the test's scripts do.
"""

import hashlib
import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from rig.config.columns import COLUMNS
from rig.interop.exchange.mask4_signals import Floats, Signals
from rig.interop.exchange.mask4_windows import Timing, Windows, by_time, from_labels
from rig.kinds.wavebot.signals import WaveBotRow
from rig.realtime.safety import Mode, Reason
from rig.realtime.sequence import Phase
from rig.recording import provenance, row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs import create
from rig.recording.runs.folder import CONFIG, MCAP, STATUS
from rig.recording.runs.mcap_file import Records, row_dtype
from rig.regular_file import MAX_RECORD_BYTES, read_regular

Zeros = Literal["window", "run", "none"]

MODE = "imported"
_STAMP = re.compile(r"(\d{4})_(\d\d)_(\d\d)_(\d\d)_(\d\d)_(\d\d)")
_LOGGED = {
    "kp": "heave.demand.kp",
    "ki": "heave.demand.ki",
    "spring_rate": "spring_command.rate",
    "bus_voltage": "drive_command.settings.bus_voltage",
    "switching_period": "drive_command.settings.switching_period",
    "velocity_threshold": "drive_command.settings.velocity_threshold",
}
_CELLS = {"lcb": "mechanical_1", "trs": "mechanical_2"}


class FileDescription(NamedTuple):
    """What a person says of a file that it does not say itself."""

    name: str  # of the campaign
    started: datetime  # when its time began
    sea: dict[str, Any]  # as in a plan: kind, words, frequency_hz, ...
    repeat: float | None  # s, of the waves
    timing: Timing | None  # not needed where the file has our labels
    zeros: Zeros = "window"


class Imported(NamedTuple):
    """A run made of a file."""

    folder: Path
    rows: int
    remarks: tuple[str, ...]


def started_by_name(path: Path) -> datetime | None:
    """The date in a file's name, waveBotCtrlMdl_2023_09_26_12_08_43full.mat, by its own clock."""
    found = _STAMP.search(path.name)
    if found is None:
        return None
    return datetime.strptime(found[0], "%Y_%m_%d_%H_%M_%S").replace(tzinfo=UTC)


def write_run(signals: Signals, path: Path, runs: Path, said: FileDescription) -> Imported:
    """A run folder in ``runs``; ValueError where rows cannot be found in the file."""
    windows, columns = _windows(signals, said)
    time = signals.time - signals.time[0]
    dt = float(np.median(np.diff(time)))
    data = _ticks(signals, windows, time, dt)
    _zeros(data, said.zeros)
    rows = _rows(data, columns, said.timing if from_labels(signals.found) is None else None)
    remarks = list(windows.remarks)
    if signals.absent:
        remarks.append(f"not in the file: {', '.join(signals.absent)}")
    folder = create.create_folder(runs, said.name, said.started)
    source = {
        "file": path.name,
        "sha256": hashlib.sha256(read_regular(path, MAX_RECORD_BYTES)).hexdigest(),
        "zeros": said.zeros,
        "timing": said.timing._asdict() if said.timing else "labels of the file",
        "remarks": remarks,
    }
    plan = {"dt": dt, "rows": rows, "repeat_s": said.repeat, "sea": said.sea}
    _write(folder, data, plan, _config(signals, said, source), said)
    return Imported(folder, len(rows), tuple(remarks))


def _windows(signals: Signals, said: FileDescription) -> tuple[Windows, tuple[str, ...]]:
    """Rows of the file, and which settings it knows."""
    columns = tuple(name for name, leaf in _LOGGED.items() if leaf in signals.leaves)
    labelled = from_labels(signals.found)
    if labelled is not None:
        return labelled, columns
    if said.timing is None:
        raise ValueError("say how long its rows are: the file itself does not")
    if "spring_rate" not in columns:
        raise ValueError("no magSpringSetpointSignals.targetSpring_N_m in the file")
    counter = signals.found.get("expCtrl.runCounter")
    if counter is None or len(counter) != len(signals.time):
        raise ValueError("no expCtrl.runCounter in the file, so its first row cannot be found")
    settings = np.stack([signals.leaves[_LOGGED[name]] for name in columns], axis=1)
    return by_time(signals.time, np.asarray(counter), settings, columns, said.timing), columns


def _ticks(signals: Signals, windows: Windows, time: Floats, dt: float) -> Records:
    leaves = row_layout.leaves(WaveBotRow)
    data: Records = np.zeros(len(time), row_dtype(leaves))
    for leaf in leaves:
        if leaf.code == "d":
            data[leaf.name] = np.nan
    for name, value in signals.leaves.items():
        data[name] = value
    data["tick"] = data["tick_end"] = np.rint(time / dt).astype(np.int64)
    data["time"] = time
    data["plan.row"], data["plan.phase"] = windows.row, windows.phase
    data["plan.attempt"] = windows.attempt
    data["safety.mode"] = Mode.RUN
    data["heave.sense.enabled"] = 1
    if "heave.demand.force" in signals.leaves:
        data["heave.command.force"] = signals.leaves["heave.demand.force"]
    trigger = signals.found.get("setpointSignals.trigger")
    since = np.full(len(time), -1.0)
    if trigger is not None and len(trigger) == len(time) and (trigger > 5.0).any():
        began = int(np.argmax(trigger > 5.0))
        since[began:] = time[began:] - time[began]
    data["plan.wave_clock"] = since
    return data


def _zeros(data: Records, zeros: Zeros) -> None:
    """Zeros of the load cells, and power of the forces from them."""
    measured = data["plan.phase"] == Phase.MEASURE
    for cell, station in _CELLS.items():
        force, zero = data[f"load.{cell}"], np.zeros(len(data))
        if zeros != "none" and measured.any():
            zero[:] = force[measured].mean()
        if zeros == "window":
            for row in np.unique(data["plan.row"][measured]):
                inside = measured & (data["plan.row"] == row)
                zero[inside] = force[inside].mean()
        data[f"tare.{cell}"] = zero
        data[f"power.{station}"] = (force - zero) * data["heave.estimate.velocity"]
    data["tare.slew"] = 0.0
    data["tare.samples"] = 0 if zeros == "none" else int(measured.sum())


def _rows(data: Records, columns: tuple[str, ...], timing: Timing | None) -> list[dict[str, Any]]:
    """The plan's rows, as the first sample of each window has its set point."""
    units = {column.name for column in COLUMNS}
    points: dict[tuple[float, ...], int] = {}
    asked: dict[int, int] = {}
    made = []
    measured = data["plan.phase"] == Phase.MEASURE
    for row in np.unique(data["plan.row"][measured & (data["plan.row"] >= 0)]).tolist():
        here = data[measured & (data["plan.row"] == row)]
        # Nine digits, so that rounding makes no two points of one.
        setting = {name: float(f"{here[_LOGGED[name]][0]:.9g}") for name in columns}
        point = points.setdefault(tuple(setting.values()), len(points))
        asked[point] = asked.get(point, -1) + 1
        line = {"row": row, "point": point, "repetition": asked[point]}
        line |= {name: value for name, value in setting.items() if name in units}
        line |= {"measure_s": timing.measure} if timing else {}
        stator = float(here["spring_sense.position"].mean())
        made.append(line | ({"stator": stator} if np.isfinite(stator) else {}))
    return made


def _config(signals: Signals, said: FileDescription, source: dict[str, Any]) -> dict[str, Any]:
    drive = {"kind": signals.drive}
    if signals.drive == "custom":
        drive["modulation"] = "not recorded"
    heave = {"torque_constant_n_m_per_a": 6.1745, "gear_ratio_rad_per_m": 12.4666}
    rig = {"name": "WaveBot (MASK4)", "kind": "wavebot", "drive": drive, "heave": heave}
    return {"name": said.name, "rig": rig, "campaign": {"name": said.name}, "imported": source}


def _write(
    folder: Path, data: Records, plan: dict[str, Any], config: dict[str, Any], said: FileDescription
) -> None:
    status = {
        "run": folder.name,
        "status": "complete",
        "reason": Reason.PLAN_END.name,
        "mode": MODE,
        "campaign": said.name,
        "rows_planned": len(plan["rows"]),
        "rows_done": len(plan["rows"]),
        "started_utc": said.started.isoformat(),
    }
    rate = 1.0 / plan["dt"]
    timing = {"summary": f"Recorded by another system at {rate:g} Hz: no timing certificate."}
    texts = {CONFIG: config, "plan.json": plan, "code.json": provenance.describe_code()}
    writer = RowWriter(
        folder / MCAP,
        WaveBotRow,
        {name: json.dumps(value).encode() for name, value in texts.items()},
        {"run": {"run": folder.name, "mode": MODE}},
        start_utc_ns=round(said.started.timestamp() * 1e9),
    )
    for begin in range(0, len(data), 1000):
        writer.append(data[begin : begin + 1000].tobytes())
    writer.attach("timing.json", json.dumps(timing).encode())
    writer.attach("status.json", json.dumps(status).encode())
    writer.finish()
    for name, value in {**texts, STATUS: status}.items():
        create.write_json(folder, name, value)
