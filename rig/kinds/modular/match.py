"""The gains of the impedance law that match the plant's impedance in a regular wave."""

import numpy as np

from rig.campaign import AnyCampaign
from rig.campaign.set_points import row_setting
from rig.config.problems import Problem, format_number
from rig.config.sea import RegularSea
from rig.kinds.modular.build import linear_response
from rig.kinds.modular.rehearsal.job import load_model
from rig.kinds.modular.tick.composition import ROTATION
from rig.planning.input_files import ConfigSource
from sim_plant.modes import building, radiation
from sim_plant.modes.building import PlantModel

WEAK = 0.01  # of the plant's impedance: such gains change next to nothing


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


def weak_gains(campaign: AnyCampaign) -> tuple[Problem, ...]:
    """Return a warning if the law's force is far below the plant's impedance, as in a wrong unit.

    Empty without such a force, with a reference, which acts as well, for laws without a linear
    form, and where `impedance_match` has nothing to compare with.
    """
    match = impedance_match(campaign)
    if not match or campaign.file.reference is not None:
        return ()
    ((name, axis_law),) = campaign.axis_laws.items()
    rows = [row_setting(campaign.kind, campaign.file, campaign.rig, p) for p in campaign.points]
    if any(axis_law.chosen(values).linear is None for values in rows):
        return ()
    response, omega = linear_response(campaign, name), 2.0 * np.pi * campaign.file.sea.frequency
    largest = max((abs(response(values, omega)) for values in rows), default=0.0)
    impedance = -match["kp_real"]
    if largest == 0.0 or largest >= WEAK * impedance:
        return ()
    unit = "N*m*s/rad" if campaign.rig.axes[name].motion == ROTATION else "N*s/m"
    message = (
        f"the largest force per velocity of all rows, {largest:.3g} {unit}, is "
        f"{100.0 * largest / impedance:.2g} % of the plant's impedance, {impedance:.4g} {unit} at "
        f"{format_number(campaign.file.sea.frequency)} Hz: the rows hardly differ from none; are "
        "the gains in the units of their keys?"
    )
    return (campaign.locate.problem(("matrix",), largest, message),)


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
