"""Manual mode of the bench: its session, the set points that people choose, and rows of them.

A set point of the velocity loop has a goal of the shaft's angle, the speed of the way there, a jog
velocity, and a signal on angle or velocity. One of the torque loop has a torque, a signal on it,
and the motor's damping of a flap. Both have damping and current of the brake, if there is one. A
row of a session is a sine of angle or torque around zero, so only such set points can be kept.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from math import degrees, hypot, pi, radians
from pathlib import Path
from typing import Any

from controllers.signal_generator import SetPoint
from rig.campaign.derived_file import derived_name, row_text
from rig.config.problems import ConfigError, Problem, display_path
from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench.config.session_file import FREE_SHAFT, SESSION_COLUMNS, SESSION_KINDS
from rig.kinds.oswec_bench.sessions.check import SessionReport
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.sessions.plan import NO_FLUME, REST, SessionPlan, setpoint_table
from rig.kinds.oswec_bench.tick import manual
from rig.people import set_points
from rig.people.set_points import (
    Amplitude,
    Checked,
    Description,
    Kept,
    KeptRows,
    LiveSet,
    RefusedError,
    Row,
    field_range,
)
from rig.planning.input_files import ConfigSource, load_named_source
from rig.processes.run_types import Task
from rig.realtime.live_setpoints import numbers_at

Examine = Callable[[Path], SessionReport]

_SESSIONS = {
    ("velocity", False): "driveline",
    ("torque", False): "torque_tracking",
    ("velocity", True): "flap_hydrostatic",
    ("torque", True): "flap_pto_sweep",
}
"""The kind of session of a rig in manual mode, by the drive's loop and whether it has a flap."""

_COLUMNS = {column.key: column for column in SESSION_COLUMNS}
_BRAKE = ("damping_n_m_s_per_rad", "brake_current_a")
_PTO = "pto_damping_n_m_s_per_rad"
_QUANTITIES = {
    "amplitude_deg": manual.ANGLE,
    "amplitude_rad_per_s": manual.VELOCITY,
    "amplitude_n_m": manual.TORQUE,
}
"""The quantity of the signal by the key of its amplitude."""

_SIGNAL_COLUMNS = {
    "amplitude_deg": "amplitude_deg",
    "torque_amplitude_n_m": "amplitude_n_m",
    "current_amplitude_a": "amplitude_n_m",
}
"""The signal's amplitude that a row's amplitude is, by the column of the row."""

_FREE_FLAP = "its flap is free of the motor, which alone would turn; couple them for manual mode"


def write_task(file: Path, path: Path, drive: str = "", *, clamped: bool = False) -> None:
    """Write the session for manual mode, as of `rig.kinds.interface.Manual`: a row at rest."""
    source = ConfigSource(*load_mapping(file))
    mapping, locate = source
    if "rig" in mapping:
        kind = str(mapping.get("session"))
        requirements = SESSION_KINDS.get(kind)
        if requirements is None:
            message = f"{kind} is not known; allowed {', '.join(SESSION_KINDS)}"
            raise ConfigError([locate.problem(("session",), kind, message)])
        if drive not in ("", requirements.loop):
            message = (
                f"a session {kind} uses the {requirements.loop} loop; leave --drive {drive} out"
            )
            raise ConfigError([locate.problem(("session",), kind, message)])
        if requirements.flap_coupling == "free":
            raise ConfigError([locate.problem(("session",), kind, f"{kind}: {_FREE_FLAP}")])
        if requirements.needs_clamp:
            shaft = mapping.get("shaft", "free")
            if shaft == "free":
                raise ConfigError([locate.problem(("shaft",), shaft, f"{shaft}: {FREE_SHAFT}")])
        name = str(mapping.get("name", ""))
    else:
        flap = _flap(source)
        if flap.get("coupled", {}).get("value", 1) == 0:
            plant = mapping.get("plant")
            raise ConfigError([locate.problem(("plant",), plant, f"{plant}: {_FREE_FLAP}")])
        kind = _SESSIONS[drive or "velocity", bool(flap)]
        if SESSION_KINDS[kind].needs_clamp and not clamped:
            message = f"{FREE_SHAFT}; clamp the shaft by hand, and say so with --clamped"
            raise ConfigError([Problem(display_path(file), 1, "", drive, message)])
        name = file.stem
    if clamped and not SESSION_KINDS[kind].needs_clamp:
        message = f"a session {kind} moves the shaft; unclamp it, and leave --clamped out"
        raise ConfigError([Problem(display_path(file), 1, "", "clamped", message)])
    row = {key: _least(key) for key in ("period_s", *_required(kind))}
    text = _session_text(file, path, derived_name(name, "-manual"), kind, [(row, "never run")])
    path.write_text(text)


def live_columns(
    task: Task, session: Session, plan: SessionPlan, file: Path, examine: Examine, kept: Path
) -> "BenchSetPoints":
    """Return the set points of a run, as of `rig.kinds.interface.Manual`."""
    session_file = session.file
    if SESSION_KINDS[session_file.session].flap_coupling == "free":
        raise RefusedError(_FREE_FLAP)
    return BenchSetPoints(file, session, plan, examine, kept)


class BenchSetPoints:
    """The set points of a session's drive and brake, their checks, and the file of kept rows."""

    moving_s = 0.0  # no part moves between set points but the shaft itself

    def left_behind(self, before: Sequence[LiveSet], row: int) -> str:
        return ""  # a row begins with homing

    def __init__(
        self, file: Path, session: Session, plan: SessionPlan, examine: Examine, kept: Path
    ) -> None:
        """``file``: the session that kept rows extend, or a rig; ``kept``: the file of these."""
        self._file, self._session, self._plan, self._examine = file, session, plan, examine
        limits, rig, constants = session.limits, session.rig, session.constants
        motor = limits.motor
        self._has_flap = "flap" in session.plant
        self._velocity_loop = session.file.loop == "velocity"
        self._range_deg = motor.angle_warn_deg
        fastest = min(motor.velocity_command_rad_per_s, rig.servo.command_v * constants.velocity)
        least_constant = min(constants.torque_positive, constants.torque_negative)
        strongest = min(limits.load_cell.twisting_stop_n_m, motor.current_peak_a * least_constant)
        self._fastest, self._strongest = fastest, strongest
        describe = set_points.describe
        if self._velocity_loop:
            drive = [
                describe("angle_deg", "angle", "deg", -self._range_deg, self._range_deg),
                describe("speed_rad_per_s", "speed to the angle", "rad/s", 0.0, fastest),
                describe("velocity_rad_per_s", "jog velocity", "rad/s", -fastest, fastest),
            ]
            amplitudes = [
                Amplitude("amplitude_deg", "amplitude of angle", "deg", self._range_deg),
                Amplitude("amplitude_rad_per_s", "amplitude of velocity", "rad/s", fastest),
            ]
        else:
            drive = [
                describe("torque_n_m", "torque", "N*m", -strongest, strongest),
                *([_describe(_PTO)] if self._has_flap else []),
            ]
            amplitudes = [Amplitude("amplitude_n_m", "amplitude of torque", "N*m", strongest)]
        damping, current = (_describe(key) for key in _BRAKE)
        current["high"] = rig.brake.map[-1].current_a
        brake = [] if self._has_flap else [damping, current]
        self._values = [*drive, *brake]
        self._amplitudes = [each.key for each in amplitudes]
        self._signal = set_points.describe_signal(amplitudes, rig.rate_hz)
        self._kept = KeptRows(kept, self._text, self._problems_of)

    def describe(self) -> list[dict[str, Any]]:
        return self._values + self._signal

    def first(self) -> LiveSet:
        """Return a set point at rest: the shaft at its zero, no torque, the brake off."""
        values = {each["key"]: 0.0 for each in self._values}
        if self._velocity_loop:
            values["speed_rad_per_s"] = self._session.rig.homing.speed_rad_per_s
        return LiveSet(values, set_points.no_signal(self._amplitudes))

    def of_row(self, row: int) -> LiveSet:
        """Return the set point of a row; without its motion where the generator cannot give it."""
        given, first = self._plan.rows[row].values, self.first()
        values = first.values | {key: given[key] for key in first.values if key in given}
        still = LiveSet(values, first.signal)
        amplitude = next((key for key in given if key in _SIGNAL_COLUMNS), "")
        if not amplitude or "period_s" not in given:  # waves, or an irregular reference
            return still
        size = given[amplitude]
        if amplitude == "current_amplitude_a":
            size *= self._session.rig.servo.torque_constant_n_m_per_a
        sine = {"kind": "sine", _SIGNAL_COLUMNS[amplitude]: size}
        moving = LiveSet(values, first.signal | sine | {"frequency_hz": 1.0 / given["period_s"]})
        return still if self.check(moving).problems else moving

    def check(self, chosen: LiveSet, before: Sequence[LiveSet] = ()) -> Checked:
        values, signal = chosen.values, chosen.signal
        problems = [
            *set_points.unknown("values", values, (each["key"] for each in self._values)),
            *set_points.unknown("signal", signal, (each["key"] for each in self._signal)),
            *set_points.outside(self._values, values),
            *set_points.outside(self._signal, signal),
        ]
        if not problems:
            together = self._drive_problems if self._velocity_loop else self._torque_problems
            problems = list(together(values, signal))
        if problems:
            return Checked((), tuple(problems))
        return Checked(numbers_at(setpoint_table((self._setpoint(chosen),)), 0))

    def keep(self, chosen: LiveSet, comment: str) -> Kept:
        """Append a set point to the file of kept rows, a session.

        RefusedError lists all reasons why a session of this kind has no such row.
        """
        reasons = list(self._no_row(chosen))
        if reasons:
            raise RefusedError("; ".join(reasons))
        signal, kind = chosen.signal, self._session.file.session
        requirements = SESSION_KINDS[kind]
        size = float(signal[_SIGNAL_COLUMNS[requirements.amplitude_column]])
        if requirements.amplitude_column == "current_amplitude_a":
            size /= self._session.rig.servo.torque_constant_n_m_per_a
        row = {requirements.amplitude_column: size, "period_s": 1.0 / float(signal["frequency_hz"])}
        brake = {key: float(chosen.values.get(key, 0.0)) for key in requirements.optional_columns}
        return Kept(self._kept.add(row | brake, comment))

    # --- checks of several values together

    def _drive_problems(self, values: dict[str, Any], signal: dict[str, Any]) -> Iterator[str]:
        angle, turn = self._amplitude(signal, "amplitude_deg"), "signal.amplitude_rad_per_s"
        velocity, jog = self._amplitude(signal, "amplitude_rad_per_s"), values["velocity_rad_per_s"]
        low, high = _frequencies(signal)
        if angle > 0.0 and velocity > 0.0:
            both = f"{angle:g} deg and {velocity:g} rad/s"
            yield f"signal.amplitude_deg, {turn}: {both}; allowed one of them above 0"
        if angle > 0.0 and jog != 0.0:
            yield f"velocity_rad_per_s: {jog:g}; allowed 0 with a signal on the angle"
        reach = abs(values["angle_deg"]) + angle
        if reach > self._range_deg:
            yield (
                f"angle_deg, signal.amplitude_deg: together {reach:g}; allowed up to "
                f"{self._range_deg:g} deg (motor.angle_warn_deg)"
            )
        # A ramp of the amplitude adds to the sine's velocity, a quarter period apart.
        ramp = self._session.rig.manual_ramp_s
        peak = radians(angle) * hypot(1.0 / ramp, high)
        for keys, fastest in (
            ("speed_rad_per_s, signal", values["speed_rad_per_s"] + peak if peak > 0.0 else 0.0),
            ("velocity_rad_per_s, signal", abs(jog) + velocity),
        ):
            if fastest > self._fastest:
                allowed = f"allowed up to {self._fastest:g} rad/s"
                yield f"{keys}: the drive would turn with {fastest:g} rad/s; {allowed}"
        acceleration = max(radians(angle) * high, velocity) * high
        most = self._session.limits.motor.acceleration_rad_per_s2
        if acceleration > most:
            allowed = f"allowed up to {most:g} rad/s^2 (motor.acceleration_rad_per_s2)"
            yield f"signal: accelerates with {acceleration:g} rad/s^2; {allowed}"
        # From rest the first half period takes the shaft to one side by 2 v / w. No later one goes
        # farther, nor does it while the amplitude ramps or the (first) sweep lasts.
        left = radians(self._range_deg - abs(values["angle_deg"]))
        if signal["kind"] in ("sine", "chirp") and 2.0 * velocity > low * left:
            swing = f"by {degrees(2.0 * velocity / low):.4g} deg" if low > 0.0 else "without end"
            allowed = f"allowed up to {self._range_deg:g} deg (motor.angle_warn_deg)"
            swing = f"{velocity:g} rad/s turns the shaft {swing} to one side"
            yield f"angle_deg, {turn}: {swing}; {allowed}"

    def _torque_problems(self, values: dict[str, Any], signal: dict[str, Any]) -> Iterator[str]:
        peak = abs(values["torque_n_m"]) + self._amplitude(signal, "amplitude_n_m")
        stop = self._session.limits.load_cell.twisting_stop_n_m
        if peak > self._strongest or peak >= stop:
            allowed = f"up to {self._strongest:g} N*m (motor.current_peak_a)"
            if self._strongest >= stop:
                allowed = f"below {stop:g} N*m (load_cell.twisting_stop_n_m)"
            yield f"torque_n_m, signal.amplitude_n_m: together {peak:g}; allowed {allowed}"

    def _amplitude(self, signal: dict[str, Any], key: str) -> float:
        return 0.0 if signal["kind"] == "none" else float(signal[key])

    # --- numbers and rows

    def _setpoint(self, chosen: LiveSet) -> Any:
        values, signal = {k: float(v) for k, v in chosen.values.items()}, chosen.signal
        key = next((k for k in self._amplitudes if signal[k] > 0.0), self._amplitudes[0])
        size = self._amplitude(signal, key)
        size = radians(size) if key == "amplitude_deg" else size
        generated: SetPoint = set_points.signal_numbers(signal, size)
        chosen_motion = manual.SetPoint(
            radians(values.get("angle_deg", 0.0)),
            values.get("speed_rad_per_s", 0.0),
            values.get("velocity_rad_per_s", 0.0),
            values.get("torque_n_m", 0.0),
            float(_QUANTITIES[key]),
            generated,
        )
        damping, current = (values.get(each, 0.0) for each in _BRAKE)
        flume = NO_FLUME._replace(pto_damping=values.get(_PTO, 0.0))
        return REST._replace(
            damping=damping, brake_current=current, flume=flume, by_people=chosen_motion
        )

    def _no_row(self, chosen: LiveSet) -> Iterator[str]:
        """Yield the reasons why no row of this kind of session is the set point."""
        kind, signal = self._session.file.session, chosen.signal
        requirements = SESSION_KINDS[kind]
        if requirements.needs_waves:
            yield f"a row of a session {kind} has waves, manual mode has none"
            return
        for key, value in chosen.values.items():
            if value == 0.0 or key == "speed_rad_per_s" or key in requirements.optional_columns:
                continue
            if key in _COLUMNS:
                yield f"{key}: {value:g}; a row of a session {kind} has no such column"
            else:
                yield f"{key}: {value:g}; a row moves around zero, allowed 0"
        amplitude = _SIGNAL_COLUMNS[requirements.amplitude_column]
        if signal["kind"] != "sine":
            yield f"signal.kind: {signal['kind']}; a row is a sine"
        elif not signal[amplitude] > 0.0:
            yield f"signal.{amplitude}: {signal[amplitude]:g}; a row needs it, allowed above 0"
        if signal["kind"] == "sine" and not signal["frequency_hz"] > 0.0:
            yield f"signal.frequency_hz: {signal['frequency_hz']:g}; allowed above 0"

    def _text(self, path: Path, rows: Sequence[Row]) -> str:
        name = derived_name(self._session.file.name, "-kept")
        return _session_text(self._file, path, name, self._session.file.session, rows)

    def _problems_of(self, path: Path) -> Iterator[str]:
        for each in self._examine(path).problems:
            yield f"{each.key}: {each.message}" if each.key else each.message


def _session_text(file: Path, path: Path, name: str, kind: str, rows: Sequence[Row]) -> str:
    """Return the text of a session at ``path`` with these rows, without correction.

    ``file``: the session that it extends; or a rig.
    """
    mapping, _ = load_mapping(file)
    base = json.dumps(os.path.relpath(file.resolve(), path.resolve().parent))
    lines = ["# Set points of manual mode"]
    if "rig" in mapping:
        removed = (f"{key}:" for key in ("grid", "irregular") if mapping.get(key) is not None)
        changed = {"correction": "none", "repeat": "1", "order": "as given"}
        lines += [f"extends: {base}", f"name: {json.dumps(name)}", *removed]
        lines += [f"{key}: {value}" for key, value in changed.items() if key in mapping]
    else:
        lines += [f"name: {json.dumps(name)}", f"session: {kind}", f"rig: {base}"]
        lines += ["shaft: clamped"] if kind == "torque_tracking" else []
        lines += ["timing: {rise_s: 1.5, settle_periods: 2, periods: 10}"]
    lines += ["rows:", *(f"  - {row_text(values)}  # {comment}" for values, comment in rows)]
    return "\n".join(lines) + "\n"


def _flap(rig: ConfigSource) -> dict[str, Any]:
    """Return the flap of a rig's plant file; empty without one."""
    plant = load_named_source(rig, ("plant",))
    flap = plant.mapping.get("flap") if plant is not None else None
    return flap if isinstance(flap, dict) else {}


def _required(kind: str) -> tuple[str, ...]:
    """Return the columns that a row of a kind of session has, besides the period."""
    return SESSION_KINDS[kind].amplitude_column, *SESSION_KINDS[kind].required_columns


def _describe(key: str) -> Description:
    """Return the description of a column of sessions."""
    column = _COLUMNS[key]
    low, high = field_range([SESSION_COLUMNS[column]])
    return set_points.describe(key, column.label, column.unit, low, high)


def _least(key: str) -> float:
    """Return a value of a column for a row that is never run."""
    return {"period_s": 2.0, _PTO: 0.0}.get(key, 0.1)


def _frequencies(signal: dict[str, Any]) -> tuple[float, float]:
    """Return the lowest and the highest frequency of a signal, rad/s; 0 of a step."""
    if signal["kind"] not in ("sine", "chirp"):
        return 0.0, 0.0
    ends = [signal["frequency_hz"]]
    if signal["kind"] == "chirp":
        ends.append(signal["end_frequency_hz"])
    return 2.0 * pi * float(min(ends)), 2.0 * pi * float(max(ends))
