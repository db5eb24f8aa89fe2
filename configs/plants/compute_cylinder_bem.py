"""Computes cylinder_bem.nc and two_body_bem.nc with capytaine; no part of the program.

cylinder: radius 1 m, draught 1 m; surge, heave and pitch about its centre of mass, 0.3 m below the
water. two_body: the same cylinder in heave above a submerged disc (radius 1.25 m, 0.3 m thick, its
top 2.5 m below the water), also in heave: a self-referenced point absorber. Infinite depth,
1000 kg/m3, 9.81 m/s2, waves from -x to +x, phases e^{-i omega t}.

    python -m venv bem && bem/bin/pip install 'capytaine>=2.3.1,<4' h5netcdf
    bem/bin/python configs/plants/compute_cylinder_bem.py configs/plants

It takes some minutes. The files are capytaine's own, with what the plant does not need left out.
"""

import sys
from pathlib import Path
from typing import Any

import capytaine as cpt
import numpy as np

RADIUS, DRAUGHT, MASS_DEPTH = 1.0, 1.0, 0.3  # m
DISC_RADIUS, DISC_TOP, DISC_HEIGHT = 1.25, 2.5, 0.3  # m
FREQUENCIES = np.linspace(0.025, 1.5, 60)  # Hz
KEPT = ("added_mass", "radiation_damping", "excitation_force", "hydrostatic_stiffness",
        "inertia_matrix")  # fmt: skip


def floating_cylinder(dofs: tuple[str, ...]) -> Any:
    """Give the floating cylinder with a lid, which removes irregular frequencies."""
    mesh = cpt.mesh_vertical_cylinder(
        length=2.0 * DRAUGHT, radius=RADIUS, center=(0, 0, 0), resolution=(10, 60, 24), name="float"
    ).immersed_part()
    lid = mesh.generate_lid(z=-0.02)
    centre = (0.0, 0.0, -MASS_DEPTH)
    return cpt.FloatingBody(
        mesh=mesh,
        lid_mesh=lid,
        dofs=cpt.rigid_body_dofs(only=dofs, rotation_center=centre),
        center_of_mass=centre,
        name="float",
    )


def disc() -> Any:
    """Give the submerged disc in heave."""
    middle = (0.0, 0.0, -DISC_TOP - 0.5 * DISC_HEIGHT)
    mesh = cpt.mesh_vertical_cylinder(
        length=DISC_HEIGHT, radius=DISC_RADIUS, center=middle, resolution=(12, 60, 4), name="disc"
    )
    return cpt.FloatingBody(
        mesh=mesh,
        dofs=cpt.rigid_body_dofs(only=("Heave",), rotation_center=middle),
        center_of_mass=middle,
        name="disc",
    )


def solve(body: Any) -> Any:
    """Give capytaine's dataset; the last frequency is infinite, for the added mass."""
    water = {"body": body, "rho": 1000.0, "g": 9.81, "water_depth": np.inf}
    omegas = 2.0 * np.pi * FREQUENCIES
    problems = [
        cpt.RadiationProblem(omega=omega, radiating_dof=dof, **water)
        for omega in (*omegas, np.inf)
        for dof in body.dofs
    ]
    problems += [cpt.DiffractionProblem(omega=w, wave_direction=0.0, **water) for w in omegas]
    results = cpt.BEMSolver().solve_all(problems, progress_bar=False)
    return cpt.assemble_dataset(results)


def save(path: Path, body: Any) -> None:
    """Write the dataset of a body to a file."""
    dataset = solve(body)
    left_out = [name for name in dataset.data_vars if name not in KEPT]
    cpt.export_dataset(path, dataset.drop_vars(left_out), format="netcdf")


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    cpt.set_logging("WARNING")
    save(folder / "cylinder_bem.nc", floating_cylinder(("Surge", "Heave", "Pitch")))
    save(folder / "two_body_bem.nc", floating_cylinder(("Heave",)) + disc())
