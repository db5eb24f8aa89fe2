"""Plants of one to four coupled modes, and BEM files in every format, for these tests."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr
from scipy.io import netcdf_file

from rig.kinds.modular.rehearsal.compiled_plant import CompiledStepper
from sim_plant.modes.bem import BemModes, read_modes
from sim_plant.modes.bem_content import Floats
from sim_plant.modes.building import PlantModel, assemble, build
from sim_plant.modes.parameters import Plant
from sim_plant.modes.world import Stepper, World
from sim_plant.sea_states import Sea

DT = 0.001
ROOT = Path(__file__).resolve().parents[2]
PLANTS = ROOT / "configs" / "plants"
CYLINDER, TWO_BODY, WAVEBOT = (
    PLANTS / f"{name}_bem.nc" for name in ("cylinder", "two_body", "wavebot")
)
HERE = Path(__file__).resolve().parent
NUMERIC = HERE / "cylinder.1"  # and .3, by capytaine 3.0
HEMISPHERE = HERE / "hemisphere" / "hemisphere.nc"  # beside it those of WAMIT and Nemoh

DRIVE: dict[str, Any] = {"current_bandwidth_hz": 200.0, "current_limit_a": 1000.0}
AXIS: dict[str, Any] = {
    "torque_constant_n_m_per_a": 1.5,
    "gear_ratio": 12.0,
    "counts_per_revolution": 1_048_576,
    "drive": DRIVE,
}
HEAVE: dict[str, Any] = {"dof": "Heave", "mass": 3136.0}
SURGE: dict[str, Any] = {"dof": "Surge", "mass": 3136.0, "stiffness": 9000.0}
PITCH: dict[str, Any] = {"dof": "Pitch", "mass": 1000.0}
OIL: dict[str, Any] = {  # a cylinder of 5 cm2, a motor of 13 cm3 a revolution
    "area_m2": 0.0005,
    "displacement_m3_per_rad": 2.0e-6,
    "precharge_pa": 2.0e6,
    "start_pressure_pa": 2.5e6,
    "volume_m3": 0.0004,
    "leakage_m3_per_s_pa": 1.0e-13,
    "inertia_kg_m2": 0.002,
    "viscous_n_m_s_per_rad": 0.001,
    "valve_velocity_m_per_s": 0.02,
}
BUS: dict[str, Any] = {
    "capacitance_f": 0.02,
    "voltage_v": 60.0,
    "supply_v": 58.0,
    "supply_resistance_ohm": 0.5,
    "dump_ohm": 5.0,
    "dump_on_v": 64.0,
    "dump_off_v": 62.0,
    "undervoltage_v": 40.0,
    "brownout_v": 30.0,
    "overvoltage_v": 120.0,
}


def mapping(
    modes: dict[str, Any], axes: dict[str, Any] | None = None, **values: Any
) -> dict[str, Any]:
    """Return the mapping of a plant file; `axes` gives what an axis has besides `AXIS`."""
    axes = axes or {next(iter(modes)): {"moves_with": {next(iter(modes)): 1.0}}}
    return {
        "name": "test",
        "bem": CYLINDER.name,
        "modes": modes,
        "axes": {name: {**AXIS, **axis} for name, axis in axes.items()},
        "wave_onset_s": 0.0,
        **values,
    }


def model(given: dict[str, Any], path: Path = CYLINDER) -> PlantModel:
    return build(Plant.model_validate(given), path)


def world(
    plant: PlantModel, sea: Sea, *, stepper: type[Stepper] = CompiledStepper, dt: float = DT
) -> World:
    return World(plant, sea, dt=dt, seed=1, stepper=stepper)


@functools.cache
def cylinder(*modes: str) -> BemModes:
    return read_modes(CYLINDER, modes or None)


def four_modes() -> BemModes:
    """Return two coupled copies of the two bodies: a Kronecker product of passive matrices."""
    pair = read_modes(TWO_BODY)
    weights = np.array([[1.0, 0.4], [0.4, 1.0]])

    def spread(values: Floats) -> Floats:
        return np.array([np.kron(weights, each) for each in values])

    return pair._replace(
        modes=("a", "b", "c", "d"),
        added_mass=spread(pair.added_mass),
        damping=spread(pair.damping),
        excitation=np.hstack([pair.excitation, 0.5j * pair.excitation]),
        added_mass_infinite=np.kron(weights, pair.added_mass_infinite),
        stiffness=None,
    )


def four_mode_model() -> PlantModel:
    modes = {
        name: {"dof": name, "mass": 3000.0, "stiffness": stiffness, "linear_damping": 300.0}
        for name, stiffness in zip("abcd", (30762.0, 9000.0, 25000.0, 12000.0), strict=True)
    }
    axes = {
        "one": {"moves_with": {"a": 1.0, "b": -1.0}, "viscous_friction": 1500.0, "inertia": 100.0},
        "two": {"moves_with": {"c": 1.0, "d": -0.5}, "viscous_friction": 900.0},
    }
    return assemble(Plant.model_validate(mapping(modes, axes)), four_modes())


def write_out(path: Path, bem: BemModes, numbers: list[int], **lines: str) -> Path:
    """Write WAMIT's formatted output (L = 1 m) of modes by number; `lines` replaces some."""
    assert bem.stiffness is not None
    text = [
        lines.get("gravity", f" Gravity:  {bem.gravity:.5f}         Length scale:        1.00000"),
        lines.get("depth", " Water depth:        infinite"),
        " XBODY =    0.0000 YBODY =    0.0000 ZBODY =   0.0000 PHIBODY =   0.0",
        " Hydrostatic and gravitational restoring coefficients:",
    ]  # fmt: skip
    scale = bem.density * bem.gravity
    full = np.zeros((7, 7))
    full[np.ix_(numbers, numbers)] = bem.stiffness / scale
    text += [
        f" C(3,3),C(3,4),C(3,5):   {full[3, 3]:.6E} {full[3, 4]:.6E} {full[3, 5]:.6E}",
        f" C(4,4),C(4,5),C(4,6):   {full[4, 4]:.6E} {full[4, 5]:.6E} {full[4, 6]:.6E}",
        f"        C(5,5),C(5,6):   {full[5, 5]:.6E} {full[5, 6]:.6E}",
    ]
    stars = " " + "*" * 72
    text += [stars, " Wave period = zero                                 Wavenumber = infinite", ""]
    text += ["    ADDED-MASS COEFFICIENTS", "     I     J         A(I,J)", ""]
    for i, j in np.ndindex(len(numbers), len(numbers)):
        value = bem.added_mass_infinite[i, j] / bem.density
        text.append(f"{numbers[i]:6d}{numbers[j]:6d}   {value:.9E}")
    for k in range(bem.frequency.size)[::-1]:  # WAMIT's order is that of its input
        omega = 2.0 * np.pi * bem.frequency[k]
        text += ["", stars, ""]
        text.append(
            f" Wave period (sec) =  {1.0 / bem.frequency[k]:.9E}        Wavenumber (kL) =  1.0"
        )
        text += ["", "    ADDED-MASS AND DAMPING COEFFICIENTS", "     I     J         A(I,J)"]
        for i, j in np.ndindex(len(numbers), len(numbers)):
            mass = bem.added_mass[k, i, j] / bem.density
            damping = bem.damping[k, i, j] / (bem.density * omega)
            text.append(f"{numbers[i]:6d}{numbers[j]:6d}   {mass:.9E}   {damping:.9E}")
        text += ["", lines.get("force", "    DIFFRACTION EXCITING FORCES AND MOMENTS"), ""]
        text += ["  Wave Heading (deg) :      0", "", "     I     Mod[Xh(I)]     Pha[Xh(I)]", ""]
        for i, number in enumerate(numbers):
            force = np.conj(bem.excitation[k, i]) / scale
            phase = np.degrees(np.angle(force))
            text.append(f"{number:6d}   {abs(force):.9E}   {phase:12.6f}")
    path.write_text("\n".join(text) + "\n")
    return path


def write_bemio(path: Path, bem: BemModes) -> Path:
    """Write a BEMIO file of a body with modes 1 to n, normalised as WEC-Sim does."""
    rho, g = bem.density, bem.gravity
    omega = 2.0 * np.pi * bem.frequency
    force = np.conj(bem.excitation).T[:, None, :] / (rho * g)
    assert bem.stiffness is not None
    fields = {
        "simulation_parameters/scaled": 0.0,
        "simulation_parameters/g": g,
        "simulation_parameters/rho": rho,
        "simulation_parameters/w": omega[:, None],
        "simulation_parameters/wave_dir": np.zeros((1, 1)),
        "body1/properties/disp_vol": 1.0,
        "body1/hydro_coeffs/added_mass/all": np.moveaxis(bem.added_mass, 0, 2) / rho,
        "body1/hydro_coeffs/added_mass/inf_freq": bem.added_mass_infinite / rho,
        "body1/hydro_coeffs/radiation_damping/all": np.moveaxis(bem.damping, 0, 2) / (rho * omega),
        "body1/hydro_coeffs/excitation/re": force.real,
        "body1/hydro_coeffs/excitation/im": force.imag,
        "body1/hydro_coeffs/linear_restoring_stiffness": bem.stiffness / (rho * g),
    }
    with h5py.File(path, "w") as file:
        for name, value in fields.items():
            file[name] = value
        file["simulation_parameters/water_depth"] = "infinite"
    return path


def dataset(path: Path = CYLINDER) -> xr.Dataset:
    """Return a Capytaine file, to change and write it."""
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        return opened.load()


def saved(path: Path, changed: xr.Dataset) -> Path:
    changed.to_netcdf(path, engine="h5netcdf")
    return path


def lupa(path: Path) -> Path:
    """Write the coefficients of LUPA in Capytaine's layout, as NetCDF-3; its own numbers.

    Float and spar in heave, both bodies in surge and pitch about z = -0.5027 m. Heave is that of
    `heave.csv`: the direct damping of the spar by the float does not converge.
    """
    names = ["float__Heave", "spar__Heave", "Surge", "Pitch"]
    table = np.genfromtxt(
        ROOT / "examples" / "lupa" / "hydrodynamics" / "heave.csv", delimiter=",", skip_header=2
    ).T
    with netcdf_file(HERE / "lupa" / "lupa_bem_4dof.nc", mmap=False) as file:
        omega, mass, damping, real, imaginary = (
            np.array(file.variables[name][...], np.float64)
            for name in (
                "omega",
                "added_mass",
                "radiation_damping",
                "excitation_re",
                "excitation_im",
            )
        )
    for matrix, (one, both, other) in ((mass, table[1:4]), (damping, table[4:7])):
        matrix[:, :2, :] = matrix[:, :, :2] = 0.0
        matrix[:, 0, 0], matrix[:, 1, 1] = one, other
        matrix[:, 0, 1] = matrix[:, 1, 0] = both
    force = np.full((2, omega.size, 1, 4), np.nan)
    force[:, :-1, 0] = real, imaginary
    force[:, :-1, 0, 0], force[:, :-1, 0, 1] = table[7:9, :-1], table[9:11, :-1]
    matrix_of = ("omega", "influenced_dof", "radiating_dof")
    fields = {
        "added_mass": (matrix_of, mass),
        "radiation_damping": (matrix_of, damping),
        "excitation_force": (("complex", "omega", "wave_direction", "influenced_dof"), force),
    }
    coordinates = {
        "omega": omega, "influenced_dof": names, "radiating_dof": names, "complex": ["re", "im"],
        "wave_direction": [0.0], "rho": 1000.0, "g": 9.81, "water_depth": 2.7,
    }  # fmt: skip
    xr.Dataset(fields, coordinates).to_netcdf(path, engine="scipy")
    return path
