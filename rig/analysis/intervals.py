"""Intervals of 95 % of mean powers: Student's for scatter alone, and of scatter with a budget."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CONFIDENCE = 0.95
_SHARE = 0.5 * (1.0 + CONFIDENCE)
_DRAWS = 20_000  # with which the half width scatters by 0.7 %
_SEED = 20_261_127  # fixed: equal errors have equal intervals


def half_width(error: float, dof: float) -> float:
    """Return the half width of Student's interval; NaN without a degree of freedom."""
    if not dof > 0.0:
        return float("nan")
    return _student_factor(dof) * error


def combined_half_width(
    error: float, dof: float, contributions: Floats, distributions: tuple[str, ...]
) -> float:
    """Return the half width of the interval of a sum of errors around zero; NaN where unknown.

    ``error`` and ``dof``: standard error of the scatter (Type A) and its degrees of freedom.
    ``contributions``: signed standard uncertainties of the sources of a budget (Type B), which have
    these distributions; without any, the interval is Student's.

    The distribution of a sum of a few rectangular errors is not normal, so its interval is found
    by propagation of distributions (JCGM 101:2008). That the scatter comes from few periods widens
    it by Student's factor for the effective degrees of freedom (Welch and Satterthwaite, GUM G.4);
    a draw of Student's distribution itself would cover 97 % in place of 95.
    """
    if not dof > 0.0 or not np.isfinite(error):
        return float("nan")
    if not len(contributions) or not np.any(contributions):
        return half_width(error, dof)
    sources, scatter = _draws(distributions)
    errors = np.abs(contributions @ sources + error * scatter)
    at = round(CONFIDENCE * _DRAWS)
    half = float(np.partition(errors, at)[at])
    if error == 0.0:
        return half
    variance = float(contributions @ contributions) + error * error
    freedom = dof * (variance / (error * error)) ** 2
    return half * _student_factor(freedom) / _student_factor(np.inf)


def _student_factor(dof: float) -> float:
    """Return the half width of Student's interval over the standard error."""
    from scipy.special import stdtrit  # noqa: PLC0415  (half a second, and a check needs none)

    return float(stdtrit(dof, _SHARE))


@lru_cache(maxsize=4)
def _draws(distributions: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Return draws of each source and of a normal scatter, of unit standard uncertainty."""
    random = np.random.default_rng(_SEED)

    def draw(distribution: str) -> Floats:
        if distribution == "rectangular":
            return random.uniform(-np.sqrt(3.0), np.sqrt(3.0), _DRAWS)
        if distribution == "triangular":
            return random.triangular(-np.sqrt(6.0), 0.0, np.sqrt(6.0), _DRAWS)
        return random.standard_normal(_DRAWS)

    return np.array([draw(each) for each in distributions]), draw("normal")
