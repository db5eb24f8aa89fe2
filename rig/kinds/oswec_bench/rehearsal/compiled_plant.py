"""The compiled steps of bench and flap: the same functions and bits as the interpreted ones."""

from types import ModuleType
from typing import Any

import numpy as np

from rig.compilation import lifting
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
from sim_plant.bench.signals import OFF, Actuation, BenchReading
from sim_plant.flap import body, oswec
from sim_plant.flap import stepper as flap_stepper
from sim_plant.flap.oswec import FlapState

_BENCH_MODULES = (
    brake, drive, dynamometer, gearbox, load_cell, losses, motor, sensors, servo, transmission,
)  # fmt: skip

# One array holds all numbers: the state, the length of the step, the constants, the noise table.
_SOURCE_TEMPLATE = '''"""Generated: one tick of {module} on an array of its numbers."""

from numba import float64, int64, njit

{imports}

ACTUATION = (int64, int64, float64, float64, float64, int64)
MOMENT = (int64, int64, {types}int64)


@njit((float64[::1], *ACTUATION, *MOMENT), cache=True, error_model="numpy")
def advance(x, a0, a1, a2, a3, a4, a5, fresh, stopped, {extra}tick):
    params = {params}
    state = {state}
    normals = x[{normals}:]
    actuation = Actuation(a0, a1, a2, a3, a4, a5)
    state = step(params, state, actuation, fresh, stopped, {extra}normals, x[{dt}])
    {store}
    read = sample(params, state, stopped, tick, normals)
    return {read}


def unpack(x):
    return {state}
'''


class _CompiledStep:
    """A compiled step and the array on which it works."""

    def __init__(self, start: Any, module: ModuleType, lifted: tuple[ModuleType, ...], extra: str):
        """``extra``: name of the float that the step takes besides the actuation, or empty."""
        self._code = _compile_step(start, module, lifted, extra)
        state = lifting.flatten(start.state)
        self._x = np.array([*state, start.dt, *lifting.flatten(start.params), *start.normals])
        self._state = self._x[: len(state)]
        # The first call of compiled code takes milliseconds, so it must not be in a tick.
        self.advance(*OFF, 0, 0, *([0.0] if extra else []), 0)
        self.put(start.state)

    def advance(self, *actuation: float) -> BenchReading:
        return tuple.__new__(BenchReading, self._code.advance(self._x, *actuation))

    def put(self, state: Any) -> None:
        self._state[:] = lifting.flatten(state)

    def state(self) -> Any:
        return self._code.unpack(self._state.tolist())


class CompiledStepper(stepper.Stepper):
    """A `Stepper` of the bench that runs compiled, on one array."""

    def __init__(self, start: stepper.StepperInputs) -> None:
        self._array = _CompiledStep(start, dynamometer, _BENCH_MODULES, "")
        super().__init__(start)

    @property
    def state(self) -> BenchState:
        """The bench's state, rebuilt from the array."""
        state: BenchState = self._array.state()
        return state

    @state.setter
    def state(self, state: BenchState) -> None:
        self._array.put(state)

    def advance(self, actuation: Actuation, fresh: int, stopped: int, tick: int) -> BenchReading:
        """Step to ``tick`` and return the sensors' readings there."""
        return self._array.advance(*actuation, fresh, stopped, tick)


class CompiledFlapStepper(flap_stepper.Stepper):
    """A `Stepper` of the flap that runs compiled, on one array."""

    def __init__(self, start: flap_stepper.StepperInputs) -> None:
        self._array = _CompiledStep(start, oswec, (*_BENCH_MODULES, body, oswec), "excitation")
        super().__init__(start)

    @property
    def state(self) -> FlapState:
        """The flap's state, rebuilt from the array."""
        state: FlapState = self._array.state()
        return state

    @state.setter
    def state(self, state: FlapState) -> None:
        self._array.put(state)

    def advance(
        self, actuation: Actuation, fresh: int, stopped: int, excitation: float, tick: int
    ) -> BenchReading:
        """Step to ``tick`` with the waves' excitation and return the sensors' readings there."""
        return self._array.advance(*actuation, fresh, stopped, excitation, tick)


def _compile_step(
    start: Any, module: ModuleType, lifted: tuple[ModuleType, ...], extra: str
) -> Any:
    params, state = start.params, start.state
    names = lifting.tuple_types(params) | lifting.tuple_types(state) | {Actuation}
    imports = [f"from {kind.__module__} import {kind.__name__}" for kind in names]
    dt_index = len(lifting.flatten(state))
    source = _SOURCE_TEMPLATE.format(
        module=module.__name__,
        imports="\n".join([*sorted(imports), f"from {module.__name__} import sample, step"]),
        types="float64, " if extra else "",
        extra=f"{extra}, " if extra else "",
        params=lifting.unpack_source(params, "x", dt_index + 1),
        state=lifting.unpack_source(state, "x"),
        normals=dt_index + 1 + len(lifting.flatten(params)),
        dt=dt_index,
        store="\n    ".join(lifting.pack_source(state, "state", "x")),
        read="(" + ", ".join(f"read[{i}]" for i in range(len(BenchReading._fields))) + ")",
    )
    return lifting.load(f"{module.__name__.rsplit('.', 1)[-1]}_step", source, lifted)
