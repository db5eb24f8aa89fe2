"""The torque constant of a locked driveline: torque per current as it ramps up, by direction.

Section 3.1 of the OSWEC thesis: lines of measured torque over current command where the torque
grows, per oscillation and direction.

Gearbox friction hides the motor's own constant in these lines, but not in the hysteresis. At its
peak the torque T is constant while the current falls from I1, where friction F opposed the motor,
to I2, where friction opposes the back-off: K I1 = T + F and K I2 = T - F. The shaft has not moved
in between, so F is the same, whatever it depends on: K = 2 T / (I1 + I2).
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.estimate import (
    CELL_UNCERTAINTY,
    Estimate,
    Floats,
    mean,
    with_floor,
)
from rig.kinds.oswec_bench.products.periods import PeriodCut, rms
from rig.kinds.oswec_bench.products.quarters import FitDomain, fit_domain, split_quarters

RAMP = (0.10, 0.97)
"""Domain of a ramp fit: shares of a quarter's largest torque."""
BACK_OFF = (0.15, 0.85)
"""Domain of the back-off fit: without its plateau, where stiction holds the torque."""
PLATEAU_END = (0.70, 0.95)
"""Start of the back-off: its line is extrapolated back to the peak's torque."""
PLATEAU = 0.1
"""Share of the back-off in which stiction certainly holds the torque."""
UNIT = "N*m/A"


class RampFits(NamedTuple):
    """Fits of one set point."""

    ramp_up: list[FitDomain]  # torque grows
    back_off: list[FitDomain]  # torque falls
    motor_constants: Floats  # N*m/A, motor constant by half wave
    current_amplitude: float  # A
    rms_torque: float  # N*m
    hysteresis: float  # N*m, torque at half the current, falling less rising, mean

    def slopes(self, sign: int) -> Floats:
        """Return the constants of one direction (1: positive torque), N*m/A."""
        return np.array([d.line.slope for d in self.ramp_up if d.quarter.sign == sign])


def fit_ramps(current: Floats, torque: Floats, cut: PeriodCut) -> RampFits:
    """Return the fitted domains of a set point; signals are cut to their whole periods."""
    ramp_up: list[FitDomain] = []
    motor_constants = []
    back_off: list[FitDomain] = []
    half_current_torques = []
    for each in split_quarters(current, cut):
        low, high = RAMP if each.growing else BACK_OFF
        fitted_domain = fit_domain(each, current, torque, criterion=torque, low=low, high=high)
        if fitted_domain is not None and fitted_domain.line.slope > 0.0:
            (ramp_up if each.growing else back_off).append(fitted_domain)
        if not each.growing:
            low, high = PLATEAU_END
            release = fit_domain(each, current, torque, criterion=torque, low=low, high=high)
            if release is not None and release.line.slope > 0.0:
                motor_constants.append(_motor_constant(release, current, torque))
        distance = np.abs(np.abs(current[each.samples]) - 0.5 * np.abs(current).max())
        sign = -1.0 if each.growing else 1.0
        half_current_torques.append(
            sign * each.sign * torque[each.samples][int(np.argmin(distance))]
        )
    return RampFits(
        ramp_up,
        back_off,
        np.array(motor_constants),
        float(0.5 * np.ptp(current)),
        rms(torque),
        2.0 * float(np.mean(half_current_torques)) if half_current_torques else float("nan"),
    )


def _motor_constant(back_off: FitDomain, current: Floats, torque: Floats) -> float:
    """Return the motor's constant of one peak.

    The back-off line reaches the peak's torque at I2.
    """
    samples = back_off.quarter.samples
    plateau = slice(
        samples.start, samples.start + max(1, round(PLATEAU * (samples.stop - samples.start)))
    )
    peak = float(np.median(torque[plateau]))
    release_current = (peak - back_off.line.intercept) / back_off.line.slope
    return 2.0 * peak / (float(current[samples.start]) + release_current)


class TorqueConstants(NamedTuple):
    """Results of the session."""

    both: Estimate
    positive: Estimate
    negative: Estimate
    motor: Estimate
    spread_positive: float  # (largest - smallest) / mean of single ramps
    spread_negative: float
    smallest: float  # N*m/A, of all ramps
    largest: float


def torque_constants(points: list[RampFits]) -> TorqueConstants:
    """Return means over set points, each with the interval by the scatter between set points."""
    slopes_by_sign = {sign: [each.slopes(sign) for each in points] for sign in (1, -1)}
    method = f"lines of ramp-up, mean of {len(points)} set points, by their scatter"

    def mean_of_direction(sign: int) -> Estimate:
        return with_floor(
            mean([s.mean() for s in slopes_by_sign[sign] if len(s)], UNIT, method), CELL_UNCERTAINTY
        )

    def spread(sign: int) -> float:
        values = np.concatenate(slopes_by_sign[sign])
        return float(np.ptp(values) / values.mean())

    slopes_by_point = [
        np.concatenate(pair) for pair in zip(slopes_by_sign[1], slopes_by_sign[-1], strict=True)
    ]
    all_slopes = np.concatenate(slopes_by_point)
    motor_method = "at the peaks, where friction cancels; mean of "
    motor_method += f"{len(points)} set points, by their scatter"
    motor = mean(
        [each.motor_constants.mean() for each in points if len(each.motor_constants)],
        UNIT,
        motor_method,
    )
    return TorqueConstants(
        with_floor(
            mean([s.mean() for s in slopes_by_point if len(s)], UNIT, method), CELL_UNCERTAINTY
        ),
        mean_of_direction(1),
        mean_of_direction(-1),
        with_floor(motor, CELL_UNCERTAINTY),
        spread(1),
        spread(-1),
        float(all_slopes.min()),
        float(all_slopes.max()),
    )
