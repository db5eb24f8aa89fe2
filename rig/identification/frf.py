"""Frequency responses with confidence bands, from periods and realisations.

The functions are pure. This is an errors-in-variables problem: force and velocity are both
measured, the reference r is known exactly. Every channel is therefore first related to the
reference, by least squares over the realisations m,

    z = sum_m mean_p(Z_mp) R_m* / sum_m |R_m|^2

and a response is the quotient of two of them, G = a/b. Averaging removes non-periodic noise from
both before the division, and feedback does no harm (Pintelon & Schoukens, System Identification,
2nd ed., sections 2.6 and 7.2). For one realisation this is (a/r)/(b/r). Regression on a measured
input would be biased by the input's noise.

The error a - G b is complex normal, so |a - G b|^2 / s^2 is distributed as F(2, 2 nu): s^2 is its
variance, estimated with nu degrees of freedom. The 95 % band is a circle about G of radius
sqrt(F_0.95(2, 2 nu)) s / |b|. There are two bands:

- noise: s^2 from the scatter of periods, nu = sum_m (P_m - 1) = M (P - 1);
- total: s^2 from the scatter of realisations, nu = M - 1. It includes the effect of nonlinearity,
  which depends on the phases (stochastic nonlinear distortion).

Neither contains an error that all periods share. There are two such radii:

- rounding: a periodic motion is rounded to the same counts in each period (`spectra.rounding`). It
  depends on the phases, so the scatter of realisations has it. Its variance s^2 is known, and the
  radius is sqrt(-ln 0.05) s / |b|. It adds to the noise as independent errors do;
- systematic: where two channels measure the same force, the distance of their two responses, as by
  a delay. The bands add it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtri

from rig.spectra.periods import Complexes, Flags, Floats, Ticks

CONFIDENCE = 0.95
_KNOWN_VARIANCE_FACTOR = math.sqrt(-math.log(1.0 - CONFIDENCE))  # `band_factor` of infinite nu


class Response(NamedTuple):
    """A frequency response, one entry per line; unknown radii are NaN."""

    value: Complexes
    noise: Floats  # radius of the 95 % circle from periods
    total: Floats  # radius of the 95 % circle from realisations
    noise_deviation: Floats  # standard deviation of the value, noise only
    total_deviation: Floats  # standard deviation from noise and nonlinear distortion
    systematic: Floats  # distance from the response by another channel of the same force
    rounding: Floats  # radius of the 95 % circle from rounding to counts, which all periods share

    @property
    def band(self) -> Floats:
        """The radius to draw: `band_radius` of its parts."""
        return band_radius(self.noise, self.total, self.systematic, self.rounding)

    def compared_with(self, other: "Response") -> "Response":
        """Return the response with its distance from another one as systematic radius."""
        return self._replace(systematic=np.abs(other.value - self.value))

    def select(self, lines: Flags | Ticks) -> "Response":
        """Return the response at some of its lines."""
        value, *radii = (part[lines] for part in self)
        return Response(np.asarray(value, dtype=np.complex128), *map(np.real, radii))


class Channel(NamedTuple):
    """One channel of several realisations, each an array of periods by lines."""

    realisations: tuple[Complexes, ...]
    rounding: tuple[Floats, ...] = ()
    """Standard deviation of each realisation's mean by rounding, by line; empty: none."""

    def minus(self, other: "Channel") -> "Channel":
        """Return the difference of two channels without rounding."""
        pairs = zip(self.realisations, other.realisations, strict=True)
        return Channel(tuple(own - others for own, others in pairs))


def band_factor(degrees: float) -> float:
    """Return sqrt(F_0.95(2, 2 nu)), the band's radius in standard deviations; NaN for nu < 1."""
    return float(np.sqrt(fdtri(2, 2 * degrees, CONFIDENCE))) if degrees >= 1 else np.nan


def band_radius(noise: Floats, total: Floats, systematic: Floats, rounding: Floats) -> Floats:
    """Return the radius from periods and rounding if known, else realisations, plus systematic."""
    random = np.where(np.isfinite(noise), np.sqrt(noise**2 + rounding**2), total)
    return np.asarray(random + systematic, dtype=np.float64)


def relate_to_reference(channel: Channel, references: Sequence[Complexes]) -> Complexes:
    """Return the channel per unit of the reference, by line, least squares over realisations."""
    numerator = sum(
        z.mean(axis=0) * r.conj() for z, r in zip(channel.realisations, references, strict=True)
    )
    return np.asarray(numerator / _power(references), dtype=np.complex128)


def response(numerator: Channel, denominator: Channel, references: Sequence[Complexes]) -> Response:
    """Return the response ``numerator``/``denominator`` of two channels, with its bands.

    Lines without reference are NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (
            relate_to_reference(numerator, references),
            relate_to_reference(denominator, references),
        )
        value = a / b
        errors = [
            num - value * den
            for num, den in zip(numerator.realisations, denominator.realisations, strict=True)
        ]
        power, magnitude = _power(references), np.abs(b)
        noise, degrees = _scatter_of_periods(errors, references, power)
        total, realisation_degrees = _scatter_of_realisations(errors, power)
        noise_deviation, total_deviation = np.sqrt(noise) / magnitude, np.sqrt(total) / magnitude
        rounding = np.sqrt(
            _rounding(numerator, references, power)
            + np.abs(value) ** 2 * _rounding(denominator, references, power)
        )
    return Response(
        value,
        band_factor(degrees) * noise_deviation,
        band_factor(realisation_degrees) * total_deviation,
        noise_deviation,
        total_deviation,
        np.zeros(value.shape),
        _KNOWN_VARIANCE_FACTOR * rounding / magnitude,
    )


def _power(references: Sequence[Complexes]) -> Floats:
    return np.asarray(sum(np.abs(r) ** 2 for r in references), dtype=np.float64)


def _rounding(channel: Channel, references: Sequence[Complexes], power: Floats) -> Floats:
    """Return the variance of `relate_to_reference` by rounding, by line."""
    total = np.zeros(power.shape)
    for deviation, r in zip(channel.rounding, references, strict=bool(channel.rounding)):
        total += (deviation * np.abs(r)) ** 2
    return np.asarray(total / power**2, dtype=np.float64)


def _scatter_of_periods(
    errors: list[Complexes], references: Sequence[Complexes], power: Floats
) -> tuple[Floats, int]:
    """Return the variance of a - G b by the scatter of periods, and its degrees of freedom."""
    degrees = sum(len(e) - 1 for e in errors)
    if degrees < 1:
        return np.full(power.shape, np.nan), 0
    scatter = sum(np.sum(np.abs(e - e.mean(axis=0)) ** 2, axis=0) for e in errors) / degrees
    weight = sum(np.abs(r) ** 2 / len(e) for e, r in zip(errors, references, strict=True))
    return np.asarray(scatter * weight / power**2, dtype=np.float64), degrees


def _scatter_of_realisations(errors: list[Complexes], power: Floats) -> tuple[Floats, int]:
    """Return the variance of a - G b by the scatter of realisations, and its degrees of freedom."""
    degrees = len(errors) - 1
    if degrees < 1:
        return np.full(power.shape, np.nan), 0
    scatter = sum(np.abs(e.mean(axis=0)) ** 2 for e in errors) / degrees
    return np.asarray(scatter / power, dtype=np.float64), degrees
