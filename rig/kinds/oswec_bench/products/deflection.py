"""Lag of the shaft behind the motor at one set point: deflection, phase shift, amplitude
difference.

The quantities are those of figure 2.2 of the OSWEC thesis, from measured encoder angles at the
gearbox output (rad) and the load cell's torque (N*m).
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d

from rig.kinds.oswec_bench.products import periods
from rig.kinds.oswec_bench.products.estimate import Floats
from rig.kinds.oswec_bench.products.periods import PeriodCut

DEGREE = float(np.pi / 180.0)
WINDOW = 0.015  # s, of the moving-window differentiator
PERCENTILE = 95.0  # percentile that rates a deflection


class Motion(NamedTuple):
    """A set point, cut to its whole periods, with drift and mean of the angles removed."""

    cut: PeriodCut
    motor: Floats  # rad
    shaft: Floats  # rad
    torque: Floats  # N*m, positive as the motor's on the brake

    @property
    def deflection(self) -> Floats:
        """Motor minus shaft, rad."""
        return self.motor - self.shaft


class ShaftLag(NamedTuple):
    """The driveline's results at a set point; arrays are by period."""

    phase_shift: Floats  # delay of the shaft as a share of the period
    amplitude_difference: Floats  # rad, half stroke of the motor less that of the shaft
    amplitude: float  # rad, of the motor
    rms_velocity: float  # rad/s, of the motor
    rms_torque: float  # N*m
    deflection_mean: float  # rad, of the magnitude
    deflection_low: float  # rad, its 5th percentile
    deflection_high: float  # rad, its 95th


def trim_motion(motor: Floats, shaft: Floats, torque: Floats, cut: PeriodCut) -> Motion:
    """Return measured signals, (samples,), cut to whole periods and detrended."""
    return Motion(
        cut,
        periods.detrend(motor, cut),
        periods.detrend(shaft, cut),
        cut.trim(torque),
    )


def shaft_lag(motion: Motion) -> ShaftLag:
    """Return the lag: phase shift by the fundamentals, amplitude difference by the peaks, by
    period.
    """
    motor_fundamentals, shaft_fundamentals = (
        periods.fundamentals(each, motion.cut) for each in (motion.motor, motion.shaft)
    )
    strokes = [periods.half_strokes(each, motion.cut) for each in (motion.motor, motion.shaft)]
    magnitude = np.abs(motion.deflection)
    low, high = np.percentile(magnitude, [100.0 - PERCENTILE, PERCENTILE])
    velocity = periods.velocity(motion.motor, motion.cut.dt, WINDOW)
    return ShaftLag(
        np.angle(motor_fundamentals * np.conj(shaft_fundamentals)) / (2.0 * np.pi),
        strokes[0] - strokes[1],
        float(strokes[0].mean()),
        periods.rms(velocity),
        periods.rms(motion.torque),
        float(magnitude.mean()),
        float(low),
        float(high),
    )


def error_percentile(error: Floats) -> float:
    """Return the 95th percentile of the magnitude of a position error, rad."""
    return float(np.percentile(np.abs(error), PERCENTILE))


def pooled_percentile(errors: list[Floats]) -> float:
    """Return the 95th percentile over all samples of several set points, rad."""
    return error_percentile(np.concatenate(errors))


def engaged(motion: Motion) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return a mask of the samples at which the teeth are in contact and the shaft moves against
    its load.

    After a reversal the shaft rests until the gap is crossed; meanwhile the load cell's torque is
    not the torque that the driveline transmits.
    """
    velocity = periods.velocity(motion.shaft, motion.cut.dt, WINDOW)
    moving = (np.abs(velocity) > 0.15 * np.abs(velocity).max()) & (velocity * motion.torque > 0.0)
    # The window responds to a start before it happens.
    window_samples = 2 * round(WINDOW / motion.cut.dt) + 1
    in_contact: np.ndarray[tuple[int], np.dtype[np.bool_]] = minimum_filter1d(
        moving, window_samples
    )
    return in_contact
