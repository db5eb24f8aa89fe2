"""Frequency responses with confidence bands, from periods and realisations. Pure.

Errors in variables: force and velocity are both measured, the reference r is known exactly. Every
channel is therefore first related to the reference, by least squares over the realisations m,

    z = sum_m mean_p(Z_mp) R_m* / sum_m |R_m|^2

and a response is a quotient of two of them, G = a/b: noise that is not periodic is averaged out of
both before they are divided, and feedback does no harm (Pintelon & Schoukens, System
Identification, 2nd ed., sections 2.6 and 7.2). Of one realisation this is (a/r)/(b/r); regression
on a measured input would be biased by the input's noise.

The error a - G b is complex normal, so |a - G b|^2 / s^2 is distributed as F(2, 2 nu): s^2 is its
variance, estimated with nu degrees of freedom. The 95 % band is a circle about G of radius
sqrt(F_0.95(2, 2 nu)) s / |b|. Two bands are told:

- noise: s^2 from the scatter of periods, nu = sum_m (P_m - 1) = M (P - 1);
- total: s^2 from the scatter of realisations, nu = M - 1, which holds what nonlinearity adds, as it
  depends on the phases (stochastic nonlinear distortion).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from rig.identification.periods import Complexes, Flags, Floats, Ticks

CONFIDENCE = 0.95


class Response(NamedTuple):
    """A frequency response, one entry a line; radii NaN where nothing tells them."""

    value: Complexes
    noise: Floats  # radius of the 95 % circle from periods
    total: Floats  # radius of the 95 % circle from realisations
    noise_deviation: Floats  # standard deviation of the value: noise alone
    total_deviation: Floats  # noise and nonlinear distortion

    @property
    def band(self) -> Floats:
        """The radius to draw: from periods where known, from realisations else."""
        return np.where(np.isfinite(self.noise), self.noise, self.total)

    def at(self, lines: Flags | Ticks) -> "Response":
        """The same at some of its lines."""
        value, *radii = (each[lines] for each in self)
        return Response(np.asarray(value, dtype=np.complex128), *map(np.real, radii))


class Channel(NamedTuple):
    """One channel of several realisations: each periods by lines."""

    realisations: tuple[Complexes, ...]

    def minus(self, other: "Channel") -> "Channel":
        """The difference of two channels."""
        pairs = zip(self.realisations, other.realisations, strict=True)
        return Channel(tuple(one - two for one, two in pairs))


def factor(degrees: float) -> float:
    """sqrt(F_0.95(2, 2 nu)): radius of the band in standard deviations; NaN without degrees."""
    return float(np.sqrt(stats.f.ppf(CONFIDENCE, 2, 2 * degrees))) if degrees >= 1 else np.nan


def related(channel: Channel, references: Sequence[Complexes]) -> Complexes:
    """The channel per unit of the reference, by line: least squares over the realisations."""
    top = sum(
        z.mean(axis=0) * r.conj() for z, r in zip(channel.realisations, references, strict=True)
    )
    return np.asarray(top / _power(references), dtype=np.complex128)


def response(above: Channel, below: Channel, references: Sequence[Complexes]) -> Response:
    """The response ``above``/``below`` of channels in one experiment, with its bands.

    Lines without reference are NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = related(above, references), related(below, references)
        value = a / b
        errors = [
            one - value * two
            for one, two in zip(above.realisations, below.realisations, strict=True)
        ]
        power, size = _power(references), np.abs(b)
        noise, degrees = _scatter_of_periods(errors, references, power)
        total, several = _scatter_of_realisations(errors, power)
        noise_deviation, total_deviation = np.sqrt(noise) / size, np.sqrt(total) / size
    return Response(
        value,
        factor(degrees) * noise_deviation,
        factor(several) * total_deviation,
        noise_deviation,
        total_deviation,
    )


def _power(references: Sequence[Complexes]) -> Floats:
    return np.asarray(sum(np.abs(r) ** 2 for r in references), dtype=np.float64)


def _scatter_of_periods(
    errors: list[Complexes], references: Sequence[Complexes], power: Floats
) -> tuple[Floats, int]:
    """Variance of a - G b by the scatter of periods, and its degrees of freedom."""
    degrees = sum(len(e) - 1 for e in errors)
    if degrees < 1:
        return np.full(power.shape, np.nan), 0
    scatter = sum(np.sum(np.abs(e - e.mean(axis=0)) ** 2, axis=0) for e in errors) / degrees
    weight = sum(np.abs(r) ** 2 / len(e) for e, r in zip(errors, references, strict=True))
    return np.asarray(scatter * weight / power**2, dtype=np.float64), degrees


def _scatter_of_realisations(errors: list[Complexes], power: Floats) -> tuple[Floats, int]:
    """Variance of a - G b by the scatter of realisations about the common response."""
    degrees = len(errors) - 1
    if degrees < 1:
        return np.full(power.shape, np.nan), 0
    scatter = sum(np.abs(e.mean(axis=0)) ** 2 for e in errors) / degrees
    return np.asarray(scatter / power, dtype=np.float64), degrees
