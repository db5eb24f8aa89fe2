"""From a session to the table the loop walks: rows, segments, set points.

The plan: tare (drive and brake off, the shaft at rest), then row after row: the shaft is brought
home while the drive is on (moving), the motion grows and settles for whole periods, whole periods
are measured, and the motion fades (tail). The wave clock of each row begins with its motion.
"""

import math
from typing import NamedTuple

import numpy as np

from controllers.oswec_position import PI, Component
from rig.config.session_file import SESSION_COLUMNS, SessionFile
from rig.kinds.oswec_bench import Flume, Setpoints
from rig.kinds.oswec_bench.signals import NO_FLUME
from rig.planning.campaign.segments import PlanSegment, cut_into_ticks
from rig.planning.session.correction import Ahead
from rig.planning.session.files import Session
from rig.planning.session.flume import flume, irregular_lines
from rig.planning.session.rows import SessionPoint
from rig.realtime.sequence import NO_ROW, WAIT_DRIVE, Phase, Segments


class SessionRow(NamedTuple):
    """One row of the plan: a row of the file, run once."""

    row: int  # from 0, in the order of the plan
    point: int  # from 0, in the order of the file
    repetition: int  # from 0
    given: dict[str, float]  # by file key
    periods: int  # whole periods measured
    measure: float  # s


class BenchSetting(NamedTuple):
    """One set point of the plan."""

    components: tuple[Component, ...]
    damping: float  # N*m*s/rad
    brake_current: float  # A
    rise: float  # s
    until: float  # s
    flume: Flume


class SessionPhases(NamedTuple):
    """Planned seconds of each phase."""

    tare: float
    moving: float
    settle: float
    measure: float
    tail: float


class SessionPlan(NamedTuple):
    """A session ready to be walked by `rig.realtime.sequence.step`."""

    rows: tuple[SessionRow, ...]
    segments: Segments
    setpoints: Setpoints
    dt: float  # s, length of a tick
    duration: float  # s, planned; waiting for the drive may add to it
    phases: SessionPhases


REST = BenchSetting((), 0.0, 0.0, 0.1, 0.0, NO_FLUME)
"""Nothing is asked of motor and brake."""


def plan_session(session: Session) -> SessionPlan:
    """The plan of a session that passed all checks (`rig.planning.session.open_session`)."""
    file, rig = session.file, session.rig
    rows, pieces = (
        [],
        [
            PlanSegment(NO_ROW, Phase.TARE, file.tare_duration, REST, waves=0, drive=0),
        ],
    )
    for number, (repetition, index) in enumerate(_turns(file, len(session.points))):
        point = session.points[index]
        period = _period(file, point)
        rise = file.timing.rise_s
        whole = math.ceil(rise / period - 1e-9) + file.timing.settle_periods
        settle, measure = whole * period, file.timing.periods * period
        setting = BenchSetting(
            components(session, point, session.correction.rows[index]),
            point.given.get("damping", 0.0),
            point.given.get("brake_current", 0.0),
            rise,
            settle + measure,
            flume(file, point, index),
        )
        free = setting._replace(flume=setting.flume._replace(held=0))  # let go at its measurement
        given = {c.key: point.given[c.name] for c in SESSION_COLUMNS if c.name in point.given}
        rows.append(SessionRow(number, index, repetition, given, file.timing.periods, measure))
        pieces += [
            PlanSegment(
                number, Phase.MOVING, rig.homing.duration_s, setting,
                wait=WAIT_DRIVE, timeout=rig.homing.duration_s + rig.drive_enable_timeout_s,
                waves=0,
            ),
            PlanSegment(number, Phase.SETTLE, settle, setting),
            PlanSegment(number, Phase.MEASURE, measure, free),
            PlanSegment(number, Phase.TAIL, rise, free),
        ]  # fmt: skip
    pieces.append(PlanSegment(NO_ROW, Phase.DONE, 0.0, REST, waves=0, drive=0))
    return _table(tuple(rows), pieces, float(rig.rate_hz))


def _turns(file: SessionFile, count: int) -> list[tuple[int, int]]:
    """Repetition and point of every row, in the order of the plan."""
    turns = [(repetition, i) for repetition in range(file.repeat) for i in range(count)]
    if file.order == "random":
        order = np.random.default_rng(file.seed).permutation(len(turns))
        return [turns[i] for i in order]
    return turns


def _period(file: SessionFile, point: SessionPoint) -> float:
    return point.given["period"] if file.irregular is None else file.irregular.repeat_s


def components(session: Session, point: SessionPoint, ahead: Ahead) -> tuple[Component, ...]:
    """The cosines of a row's reference, each with its share of the correction.

    Rad in the velocity loop; N*m in the torque loop, where a sine begins without torque. The
    amplitude of an irregular reference is its greatest magnitude.
    """
    file, given = session.file, point.given
    if "wave_amplitude" in given or "release" in given:  # waves or a hand move it, not the drive
        return ()
    if file.irregular is not None:
        lines, peak = irregular_lines(file.irregular), math.radians(given["amplitude"])
        cosines = [
            (peak * share, 2.0 * PI * float(k) / lines.repeat, phase)
            for share, k, phase in zip(lines.share, lines.cycles, lines.phase, strict=True)
        ]
    elif file.loop == "torque":
        constant = session.rig.servo.torque_constant_n_m_per_a
        torque = given.get("torque_amplitude", given.get("current_amplitude", 0.0) * constant)
        cosines = [(torque, 2.0 * PI / given["period"], -0.5 * PI)]
    else:
        cosines = [(math.radians(given["amplitude"]), 2.0 * PI / given["period"], 0.0)]
    equal = math.sqrt(sum(a * a for a, _, _ in cosines))  # amplitude of the sine of equal rms
    gain, advance = 1.0 + ahead.more / equal, ahead.advance + session.constants.lag
    return tuple(Component(a, w, phase, gain, advance) for a, w, phase in cosines)


def _table(
    rows: tuple[SessionRow, ...], pieces: list[PlanSegment[BenchSetting]], rate: float
) -> SessionPlan:
    segments, kept, table = cut_into_ticks(pieces, rate)

    def seconds(phase: Phase) -> float:
        return sum(n for n, p in zip(segments.ticks, kept, strict=True) if p.phase is phase) / rate

    setpoints = Setpoints(
        tuple(one.components for one in table),
        tuple(one.damping for one in table),
        tuple(one.brake_current for one in table),
        tuple(one.rise for one in table),
        tuple(one.until for one in table),
        tuple(one.flume for one in table),
    )
    phases = SessionPhases(
        seconds(Phase.TARE),
        seconds(Phase.MOVING),
        seconds(Phase.SETTLE),
        seconds(Phase.MEASURE),
        seconds(Phase.TAIL),
    )
    duration = sum(segments.ticks) / rate
    return SessionPlan(rows, segments, setpoints, 1.0 / rate, duration, phases)
