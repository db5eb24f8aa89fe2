"""The body of a modular rig as the device from whose motion the waves of a run are recovered."""

from typing import Any

import numpy as np

from rig.design.axis_params import metres_per_count, newtons_per_ampere
from rig.identification.incident_waves import WaveSensors
from rig.kinds.modular.config import RigFile
from rig.spectra.periods import Complexes, Floats
from sim_plant import bem
from sim_plant.modes import building, radiation
from sim_plant.modes.bem import mode_bem
from sim_plant.modes.building import PlantModel


def wave_sensors(rig: RigFile) -> WaveSensors:
    """Return the log fields of the first axis from which waves are recovered.

    The force is that of the motor, by its measured current.
    """
    name, motor = next(iter(rig.axes.items()))
    return WaveSensors(
        position=f"{name}.sense.counts",
        position_age=f"{name}.sense.encoder_age",
        metres=metres_per_count(motor),
        force=f"{name}.sense.current",
        force_age=f"{name}.sense.drive_age",
        elevation="wave.elevation",
        newtons=newtons_per_ampere(motor),
    )


class BodyInWaves:
    """A plant of one mode with the moving parts of its axis; what the motor's force acts on.

    Forces of several modes cannot be separated by the motion of one axis, so such a plant is
    refused when they are needed: the undisturbed elevation, where it is logged, needs none.
    """

    def __init__(self, rig: RigFile, model: PlantModel) -> None:
        self._model = model
        sensors, name = wave_sensors(rig), next(iter(rig.axes))
        factors = list(model.plant.axes[name].moves_with.values())
        factor = factors[0] if len(factors) == 1 and factors[0] != 0.0 else 1.0
        self.sensors = sensors._replace(
            metres=sensors.metres / factor, newtons=sensors.newtons * factor
        )

    @property
    def quadratic(self) -> float:
        """Coefficient of quadratic drag, N s2/m2."""
        return float(self._only_mode().quadratic_damping)

    def dynamic_stiffness(self, omega: Floats) -> Complexes:
        """Return the force per position (N/m, e^{+i omega t}), with linear damping and friction."""
        plant, (axis,) = self._model.plant, self._model.plant.axes.values()
        factor = building.factor_matrix(plant)[0, 0]
        damping = self._only_mode().linear_damping + factor * factor * axis.viscous_friction
        damping += building.line_damping(plant)[0, 0]
        mass = building.inertia_matrix(plant, self._model.bem)[0, 0]
        stiffness = building.stiffness_at_rest(plant, self._model.bem)[0, 0]
        memory = radiation.response(self._model.radiation, omega)[:, 0, 0]
        found: Complexes = stiffness - omega * omega * mass + 1j * omega * (damping + memory)
        return found

    def excitation(self, frequency: Floats) -> Complexes:
        """Return the force per metre of wave (N/m, e^{+i omega t}) at frequencies in Hz."""
        self._only_mode()
        return np.conj(bem.excitation_at(mode_bem(self._model.bem, 0), frequency))

    def _only_mode(self) -> Any:
        modes, axes = self._model.plant.modes, self._model.plant.axes
        if len(modes) > 1 or len(axes) > 1:
            raise ValueError(
                "waves are recovered from forces only for a plant with one mode and one axis; this "
                f"one has the modes {', '.join(modes)} and the axes {', '.join(axes)}: use a run "
                "that logged the undisturbed elevation"
            )
        for name, axis in axes.items():
            if axis.backlash is not None or axis.hydraulic is not None:
                part = "hydraulic" if axis.backlash is None else "backlash"
                raise ValueError(
                    "waves are recovered from forces only where the motor's force acts on the body "
                    f"itself; the plant's axis {name} has a section {part}: use a run that logged "
                    "the undisturbed elevation"
                )
        return next(iter(modes.values()))
