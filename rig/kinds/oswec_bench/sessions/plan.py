"""Planning of a session: from its file to the table that the loop runs (rows, segments, set
points).

The plan is a tare (drive and brake off, the shaft at rest), then row after row: the shaft is homed
with the drive on (moving), the motion grows and settles for whole periods, whole periods are
measured, and the motion fades out (tail). The wave clock of each row starts with its motion.
"""

import math
from itertools import accumulate, chain
from typing import NamedTuple

import numpy as np

from controllers.oswec_position import PI, Components, EnvelopeTimes
from rig.kinds.oswec_bench.config.session_file import (
    SESSION_COLUMNS,
    SESSION_KINDS,
    IrregularReference,
    SessionFile,
)
from rig.kinds.oswec_bench.sessions.correction import RowCorrection
from rig.kinds.oswec_bench.sessions.files import Session
from rig.kinds.oswec_bench.tick import manual
from rig.kinds.oswec_bench.tick.signals import Setpoints
from rig.planning.multisine import Multisine, design_multisine, scale_to_peak
from rig.planning.point import Point
from rig.planning.segments import PlanSegment, cut_into_ticks, phase_seconds
from rig.realtime.sequence import NO_ROW, WAIT_DRIVE, Phase, Segments


class SessionRow(NamedTuple):
    """One row of the plan: a row of the file, run once."""

    row: int  # from 0, in the order of the plan
    point: int  # from 0, in the order of the file
    repetition: int  # from 0
    values: dict[str, float]  # by key of the file
    periods: int  # number of measured periods
    measure: float  # s


class Flume(NamedTuple):
    """The flap's part of a set point; it takes the place of the brake's part."""

    sea: int  # index into the session's seas; -1: still water
    flap_held: int  # 1: a person holds the flap
    hold_angle: float  # rad, of the held flap
    pto_damping: float  # N*m*s/rad, of the motor acting as power take-off


NO_FLUME = Flume(-1, 0, 0.0, 0.0)
"""The flume part of a set point without a flap."""


class Setpoint(NamedTuple):
    """A set point of the plan, an entry of the tick's `Setpoints`."""

    components: Components  # of the reference: rad in the velocity loop, N*m in torque
    span: EnvelopeTimes  # rise from zero, and clock of the row at which the fade-out starts
    damping: float  # N*m*s/rad, R of the brake law T = R |v|
    brake_current: float  # A, added to the current of the brake law
    flume: Flume
    by_people: manual.SetPoint = manual.AT_REST  # in manual mode


class SessionPlan(NamedTuple):
    """A planned session, ready for `rig.realtime.sequence.step`."""

    rows: tuple[SessionRow, ...]
    segments: Segments
    setpoints: tuple[Setpoint, ...]
    dt: float  # s, length of a tick
    duration: float  # s, planned; waiting for the drive may extend it
    phases: dict[str, float]  # planned duration of each phase, s, by its name


NO_COMPONENTS = Components((), (), (), (), ())
"""The components of a set point at which the drive moves nothing."""

REST = Setpoint(NO_COMPONENTS, EnvelopeTimes(0.1, 0.0), 0.0, 0.0, NO_FLUME)
"""The set point at rest: no demand on motor and brake."""


def plan_session(session: Session) -> SessionPlan:
    """Return the plan of a session that passed all checks (`open_session`)."""
    file, rig = session.file, session.rig
    rows = []
    pieces = [PlanSegment(NO_ROW, Phase.TARE, file.tare_duration, REST, waves=0, drive=0)]
    for row_number, (repetition, index) in enumerate(_row_order(file, len(session.points))):
        point = session.points[index]
        period = _period(file, point)
        rise = file.timing.rise_s
        settle_periods = math.ceil(rise / period - 1e-9) + file.timing.settle_periods
        settle, measure = settle_periods * period, file.timing.periods * period
        setpoint = Setpoint(
            row_components(session, point, session.correction.rows[index]),
            EnvelopeTimes(rise, settle + measure),
            point.values.get("damping", 0.0),
            point.values.get("brake_current", 0.0),
            row_flume(file, point, index),
            manual.AT_REST._replace(speed=rig.homing.speed_rad_per_s),
        )
        # The flap is released when its measurement starts.
        released = setpoint._replace(flume=setpoint.flume._replace(flap_held=0))
        values = {c.key: point.values[c.name] for c in SESSION_COLUMNS if c.name in point.values}
        rows.append(SessionRow(row_number, index, repetition, values, file.timing.periods, measure))
        pieces += [
            PlanSegment(
                row_number, Phase.MOVING, rig.homing.duration_s, setpoint,
                wait=WAIT_DRIVE, timeout=rig.homing.duration_s + rig.drive_enable_timeout_s,
                waves=0,
            ),
            PlanSegment(row_number, Phase.SETTLE, settle, setpoint),
            PlanSegment(row_number, Phase.MEASURE, measure, released),
            PlanSegment(row_number, Phase.TAIL, rise, released),
        ]  # fmt: skip
    pieces.append(PlanSegment(NO_ROW, Phase.DONE, 0.0, REST, waves=0, drive=0))
    rate = float(rig.rate_hz)
    table = cut_into_ticks(pieces, rate)
    segments, _, setpoints = table
    seconds = phase_seconds(table, rate)
    timed = (Phase.TARE, Phase.MOVING, Phase.SETTLE, Phase.MEASURE, Phase.TAIL)
    phases = {phase.name.lower(): seconds[phase] for phase in timed}
    duration = sum(segments.ticks) / rate
    return SessionPlan(tuple(rows), segments, setpoints, 1.0 / rate, duration, phases)


def setpoint_table(setpoints: tuple[Setpoint, ...]) -> Setpoints:
    """Return the set points by columns, as the loop uses them."""
    components, spans, damping, brake_current, flumes, manual_set_points = zip(
        *setpoints, strict=True
    )
    length = tuple(len(each.amplitude) for each in components)
    rise, fade_start = zip(*spans, strict=True)
    sea, flap_held, hold_angle, pto_damping = zip(*flumes, strict=True)
    return Setpoints(
        Components(*(tuple(chain(*columns)) for columns in zip(*components, strict=True))),
        tuple(accumulate(length, initial=0))[:-1],
        length,
        rise,
        fade_start,
        damping,
        brake_current,
        sea,
        flap_held,
        hold_angle,
        pto_damping,
        manual.columns(manual_set_points),
    )


def _row_order(file: SessionFile, count: int) -> list[tuple[int, int]]:
    """Return repetition and point of every row, in the order of the plan."""
    rows = [(repetition, i) for repetition in range(file.repeat) for i in range(count)]
    if file.order == "random":
        order = np.random.default_rng(file.seed).permutation(len(rows))
        return [rows[i] for i in order]
    return rows


def _period(file: SessionFile, point: Point) -> float:
    return point.values["period"] if file.irregular is None else file.irregular.repeat_s


def row_components(session: Session, point: Point, row_correction: RowCorrection) -> Components:
    """Return the cosines of a row's reference, each with its share of the correction.

    Unit: rad in the velocity loop; N*m in the torque loop, where a sine starts at zero torque. The
    amplitude of an irregular reference is its largest magnitude.
    """
    file, values = session.file, point.values
    if "wave_amplitude" in values or "release" in values:
        return NO_COMPONENTS  # waves or a person move the flap, not the drive
    if file.irregular is not None:
        repeat, *lines = irregular_signal(file.irregular)
        peak = math.radians(values["amplitude"])
        cosines = [
            (peak * share, 2.0 * PI * float(k) / repeat, phase)
            for k, share, phase in zip(*(each.tolist() for each in lines), strict=True)
        ]
    elif file.loop == "torque":
        constant = session.rig.servo.torque_constant_n_m_per_a
        torque = values.get("torque_amplitude", values.get("current_amplitude", 0.0) * constant)
        cosines = [(torque, 2.0 * PI / values["period"], -0.5 * PI)]
    else:
        cosines = [(math.radians(values["amplitude"]), 2.0 * PI / values["period"], 0.0)]
    # Amplitude of a sine of equal rms.
    equivalent_amplitude = math.sqrt(sum(a * a for a, _, _ in cosines))
    gain = 1.0 + row_correction.extra_amplitude / equivalent_amplitude
    advance = row_correction.advance + session.constants.lag
    return Components(*zip(*((*cosine, gain, advance) for cosine in cosines), strict=True))


class Sea(NamedTuple):
    """A sea as the wave maker receives it: elevation at the flap's position, without the flap."""

    repeat_s: float
    cycles: tuple[int, ...]
    amplitude_m: tuple[float, ...]
    phase_rad: tuple[float, ...]  # at time zero of the wave clock


def irregular_signal(settings: IrregularReference) -> Multisine:
    """Return an irregular signal of unit peak."""
    multisine = design_multisine(
        settings.low_hz,
        settings.high_hz,
        settings.repeat_s,
        rms=1.0,
        seed=settings.seed,
        draws=settings.draws,
    )
    return scale_to_peak(multisine, 1.0)


def session_seas(file: SessionFile, points: tuple[Point, ...]) -> tuple[Sea, ...]:
    """Return one sea per point of the file; empty if the session makes no waves.

    A sea is one cosine, or an irregular sea with the given highest elevation.
    """
    if not SESSION_KINDS[file.session].needs_waves:
        return ()
    amplitudes = [point.values["wave_amplitude"] for point in points]
    if file.irregular is None:
        pairs = zip(points, amplitudes, strict=True)
        return tuple(Sea(p.values["period"], (1,), (a,), (0.0,)) for p, a in pairs)
    repeat, cycles, shares, phases = irregular_signal(file.irregular)
    lines, angles = tuple(cycles.tolist()), tuple(phases.tolist())
    return tuple(Sea(repeat, lines, tuple((a * shares).tolist()), angles) for a in amplitudes)


def row_flume(file: SessionFile, point: Point, index: int) -> Flume:
    """Return the requests of a row to flap and flume; ``index`` is that of its sea."""
    demand = SESSION_KINDS[file.session]
    if not demand.flap_coupling:
        return NO_FLUME
    return Flume(
        index if demand.needs_waves else -1,
        1 if "release" in point.values else 0,
        math.radians(point.values.get("release", 0.0)),
        point.values.get("pto_damping", 0.0),
    )
