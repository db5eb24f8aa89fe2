"""The driveline session: deflection between motor and shaft, its trends, its correction.

Chapter 2 of the OSWEC thesis. Corrected set points are judged by the reference less the shaft,
beside the uncorrected one of the same amplitude and damping; the drive's own following error
(reference less motor) stands apart.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session import periods, regressions, torque_map
from rig.analysis.session.deflection import WINDOW, Behind, Motion, behind, judged, pooled
from rig.analysis.session.estimate import Floats
from rig.analysis.session.points import Point, Session
from rig.analysis.session.regressions import Correction, Regressions
from rig.analysis.session.torque_map import TorqueMap

DEGREE = float(np.pi / 180.0)


class Driven(NamedTuple):
    """A set point with all that is judged of it."""

    point: Point
    motion: Motion
    behind: Behind
    error: Floats  # rad, reference less shaft, drift taken out
    following: Floats  # rad, reference less motor
    drift: float  # rad/s, of the motor
    gain: float  # rad/s/V, of the drive: motor's velocity over command, fundamentals
    lag: float  # s, of the drive: the motor behind its command, the age of the readings apart

    @property
    def place(self) -> tuple[float, float]:
        """Amplitude (deg) and damping (N*m*s/rad) asked for."""
        return (
            round(self.point.number("amplitude_deg"), 3),
            round(self.point.number("damping_n_m_s_per_rad"), 3),
        )


class Offline(NamedTuple):
    """Equation 2.6 on uncorrected set points, rad; one entry a set point."""

    by_all: list[Floats]  # corrected motor less shaft, regressions of all set points
    by_others: list[Floats]  # regressions without the judged one
    by_torque: list[Floats]  # the same, the delay over torque


class Scheme(NamedTuple):
    """A correction in the loop beside the uncorrected set points."""

    name: str
    pairs: list[tuple[Driven, Driven]]  # corrected, uncorrected

    @property
    def corrected(self) -> float:
        """95th percentile over all pairs, rad."""
        return pooled([one.error for one, _ in self.pairs])

    @property
    def uncorrected(self) -> float:
        """The same without correction, rad."""
        return pooled([other.error for _, other in self.pairs])


class Found(NamedTuple):
    """All that the session gives, in SI."""

    plain: list[Driven]  # uncorrected
    corrected: list[Driven]
    trends: Regressions | None  # None for fewer than three uncorrected set points
    offline: Offline | None
    known: TorqueMap | None
    schemes: list[Scheme]


def driven(point: Point) -> Driven:
    """One set point."""
    made = point.motion()
    wanted = periods.detrended(point.due_angle, made.of)
    return Driven(
        point,
        made,
        behind(made),
        wanted - made.shaft,
        wanted - made.motor,
        periods.drift(point.motor, made.of),
        *_drive(point, made),
    )


def _drive(point: Point, of: Motion) -> tuple[float, float]:
    """Gain and lag of the velocity loop under load; NaN where nothing was commanded."""
    command = periods.fundamentals(point.over(point.volts, of.of), of.of).mean()
    if not abs(command) > 1e-6:
        return float("nan"), float("nan")
    ratio = 1j * of.of.omega * periods.fundamentals(of.motor, of.of).mean() / command
    return float(np.abs(ratio)), float(-np.angle(ratio) / of.of.omega) - point.age


def find(session: Session, against: Session | None = None) -> Found:
    """Analyse a run; ``against`` holds the uncorrected set points where this run has none."""
    every = [driven(point) for point in session.whole]
    if session.irregular:
        every = [each._replace(behind=_by_delay(each)) for each in every]
    plain = [each for each in every if each.point.correction_name == "none"]
    others = [driven(p) for p in against.whole] if against else []
    base = {each.place: each for each in others if each.point.correction_name == "none"}
    base |= {each.place: each for each in plain}
    corrected = [each for each in every if each.point.correction_name != "none"]
    sinusoids = [] if session.irregular else plain
    trends = regressions.regress([e.behind for e in sinusoids]) if len(sinusoids) >= 3 else None
    loads = [torque_map.loaded(each.motion) for each in plain]
    loads = [each for each in loads if len(each.torque) >= 4]
    names = dict.fromkeys(each.point.correction_name for each in corrected)
    schemes = [
        Scheme(name, pairs)
        for name in names
        if (
            pairs := [
                (each, base[each.place])
                for each in corrected
                if each.point.correction_name == name and each.place in base
            ]
        )
    ]
    return Found(
        plain,
        corrected,
        trends,
        _offline(plain, trends),
        torque_map.fit(loads) if len(loads) >= 3 else None,
        schemes,
    )


def _by_delay(of: Driven) -> Behind:
    """An irregular set point has no one phase: its delay as a share of its repeat period.

    s(t) = m(t - d) is m - d m' to first order, so d = sum (m - s) m' / sum m'^2.
    """
    motor, cut = of.motion.motor, of.motion.of
    rate = periods.velocity(motor, cut.dt, WINDOW)
    bent = of.motion.deflection
    delays = [
        float((d * v).sum() / (v * v).sum())
        for d, v in zip(periods.pieces(bent, cut), periods.pieces(rate, cut), strict=True)
    ]
    return of.behind._replace(phase_shift=np.array(delays) / cut.period)


def _offline(plain: list[Driven], trends: Regressions | None) -> Offline | None:
    if trends is None or len(plain) < 4:
        return None
    points = [each.behind for each in plain]

    def error(i: int, by: Correction) -> Floats:
        of = plain[i].motion
        return regressions.offline(of, by, points[i].amplitude) - of.shaft

    others = [regressions.without(points, i) for i in range(len(points))]
    numbers = range(len(points))
    return Offline(
        [error(i, regressions.predicted(trends, points[i])) for i in numbers],
        [error(i, regressions.predicted(others[i], points[i])) for i in numbers],
        [error(i, regressions.predicted(others[i], points[i], by_torque=True)) for i in numbers],
    )


def highest(found: Found) -> float:
    """The largest 95th percentile of the deflection of any uncorrected set point, rad."""
    return max((judged(each.motion.deflection) for each in found.plain), default=float("nan"))
