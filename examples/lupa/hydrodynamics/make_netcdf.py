"""Write heave.nc, a BEM file in Capytaine's layout, from the table heave.csv.

The table was computed with Capytaine 3.0.0 from the published dimensions (see README.md). The
hydrostatic stiffness is that of the water planes: a ring of radius 0.5 m around a rod of 0.05 m,
and the rod. The added mass at infinite frequency is left out, and wec-rig derives it: 148.6 kg of
the float do not fit the rest of the table (Ogilvie's relation gives 153.6 kg, a run of WAMIT by
others 152.5 kg).
"""

import math
from pathlib import Path

import numpy as np
import xarray as xr

HERE = Path(__file__).parent
DENSITY, GRAVITY, DEPTH = 1000.0, 9.81, 2.7
FLOAT, ROD = 0.5, 0.05  # m, radii at the water line


def main() -> None:
    """Read the table, write the file."""
    table = np.genfromtxt(HERE / "heave.csv", delimiter=",", skip_header=2)
    finite = table[:-1]  # without infinity, see above
    modes = ["float__Heave", "spar__Heave"]
    matrix = ("omega", "influenced_dof", "radiating_dof")

    def symmetric(columns: np.ndarray) -> np.ndarray:
        first, cross, second = columns.T
        return np.array([[first, cross], [cross, second]]).transpose(2, 0, 1)

    force = finite[:, [7, 9]] + 1j * finite[:, [8, 10]]
    scale = DENSITY * GRAVITY * math.pi
    stiffness = np.diag([scale * (FLOAT**2 - ROD**2), scale * ROD**2])
    data = xr.Dataset(
        {
            "added_mass": (matrix, symmetric(finite[:, 1:4])),
            "radiation_damping": (matrix, symmetric(finite[:, 4:7])),
            "excitation_force": (
                ("complex", "omega", "wave_direction", "influenced_dof"),
                np.array([force.real, force.imag])[:, :, None, :],
            ),
            "hydrostatic_stiffness": (matrix[1:], stiffness),
            "rho": DENSITY,
            "g": GRAVITY,
            "water_depth": DEPTH,
        },
        coords={
            "omega": 2.0 * np.pi * finite[:, 0],
            "influenced_dof": modes,
            "radiating_dof": modes,
            "wave_direction": [0.0],
            "complex": ["re", "im"],
        },
    )
    data.to_netcdf(HERE / "heave.nc", engine="h5netcdf")


if __name__ == "__main__":
    main()
