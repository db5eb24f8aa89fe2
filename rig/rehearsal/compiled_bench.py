"""The bench's step, compiled: the same functions, the same bits, less time (see compiled.py)."""

from typing import Any

import numpy as np

from rig import lift
from sim_plant import drive, sensors
from sim_plant.bench import (
    brake,
    dynamometer,
    gearbox,
    load_cell,
    losses,
    motor,
    servo,
    transmission,
)
from sim_plant.bench.dynamometer import BenchState
from sim_plant.bench.stepper import Start, Stepper
from sim_plant.bench.words import OFF, Actuation, Reading

_LIFTED = (
    brake, drive, dynamometer, gearbox, load_cell, losses, motor, sensors, servo, transmission,
)  # fmt: skip

# One array holds all numbers: the state, the length of the step, the constants, the noise table.
_SOURCE = '''"""Generated: one tick of the bench on an array of its numbers."""

from numba import float64, int64, njit

{imports}

ACTUATION = (int64, int64, float64, float64, float64, int64)
MOMENT = (int64, int64, int64)


@njit((float64[::1], *ACTUATION, *MOMENT), cache=True, error_model="numpy")
def advance(x, a0, a1, a2, a3, a4, a5, fresh, stopped, tick):
    params = {params}
    state = {state}
    normals = x[{normals}:]
    wires = Actuation(a0, a1, a2, a3, a4, a5)
    state = step(params, state, wires, fresh, stopped, normals, x[{dt}])
    {store}
    read = sample(params, state, stopped, tick, normals)
    return {read}


def unpack(x):
    return {state}
'''


class CompiledStepper(Stepper):
    """A `Stepper` of the bench that runs compiled, on one array."""

    def __init__(self, start: Start) -> None:
        state = lift.numbers(start.state)
        self._code = _code(start)
        self._x = np.array([*state, start.dt, *lift.numbers(start.params), *start.normals])
        self._state = self._x[: len(state)]
        self._step = self._code.advance
        super().__init__(start)
        # The first call of compiled code takes milliseconds; not in a tick, please.
        self.advance(OFF, 0, 0, 0)
        self.state = start.state

    @property
    def state(self) -> BenchState:
        """The bench's state, rebuilt from the array."""
        state: BenchState = self._code.unpack(self._state.tolist())
        return state

    @state.setter
    def state(self, state: BenchState) -> None:
        self._state[:] = lift.numbers(state)

    def advance(self, actuation: Actuation, fresh: int, stopped: int, tick: int) -> Reading:
        """Step to ``tick``; give what sensors read there."""
        return tuple.__new__(Reading, self._step(self._x, *actuation, fresh, stopped, tick))


def _code(start: Start) -> Any:
    params, state = start.params, start.state
    names = lift.words(params) | lift.words(state) | {Actuation}
    imports = [f"from {kind.__module__} import {kind.__name__}" for kind in names]
    moment = len(lift.numbers(state))
    source = _SOURCE.format(
        imports="\n".join(
            [*sorted(imports), "from sim_plant.bench.dynamometer import sample, step"]
        ),
        params=lift.unpacking(params, "x", moment + 1),
        state=lift.unpacking(state, "x"),
        normals=moment + 1 + len(lift.numbers(params)),
        dt=moment,
        store="\n    ".join(lift.packing(state, "state", "x")),
        read="(" + ", ".join(f"read[{i}]" for i in range(len(Reading._fields))) + ")",
    )
    return lift.load("bench_step", source, _LIFTED)
