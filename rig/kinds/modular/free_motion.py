"""Remainder of a modular rig's free motion when the measured window of a row begins.

An identification takes the response to the reference as periodic. The free motion after the start
of the reference is not; it decays with the slowest mode of the plant's linear model: inertia,
springs, linear and viscous damping, radiation. Drag and Coulomb friction, which the model lacks,
shorten it.
"""

import math

import numpy as np

from rig.campaign import AnyCampaign
from rig.config.problems import Problem, format_number
from rig.config.reference import MultisineReference
from rig.kinds.modular.rehearsal.job import load_model
from rig.planning.input_files import ConfigSource
from rig.spectra.periods import Complexes
from sim_plant.modes import building
from sim_plant.modes.building import PlantModel

MAX_REMAINDER = 0.001  # of the free motion: a warning
_AT_REST = 1.0e-6  # 1/s: a pole below is a position without a spring, which moves nothing


def free_motion_warnings(campaign: AnyCampaign) -> tuple[Problem, ...]:
    """Return a warning if more than `MAX_REMAINDER` of the free motion is left after settling.

    Empty without a multisine, with a law that acts on the motion, and for a plant that does not
    come to rest by itself.
    """
    if not isinstance(campaign.file.reference, MultisineReference):
        return ()
    gains = {column.name for law in campaign.axis_laws.values() for column in law.columns}
    if any(point.values.get(name) for point in campaign.points for name in gains):
        return ()
    model, _ = load_model(ConfigSource(campaign.plant, campaign.plant_locate))
    decay = math.inf if model is None else decay_time(model)
    settle = campaign.kind.windows(campaign.file).settle
    remainder = math.exp(-settle / decay)
    if not math.isfinite(decay) or remainder <= MAX_REMAINDER:
        return ()
    needed = decay * math.log(1.0 / MAX_REMAINDER)
    message = (
        f"the slowest mode of the plant decays in {decay:.3g} s, so after "
        f"{format_number(settle)} s {100.0 * remainder:.2g} % of the free motion remains in the "
        f"measured periods, which are taken as periodic; "
        f"{100.0 * MAX_REMAINDER:g} % after {needed:.0f} s"
    )
    return (campaign.locate.problem(("timing", "settle_s"), settle, message),)


def decay_time(model: PlantModel) -> float:
    """Return the time constant of the slowest mode, s; infinite if a mode does not decay."""
    free = poles(model)
    slowest = float(np.max(free[np.abs(free) > _AT_REST].real, initial=-np.inf))
    return -1.0 / slowest if slowest < -_AT_REST else math.inf


def poles(model: PlantModel) -> Complexes:
    """Return the poles of the plant for small motions from rest, without a law, 1/s."""
    plant, memory = model.plant, model.radiation
    modes, states = len(plant.modes), len(memory.source)
    inverse = np.linalg.inv(building.inertia_matrix(plant, model.bem))
    velocity, radiated = slice(modes, 2 * modes), slice(2 * modes, None)
    system = np.zeros((2 * modes + states,) * 2)
    system[:modes, velocity] = np.eye(modes)
    system[velocity, :modes] = -inverse @ building.stiffness_at_rest(plant, model.bem)
    system[velocity, velocity] = -inverse @ building.linear_damping(plant)
    system[velocity, radiated] = -inverse @ memory.output
    fluid = np.diag(memory.diagonal)
    fluid[range(states), memory.partner] += memory.cross
    system[radiated, radiated] = fluid
    system[2 * modes + np.arange(states), modes + np.array(memory.source, dtype=int)] = memory.input
    return np.asarray(np.linalg.eigvals(system), dtype=np.complex128)
