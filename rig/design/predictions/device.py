"""The device as a plant file describes it, as far as its waves are recovered by it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.design.predictions.axis import hull_lines
from rig.identification.periods import Complexes, Floats
from rig.kinds.wavebot.build import metres_per_count
from rig.planning.campaign import Campaign
from sim_plant import bem
from sim_plant.body import BodyParams
from sim_plant.parameters import Plant


class Model(NamedTuple):
    """Bare hull in heave, and what a metre of wave does to it."""

    body: BodyParams
    coefficients: bem.Bem
    metres_per_count: float  # of the heave encoder

    @property
    def quadratic(self) -> float:
        """Quadratic drag, N s2/m2."""
        return self.body.quadratic

    def hull(self, omega: Floats) -> Complexes:
        """Force per metre of motion (N/m, e^{+i omega t}), linear damping of the hull in it."""
        return hull_lines(self.body, 0.0, omega)

    def excitation(self, frequency: Floats) -> Complexes:
        """Force per metre of wave (N/m, e^{+i omega t}) at frequencies in Hz."""
        return np.conj(bem.excitation_at(self.coefficients, frequency))


def model_of(campaign: Campaign) -> Model:
    """The model of a campaign's plant file and rig file."""
    plant = Plant.model_validate(campaign.plant)
    path = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    return Model(plant.build().body, bem.read_bem(Path(path)), metres_per_count(campaign.rig.heave))
