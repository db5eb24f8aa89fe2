"""Hull and excitation model of a plant file, used to recover the incident waves from a run."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.design.axis import Body, dynamic_stiffness
from rig.identification.periods import Complexes, Floats
from rig.kinds.wavebot.build import metres_per_count
from rig.kinds.wavebot.predictions.model import linear_body
from rig.planning.campaign import Campaign
from sim_plant import bem
from sim_plant.parameters import Plant


class DeviceModel(NamedTuple):
    """Bare hull in heave and its wave excitation."""

    body: Body
    quadratic: float  # N s2/m2, drag
    coefficients: bem.Bem
    metres_per_count: float  # of the heave encoder

    def dynamic_stiffness(self, omega: Floats) -> Complexes:
        """Return the dynamic stiffness (N/m, e^{+i omega t}), including linear hull damping."""
        return dynamic_stiffness(self.body, omega)

    def excitation(self, frequency: Floats) -> Complexes:
        """Return the force per metre of wave (N/m, e^{+i omega t}) at frequencies in Hz."""
        return np.conj(bem.excitation_at(self.coefficients, frequency))


def build_device_model(campaign: Campaign) -> DeviceModel:
    """Build the model from a campaign's plant file and rig file."""
    hull = Plant.model_validate(campaign.plant).build().body
    path = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    return DeviceModel(
        linear_body(hull, 0.0),
        hull.quadratic,
        bem.read_bem(Path(path)),
        metres_per_count(campaign.rig.heave),
    )
