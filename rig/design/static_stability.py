"""Static stability of a rig of several modes under the position gains of its axes.

The stiffness left for small motions about rest is

    K - sum over the axes of Ki f f^T,        f: position of the axis per position of each mode

because Ki > 0 acts as a negative spring. The rig has an equilibrium that it returns to only if
this matrix is positive definite. A single Ki may grow up to 1 / (f^T K^-1 f), the static stiffness
of the motion of its axis: K for a body alone, K k / (K + k) between a body of stiffness K and one
that hangs on a mooring k (springs in series).
"""

import numpy as np

from rig.spectra.periods import Floats

ROUNDING = 1.0e-9  # of the largest eigenvalue: below, a motion counts as free


def unstable_motion(stiffness: Floats) -> Floats | None:
    """Return the motion with the least stiffness, (modes,), if it is negative; None otherwise.

    A motion without any stiffness, as of a body without a mooring, drifts but does not run away.
    """
    values, vectors = np.linalg.eigh(stiffness)
    if values[0] >= -ROUNDING * np.abs(values).max():
        return None
    return vectors[:, 0]


def largest_gain(stiffness: Floats, factors: Floats) -> float | None:
    """Return the largest Ki (N/m or N*m/rad) of an axis for a stiffness without it, (modes, modes).

    None if no Ki of this axis alone makes the rig stable. ``factors``: f, (modes,).
    """
    values, vectors = np.linalg.eigh(stiffness)
    shares = vectors.T @ factors
    free = np.abs(values) <= ROUNDING * max(float(np.abs(values).max()), 1e-300)
    if (np.abs(shares[free]) > ROUNDING * np.abs(shares).max()).any():
        return 0.0 if (values[~free] > 0.0).all() else None
    compliance = float((shares[~free] ** 2 / values[~free]).sum())
    negative = int((values[~free] < 0.0).sum())
    # With one negative eigenvalue, Ki < 1 / compliance < 0 makes the determinant positive again.
    stable = compliance > 0.0 if negative == 0 else negative == 1 and compliance < 0.0
    return 1.0 / compliance if stable else None
