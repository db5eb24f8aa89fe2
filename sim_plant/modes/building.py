"""Conversion of a plant file and its BEM file to the parameters of the step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim_plant.modes import axis_springs, radiation, stored_radiation
from sim_plant.modes import plant as step
from sim_plant.modes.bem import BemModes, read_modes
from sim_plant.modes.bem_content import Complexes, Floats, Water
from sim_plant.modes.parameters import Axis, Backlash, Bus, EndStop, Hydraulic, Line, Plant
from sim_plant.modes.plant import ModesParams, MotorParams
from sim_plant.modes.radiation import Radiation
from sim_plant.parts import bus, hydraulic
from sim_plant.parts.bus import BusParams
from sim_plant.parts.drive import DriveParams
from sim_plant.parts.end_stop import FAR, EndStopParams
from sim_plant.parts.friction import FrictionParams
from sim_plant.parts.hydraulic import HydraulicParams
from sim_plant.parts.mooring_line import LineParams

MAX_STEP = 1.0  # of the fastest motion, in radians: a decay is unstable from 2 on
MAX_GAIN = 0.02  # of energy, of an oscillation in half a period


class PlantModel(NamedTuple):
    """A plant file with its hydrodynamics: what `World` simulates."""

    plant: Plant
    bem: BemModes
    radiation: Radiation
    params: ModesParams


def read_bem(plant: Plant, path: Path) -> BemModes:
    """Return the coefficients of the plant's modes in water from its BEM file at a path.

    Raises ValueError or OSError as `bem.read_modes`, and ValueError if a stiffness is missing.
    """
    water = Water(
        plant.density_kg_per_m3, plant.gravity_m_per_s2, plant.depth_m, plant.length_scale_m
    )
    wet = {name: mode for name, mode in plant.modes.items() if mode.dof is not None}
    dofs = [str(mode.dof) for mode in wet.values()]
    found = read_modes(path, dofs, direction=plant.wave_direction_deg, water=water)
    if found.stiffness is None:
        for name, mode in wet.items():
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
    """Return the model of a plant with the coefficients of `read_bem` and their fit."""
    found, memory = _with_dry_modes(plant, found, memory or radiation.fit(found))
    infinite = found.added_mass_infinite + memory.added_mass
    found = found._replace(added_mass_infinite=infinite)
    return PlantModel(plant, found, memory, _params(plant, found, memory))


def _with_dry_modes(plant: Plant, bem: BemModes, memory: Radiation) -> tuple[BemModes, Radiation]:
    """Return coefficients and fit of all modes: zeros for those that are out of the water."""
    wet = [k for k, mode in enumerate(plant.modes.values()) if mode.dof is not None]
    count = len(plant.modes)
    if len(wet) == count:
        return bem, memory
    rows, columns = np.ix_(wet, wet)

    def matrix(values: Floats) -> Floats:
        full = np.zeros((*values.shape[:-2], count, count))
        full[..., rows, columns] = values
        return full

    excitation = np.zeros((bem.frequency.size, count), np.complex128)
    excitation[:, wet] = bem.excitation
    output = np.zeros((count, memory.output.shape[1]))
    output[wet] = memory.output
    volume = dict(zip(wet, bem.volume, strict=True))
    return bem._replace(
        modes=tuple(mode.dof or name for name, mode in plant.modes.items()),
        added_mass=matrix(bem.added_mass),
        damping=matrix(bem.damping),
        excitation=excitation,
        added_mass_infinite=matrix(bem.added_mass_infinite),
        stiffness=None if bem.stiffness is None else matrix(bem.stiffness),
        volume=tuple(volume.get(k) for k in range(count)),
        inertia=None if bem.inertia is None else matrix(bem.inertia),
    ), memory._replace(
        source=tuple(wet[k] for k in memory.source),
        output=output,
        error=matrix(memory.error),
        added_mass=matrix(memory.added_mass),
    )


def stiffness_matrix(plant: Plant, bem: BemModes) -> Floats:
    """Return hydrostatics plus linear mooring.

    Hydrostatics are the BEM file's, their diagonal replaced where the plant states it.
    """
    count = len(plant.modes)
    matrix = np.zeros((count, count)) if bem.stiffness is None else bem.stiffness.copy()
    for k, mode in enumerate(plant.modes.values()):
        if mode.stiffness is not None:
            matrix[k, k] = mode.stiffness
    names = list(plant.modes)
    given = {(names.index(one), names.index(other)): value
             for one, row in plant.mooring.stiffness.items()
             for other, value in row.items()}  # fmt: skip
    for (i, j), value in (given | {(j, i): value for (i, j), value in given.items()}).items():
        matrix[i, j] += value
    return matrix


def line_factors(plant: Plant) -> Floats:
    """Return the displacement of each line's fairlead by positions of the modes, (lines, 3, n)."""
    modes = list(plant.modes)
    factors = np.zeros((len(plant.mooring.lines), 3, len(modes)))
    for k, line in enumerate(plant.mooring.lines.values()):
        for mode, vector in line.moves_with.items():
            factors[k, :, modes.index(mode)] = vector
    return factors


def line_stiffness(plant: Plant) -> Floats:
    """Return the stiffness of the taut lines for small motions, (n, n)."""
    total = np.zeros((len(plant.modes),) * 2)
    for line, factors in zip(plant.mooring.lines.values(), line_factors(plant), strict=True):
        vector = _line_vector(line)
        length = float(np.linalg.norm(vector))
        along = np.outer(vector, vector) / length**2
        tangent = line.stiffness_n_per_m * along
        tangent += line.pretension_n / length * (np.eye(3) - along)
        total += factors.T @ tangent @ factors
    return total


def spring_stiffness(plant: Plant) -> Floats:
    """Return the stiffness of the axes' springs for small motions from rest, (n, n)."""
    factors = factor_matrix(plant)
    total: Floats = factors.T @ axis_springs.stiffness(plant) @ factors
    return total


def stiffness_at_rest(plant: Plant, bem: BemModes) -> Floats:
    """Return the stiffness for small motions from rest, (n, n).

    It is that of hydrostatics, mooring, lines and springs.
    """
    return stiffness_matrix(plant, bem) + line_stiffness(plant) + spring_stiffness(plant)


def _line_vector(line: Line) -> Floats:
    """Return the vector from the anchor to the fairlead at rest, m."""
    vector: Floats = np.subtract(line.fairlead_m, line.anchor_m)
    return vector


def factor_matrix(plant: Plant) -> Floats:
    """Return the factors (axes, modes) between positions of modes and axes of a plant."""
    return factors_between(plant.modes, [axis.moves_with for axis in plant.axes.values()])


def factors_between(modes: Iterable[str], motions: Sequence[Mapping[str, float]]) -> Floats:
    """Return the factors (axes, modes) between positions of modes and axes.

    ``motions``: of each axis the factors of the modes with which it moves, by mode.
    """
    names = list(modes)
    rows = [[motion.get(name, 0.0) for name in names] for motion in motions]
    return np.array(rows, dtype=float).reshape(len(motions), len(names))


def inertia_matrix(plant: Plant, bem: BemModes) -> Floats:
    """Return rigid mass plus A_inf plus the inertia of the motors that are coupled rigidly."""
    mass = np.diag([mode.mass for mode in plant.modes.values()])
    factors = factor_matrix(plant)
    reflected = np.diag([0.0 if axis.backlash else axis.inertia for axis in plant.axes.values()])
    total: Floats = mass + bem.added_mass_infinite + factors.T @ reflected @ factors
    smallest = float(np.linalg.eigvalsh(total).min())
    if not smallest > 0.0:
        raise ValueError(
            f"mass plus added mass is not positive (smallest eigenvalue {smallest:g}); check "
            "modes.*.mass and the BEM file's added mass at infinite frequency"
        )
    return total


def initial_state(model: PlantModel) -> list[float]:
    """Return the state of a plant at rest, its accumulators and bus filled."""
    params, state = model.params, [0.0] * step.state_size(model.params)
    for a, axis in enumerate(model.plant.axes.values()):
        if axis.hydraulic is not None:
            oil = _hydraulic_params(axis.hydraulic)
            start = axis.hydraulic.start_pressure_pa or oil.precharge
            state[step.pto_place(params, 0, a)] = hydraulic.volume_at(oil, start)
    if params.bus_count:
        at = step.bus_place(params)
        state[at : at + len(bus.BusState._fields)] = map(
            float, bus.initial(step.bus_params(params))
        )
    return state


def check_step(model: PlantModel, dt: float) -> None:
    """Raise ValueError if the fastest motion of the plant is too fast for a step of dt (s).

    End stops and teeth count as closed and Coulomb friction as its steepest slope.
    """
    plant, memory = model.plant, model.radiation
    count, states = len(plant.modes), len(memory.source)
    factors, axes = factor_matrix(plant), plant.axes.values()
    stops = np.diag([_contact(mode.end_stop)[0] for mode in plant.modes.values()])
    stop_damping = [m.linear_damping + _contact(m.end_stop)[1] for m in plant.modes.values()]
    stiff = stiffness_matrix(plant, model.bem) + line_stiffness(plant) + stops
    damping = np.diag(stop_damping) + line_damping(plant)
    slopes = [_friction_slope(axis) for axis in axes]
    # A motor behind a backlash has a motion of its own; all others move with the modes.
    free = [a for a, axis in enumerate(axes) if axis.backlash]
    fixed = [0.0 if axis.backlash else slope for axis, slope in zip(axes, slopes, strict=True)]
    contacts = np.array([np.add(_contact(axis.end_stop), _contact(axis.backlash)) for axis in axes])
    springs = axis_springs.largest_stiffness(plant)
    stiff = stiff + factors.T @ (np.diag(contacts[:, 0]) + springs) @ factors
    damping = damping + factors.T @ np.diag(contacts[:, 1] + fixed) @ factors
    n = count + len(free)
    mass, k_matrix, c_matrix = np.zeros((3, n, n))
    mass[:count, :count] = inertia_matrix(plant, model.bem)
    k_matrix[:count, :count], c_matrix[:count, :count] = stiff, damping
    for row, a in enumerate(free, count):
        axis = list(axes)[a]
        stiffness, damper = _contact(axis.backlash)
        mass[row, row] = axis.inertia
        k_matrix[row, row], c_matrix[row, row] = stiffness, damper + slopes[a]
        k_matrix[row, :count] = k_matrix[:count, row] = -stiffness * factors[a]
        c_matrix[row, :count] = c_matrix[:count, row] = -damper * factors[a]
    system = np.zeros((2 * n + states,) * 2)
    system[:n, n : 2 * n] = np.eye(n)
    forces = np.vstack([memory.output, np.zeros((len(free), states))])
    system[n : 2 * n] = -np.linalg.solve(mass, np.hstack([k_matrix, c_matrix, forces]))
    for k in range(states):
        row = 2 * n + k
        system[row, row] += memory.diagonal[k]
        system[row, 2 * n + memory.partner[k]] += memory.cross[k]
        system[row, n + memory.source[k]] += memory.input[k]
    rates = [np.linalg.eigvals(system), *(np.array([rate]) for rate in _single_rates(plant))]
    poles = np.concatenate(rates)
    fastest = float(np.abs(poles).max())
    if fastest * dt > MAX_STEP or _energy_gain(poles, dt) > MAX_GAIN:
        needed = dt
        while fastest * needed > MAX_STEP or _energy_gain(poles, needed) > MAX_GAIN:
            needed *= 0.9
        raise ValueError(
            f"the fastest motion of the plant, {fastest:.0f} rad/s, needs a tick of at most "
            f"{needed:.2g} s, not {dt:g} s; soften end stops or damp them, lower coulomb_friction, "
            "or raise coulomb_velocity or rate_hz"
        )


def _energy_gain(poles: Complexes, dt: float) -> float:
    """Return the largest share of energy that a free oscillation gains in half a period.

    The midpoint rule multiplies a motion by 1 + z + z²/2 in a step, z = pole times dt; half a
    period is the contact with an end stop.
    """
    swinging = poles[np.abs(poles.imag) > 1.0e-9] * dt
    if swinging.size == 0:
        return 0.0
    growth = np.log(np.abs(1.0 + swinging + 0.5 * swinging * swinging))
    return float((2.0 * growth * math.pi / np.abs(swinging.imag)).max())


def _single_rates(plant: Plant) -> list[float]:
    """Return the rates, 1/s, of what moves by itself: brakes of hydraulic motors, and the bus."""
    rates = []
    for axis in plant.axes.values():
        if axis.hydraulic is not None:
            torque = axis.torque_constant_n_m_per_a * axis.drive.current_limit_a
            rates.append(-torque / (hydraulic.STANDSTILL * axis.hydraulic.inertia_kg_m2))
    if plant.bus is not None:
        resistors = [plant.bus.dump_ohm]
        resistors += [plant.bus.supply_resistance_ohm] if plant.bus.supply_v is not None else []
        rates += [-2.0 / (ohm * plant.bus.capacitance_f) for ohm in resistors if ohm is not None]
    return rates


def _contact(part: EndStop | Backlash | None) -> tuple[float, float]:
    """Return stiffness and damping of a closed contact."""
    return (part.stiffness, part.damping) if part is not None else (0.0, 0.0)


def _friction_slope(axis: Axis) -> float:
    """Return the steepest slope of what resists an axis by the sign of its motion."""
    slope = axis.viscous_friction + axis.coulomb_friction / axis.coulomb_velocity
    peak = axis.torque_constant_n_m_per_a * axis.gear_ratio * axis.drive.current_limit_a
    slope += (1.0 - axis.gear_efficiency) * peak / axis.coulomb_velocity
    oil = axis.hydraulic
    if oil is not None:
        highest = _relief(oil) - oil.low_pressure_pa
        slope += oil.area_m2 * highest / oil.valve_velocity_m_per_s
    return slope


def _relief(oil: Hydraulic) -> float:
    """Return the pressure at which the relief valve opens, Pa."""
    return oil.relief_pa or 4.0 * oil.precharge_pa


def line_damping(plant: Plant) -> Floats:
    """Return the damping of the taut lines for small motions, (n, n)."""
    total = np.zeros((len(plant.modes),) * 2)
    for line, factors in zip(plant.mooring.lines.values(), line_factors(plant), strict=True):
        vector = _line_vector(line)
        along = vector @ factors / np.linalg.norm(vector)
        total += line.damping_n_s_per_m * np.outer(along, along)
    return total


def linear_damping(plant: Plant) -> Floats:
    """Return the linear damping of modes, axes and taut lines for small motions, (n, n).

    Viscous friction of the axes counts; drag, Coulomb friction and radiation do not.
    """
    factors = factor_matrix(plant)
    viscous = np.diag([axis.viscous_friction for axis in plant.axes.values()])
    modes = np.diag([mode.linear_damping for mode in plant.modes.values()])
    return np.asarray(modes + factors.T @ viscous @ factors + line_damping(plant))


def _params(plant: Plant, bem: BemModes, memory: Radiation) -> ModesParams:
    modes, sensors = plant.modes.values(), plant.sensors.values()
    signals = plant.signals()
    channels = [(*signals[s.signal], s.scale, s.offset, s.noise) for s in sensors]
    lines = list(plant.mooring.lines.values())
    return ModesParams(
        len(modes),
        len(plant.axes),
        len(memory.source),
        len(lines),
        len(plant.sprung_axes()),
        int(plant.bus is not None),
        len(channels),
        _flat(np.linalg.inv(inertia_matrix(plant, bem))),
        _flat(stiffness_matrix(plant, bem)),
        [float(mode.linear_damping) for mode in modes],
        [float(mode.quadratic_damping) for mode in modes],
        [number for mode in modes for number in _stop_params(mode.end_stop)],
        list(memory.source),
        list(memory.partner),
        _flat(memory.diagonal),
        _flat(memory.cross),
        _flat(memory.input),
        _flat(memory.output),
        _flat(factor_matrix(plant)),
        [number for axis in plant.axes.values() for number in _axis_params(axis)],
        [float(number) for line in lines for number in _line_params(line)],
        _flat(line_factors(plant)),
        axis_springs.numbers(plant),
        [float(number) for number in _bus_params(plant.bus)] if plant.bus else [],
        [float(number) for channel in channels for number in channel],
    )


def _axis_params(axis: Axis) -> list[float]:
    """Return the numbers of `plant.AXIS_PARTS` for one axis of the file."""
    own = axis.drive
    kind = step.BACKLASH if axis.backlash else step.HYDRAULIC if axis.hydraulic else step.RIGID
    ratio = 1.0 if axis.hydraulic else axis.gear_ratio
    teeth = axis.backlash
    parts = (
        MotorParams(
            kind=kind,
            force_per_current=axis.torque_constant_n_m_per_a * ratio,
            inertia=axis.inertia,
            efficiency=axis.gear_efficiency,
            cogging=axis.cogging.force_n if axis.cogging else 0.0,
            pitch=axis.cogging.pitch_m if axis.cogging else 1.0,
            resistance=own.resistance_ohm,
            linear_loss=own.loss_w_per_a,
            standby=own.standby_w,
            regeneration=own.regeneration_efficiency,
            back_emf=(own.back_emf_v_s_per_rad or 0.0) * ratio,
            voltage_drop=own.voltage_drop_v_per_a or own.resistance_ohm or 1.0,
            modulation=own.modulation,
            current_noise=own.current_noise_a,
            counts_per_unit=axis.gear_ratio / (2.0 * math.pi) * axis.counts_per_revolution,
            count_offset=axis.count_offset,
        ),
        DriveParams(
            own.current_limit_a,
            1.0 / (2.0 * math.pi * own.current_bandwidth_hz),
            own.enable_delay_s,
            own.watchdog_s,
        ),
        FrictionParams(axis.viscous_friction, axis.coulomb_friction, axis.coulomb_velocity),
        _stop_params(axis.end_stop),
        EndStopParams(teeth.half_gap, teeth.stiffness, teeth.damping)
        if teeth
        else EndStopParams(FAR, 0.0, 0.0),
        _hydraulic_params(axis.hydraulic),
    )
    return [float(number) for part in parts for number in part]


def _stop_params(stop: EndStop | None) -> EndStopParams:
    if stop is None:
        return EndStopParams(FAR, 0.0, 0.0)
    return EndStopParams(stop.position, stop.stiffness, stop.damping)


def _hydraulic_params(oil: Hydraulic | None) -> HydraulicParams:
    if oil is None:
        return HydraulicParams(*(1.0 for _ in HydraulicParams._fields))  # unused
    return HydraulicParams(
        area=oil.area_m2,
        displacement=oil.displacement_m3_per_rad,
        low_pressure=oil.low_pressure_pa,
        precharge=oil.precharge_pa,
        volume=oil.volume_m3,
        least_volume=oil.volume_m3 * (oil.precharge_pa / _relief(oil)) ** (1.0 / oil.exponent),
        exponent=oil.exponent,
        leakage=oil.leakage_m3_per_s_pa,
        inertia=oil.inertia_kg_m2,
        viscous=oil.viscous_n_m_s_per_rad,
        valve_width=oil.valve_velocity_m_per_s,
    )


def _line_params(line: Line) -> LineParams:
    x, y, z = _line_vector(line).tolist()
    return LineParams(x, y, z, line.pretension_n, line.stiffness_n_per_m, line.damping_n_s_per_m)


def _bus_params(given: Bus) -> BusParams:
    """Return the parameters of the bus; its dump is always selected where there is one."""
    dumps = given.dump_ohm is not None
    return BusParams(
        capacitance=given.capacitance_f,
        set_voltage=given.voltage_v,
        supply_connected=int(given.supply_v is not None),
        supply_voltage=given.supply_v or 0.0,
        supply_resistance=given.supply_resistance_ohm,
        dump_on=given.dump_on_v or 0.0,
        dump_off=given.dump_off_v or 0.0,
        dump_conductance=1.0 / given.dump_ohm if given.dump_ohm else 0.0,
        dump_mask=int(dumps),
        undervoltage=given.undervoltage_v,
        brownout=given.brownout_v,
        overvoltage=given.overvoltage_v,
        trip_delay=given.undervoltage_delay_s,
    )


def _flat(values: Any) -> list[float]:
    numbers: list[float] = np.asarray(values, np.float64).ravel().tolist()
    return numbers
