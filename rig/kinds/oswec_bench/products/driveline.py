"""The driveline session: deflection between motor and shaft, its trends, its correction.

The analysis follows chapter 2 of the OSWEC thesis. A corrected set point is rated by reference
minus shaft, compared with the uncorrected one of the same amplitude and damping; the drive's own
following error (reference minus motor) is listed separately.

Trends between set points and the position correction that follows from them are figures 2.4 and 2.5
and equation 2.6. The thesis relates the phase shift to the motor's velocity; a compliance delays by
torque per velocity, so the delay over rms torque is fitted, too.
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products import periods, torque_map
from rig.kinds.oswec_bench.products.deflection import (
    WINDOW,
    Motion,
    ShaftLag,
    pooled_percentile,
    shaft_lag,
)
from rig.kinds.oswec_bench.products.estimate import Floats, Line, fit_line
from rig.kinds.oswec_bench.products.points import SessionRun, SetpointData
from rig.kinds.oswec_bench.products.torque_map import TorqueMap


class Regressions(NamedTuple):
    """Lines through the means of the set points."""

    amplitude: Line  # amplitude difference, rad, over rms torque, N*m
    velocity_phase: Line  # phase shift, share of the period, over rms motor velocity, rad/s
    torque_phase: Line  # phase shift, share of the period, over rms torque, N*m


class Correction(NamedTuple):
    """Amplitude and advance: removed from a motor's sine to predict the shaft, or added to a
    command.
    """

    amplitude: float  # rad
    advance: float  # share of the period


def fit_regressions(points: list[ShaftLag]) -> Regressions:
    """Return the three trends over at least three set points; ValueError for fewer."""
    torque = [each.rms_torque for each in points]
    phase = [float(each.phase_shift.mean()) for each in points]
    amplitude = [float(each.amplitude_difference.mean()) for each in points]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points; regressions need at least 3")
    return Regressions(
        fit_line(torque, amplitude),
        fit_line([each.rms_velocity for each in points], phase),
        fit_line(torque, phase),
    )


def explained_variance(points: list[ShaftLag]) -> float:
    """Return R^2 of the phase shift over 1/v and T/v: the joint effect of gap and compliance.

    Each term is a deflection over a velocity. Velocity alone (Fig. 2.4) leaves out the torque,
    which differs fourfold between dampings at one velocity.
    """
    v = np.array([each.rms_velocity for each in points])
    torque = np.array([each.rms_torque for each in points])
    phase = np.array([float(each.phase_shift.mean()) for each in points])
    design = np.stack([1.0 / v, torque / v, np.ones(len(v))], axis=1)
    residual = phase - design @ np.linalg.lstsq(design, phase, rcond=None)[0]
    return 1.0 - float((residual * residual).sum() / ((phase - phase.mean()) ** 2).sum())


def predict_correction(
    regressions: Regressions, point: ShaftLag, *, delay_over_torque: bool = False
) -> Correction:
    """Return the correction of a set point by its rms velocity and torque.

    ``delay_over_torque`` uses the delay over torque instead of the thesis's phase over velocity.
    """
    advance = (
        regressions.torque_phase.at(point.rms_torque)
        if delay_over_torque
        else regressions.velocity_phase.at(point.rms_velocity)
    )
    return Correction(float(regressions.amplitude.at(point.rms_torque)), float(advance))


def correct_offline(motion: Motion, correction: Correction, amplitude: float) -> Floats:
    """Return the motor's motion corrected towards the shaft's, rad: equation 2.6 of the thesis.

    Theta = (1 - dA / A) FFT(theta_m) exp(-i omega phi), transformed back; ``amplitude`` A in rad.
    """
    spectrum = np.fft.rfft(motion.motor)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(motion.motor), motion.cut.dt)
    spectrum *= (1.0 - correction.amplitude / amplitude) * np.exp(
        -1j * omega * correction.advance * motion.cut.period
    )
    return np.fft.irfft(spectrum, len(motion.motor))


class DrivelineSetpoint(NamedTuple):
    """A set point with its results."""

    point: SetpointData
    motion: Motion
    lag: ShaftLag
    error: Floats  # rad, reference minus shaft, drift removed
    following_error: Floats  # rad, reference minus motor
    drift: float  # rad/s, of the motor
    drive_gain: float  # rad/s/V, motor's velocity over command, fundamentals
    drive_lag: float  # s, of the motor behind its command, without the age of the readings

    @property
    def setpoint(self) -> tuple[float, float]:
        """Requested amplitude (deg) and damping (N*m*s/rad)."""
        return (
            round(self.point.plan_value("amplitude_deg"), 3),
            round(self.point.plan_value("damping_n_m_s_per_rad"), 3),
        )


OfflineErrors = tuple[list[Floats], ...]
"""Errors after equation 2.6, corrected motor minus shaft, on uncorrected set points, rad.

One entry per set point, by regressions of all set points, by those without the rated set point, and
as before with the delay over torque.
"""


class CorrectionScheme(NamedTuple):
    """A correction in the loop, compared with the uncorrected set points."""

    name: str
    pairs: list[tuple[DrivelineSetpoint, DrivelineSetpoint]]  # corrected, uncorrected

    @property
    def errors(self) -> tuple[float, float]:
        """95th percentile of the error over all pairs, with and without correction, rad."""
        corrected, uncorrected = ([e.error for e in side] for side in zip(*self.pairs, strict=True))
        return pooled_percentile(corrected), pooled_percentile(uncorrected)


class DrivelineResult(NamedTuple):
    """All results of the session, in SI units."""

    uncorrected: list[DrivelineSetpoint]  # uncorrected
    corrected: list[DrivelineSetpoint]
    regressions: Regressions | None  # None with fewer than three uncorrected set points
    offline: OfflineErrors | None
    torque_map: TorqueMap | None
    schemes: list[CorrectionScheme]


def analyse_point(point: SetpointData) -> DrivelineSetpoint:
    """Return the results of one set point."""
    motion = point.motion()
    reference = periods.detrend(point.delayed_reference_angle, motion.cut)
    return DrivelineSetpoint(
        point,
        motion,
        shaft_lag(motion),
        reference - motion.shaft,
        reference - motion.motor,
        periods.drift(point.motor, motion.cut),
        *_drive_gain_and_lag(point, motion),
    )


def _drive_gain_and_lag(point: SetpointData, motion: Motion) -> tuple[float, float]:
    """Return gain and lag of the velocity loop under load; NaN if there was no command."""
    command = periods.fundamentals(motion.cut.trim(point.volts), motion.cut).mean()
    if not abs(command) > 1e-6:
        return float("nan"), float("nan")
    ratio = 1j * motion.cut.omega * periods.fundamentals(motion.motor, motion.cut).mean() / command
    return float(np.abs(ratio)), float(-np.angle(ratio) / motion.cut.omega) - point.encoder_age


def analyse_driveline(session: SessionRun, baseline: SessionRun | None = None) -> DrivelineResult:
    """Analyse a run; ``baseline`` supplies uncorrected set points that this run lacks."""
    points = [analyse_point(point) for point in session.complete_points]
    if session.irregular:
        points = [each._replace(lag=_lag_by_delay(each)) for each in points]
    uncorrected = [each for each in points if each.point.correction_name == "none"]
    corrected = [each for each in points if each.point.correction_name != "none"]
    baseline_points = [analyse_point(p) for p in baseline.complete_points] if baseline else []
    references = {
        each.setpoint: each
        for each in (*baseline_points, *uncorrected)
        if each.point.correction_name == "none"
    }
    pairs_by_name: dict[str, list[tuple[DrivelineSetpoint, DrivelineSetpoint]]] = {}
    for each in corrected:
        if each.setpoint in references:
            pairs = pairs_by_name.setdefault(each.point.correction_name, [])
            pairs.append((each, references[each.setpoint]))
    sinusoids = [] if session.irregular else [each.lag for each in uncorrected]
    trends = fit_regressions(sinusoids) if len(sinusoids) >= 3 else None
    binned = [torque_map.bin_deflection(each.motion) for each in uncorrected]
    binned = [each for each in binned if len(each.torque) >= 4]
    return DrivelineResult(
        uncorrected,
        corrected,
        trends,
        _offline_errors(uncorrected, trends),
        torque_map.fit_map(binned) if len(binned) >= 3 else None,
        [CorrectionScheme(name, pairs) for name, pairs in pairs_by_name.items()],
    )


def _lag_by_delay(point: DrivelineSetpoint) -> ShaftLag:
    """Return the lag of an irregular set point, with its delay as a share of the repeat period.

    An irregular motion has no single phase. s(t) = m(t - d) is m - d m' to first order, so d = sum
    (m - s) m' / sum m'^2.
    """
    motor, cut = point.motion.motor, point.motion.cut
    velocity = periods.velocity(motor, cut.dt, WINDOW)
    pieces = (periods.split_periods(each, cut) for each in (point.motion.deflection, velocity))
    delays = [float((d * v).sum() / (v * v).sum()) for d, v in zip(*pieces, strict=True)]
    return point.lag._replace(phase_shift=np.array(delays) / cut.period)


def _offline_errors(
    uncorrected: list[DrivelineSetpoint], trends: Regressions | None
) -> OfflineErrors | None:
    if trends is None or len(uncorrected) < 4:
        return None
    lags = [each.lag for each in uncorrected]
    left_out = [fit_regressions([*lags[:i], *lags[i + 1 :]]) for i in range(len(lags))]

    def errors(trends: list[Regressions], *, delay_over_torque: bool = False) -> list[Floats]:
        return [
            correct_offline(
                each.motion,
                predict_correction(fitted, each.lag, delay_over_torque=delay_over_torque),
                each.lag.amplitude,
            )
            - each.motion.shaft
            for each, fitted in zip(uncorrected, trends, strict=True)
        ]

    by_all = errors([trends] * len(lags))
    return by_all, errors(left_out), errors(left_out, delay_over_torque=True)
