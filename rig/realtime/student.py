"""Quantile of Student's distribution for the tick."""

NORMAL_QUANTILE = 2.5758  # one-sided 99.5 %


def quantile(freedom: int) -> float:
    """Return the one-sided 99.5 % quantile of Student's distribution, within 1 % from 3 on.

    ``freedom``: degrees of freedom. The expansion of Cornish and Fisher (Abramowitz and Stegun
    26.7.5).
    """
    z = NORMAL_QUANTILE
    s = z * z
    first = z * (s + 1.0) / 4.0
    second = z * ((5.0 * s + 16.0) * s + 3.0) / 96.0
    third = z * (((3.0 * s + 19.0) * s + 17.0) * s - 15.0) / 384.0
    fourth = z * ((((79.0 * s + 776.0) * s + 1482.0) * s - 1920.0) * s - 945.0) / 92160.0
    return z + (first + (second + (third + fourth / freedom) / freedom) / freedom) / freedom
