"""The compiled steps of bench and flap: the same functions and bits as the interpreted ones."""

from types import ModuleType
from typing import Any, ClassVar

from rig.compilation.plant_step import PlantStep
from sim_plant import sensors
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
from sim_plant.bench.signals import Actuation, BenchReading
from sim_plant.flap import body, oswec
from sim_plant.flap import stepper as flap_stepper
from sim_plant.parts import drive

_BENCH_MODULES = (
    brake, drive, dynamometer, gearbox, load_cell, losses, motor, sensors, servo, transmission,
)  # fmt: skip

_ACTUATION = {
    "enable": "int64", "mode": "int64", "volts": "float64", "current": "float64",
    "brake_current": "float64", "locked": "int64",
}  # fmt: skip


class CompiledStepper(stepper.Stepper):
    """A `Stepper` of the bench that runs compiled, on one array."""

    _lifted: tuple[ModuleType, ...] = _BENCH_MODULES
    _moment: tuple[str, ...] = ()  # names of the numbers that `advance` takes after the tick

    def __init__(self, start: stepper.StepperInputs) -> None:
        arguments = ("actuation", "fresh", "stopped", *self._moment, "normals", "dt")
        self._compiled = PlantStep(
            self.plant,
            self._lifted,
            {**_ACTUATION, "fresh": "int64", "stopped": "int64", "tick": "int64"}
            | dict.fromkeys(self._moment, "float64"),
            (
                f"actuation = Actuation({', '.join(_ACTUATION)})",
                f"state = step(params, state, {', '.join(arguments)})",
                "read = sample(params, state, stopped, tick, normals)",
            ),
            **start._asdict(),
            imported=(Actuation,),
            reading=BenchReading,
        )
        super().__init__(start)

    @property
    def state(self) -> Any:
        """The plant's state, rebuilt from the array."""
        return self._compiled.state

    @state.setter
    def state(self, state: Any) -> None:
        self._compiled.state = state

    def advance(
        self, actuation: Actuation, fresh: int, stopped: int, tick: int, *excitation: float
    ) -> BenchReading:
        """Step to ``tick``, a flap with the waves' excitation; return the sensors' readings."""
        step = self._compiled
        return tuple.__new__(
            BenchReading,
            step.code.advance(step.array, *actuation, fresh, stopped, tick, *excitation),
        )


class CompiledFlapStepper(CompiledStepper, flap_stepper.Stepper):
    """A `Stepper` of the flap that runs compiled, on one array."""

    plant: ClassVar[Any] = oswec
    _lifted = (*_BENCH_MODULES, body, oswec)
    _moment = ("excitation",)
