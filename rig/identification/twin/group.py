"""Parameters that were estimated together: values, and how surely."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rig.identification.periods import Floats


class Group(NamedTuple):
    """Values by name with their covariance, and where they come from."""

    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Floats  # names by names
    source: str

    @property
    def known(self) -> dict[str, float]:
        """Value by name."""
        return dict(zip(self.names, self.values, strict=True))

    def deviation(self, name: str) -> float:
        """Standard deviation of one of the values."""
        at = self.names.index(name)
        return float(np.sqrt(max(self.covariance[at, at], 0.0)))

    def directions(self) -> Iterator[dict[str, float]]:
        """One standard deviation along each principal axis of the covariance, by name."""
        size = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        within, axes = np.linalg.eigh(self.covariance / np.outer(size, size))
        for variance, axis in zip(within, axes.T, strict=True):
            step = np.sqrt(max(variance, 0.0)) * axis * size
            if np.any(np.abs(step) > 0.0):
                yield dict(zip(self.names, step.tolist(), strict=True))


def allowance(group: Group, name: str, deviation: float) -> Group:
    """The group with more doubt about one value (standard deviation, of the value's unit)."""
    at = group.names.index(name)
    wider = group.covariance.copy()
    wider[at, at] += deviation * deviation
    return group._replace(covariance=wider)


def least_squares(names: tuple[str, ...], columns: Floats, measured: Floats, source: str) -> Group:
    """The values, none of them negative, that explain ``measured`` best.

    Raises ValueError where there is less to explain than there are values.
    """
    count, free = columns.shape
    if count <= free:
        raise ValueError(f"{count} measurements cannot tell {', '.join(names)}")
    size = np.sqrt(np.mean(columns * columns, axis=0))
    scale = np.where(size > 0.0, size, 1.0)
    values, _ = nnls(columns / scale, measured)
    left = measured - (columns / scale) @ values
    variance = float(left @ left) / (count - free)
    inverse = np.linalg.pinv((columns / scale).T @ (columns / scale))
    covariance = variance * inverse / np.outer(scale, scale)
    return Group(names, tuple((values / scale).tolist()), covariance, source)
