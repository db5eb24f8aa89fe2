"""Computes wavebot_surge_bem.npz with capytaine, and what tests compare; no part of the program.

The WaveBot hull: a cylinder of 0.88 m radius (0.17 m high, 0.01 m of it above water) on a cone to a
radius of 0.35 m over 0.37 m, closed by a disc; infinite depth, 1000 kg/m3, 9.81 m/s2. It is the
hull of wavebot_bem.npz (heave): draught 0.53 m, 0.8561 m3.

Phases are capytaine's: every quantity is Re(X e^{-i omega t}), waves come from -x and travel to +x.

    python -m venv bem && bem/bin/pip install 'capytaine>=2.3.1,<4'
    bem/bin/python configs/plants/compute_bem.py FOLDER

It takes half an hour. FOLDER gets wavebot_surge_bem.npz, which belongs here, and
capytaine_heave.npz (heave computed on the way and the wave it radiates), which belongs into
tests/sim_plant.
"""

import sys
from pathlib import Path
from typing import Any

import capytaine as cpt
import numpy as np
from capytaine.bem.airy_waves import froude_krylov_force

CYLINDER, BOTTOM, IMMERSED, CONE = 0.88, 0.35, 0.16, 0.37  # m
AROUND, CYLINDER_ROWS, CONE_ROWS, DISC_ROWS, LID_ROWS = 96, 10, 16, 8, 10
WATER = {"rho": 1000.0, "g": 9.81, "water_depth": np.inf}
FREQUENCIES = np.linspace(0.05, 2.0, 60)  # Hz, those of wavebot_bem.npz
RADII = np.array([2.0, 3.0, 4.0, 5.0, 8.0])  # m, where the radiated wave is kept
RADIATED = (5, 8, 11, 14, 18, 23, 29)  # of FREQUENCIES: 0.215 to 1.008 Hz
DOFS = ("Surge", "Heave")
STIFFNESS = {"Surge": 0.0, "Heave": WATER["rho"] * WATER["g"] * np.pi * CYLINDER**2}  # N/m


def revolved(profile: list[tuple[float, float]]) -> Any:
    """Give the mesh of a profile of (radius, z) turned about the z axis, normals into the water.

    Radii are widened so that the polygon has the area of the circle: the volume is the hull's.
    """
    turn = 2.0 * np.pi / AROUND
    wider = np.sqrt(turn / np.sin(turn))
    points = [
        (wider * r * np.cos(turn * j), wider * r * np.sin(turn * j), z)
        for r, z in profile
        for j in range(AROUND)
    ]
    panels = []
    for above in range(0, (len(profile) - 1) * AROUND, AROUND):
        below = above + AROUND
        for j in range(AROUND):
            right = (j + 1) % AROUND
            panels.append([above + j, below + j, below + right, above + right])
    return cpt.Mesh(vertices=np.array(points), faces=np.array(panels))


def line(start: tuple[float, float], end: tuple[float, float], share: Any) -> list[Any]:
    """Give points from a start (share 0) towards an end (1, left out)."""
    along = np.asarray(share)[:, None]
    return [tuple(p) for p in (1.0 - along) * np.array(start) + along * np.array(end)]


def even(rows: int) -> Any:
    """Give shares of equal steps."""
    return np.arange(rows) / rows


def fine_ends(rows: int) -> Any:
    """Give shares that are dense at both ends: sharp edges govern the added mass of fast motion."""
    return 0.5 - 0.5 * np.cos(np.pi * even(rows))


def hull() -> Any:
    """Give the hull with surge and heave, and a lid that removes irregular frequencies."""
    foot = -IMMERSED - CONE
    profile = [
        *line((CYLINDER, 0.0), (CYLINDER, -IMMERSED), fine_ends(CYLINDER_ROWS)),
        *line((CYLINDER, -IMMERSED), (BOTTOM, foot), fine_ends(CONE_ROWS)),
        *line((BOTTOM, foot), (0.0, foot), 1.0 - np.cos(0.5 * np.pi * even(DISC_ROWS))),
        (0.0, foot),
    ]
    lid = [*line((CYLINDER, 0.0), (0.0, 0.0), even(LID_ROWS)), (0.0, 0.0)]
    body = cpt.FloatingBody(mesh=revolved(profile), lid_mesh=revolved(lid), name="WaveBot")
    for dof in DOFS:
        body.add_translation_dof(name=dof)
    return body


def solve(body: Any) -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """Give the coefficients of both degrees of freedom and the wave that heave radiates."""
    solver = cpt.BEMSolver()
    added, damping, force = ({dof: list[Any]() for dof in DOFS} for _ in range(3))
    wave = []
    points = np.column_stack([RADII, np.zeros(RADII.size)])
    for i, omega in enumerate(2.0 * np.pi * FREQUENCIES):
        held = solver.solve(
            cpt.DiffractionProblem(body=body, omega=omega, wave_direction=0.0, **WATER)
        )
        incident = froude_krylov_force(held.problem)
        for dof in DOFS:
            moved = solver.solve(
                cpt.RadiationProblem(body=body, omega=omega, radiating_dof=dof, **WATER),
                keep_details=True,
            )
            added[dof].append(moved.added_masses[dof])
            damping[dof].append(moved.radiation_dampings[dof])
            force[dof].append(held.forces[dof] + incident[dof])
        if i in RADIATED:
            # moved is heave; capytaine's motion is 1 m, a velocity of -i omega m/s
            wave.append(solver.compute_free_surface_elevation(points, moved) / (-1j * omega))
        print(f"{FREQUENCIES[i]:.3f} Hz", flush=True)
    found = {}
    for dof in DOFS:
        limit = cpt.RadiationProblem(body=body, omega=np.inf, radiating_dof=dof, **WATER)
        found[dof] = {
            "f_hz": FREQUENCIES,
            "A": np.array(added[dof]),
            "B": np.array(damping[dof]),
            "Fe_complex": np.array(force[dof]),
            "Ainf": np.array(solver.solve(limit).added_masses[dof]),
            "K_h": np.array(STIFFNESS[dof]),
            "rho": np.array(WATER["rho"]),
            "g": np.array(WATER["g"]),
            "depth": np.array(WATER["water_depth"]),
            "draught": np.array(IMMERSED + CONE),
            "panels": np.array(body.mesh.nb_faces),
            "capytaine": np.array(cpt.__version__),
        }
    radiated = {
        "radiated_f_hz": FREQUENCIES[list(RADIATED)],
        "radius": RADII,
        "elevation_per_velocity": np.array(wave),
    }
    return found, radiated


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    cpt.set_logging("WARNING")
    coefficients, radiated_wave = solve(hull())
    np.savez(folder / "wavebot_surge_bem.npz", **coefficients["Surge"])
    np.savez(folder / "capytaine_heave.npz", **coefficients["Heave"], **radiated_wave)
