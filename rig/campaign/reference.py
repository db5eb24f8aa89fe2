"""The open-loop reference as the loop takes it: one repeat period of force, one value a tick."""

from fractions import Fraction

import numpy as np

from rig.campaign.multisine import design, scaled_to_peak, series
from rig.config.reference import MultisineReference, SineReference

LONGEST_S = 3600
"""Longest repeat period, s."""


def table(
    reference: SineReference | MultisineReference | None,
    newtons_per_ampere: float,
    rate_hz: int,
    seed: int,
) -> tuple[float, ...]:
    """Force on the body (N) over one repeat period; empty without a reference.

    ``seed`` is for a multisine that has none of its own. Raises ValueError where the signal does
    not repeat after a whole number of ticks, or its band holds no line.
    """
    if reference is None:
        return ()
    scale = reference.amplitude_a * newtons_per_ampere
    if isinstance(reference, SineReference):
        period = Fraction(reference.frequency_hz).limit_denominator(LONGEST_S)
        if abs(float(period) - reference.frequency_hz) > 1e-12:
            raise ValueError(
                f"a sine of {reference.frequency_hz!r} Hz repeats on no whole second up to "
                f"{LONGEST_S} s; the nearest that does is {period} = {float(period)!r} Hz"
            )
        phase = np.arange(period.denominator * rate_hz) * (float(period) / rate_hz)
        values = scale * np.sin(2.0 * np.pi * phase)
        return tuple(values.tolist())
    ticks = reference.repeat_s * rate_hz
    if abs(ticks - round(ticks)) > 1e-6:
        raise ValueError(f"repeats after {reference.repeat_s!r} s, no whole number of ticks")
    signal = design(
        reference.low_hz,
        reference.high_hz,
        reference.repeat_s,
        rms=1.0,
        exponent=-0.5 if reference.colour == "pink" else 0.0,
        seed=seed if reference.seed is None else reference.seed,
        realisation=reference.realisation,
        draws=reference.draws,
    )
    return tuple(series(scaled_to_peak(signal, scale), round(ticks)).tolist())
