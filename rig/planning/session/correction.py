"""Correction of the shaft's position, worked out before the run from what earlier runs found.

Per component (`online`): an uncorrected run gave, row by row, how much amplitude the driveline
loses and how late the shaft is. A line through amplitude difference over rms torque (OSWEC thesis
(University of Washington), Fig. 2.5) and one for the delay say both for the conditions of a row;
the row's own point never takes part in its lines. The delay's line is one over rms velocity
(thesis, Fig. 2.4), over rms torque, or over both: the angle by which the shaft trails, delay times
velocity, is gap and torsion at the torque of full speed, so it is a line over torque, and the delay
that angle over the row's velocity. Alone, velocity leaves out the torsion R/k, torque the gap. The
conditions come from an uncorrected run, too: "experiments will need to be run without corrections,
to capture torque" (thesis, section 2.3.2).

Of an irregular reference every component gets the same delay and the same relative amplitude. A
spring under a linear damper delays by R/k whatever the frequency, and a gap under a Gaussian motion
does so by sqrt(2/pi) beta / sigma_v (statistical linearisation), so this is what both causes say.
"""

import math
from typing import NamedTuple

import numpy as np

from rig.config.constants_file import ConstantsFile, DrivelinePoint
from rig.config.problems import ConfigError, Problem
from rig.config.session_file import InstantaneousCorrection, OnlineCorrection, SessionFile
from rig.config.yaml_source import SourceMap
from rig.planning.session.rows import SessionPoint

LEAST_POINTS = 3
"""Of other rows, for a line."""


class Ahead(NamedTuple):
    """How the components of a row are corrected."""

    more: float  # rad, added to the amplitude of the whole motion
    advance: float  # s


NOT_AHEAD = Ahead(0.0, 0.0)


class Correction(NamedTuple):
    """What a session's plan needs of its correction."""

    rows: tuple[Ahead, ...]  # one a point of the file
    torques: tuple[float, ...]  # N*m, increasing; the map of a correction in the instant, or empty
    deflections: tuple[float, ...]  # rad
    runs: dict[str, str]  # what it was worked out from: key of the file -> run


class Line(NamedTuple):
    """y = offset + slope x."""

    offset: float
    slope: float

    def at(self, x: float) -> float:
        """y."""
        return self.offset + self.slope * x


def correction(
    file: SessionFile,
    points: tuple[SessionPoint, ...],
    used: dict[str, ConstantsFile | None],
    locate: SourceMap,
) -> Correction:
    """The correction of a session; ``used`` are the files its keys name.

    Raises `ConfigError` where a row has no conditions, or too few others are left for a line.
    """
    told = file.correction
    runs = {key: one.run for key, one in used.items() if one is not None}
    none = (NOT_AHEAD,) * len(points)
    if isinstance(told, InstantaneousCorrection):
        found = used["map"]
        if found is None or found.deflection_map is None:
            raise ConfigError([_lacks(locate, "map", told.map, "deflection_map")])
        shape = found.deflection_map
        angles = tuple(math.radians(one) for one in shape.deflection_deg)
        return Correction(none, shape.torque_n_m, angles, runs)
    if isinstance(told, OnlineCorrection):
        return Correction(_online(file, told, points, used, locate), (), (), runs)
    return Correction(none, (), (), {})


def _online(
    file: SessionFile,
    told: OnlineCorrection,
    points: tuple[SessionPoint, ...],
    used: dict[str, ConstantsFile | None],
    locate: SourceMap,
) -> tuple[Ahead, ...]:
    fitted = used["regressions"]
    if fitted is None or not fitted.driveline:
        raise ConfigError([_lacks(locate, "regressions", told.regressions, "driveline")])
    conditions = used["conditions"] or fitted
    if not conditions.driveline:
        raise ConfigError([_lacks(locate, "conditions", told.conditions, "driveline")])
    rows, problems = [], []
    period = file.irregular.repeat_s if file.irregular is not None else 0.0
    for point in points:
        row = next((d for d in conditions.driveline if _same(d, point, period)), None)
        others = [d for d in fitted.driveline if not _same(d, point, period)]
        message = ""
        if row is None:
            message = f"no uncorrected row of these conditions in {conditions.run}"
        elif len(others) < LEAST_POINTS:
            message = f"{len(others)} other rows in {fitted.run}; a line needs {LEAST_POINTS}"
        if message or row is None:
            where = next(iter(point.at.values()))
            problems.append(where.problem(None, message))
            continue
        rows.append(ahead(row, others, told.phase_over))
    if problems:
        raise ConfigError(list(dict.fromkeys(problems)))
    return tuple(rows)


def ahead(row: DrivelinePoint, others: list[DrivelinePoint], phase_over: str) -> Ahead:
    """Amplitude to add and advance under a row's conditions, by lines through other rows."""
    torque = [one.rms_torque_n_m for one in others]
    over = torque if phase_over == "torque" else [one.rms_velocity_rad_per_s for one in others]
    late = [0.01 * one.phase_shift_percent * one.period_s for one in others]
    lost = [one.amplitude_difference_deg for one in others]
    at = row.rms_torque_n_m if phase_over == "torque" else row.rms_velocity_rad_per_s
    more = math.radians(line(torque, lost).at(row.rms_torque_n_m))
    if phase_over == "both":
        speed = [one.rms_velocity_rad_per_s for one in others]
        behind = [t * v for t, v in zip(late, speed, strict=True)]  # rad, of the rms
        angle = line(torque, behind).at(row.rms_torque_n_m)
        return Ahead(more, angle / row.rms_velocity_rad_per_s)
    return Ahead(more, line(over, late).at(at))


def line(x: list[float], y: list[float]) -> Line:
    """The line of least squares; level through the mean where all x are one."""
    if len(set(x)) < 2:
        return Line(float(np.mean(y)), 0.0)
    slope, offset = np.polyfit(x, y, 1)
    return Line(float(offset), float(slope))


def _same(known: DrivelinePoint, point: SessionPoint, repeat: float) -> bool:
    """Whether an earlier row was run at this set point."""
    given = point.given
    period = given.get("period", repeat)
    pairs = (
        (known.amplitude_deg, given["amplitude"]),
        (known.period_s, period),
        (known.damping_n_m_s_per_rad, given.get("damping", 0.0)),
    )
    return all(abs(one - other) <= 1e-6 * max(abs(one), 1.0) for one, other in pairs)


def _lacks(locate: SourceMap, key: str, value: object, wanted: str) -> Problem:
    return locate.problem(("correction", key), value, f"has no {wanted}; allowed a file that has")
