"""Opening a session of the bench: reads every file that it refers to, and reports every problem at
once.
"""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.config.problems import Problem, format_number
from rig.config.yaml_source import KeyPath, SourceMap, load_mapping
from rig.kinds.oswec_bench.config.constants_file import BrakeMap, ConstantsFile
from rig.kinds.oswec_bench.config.limits_file import BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SESSION_COLUMNS, SESSION_KINDS, SessionFile
from rig.kinds.oswec_bench.sessions.correction import Correction, session_correction
from rig.planning.input_files import ConfigSource, FileReader, InputFile, MappingLoader
from rig.planning.point import Point
from rig.planning.points import count_points, points_of_grids, points_of_list

MAX_ROWS = 1000
"""Maximum number of rows of a session, repetitions included."""
_TICK_TOLERANCE = 1e-6  # ticks
NOMINAL = "the rig file, nominal"


class Constants(NamedTuple):
    """Scales of commands, all at the gearbox output, and the run that measured each."""

    torque_positive: float  # N*m/A
    torque_negative: float  # N*m/A
    velocity: float  # rad/s/V
    lag: float  # s, lag of the motor behind the commanded velocity; 0 if it was not measured
    brake_currents: tuple[float, ...]  # A
    brake_torques: tuple[float, ...]  # N*m, mean of both branches
    origin: dict[str, str]  # source of each constant: the run, or the rig file


class SessionParts(NamedTuple):
    """Parts of a session for further checks; None for a part that is missing or invalid."""

    session: ConfigSource
    rig: ConfigSource | None
    plant: ConfigSource | None
    rig_file: BenchRigFile | None
    file: SessionFile | None


class Session(NamedTuple):
    """A session whose files passed every check that needs no plant."""

    file: SessionFile
    rig: BenchRigFile
    limits: BenchLimitsFile
    plant: dict[str, Any]  # merged, not validated: sim_plant validates its own parameters
    points: tuple[Point, ...]
    constants: Constants
    correction: Correction
    files: tuple[InputFile, ...]  # with the files that they extend


FurtherCheck = Callable[[SessionParts], Iterable[Problem]]
"""A further check of a session; it runs even if the session has other problems."""


class _SessionReader(FileReader):
    """Reads files of constants, too."""

    def constants(self, owner: ConfigSource | None, key: KeyPath) -> ConstantsFile | None:
        """Return the constants file named at a key."""
        return self.validated(self.read("calibration", owner, key), ConstantsFile)

    def calibrations(self, owner: ConfigSource | None) -> list[ConstantsFile]:
        """Return every file that is listed under `calibrations`."""
        names = owner.mapping.get("calibrations") if owner is not None else None
        keys = range(len(names)) if isinstance(names, list) else ()
        files = [self.constants(owner, ("calibrations", i)) for i in keys]
        return [file for file in files if file is not None]


def open_session(
    path: Path,
    further_check: FurtherCheck | None = None,
    rig_path: Path | None = None,
    load: MappingLoader = load_mapping,
) -> Session:
    """Read and check a session, its rig, that rig's limits, and the calibrations of both.

    ``further_check`` adds the checks of the simulated plant; ``rig_path`` replaces the rig that the
    session names; ``load`` reads the files and may change their values. Raises `ConfigError` with
    every problem of all these files.
    """
    reader = _SessionReader(load)
    session_source = reader.read_first("session", Path(path))
    rig_source = reader.read("rig", session_source, ("rig",), rig_path)
    limits = reader.validated(reader.read("limits", rig_source, ("limits",)), BenchLimitsFile)
    owner = session_source if session_source.mapping.get("plant") is not None else rig_source
    plant = reader.read("plant", owner, ("plant",))
    file = reader.validated(session_source, SessionFile)
    rig = reader.validated(rig_source, BenchRigFile)
    measured = [*reader.calibrations(session_source), *reader.calibrations(rig_source)]
    correction_files = {
        name: reader.constants(session_source, ("correction", name))
        for name in ("regressions", "conditions", "map")
    }
    expanded_points: tuple[Point, ...] = ()
    computed_correction: Correction | None = None
    if file is not None:
        row_count = file.repeat * count_points(file.grid, file.rows)
        if row_count > MAX_ROWS:
            message = f"{row_count} rows; allowed at most {MAX_ROWS}"
            key = "repeat" if file.repeat > 1 else "grid"
            reader.problems.append(session_source.locate.problem((key,), row_count, message))
        else:
            expanded_points = session_points(file, session_source.locate)
    later = ["the set points against the limits and the correction"]
    if file is not None and not reader.problems:
        later = []
        computed_correction = reader.attempt(
            lambda: session_correction(
                file, expanded_points, correction_files, session_source.locate
            )
        )
        if rig is not None and limits is not None:
            reader.problems += _setpoints_beyond_limits(expanded_points, rig, limits)
            reader.problems += _check_wave_periods(file, expanded_points, float(rig.rate_hz))
    if further_check is not None:
        parts = SessionParts(session_source, rig_source, plant, rig, file)
        reader.problems += further_check(parts)
    if rig is None or rig.wiring is not None:
        later.append("the wires of the rig")
    reader.raise_problems(*later)
    assert file is not None
    assert rig is not None
    assert limits is not None
    assert plant is not None
    assert computed_correction is not None
    return Session(
        file,
        rig,
        limits,
        plant.mapping,
        expanded_points,
        select_constants(rig, file, [*filter(None, correction_files.values()), *measured]),
        computed_correction,
        tuple(reader.files),
    )


def _setpoints_beyond_limits(
    setpoints: tuple[Point, ...], rig: BenchRigFile, limits: BenchLimitsFile
) -> list[Problem]:
    """Return a problem for each set point that the limits would reduce."""
    bounds = {
        "amplitude": limits.motor.angle_stop_deg,
        "release": limits.shaft.slip_stop_deg,
        "torque_amplitude": limits.load_cell.twisting_stop_n_m,
        "current_amplitude": limits.motor.current_peak_a,
        "brake_current": rig.brake.map[-1].current_a,
    }
    units = {column.name: column.unit for column in SESSION_COLUMNS}
    problems: dict[tuple[str, int], Problem] = {}
    for point in setpoints:
        for name, bound in bounds.items():
            value = point.values.get(name, 0.0)
            strict = name in ("amplitude", "torque_amplitude", "release")
            if abs(value) > bound or (strict and abs(value) == bound):
                allowed = f"{'below' if strict else 'up to'} {bound:g} {units[name]}"
                message = f"{value:g} is more than limits and rig allow; allowed {allowed}"
                problem = point.locations[name].problem(value, message)
                problems.setdefault((problem.key, problem.line), problem)
    return list(problems.values())


def session_points(file: SessionFile, locate: SourceMap) -> tuple[Point, ...]:
    """Return the rows in the order of the file."""
    grid_points = points_of_grids(file.grid, ("grid",), SESSION_COLUMNS, locate)
    return grid_points + points_of_list(file.rows, ("rows",), SESSION_COLUMNS, locate)


def select_constants(
    rig: BenchRigFile, session: SessionFile, measured: Iterable[ConstantsFile]
) -> Constants:
    """Return the constants of a session; the first file that has a constant decides.

    A session that measures a constant commands by the nominal one, since its rows are given in
    terms of that.
    """
    files = () if session.session.endswith("_constant") else tuple(measured)
    servo = rig.servo
    nominal_torque = servo.torque_constant_n_m_per_a
    origin: dict[str, str] = {}

    def first_measured(names: tuple[str, ...], nominal: float) -> float:
        for name in names:
            for file in files:
                if name in file.constants:
                    origin[names[0]] = f"{file.run}, {name}"
                    return file.constants[name].value
        origin[names[0]] = NOMINAL
        return nominal

    positive = first_measured(("torque_constant_positive", "torque_constant"), nominal_torque)
    negative = first_measured(("torque_constant_negative", "torque_constant"), nominal_torque)
    loaded_names = ("velocity_constant_loaded",) if session.session == "driveline" else ()
    velocity = first_measured(
        (*loaded_names, "velocity_constant"), servo.velocity_constant_rad_per_s_per_v
    )
    lag = first_measured(("velocity_loop_lag",), 0.0) if loaded_names else 0.0
    map_file = next((file for file in files if file.brake_map is not None), None)
    if map_file is None or map_file.brake_map is None:
        origin["brake_map"] = NOMINAL
        currents = tuple(point.current_a for point in rig.brake.map)
        torques = tuple(point.torque_n_m for point in rig.brake.map)
    else:
        origin["brake_map"] = map_file.run
        currents, torques = _mean_brake_map(map_file.brake_map)
    return Constants(positive, negative, velocity, lag, currents, torques, origin)


def _mean_brake_map(brake: BrakeMap) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the currents of both branches and the mean of their torques there, strictly rising."""
    rising, falling = brake.rising, brake.falling
    low = max(rising.current_a[0], falling.current_a[0])
    high = min(rising.current_a[-1], falling.current_a[-1])
    currents = [c for c in sorted({*rising.current_a, *falling.current_a}) if low <= c <= high]
    branches = [np.interp(currents, each.current_a, each.torque_n_m) for each in (rising, falling)]
    points: list[tuple[float, float]] = []
    for current, torque in zip(currents, 0.5 * (branches[0] + branches[1]), strict=True):
        if not points or torque > points[-1][1]:
            points.append((current, float(torque)))
    mean_currents, mean_torques = zip(*points, strict=True)
    return mean_currents, mean_torques


def _check_wave_periods(
    file: SessionFile, points: tuple[Point, ...], rate_hz: float
) -> Iterator[Problem]:
    """Yield a problem for each wave period that is no whole number of ticks: a table cannot repeat
    it.
    """
    if not SESSION_KINDS[file.session].needs_waves or file.irregular is not None:
        return
    for point in points:
        ticks = point.values["period"] * rate_hz
        if abs(ticks - round(ticks)) > _TICK_TOLERANCE:
            message = f"{format_number(point.values['period'])} s is no whole number of ticks"
            message += f"; allowed multiples of {format_number(1.0 / rate_hz)} s"
            yield point.locations["period"].problem(point.values["period"], message)
