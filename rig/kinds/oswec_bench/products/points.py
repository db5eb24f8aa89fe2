"""A bench session, recorded or simulated, as set points of evenly sampled arrays: the input of
every session's analysis.

Angles are measured ones, counts times the encoder's scale less the tared zero. Filtered estimates
are not used: their lag would count as lag of the driveline.
"""

import os
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products import periods
from rig.kinds.oswec_bench.products.deflection import Motion, trim_motion
from rig.kinds.oswec_bench.products.estimate import Floats
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.state import RecordCheck, RecordState
from rig.recording.runs.windows import Window, missing_rows, read_windows

_SIGNAL_FIELDS = {
    "current": "servo.current",
    "current_command": "command.current",
    "volts": "command.volts",
    "brake_current": "brake.current",
    "reference_angle": "reference.angle",
    "reference_velocity": "reference.velocity",
    "reference_torque": "reference.torque",
}
"""Log fields of the signals of `SetpointData` that are taken over unchanged."""
FIELDS = (
    *("encoders.motor_counts", "encoders.shaft_counts", "load.tz", *_SIGNAL_FIELDS.values()),
    *("tared.motor", "tared.shaft", "tared.torque", "tared.samples"),
    *("command.limited", "encoders.age", "plan.wave_clock", "time"),
)

NO_POINTS = "no set point was measured"


class SetpointData(NamedTuple):
    """The measured ticks of one set point, (samples,) each."""

    row: int
    plan_row: dict[str, Any]  # columns of its row in the plan
    incomplete_reason: str  # reason why it is incomplete; empty if it is complete
    lost_ticks: int  # ticks without a log row, interpolated
    limited_ticks: int  # ticks whose command was limited
    period: float  # s, repeat period of its reference
    dt: float  # s
    start_time: float  # s from run start
    wave_clock: float  # s of the row's clock at its first tick
    encoder_age: float  # s, mean age of its angles
    tare_samples: int  # ticks averaged for its zeros; 0: provisional zeros
    motor: Floats  # rad
    shaft: Floats  # rad
    torque: Floats  # N*m, of the load cell, tared
    current: Floats  # A, of the motor, measured
    current_command: Floats  # A
    volts: Floats  # V
    brake_current: Floats  # A, measured
    reference_angle: Floats  # rad, uncorrected reference
    reference_velocity: Floats  # rad/s
    reference_torque: Floats  # N*m

    @property
    def delayed_reference_angle(self) -> Floats:
        """The reference at the times when the angles were read, rad."""
        t = self.dt * np.arange(len(self.reference_angle))
        delayed: Floats = np.interp(t - self.encoder_age, t, self.reference_angle)
        return delayed

    def plan_value(self, column: str, default: float = float("nan")) -> float:
        """Return a column of the plan as a number."""
        value = self.plan_row.get(column)
        return float(value) if isinstance(value, int | float) else default

    @property
    def correction_name(self) -> str:
        """Kind of correction: none, offline, online or instantaneous."""
        return str(self.plan_row.get("correction") or "none")

    def whole_periods(self) -> PeriodCut:
        """Return all whole periods, whatever their initial phase."""
        return periods.cut_periods(len(self.motor), self.period, self.dt)

    def aligned_periods(self, command: Floats) -> PeriodCut:
        """Return the whole periods from a maximum of a command on, as in the thesis's figures."""
        cut = self.whole_periods()
        if cut.period_count < 2:
            return cut
        first = periods.first_maximum(command, self.period, self.dt)
        return periods.cut_periods(len(self.motor), self.period, self.dt, first)

    def motion(self) -> Motion:
        """Return motor, shaft and torque over the whole periods of the reference angle."""
        cut = self.aligned_periods(self.reference_angle)
        return trim_motion(self.motor, self.shaft, self.torque, cut)


class SessionRun(NamedTuple):
    """A recorded or simulated run of a session."""

    metadata: RunInfo
    kind: str  # driveline, torque_constant, ...
    name: str
    points: list[SetpointData]  # in the order of the run
    torque_constant: float  # N*m/A, in use in the run
    irregular: bool  # the reference is not a sinusoid
    record: RecordState
    missing_rows: dict[int, str]  # reasons for rows without a measured tick in the record

    @property
    def complete_points(self) -> list[SetpointData]:
        """Set points that were measured completely."""
        return [point for point in self.points if not point.incomplete_reason]


def session_config(metadata: RunInfo) -> dict[str, Any]:
    """Return the resolved session file of a run; empty for a run that is not a session's."""
    config = metadata.config.get("session")
    return config if isinstance(config, dict) else {}


def open_session(run: str | os.PathLike[str]) -> SessionRun:
    """Read a run; RunError if it is not a session's or has no measured set point."""
    source = reader.open_files(run)
    metadata = run_info(run, source.contents)
    if not session_config(metadata):
        raise RunError(f"{run}: not a run of a bench session: its configuration names no session")
    reading = RecordCheck(source.contents, source.damage)
    windows = read_windows(source, list(FIELDS), metadata.plan, reading=reading)
    points = setpoints(metadata, windows)
    if not points:
        raise RunError(f"{run}: {NO_POINTS}")
    return session_run(metadata, points, reading.state(run))


def setpoints(metadata: RunInfo, windows: Iterable[Window]) -> list[SetpointData]:
    """Return the set points of measured windows, whose data must stay valid."""
    scales = metadata.plan.get("scales") or {}
    dt = float(metadata.plan["dt"])
    rows = {int(row["row"]): row for row in metadata.plan.get("rows", [])}
    irregular = session_config(metadata).get("irregular") or {}
    repeat_period = float(irregular.get("repeat_s") or np.nan)
    latest: dict[int, SetpointData] = {}
    for window in windows:
        if window.row >= 0:
            latest.pop(window.row, None)  # a later attempt replaces an earlier one
            latest[window.row] = _setpoint_data(
                window, rows.get(window.row, {}), scales, repeat_period, dt
            )
    return list(latest.values())


def session_run(metadata: RunInfo, points: list[SetpointData], record: RecordState) -> SessionRun:
    """Return the run of a session from its set points."""
    config = session_config(metadata)
    scales = metadata.plan.get("scales") or {}
    return SessionRun(
        metadata,
        str(config.get("session") or ""),
        str(config.get("name") or config.get("session") or ""),
        points,
        float(scales.get("torque_constant_n_m_per_a") or np.nan),
        bool(config.get("irregular")),
        record,
        missing_rows(metadata.plan, {each.row for each in points}, record),
    )


def _setpoint_data(
    window: Window,
    plan_row: dict[str, Any],
    scales: dict[str, Any],
    repeat_period: float,
    dt: float,
) -> SetpointData:
    data = window.data
    ticks = data["tick"]
    grid = np.arange(ticks[0], ticks[-1] + 1)
    gaps = len(grid) != len(ticks)

    def field(name: str) -> Floats:
        values = np.asarray(data[name], np.float64)
        return np.interp(grid, ticks, values) if gaps else values

    planned_duration = plan_row.get("measure_s")
    incomplete_reason = window.incomplete_reason
    if (
        not incomplete_reason
        and isinstance(planned_duration, int | float)
        and len(grid) < 0.99 * planned_duration / dt - 1.0
    ):
        incomplete_reason = "shorter than planned"
    motor = field("encoders.motor_counts") * float(scales["motor_rad_per_count"])
    shaft = field("encoders.shaft_counts") * float(scales["shaft_rad_per_count"])
    return SetpointData(
        window.row,
        plan_row,
        incomplete_reason,
        len(grid) - len(ticks),
        int((data["command.limited"] != 0).sum()),
        float(plan_row.get("period_s") or repeat_period),
        dt,
        float(data["time"][0]),
        float(data["plan.wave_clock"][0]),
        float(data["encoders.age"].mean()),
        int(data["tared.samples"].min()),
        motor - field("tared.motor"),
        shaft - field("tared.shaft"),
        field("load.tz") - field("tared.torque"),
        **{signal: field(name) for signal, name in _SIGNAL_FIELDS.items()},
    )
