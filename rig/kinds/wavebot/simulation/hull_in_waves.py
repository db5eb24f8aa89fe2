"""The hull in heave as the device from whose motion the waves of a run are recovered."""

from pathlib import Path

import numpy as np

from rig.design.axis import dynamic_stiffness
from rig.design.axis_params import metres_per_count
from rig.identification.incident_waves import WaveSensors
from rig.kinds.wavebot.campaign import Campaign
from rig.kinds.wavebot.heave_loop import linear_body
from rig.spectra.periods import Complexes, Floats
from sim_plant import bem
from sim_plant.parameters import Plant


class HullInWaves:
    """Bare hull in heave and its wave excitation, from a campaign's plant file and rig file."""

    def __init__(self, campaign: Campaign, bem_file: Path) -> None:
        plant = Plant.model_validate(campaign.plant).build()
        hull = plant.body
        self._body = linear_body(hull, 0.0)
        self._coefficients = bem.read_bem(bem_file)
        self.quadratic = hull.quadratic
        self.sensors = WaveSensors(
            position="heave.sense.counts",
            position_age="heave.sense.encoder_age",
            metres=metres_per_count(campaign.rig.heave),
            force="load.lcb",
            force_age="load.age",
            elevation="wave.elevation",
            force_lag=plant.sensors.heave_force_lag,
        )

    def dynamic_stiffness(self, omega: Floats) -> Complexes:
        """Return the dynamic stiffness (N/m, e^{+i omega t}), including linear hull damping."""
        return dynamic_stiffness(self._body, omega)

    def excitation(self, frequency: Floats) -> Complexes:
        """Return the force per metre of wave (N/m, e^{+i omega t}) at frequencies in Hz."""
        return np.conj(bem.excitation_at(self._coefficients, frequency))
