"""Computes the files of tests/modes/hemisphere with capytaine; no part of the program.

A floating hemisphere of radius 1 m, six modes about a point 0.3 m below the water, infinite depth,
1000 kg/m3, 9.81 m/s2, waves from -x to +x. Its panels are moved outwards so that they displace the
volume of the sphere, and the direct method is used: the indirect one needs 16 times the panels.
The same results go through capytaine's own writers of three formats: NetCDF, WAMIT (.1, .3, .hst)
and Nemoh (results, mesh); `Nemoh.cal` follows the manual of Nemoh 3.

    python -m venv bem && bem/bin/pip install 'capytaine>=3,<4' netCDF4
    bem/bin/python configs/plants/compute_hemisphere_bem.py tests/modes/hemisphere

It takes some minutes.
"""

import sys
from pathlib import Path
from typing import Any

import capytaine as cpt
import numpy as np

FREQUENCIES = np.linspace(0.3, 12.0, 40)  # rad/s
CENTRE = (0.0, 0.0, -0.3)  # m
RESOLUTION = (36, 48)
VOLUME = 2.0 / 3.0 * np.pi  # m3
WATER = {"rho": 1000.0, "g": 9.81}


def hemisphere() -> Any:
    """Give the body with a lid, which removes irregular frequencies."""
    plain = cpt.mesh_sphere(radius=1.0, resolution=RESOLUTION).immersed_part()
    radius = (VOLUME / plain.volume) ** (1.0 / 3.0)
    mesh = cpt.mesh_sphere(radius=radius, resolution=RESOLUTION, name="hull").immersed_part()
    body = cpt.FloatingBody(
        mesh=mesh,
        lid_mesh=mesh.generate_lid(z=-0.02),
        dofs=cpt.rigid_body_dofs(rotation_center=CENTRE),
        center_of_mass=CENTRE,
        name="hemisphere",
    )
    body.inertia_matrix = body.compute_rigid_body_inertia(rho=WATER["rho"])
    body.hydrostatic_stiffness = body.compute_hydrostatic_stiffness(**WATER)
    return body


def solve(body: Any) -> Any:
    """Give capytaine's dataset; the last frequency is infinite, for the added mass."""
    problems = [
        cpt.RadiationProblem(body=body, omega=omega, radiating_dof=dof, water_depth=np.inf, **WATER)
        for omega in (*FREQUENCIES, np.inf)
        for dof in body.dofs
    ]
    problems += [
        cpt.DiffractionProblem(body=body, omega=w, wave_direction=0.0, water_depth=np.inf, **WATER)
        for w in FREQUENCIES
    ]
    return cpt.assemble_dataset(
        cpt.BEMSolver(method="direct").solve_all(problems, progress_bar=False)
    )


def nemoh_cal(size: int) -> str:
    """Give the text of `Nemoh.cal`."""
    kinds = [(kind, *(float(k == axis) for k in range(3))) for kind in (1, 2) for axis in range(3)]
    motions = [
        f"{kind} {x} {y} {z} {'0. 0. 0.' if kind == 1 else '0. 0. -0.3'}" for kind, x, y, z in kinds
    ]
    first, last = FREQUENCIES[0], FREQUENCIES[-1]
    return "\n".join([
        "--- Environment ---", "1000.0 ! RHO ! KG/M**3", "9.81 ! G ! M/S**2",
        "0. ! DEPTH ! M ! Water depth", "0. 0. ! XEFF YEFF ! M ! Wave measurement point",
        "--- Description of floating bodies ---", "1 ! Number of bodies", "--- Body 1 ---",
        "hull.dat ! Name of mesh file", f"{4 * size} {size} ! Number of points and panels",
        "6 ! Number of degrees of freedom", *motions,
        "6 ! Number of resulting generalised forces", *motions,
        "0 ! Number of lines of additional information", "--- Load cases to be solved ---",
        f"1 {FREQUENCIES.size} {first} {last} ! Freq type 1,2,3=[rad/s,Hz,s], number, min, max",
        "1 0. 0. ! Number of wave directions, Min and Max (degrees)", "",
    ])  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    cpt.set_logging("WARNING")
    body = hemisphere()
    data = solve(body)
    (folder / "results").mkdir(parents=True, exist_ok=True)
    cpt.export_dataset(folder / "hemisphere.nc", data, format="netcdf")
    cpt.export_dataset(folder / "hemisphere", data, format="wamit", exports=("1", "3", "hst"))
    finite = data.isel(omega=np.isfinite(data.omega.values))
    cpt.export_dataset(folder / "results", finite, format="nemoh")
    cpt.io.legacy.export_hydrostatics(str(folder / "mesh"), body)
    (folder / "Nemoh.cal").write_text(nemoh_cal(body.mesh.nb_faces))
