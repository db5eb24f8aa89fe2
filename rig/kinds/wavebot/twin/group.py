"""Groups of parameters estimated together: values and covariance."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rig.spectra.periods import Floats


class Group(NamedTuple):
    """Values by name with their covariance and source."""

    names: tuple[str, ...]
    values: tuple[float, ...]
    covariance: Floats  # names by names
    source: str

    @property
    def by_name(self) -> dict[str, float]:
        """Values by name."""
        return dict(zip(self.names, self.values, strict=True))

    def deviation(self, name: str) -> float:
        """Return the standard deviation of one value."""
        index = self.names.index(name)
        return float(np.sqrt(max(self.covariance[index, index], 0.0)))

    def directions(self) -> Iterator[dict[str, float]]:
        """Yield one standard deviation along each principal axis of the covariance, by name."""
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        variances, axes = np.linalg.eigh(self.covariance / np.outer(deviations, deviations))
        for variance, axis in zip(variances, axes.T, strict=True):
            step = np.sqrt(max(variance, 0.0)) * axis * deviations
            if np.any(np.abs(step) > 0.0):
                yield dict(zip(self.names, step.tolist(), strict=True))


def add_uncertainty(group: Group, name: str, deviation: float) -> Group:
    """Return the group with added uncertainty of one value (standard deviation, same unit)."""
    index = group.names.index(name)
    covariance = group.covariance.copy()
    covariance[index, index] += deviation * deviation
    return group._replace(covariance=covariance)


def least_squares(names: tuple[str, ...], columns: Floats, measured: Floats, source: str) -> Group:
    """Return the non-negative least-squares estimate of ``measured``.

    Raises ValueError if there are not more measurements than values.
    """
    count, parameter_count = columns.shape
    if count <= parameter_count:
        raise ValueError(f"{count} measurements are too few to estimate {', '.join(names)}")
    rms = np.sqrt(np.mean(columns * columns, axis=0))
    scale = np.where(rms > 0.0, rms, 1.0)
    values, _ = nnls(columns / scale, measured)
    residual = measured - (columns / scale) @ values
    variance = float(residual @ residual) / (count - parameter_count)
    inverse = np.linalg.pinv((columns / scale).T @ (columns / scale))
    covariance = variance * inverse / np.outer(scale, scale)
    return Group(names, tuple((values / scale).tolist()), covariance, source)
