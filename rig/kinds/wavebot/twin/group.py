"""Groups of parameters estimated together: values and covariance."""

from collections.abc import Iterator, Mapping
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

    def with_uncertainty(self, name: str, deviation: float) -> "Group":
        """Return the group with added uncertainty of one value (standard deviation, same unit)."""
        index = self.names.index(name)
        covariance = self.covariance.copy()
        covariance[index, index] += deviation * deviation
        return self._replace(covariance=covariance)

    def with_value(self, name: str, value: float, deviation: float) -> "Group":
        """Return the group with another, independent value."""
        count = len(self.names)
        covariance = np.zeros((count + 1, count + 1))
        covariance[:count, :count] = self.covariance
        covariance[count, count] = deviation * deviation
        return Group((*self.names, name), (*self.values, value), covariance, self.source)

    def without(self, name: str) -> "Group":
        """Return the group without one value."""
        kept = [i for i, other in enumerate(self.names) if other != name]
        names, values = zip(*((self.names[i], self.values[i]) for i in kept), strict=True)
        return Group(names, values, self.covariance[np.ix_(kept, kept)], self.source)


def single_value(name: str, value: float, deviation: float, source: str) -> Group:
    """Return a group of one value."""
    return Group((name,), (value,), np.array([[deviation * deviation]]), source)


def least_squares(regressors: Mapping[str, Floats], measured: Floats, source: str) -> Group:
    """Return the non-negative least-squares estimate of ``measured`` from its regressors by name.

    Raises ValueError if there are not more measurements than values.
    """
    names, columns = tuple(regressors), np.array(list(regressors.values())).T
    count, parameter_count = columns.shape
    if count <= parameter_count:
        raise ValueError(f"{count} measurements are too few to estimate {', '.join(names)}")
    rms = np.sqrt(np.mean(columns * columns, axis=0))
    scale = np.where(rms > 0.0, rms, 1.0)
    scaled = columns / scale
    values, _ = nnls(scaled, measured)
    residual = measured - scaled @ values
    variance = float(residual @ residual) / (count - parameter_count)
    covariance = variance * np.linalg.pinv(scaled.T @ scaled) / np.outer(scale, scale)
    return Group(names, tuple((values / scale).tolist()), covariance, source)
