"""Conversion of a plant file and its BEM file to the parameters of the step."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim_plant.modes import radiation, stored_radiation
from sim_plant.modes.bem import BemModes, read_modes
from sim_plant.modes.bem_content import Floats, Water
from sim_plant.modes.parameters import Axis, Plant
from sim_plant.modes.plant import ModesParams
from sim_plant.modes.radiation import Radiation

FAR = 1.0e30  # position of an end stop that is not there
MAX_STEP = 1.0  # of the fastest motion, in radians: the midpoint rule is unstable from 2 on


class PlantModel(NamedTuple):
    """A plant file with its hydrodynamics: what `World` simulates."""

    plant: Plant
    bem: BemModes
    radiation: Radiation
    params: ModesParams


def read_bem(plant: Plant, path: Path) -> BemModes:
    """Return the coefficients of the plant's modes from its BEM file at a path.

    Raises ValueError or OSError as `bem.read_modes`, and ValueError if a stiffness is missing.
    """
    water = Water(
        plant.density_kg_per_m3, plant.gravity_m_per_s2, plant.depth_m, plant.length_scale_m
    )
    dofs = [mode.dof for mode in plant.modes.values()]
    found = read_modes(path, dofs, direction=plant.wave_direction_deg, water=water)
    if found.stiffness is None:
        for name, mode in plant.modes.items():
            if mode.stiffness is None:
                raise ValueError(
                    f"{path}: has no hydrostatic stiffness; set modes.{name}.stiffness in the "
                    "plant file"
                )
    return found


def build(plant: Plant, path: Path, fitted: Path | None = None) -> PlantModel:
    """Return the model of a plant whose BEM file and stored radiation are at paths.

    Raises as `read_bem` and `stored_radiation.read`.
    """
    found = read_bem(plant, path)
    return assemble(plant, found, None if fitted is None else stored_radiation.read(fitted, found))


def assemble(plant: Plant, found: BemModes, memory: Radiation | None = None) -> PlantModel:
    """Return the model of a plant with the coefficients of its modes, in the plant's order."""
    memory = memory or radiation.fit(found)
    infinite = found.added_mass_infinite + memory.added_mass
    found = found._replace(added_mass_infinite=infinite)
    return PlantModel(plant, found, memory, _params(plant, found, memory))


def stiffness_matrix(plant: Plant, bem: BemModes) -> Floats:
    """Return the file's hydrostatic stiffness, its diagonal replaced where the plant states it."""
    count = len(plant.modes)
    matrix = np.zeros((count, count)) if bem.stiffness is None else bem.stiffness.copy()
    for k, mode in enumerate(plant.modes.values()):
        if mode.stiffness is not None:
            matrix[k, k] = mode.stiffness
    return matrix


def factor_matrix(plant: Plant) -> Floats:
    """Return the factors (axes, modes) between positions of modes and axes."""
    modes = list(plant.modes)
    matrix = np.zeros((len(plant.axes), len(modes)))
    for a, axis in enumerate(plant.axes.values()):
        for mode, factor in axis.moves_with.items():
            matrix[a, modes.index(mode)] = factor
    return matrix


def inertia_matrix(plant: Plant, bem: BemModes) -> Floats:
    """Return rigid mass plus A_inf plus the reflected inertia of the axes."""
    mass = np.diag([mode.mass for mode in plant.modes.values()])
    factors = factor_matrix(plant)
    reflected = np.diag([axis.inertia for axis in plant.axes.values()])
    total: Floats = mass + bem.added_mass_infinite + factors.T @ reflected @ factors
    smallest = float(np.linalg.eigvalsh(total).min())
    if not smallest > 0.0:
        raise ValueError(
            f"mass plus added mass is not positive (smallest eigenvalue {smallest:g}); check "
            "modes.*.mass and the BEM file's added mass at infinite frequency"
        )
    return total


def check_step(model: PlantModel, dt: float) -> None:
    """Raise ValueError if the fastest motion of the plant is too fast for a step of dt (s).

    End stops count as closed and Coulomb friction as its steepest slope.
    """
    plant, memory = model.plant, model.radiation
    count, states = len(plant.modes), len(memory.source)
    stops = [mode.end_stop for mode in plant.modes.values()]
    stiff = stiffness_matrix(plant, model.bem) + np.diag([s.stiffness if s else 0.0 for s in stops])
    factors = factor_matrix(plant)
    slopes = [
        axis.viscous_friction + axis.coulomb_friction / axis.coulomb_velocity
        for axis in plant.axes.values()
    ]
    losses = [m.linear_damping + (m.end_stop.damping if m.end_stop else 0.0)
              for m in plant.modes.values()]  # fmt: skip
    damping = np.diag(losses) + factors.T @ np.diag(slopes) @ factors
    inverse = np.linalg.inv(inertia_matrix(plant, model.bem))
    system = np.zeros((2 * count + states,) * 2)
    system[:count, count : 2 * count] = np.eye(count)
    system[count : 2 * count] = -inverse @ np.hstack([stiff, damping, memory.output])
    for k in range(states):
        row = 2 * count + k
        system[row, row] += memory.diagonal[k]
        system[row, 2 * count + memory.partner[k]] += memory.cross[k]
        system[row, count + memory.source[k]] += memory.input[k]
    fastest = float(np.abs(np.linalg.eigvals(system)).max())
    if fastest * dt > MAX_STEP:
        raise ValueError(
            f"the fastest motion of the plant, {fastest:.0f} rad/s, needs a tick of at most "
            f"{MAX_STEP / fastest:.2g} s, not {dt:g} s; soften end stops, lower coulomb_friction, "
            "or raise coulomb_velocity or rate_hz"
        )


def _params(plant: Plant, bem: BemModes, memory: Radiation) -> ModesParams:
    modes, sensors = plant.modes.values(), plant.sensors.values()
    stops = [mode.end_stop for mode in modes]
    signals = plant.signals()
    channels = [(*signals[s.signal], s.scale, s.offset, s.noise) for s in sensors]
    return ModesParams(
        len(modes),
        len(plant.axes),
        len(memory.source),
        _flat(np.linalg.inv(inertia_matrix(plant, bem))),
        _flat(stiffness_matrix(plant, bem)),
        [float(mode.linear_damping) for mode in modes],
        [float(mode.quadratic_damping) for mode in modes],
        [float(stop.position) if stop else FAR for stop in stops],
        [float(stop.stiffness) if stop else 0.0 for stop in stops],
        [float(stop.damping) if stop else 0.0 for stop in stops],
        list(memory.source),
        list(memory.partner),
        _flat(memory.diagonal),
        _flat(memory.cross),
        _flat(memory.input),
        _flat(memory.output),
        _flat(factor_matrix(plant)),
        [number for axis in plant.axes.values() for number in _axis_params(axis)],
        [float(number) for channel in channels for number in channel],
        len(channels),
    )


def _axis_params(axis: Axis) -> list[float]:
    """Return the numbers of `plant.AXIS_PARAMS` for one axis of the file."""
    drive = axis.drive
    return [
        float(drive.current_limit_a),
        1.0 / (2.0 * math.pi * drive.current_bandwidth_hz),
        float(drive.enable_delay_s),
        float(drive.watchdog_s),
        float(axis.torque_constant_n_m_per_a * axis.gear_ratio),
        float(drive.resistance_ohm),
        float(drive.standby_w),
        float(drive.regeneration_efficiency),
        float(axis.inertia),
        float(axis.viscous_friction),
        float(axis.coulomb_friction),
        float(axis.coulomb_velocity),
        axis.gear_ratio / (2.0 * math.pi) * axis.counts_per_revolution,
        float(axis.count_offset),
        float(drive.current_noise_a),
    ]


def _flat(values: Any) -> list[float]:
    numbers: list[float] = np.asarray(values, np.float64).ravel().tolist()
    return numbers
