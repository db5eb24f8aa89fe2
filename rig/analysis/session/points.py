"""A bench run as set points of evenly sampled arrays: what every session's analysis begins with.

Angles are the measured ones, counts times the encoder's scale less the tared zero; never the
filtered estimates, whose lag would be taken for the driveline's.
"""

import os
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.session import periods
from rig.analysis.session.deflection import Motion, motion
from rig.analysis.session.estimate import Floats
from rig.analysis.session.periods import Cut
from rig.analysis.windows import Window, gone, windows
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import Facts, facts
from rig.recording.runs.state import Reading, RecordState

FIELDS = (
    *("encoders.motor_counts", "encoders.shaft_counts", "load.tz", "servo.current"),
    *("brake.current", "tared.motor", "tared.shaft", "tared.torque", "tared.samples"),
    *("reference.angle", "reference.velocity", "reference.torque"),
    *("correction.angle", "command.velocity", "command.volts", "command.torque"),
    *(
        "command.current",
        "command.brake_torque",
        "command.limited",
        "demand.torque",
        "encoders.age",
        "plan.wave_clock",
        "time",
    ),
)


class Point(NamedTuple):
    """The measured ticks of one set point, (samples,) each."""

    row: int
    asked: dict[str, Any]  # its columns in the plan
    incomplete_reason: str  # why it is not whole; empty if it is
    lost: int  # ticks that were not logged: interpolated
    limited: int  # ticks whose command was not granted in full
    period: float  # s, after which its reference repeats
    dt: float  # s
    start: float  # s from run start
    clock: float  # s of the row's own clock, at its first tick
    age: float  # s, how old its angles are
    tare_samples: int  # averaged for its zeros; 0: provisional zeros
    motor: Floats  # rad
    shaft: Floats  # rad
    torque: Floats  # N*m, of the load cell, tared
    current: Floats  # A, of the motor, measured
    current_command: Floats  # A
    volts: Floats  # V
    brake_current: Floats  # A, measured
    wanted_angle: Floats  # rad, uncorrected reference
    wanted_velocity: Floats  # rad/s
    wanted_torque: Floats  # N*m
    correction: Floats  # rad, added by the position correction

    @property
    def due_angle(self) -> Floats:
        """The reference as it was when the angles were read, rad."""
        t = self.dt * np.arange(len(self.wanted_angle))
        out: Floats = np.interp(t - self.age, t, self.wanted_angle)
        return out

    def number(self, column: str, otherwise: float = float("nan")) -> float:
        """A column of the plan as a number."""
        value = self.asked.get(column)
        return float(value) if isinstance(value, int | float) else otherwise

    @property
    def correction_name(self) -> str:
        """none, offline, online or instantaneous."""
        return str(self.asked.get("correction") or "none")

    def cut(self) -> Cut:
        """All its whole periods, whatever phase they begin with."""
        return periods.cut(len(self.motor), self.period, self.dt)

    def aligned(self, command: Floats) -> Cut:
        """Its whole periods from a maximum of a command on, as the thesis's figures have them."""
        first = periods.begin(command, self.period, self.dt)
        whole = self.cut()
        if whole.whole < 2:
            return whole
        return periods.cut(len(self.motor), self.period, self.dt, first)

    def motion(self) -> Motion:
        """Motor, shaft and torque over the whole periods of the reference angle."""
        return motion(self.motor, self.shaft, self.torque, self.aligned(self.wanted_angle))

    def over(self, values: Floats, of: Cut) -> Floats:
        """A signal cut to whole periods."""
        return values[of.edges[0] : of.edges[-1]]


class Session(NamedTuple):
    """A run of a session."""

    known: Facts
    kind: str  # driveline, torque_constant, ...
    name: str
    points: list[Point]  # in the order of the run
    torque_constant: float  # N*m/A, in use in the run
    velocity_constant: float  # rad/s/V, in use in the run
    irregular: bool  # the reference is no sinusoid
    record: RecordState
    gone: tuple[int, ...]  # rows of which the record lacks all ticks

    @property
    def whole(self) -> list[Point]:
        """Set points that were measured to their end."""
        return [point for point in self.points if not point.incomplete_reason]


def session_of(known: Facts) -> dict[str, Any]:
    """The session file of a run, as resolved; empty for a run that is no session's."""
    told = known.config.get("session")
    return told if isinstance(told, dict) else {}


def open_session(run: str | os.PathLike[str]) -> Session:
    """Read a run; RunError if it is no session's or nothing was measured."""
    source = reader.source(run)
    known = facts(run, source.contents)
    told = session_of(known)
    if not told:
        raise RunError(f"{run}: no run of a bench session (its configuration names none)")
    scales = known.plan.get("scales") or {}
    dt = float(known.plan["dt"])
    rows = {int(row["row"]): row for row in known.plan.get("rows", [])}
    repeat = float((told.get("irregular") or {}).get("repeat_s") or np.nan)
    latest: dict[int, Point] = {}
    seen = Reading(source.contents, source.damage)
    for window in windows(source, list(FIELDS), known.plan, reading=seen):
        if window.row >= 0:
            latest.pop(window.row, None)  # a later attempt takes the place of an earlier one
            latest[window.row] = _point(window, rows.get(window.row, {}), scales, repeat, dt)
    if not latest:
        raise RunError(f"{run}: no set point was measured")
    record = seen.state(run)
    return Session(
        known,
        str(told.get("session") or ""),
        str(told.get("name") or told.get("session") or ""),
        list(latest.values()),
        float(scales.get("torque_constant_n_m_per_a") or np.nan),
        float(scales.get("velocity_constant_rad_per_s_per_v") or np.nan),
        bool(told.get("irregular")),
        record,
        tuple(sorted(gone(known.plan, latest, record))),
    )


def _point(
    window: Window, asked: dict[str, Any], scales: dict[str, Any], repeat: float, dt: float
) -> Point:
    data = window.data
    ticks = data["tick"]
    grid = np.arange(ticks[0], ticks[-1] + 1)
    gaps = len(grid) != len(ticks)

    def field(name: str) -> Floats:
        values = np.asarray(data[name], np.float64)
        return np.interp(grid, ticks, values) if gaps else values

    length = asked.get("measure_s")
    short = window.incomplete_reason
    if not short and isinstance(length, int | float) and len(grid) < 0.99 * length / dt - 1.0:
        short = "shorter than planned"
    motor = field("encoders.motor_counts") * float(scales["motor_rad_per_count"])
    shaft = field("encoders.shaft_counts") * float(scales["shaft_rad_per_count"])
    return Point(
        window.row,
        asked,
        short,
        len(grid) - len(ticks),
        int((data["command.limited"] != 0).sum()),
        float(asked.get("period_s") or repeat),
        dt,
        float(data["time"][0]),
        float(data["plan.wave_clock"][0]),
        float(data["encoders.age"].mean()),
        int(data["tared.samples"].min()),
        motor - field("tared.motor"),
        shaft - field("tared.shaft"),
        field("load.tz") - field("tared.torque"),
        field("servo.current"),
        field("command.current"),
        field("command.volts"),
        field("brake.current"),
        field("reference.angle"),
        field("reference.velocity"),
        field("reference.torque"),
        field("correction.angle"),
    )
