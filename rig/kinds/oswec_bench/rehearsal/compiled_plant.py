"""The compiled steps of bench and flap: the same functions and bits as the interpreted ones."""

from types import ModuleType
from typing import Any

from rig.compilation.plant_step import PlantStep
from sim_plant import drive, sensors
from sim_plant.bench import (
    brake,
    dynamometer,
    gearbox,
    load_cell,
    losses,
    motor,
    servo,
    stepper,
    transmission,
)
from sim_plant.bench.dynamometer import BenchState
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.flap import body, oswec
from sim_plant.flap import stepper as flap_stepper
from sim_plant.flap.oswec import FlapState

_BENCH_MODULES = (
    brake, drive, dynamometer, gearbox, load_cell, losses, motor, sensors, servo, transmission,
)  # fmt: skip

_ACTUATION = {
    "enable": "int64", "mode": "int64", "volts": "float64", "current": "float64",
    "brake_current": "float64", "locked": "int64",
}  # fmt: skip


def _compile(
    start: Any, module: ModuleType, lifted: tuple[ModuleType, ...], extra: str
) -> PlantStep:
    """``extra``: name of the float that the step takes besides the actuation, or empty."""
    moment = {"fresh": "int64", "stopped": "int64", **({extra: "float64"} if extra else {})}
    return PlantStep(
        module,
        lifted,
        {**_ACTUATION, **moment, "tick": "int64"},
        (
            f"actuation = Actuation({', '.join(_ACTUATION)})",
            f"state = step(params, state, actuation, {', '.join(moment)}, normals, dt)",
            "read = sample(params, state, stopped, tick, normals)",
        ),
        **start._asdict(),
        imported=(Actuation,),
        reading=BenchReading,
    )


class CompiledStepper(stepper.Stepper):
    """A `Stepper` of the bench that runs compiled, on one array."""

    def __init__(self, start: stepper.StepperInputs) -> None:
        self._compiled = _compile(start, dynamometer, _BENCH_MODULES, "")
        super().__init__(start)

    @property
    def state(self) -> BenchState:
        """The bench's state, rebuilt from the array."""
        state: BenchState = self._compiled.state
        return state

    @state.setter
    def state(self, state: BenchState) -> None:
        self._compiled.state = state

    def advance(self, actuation: Actuation, fresh: int, stopped: int, tick: int) -> BenchReading:
        """Step to ``tick`` and return the sensors' readings there."""
        step = self._compiled
        return tuple.__new__(
            BenchReading, step.code.advance(step.array, *actuation, fresh, stopped, tick)
        )


class CompiledFlapStepper(flap_stepper.Stepper):
    """A `Stepper` of the flap that runs compiled, on one array."""

    def __init__(self, start: flap_stepper.StepperInputs) -> None:
        self._compiled = _compile(start, oswec, (*_BENCH_MODULES, body, oswec), "excitation")
        super().__init__(start)

    @property
    def state(self) -> FlapState:
        """The flap's state, rebuilt from the array."""
        state: FlapState = self._compiled.state
        return state

    @state.setter
    def state(self, state: FlapState) -> None:
        self._compiled.state = state

    def advance(
        self, actuation: Actuation, fresh: int, stopped: int, excitation: float, tick: int
    ) -> BenchReading:
        """Step to ``tick`` with the waves' excitation and return the sensors' readings there."""
        step = self._compiled
        return tuple.__new__(
            BenchReading,
            step.code.advance(step.array, *actuation, fresh, stopped, excitation, tick),
        )
