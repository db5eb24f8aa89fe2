"""Correction of the shaft's position, computed before the run from results of earlier runs.

Per component (`online`): an uncorrected run gives, row by row, the amplitude loss of the driveline
and the delay of the shaft. A line of the amplitude difference over rms torque (OSWEC thesis
(University of Washington), Fig. 2.5) and a line of the delay predict both for the conditions of a
row; the row's own point never takes part in its lines. The line of the delay is one over rms
velocity (thesis, Fig. 2.4), over rms torque, or over both: the angle by which the shaft trails,
delay times velocity, is gap and torsion at the torque of full speed, so it is fitted as a line over
torque, and the delay is that angle over the row's velocity. Velocity alone leaves out the torsion
R/k, torque alone leaves out the gap. The conditions come from an uncorrected run, too: "experiments
will need to be run without corrections, to capture torque" (thesis, section 2.3.2).

Every component of an irregular reference gets the same delay and the same relative amplitude. A
spring under a linear damper delays by R/k at any frequency, and a gap under a Gaussian motion
delays by sqrt(2/pi) beta / sigma_v (statistical linearisation), so both causes support this choice.
"""

import math
from typing import NamedTuple

import numpy as np

from rig.config.problems import ConfigError, Problem
from rig.config.yaml_source import SourceMap
from rig.kinds.oswec_bench.config.constants_file import ConstantsFile, DrivelinePoint
from rig.kinds.oswec_bench.config.session_file import (
    InstantaneousCorrection,
    OnlineCorrection,
    SessionFile,
)
from rig.planning.point import Point

MIN_POINTS = 3
"""Minimum number of other rows for a line."""


class RowCorrection(NamedTuple):
    """Correction of the components of a row."""

    extra_amplitude: float  # rad, added to the amplitude of the entire motion
    advance: float  # s


NO_CORRECTION = RowCorrection(0.0, 0.0)


class Correction(NamedTuple):
    """The correction of a session, as its plan needs it."""

    rows: tuple[RowCorrection, ...]  # one per point of the file
    torques: tuple[float, ...]  # N*m, increasing; map of an instantaneous correction, or empty
    deflections: tuple[float, ...]  # rad
    runs: dict[str, str]  # sources: key of the file -> run


def session_correction(
    file: SessionFile,
    points: tuple[Point, ...],
    constants_files: dict[str, ConstantsFile | None],
    locate: SourceMap,
) -> Correction:
    """Return the correction of a session; ``constants_files`` holds the files that its keys name.

    Raises `ConfigError` if a row has no conditions, or too few other rows are left for a line.
    """
    settings = file.correction
    runs = {key: used.run for key, used in constants_files.items() if used is not None}
    uncorrected = (NO_CORRECTION,) * len(points)
    if isinstance(settings, InstantaneousCorrection):
        map_file = constants_files["map"]
        if map_file is None or map_file.deflection_map is None:
            raise ConfigError([_missing_part(locate, "map", settings.map, "deflection_map")])
        deflection_map = map_file.deflection_map
        angles = tuple(math.radians(deflection) for deflection in deflection_map.deflection_deg)
        return Correction(uncorrected, deflection_map.torque_n_m, angles, runs)
    if isinstance(settings, OnlineCorrection):
        return Correction(
            _online_corrections(file, settings, points, constants_files, locate), (), (), runs
        )
    return Correction(uncorrected, (), (), {})


def _online_corrections(
    file: SessionFile,
    settings: OnlineCorrection,
    points: tuple[Point, ...],
    constants_files: dict[str, ConstantsFile | None],
    locate: SourceMap,
) -> tuple[RowCorrection, ...]:
    regressions_file = constants_files["regressions"]
    if regressions_file is None or not regressions_file.driveline:
        raise ConfigError([_missing_part(locate, "regressions", settings.regressions, "driveline")])
    conditions_file = constants_files["conditions"] or regressions_file
    if not conditions_file.driveline:
        raise ConfigError([_missing_part(locate, "conditions", settings.conditions, "driveline")])
    rows, problems = [], []
    period = file.irregular.repeat_s if file.irregular is not None else 0.0
    for point in points:
        same = [d for d in conditions_file.driveline if _is_same_setpoint(d, point, period)]
        others = [d for d in regressions_file.driveline if not _is_same_setpoint(d, point, period)]
        if same and len(others) >= MIN_POINTS:
            rows.append(row_correction(same[0], others, settings.phase_over))
            continue
        message = f"{len(others)} other rows in {regressions_file.run}; a line needs {MIN_POINTS}"
        if not same:
            message = f"no uncorrected row of these conditions in {conditions_file.run}"
        problems.append(next(iter(point.locations.values())).problem(None, message))
    if problems:
        raise ConfigError(list(dict.fromkeys(problems)))
    return tuple(rows)


def row_correction(
    row: DrivelinePoint, others: list[DrivelinePoint], phase_over: str
) -> RowCorrection:
    """Return extra amplitude and advance of a row, by lines through other rows."""
    torque, velocity = row.rms_torque_n_m, row.rms_velocity_rad_per_s
    torques = [other.rms_torque_n_m for other in others]
    velocities = [other.rms_velocity_rad_per_s for other in others]
    delays = [0.01 * other.phase_shift_percent * other.period_s for other in others]
    amplitude_losses = [other.amplitude_difference_deg for other in others]
    extra_amplitude = math.radians(_predict(torques, amplitude_losses, torque))
    if phase_over == "torque":
        advance = _predict(torques, delays, torque)
    elif phase_over == "velocity":
        advance = _predict(velocities, delays, velocity)
    else:
        # rad, at rms velocity
        trailing_angles = [t * v for t, v in zip(delays, velocities, strict=True)]
        advance = _predict(torques, trailing_angles, torque) / velocity
    return RowCorrection(extra_amplitude, advance)


def _predict(x: list[float], y: list[float], at: float) -> float:
    """Return the line of least squares at an x; the mean of y if all x are equal."""
    if len(set(x)) < 2:
        return float(np.mean(y))
    slope, offset = np.polyfit(x, y, 1)
    return float(offset) + float(slope) * at


def _is_same_setpoint(row: DrivelinePoint, point: Point, repeat_period: float) -> bool:
    """Return whether an earlier row was run at this set point."""
    values = point.values
    period, damping = values.get("period", repeat_period), values.get("damping", 0.0)
    recorded = row.amplitude_deg, row.period_s, row.damping_n_m_s_per_rad
    pairs = zip(recorded, (values["amplitude"], period, damping), strict=True)
    return all(abs(a - b) <= 1e-6 * max(abs(a), 1.0) for a, b in pairs)


def _missing_part(locate: SourceMap, key: str, value: object, part: str) -> Problem:
    return locate.problem(("correction", key), value, f"has no {part}; allowed a file that has")
