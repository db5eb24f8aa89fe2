"""Hull and excitation model of a plant file, used to recover the incident waves from a run."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.identification.periods import Complexes, Floats
from rig.kinds.wavebot.build import metres_per_count
from rig.kinds.wavebot.predictions.axis import hull_dynamic_stiffness
from rig.planning.campaign import Campaign
from sim_plant import bem
from sim_plant.body import BodyParams
from sim_plant.parameters import Plant


class DeviceModel(NamedTuple):
    """Bare hull in heave and its wave excitation."""

    body: BodyParams
    coefficients: bem.Bem
    metres_per_count: float  # of the heave encoder

    @property
    def quadratic(self) -> float:
        """Quadratic drag coefficient, N s2/m2."""
        return self.body.quadratic

    def dynamic_stiffness(self, omega: Floats) -> Complexes:
        """Return the dynamic stiffness (N/m, e^{+i omega t}), including linear hull damping."""
        return hull_dynamic_stiffness(self.body, 0.0, omega)

    def excitation(self, frequency: Floats) -> Complexes:
        """Return the force per metre of wave (N/m, e^{+i omega t}) at frequencies in Hz."""
        return np.conj(bem.excitation_at(self.coefficients, frequency))


def build_device_model(campaign: Campaign) -> DeviceModel:
    """Build the model from a campaign's plant file and rig file."""
    plant = Plant.model_validate(campaign.plant)
    path = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    return DeviceModel(
        plant.build().body, bem.read_bem(Path(path)), metres_per_count(campaign.rig.heave)
    )
