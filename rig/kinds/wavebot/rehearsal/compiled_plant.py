"""The compiled step of the WaveBot's plant: the same functions and bits in less time.

The interpreted plant takes more time than the loop that it tests.
"""

from rig.compilation import lifting
from rig.compilation.plant_step import PlantStep
from sim_plant import (
    analyser,
    body,
    cots_drive,
    custom_drive,
    electrics,
    magnetic_spring,
    pto,
    sensors,
    stator_force,
    surge,
    wavebot,
)
from sim_plant.parts import bus, drive, friction
from sim_plant.signals import Actuation, Readings
from sim_plant.stepper import Stepper, StepperInputs
from sim_plant.wavebot import NO_EXCITATION, Excitation, Hoist, Probes, WaveBotParams, WaveBotState

LIFTED_MODULES = (
    analyser, body, bus, cots_drive, custom_drive, drive, electrics, friction, magnetic_spring,
    pto, sensors, stator_force, surge, wavebot,
)  # fmt: skip

_ARGUMENTS = {
    "current": "float64", "enable": "int64", "target": "float64", "move": "int64",
    "surge_current": "float64", "surge_enable": "int64", "conducting": "int64", "fresh": "int64",
    "heave": "float64", "surge": "float64", "tick": "int64", "elevation": "float64",
}  # fmt: skip
_BODY = (
    "after = Excitation(heave, surge)",
    "actuation = Actuation("
    "current, enable, target, move, 0, surge_current, surge_enable, conducting)",
    "state = step(params, state[0], actuation, fresh, state[1], after, dt), after",
    "read = sample(params, state[0], tick, elevation, normals)",
)  # the state of the plant, and the excitation at the present tick


def _place(field: str, state: WaveBotState) -> slice:
    """Return the place of a field's numbers among those of the state."""
    fields = list(state._fields)
    before = sum(len(lifting.flatten(each)) for each in state[: fields.index(field)])
    return slice(before, before + len(lifting.flatten(getattr(state, field))))


class CompiledStepper(Stepper):
    """A `Stepper` that runs compiled, on one array."""

    def __init__(self, start: StepperInputs) -> None:
        self._compiled = compiled = PlantStep(
            wavebot,
            LIFTED_MODULES,
            _ARGUMENTS,
            _BODY,
            **start._replace(state=(start.state, NO_EXCITATION))._asdict(),  # type: ignore[arg-type]
            imported=(Actuation,),
            reading=Readings,
        )
        self._excitation = compiled.numbers[-len(NO_EXCITATION) :]
        self._state = compiled.numbers[: -len(NO_EXCITATION)]
        self._probes = self._state[_place("probes", start.state)]
        self._hoist = self._state[_place("hoist", start.state)]
        self._step, self._x = compiled.code.advance, compiled.array
        super().__init__(start)

    @property
    def params(self) -> WaveBotParams:
        """The constants that were set last."""
        return self._params

    @params.setter
    def params(self, params: WaveBotParams) -> None:
        self._params = params
        self._compiled.constants[:] = lifting.flatten(params)

    @property
    def state(self) -> WaveBotState:
        """The plant's state, rebuilt from the array."""
        state: WaveBotState = self._compiled.state[0]
        return state

    @state.setter
    def state(self, state: WaveBotState) -> None:
        self._state[:] = lifting.flatten(state)

    @property
    def excitation(self) -> Excitation:
        """Excitation at the present tick."""
        return Excitation(*self._excitation.tolist())

    @excitation.setter
    def excitation(self, excitation: Excitation) -> None:
        self._excitation[:] = excitation

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        heave: float,
        surge: float,
        tick: int,
        elevation: float,
    ) -> Readings:
        """Step to ``tick`` with the excitation in heave and surge; return the sensors' readings."""
        return tuple.__new__(
            Readings,
            self._step(
                self._x,
                actuation.heave_current,
                actuation.heave_enable,
                actuation.stator_target,
                actuation.stator_enable,
                actuation.surge_current,
                actuation.surge_enable,
                actuation.conducting,
                fresh,
                heave,
                surge,
                tick,
                elevation,
            ),
        )

    def motion(self) -> tuple[float, float]:
        """Return the present heave position and velocity."""
        return float(self._state[0]), float(self._state[1])

    def set_hoist(self, hoist: Hoist) -> None:
        """Impose heave in the following steps, or leave it free."""
        self._hoist[:] = hoist

    def set_probes(self, probes: Probes) -> None:
        """Set a new sample of the basin probes."""
        self._probes[:] = probes
