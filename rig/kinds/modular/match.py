"""The gains of the impedance law that match the plant's impedance in a regular wave."""

import numpy as np

from rig.campaign import AnyCampaign
from rig.config.sea import RegularSea
from rig.kinds.modular.rehearsal.job import load_model
from rig.planning.input_files import ConfigSource
from sim_plant.modes import building, radiation
from sim_plant.modes.building import PlantModel


def impedance_match(campaign: AnyCampaign) -> dict[str, float]:
    """Return the theoretical gains that absorb most at the body, for pictures.

    ``kp`` and ``ki`` are those of the complex conjugate, -Re Z and -omega Im Z; ``kp_real`` is the
    best without a spring, -|Z|. SI units of the axis. Empty for several axes, which see each
    other's gains, for an irregular sea, and for an axis whose motor is not on the body.
    """
    sea, axes = campaign.file.sea, campaign.rig.axes
    if not isinstance(sea, RegularSea) or len(axes) != 1:
        return {}
    model, _ = load_model(ConfigSource(campaign.plant, campaign.plant_locate))
    if model is None or len(model.plant.axes) != 1:  # the plant may have axes that the rig has not
        return {}
    (axis,) = model.plant.axes.values()
    if axis.backlash is not None or axis.hydraulic is not None:
        return {}
    omega = 2.0 * np.pi * sea.frequency
    z = axis_impedance(model, omega)
    return {"kp": -z.real, "ki": -omega * z.imag, "kp_real": -abs(z)}


def axis_impedance(model: PlantModel, omega: float) -> complex:
    """Return force per velocity of the only axis, N*s/m or N*m*s/rad, e^{+i omega t}.

    Waves, springs, linear damping and viscous friction count; drag and Coulomb friction do not.
    """
    plant = model.plant
    (factors,), damping = building.factor_matrix(plant), building.linear_damping(plant)
    inertia = building.inertia_matrix(plant, model.bem)
    stiffness = building.stiffness_at_rest(plant, model.bem)
    memory = radiation.response(model.radiation, np.array([omega]))[0]
    impedance = damping + memory + 1j * (omega * inertia - stiffness / omega)
    return complex(1.0 / (factors @ np.linalg.solve(impedance, factors)))
