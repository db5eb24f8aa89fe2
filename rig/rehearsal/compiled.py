"""The plant's step, compiled: the same functions, the same bits, less time.

The interpreted plant costs as much as the loop it is there to exercise.
"""

from typing import Any

import numpy as np

from rig import lift
from sim_plant import body, drive, magnetic_spring, pto, sensors, wavebot
from sim_plant.wavebot import Actuation, Readings, WaveBotParams, WaveBotState
from sim_plant.world import OFF, Stepper

_LIFTED = (body, drive, magnetic_spring, pto, sensors, wavebot)

_SOURCE = '''"""Generated: one tick of the plant on arrays of its numbers."""

from numba import float64, int64, njit

{imports}

ARRAY = float64[::1]
ACTUATION = (float64, int64, float64, int64, int64, float64, int64, int64)
MOMENT = (int64, float64, float64, int64, float64, float64)


@njit((ARRAY, *ACTUATION, *MOMENT), cache=True, error_model="numpy")
def advance(x, a0, a1, a2, a3, a4, a5, a6, a7, fresh, now, after, tick, elevation, dt):
    params = {params}
    state = {state}
    state = step(params, state, Actuation(a0, a1, a2, a3, a4, a5, a6, a7), fresh, now, after, dt)
    {store}
    return sample(params, state, tick, elevation, x[{normals}:])


def unpack(x):
    return {state}
'''


class CompiledStepper(Stepper):
    """A `Stepper` that runs compiled, on one array: handing over each array costs 0.2 us a tick."""

    def __init__(self, params: WaveBotParams, state: WaveBotState, normals: list[float]) -> None:
        self._code = _code(params, state)
        numbers = lift.numbers(state)
        self._x = np.array([*numbers, *lift.numbers(params), *normals])
        self._state = self._x[: len(numbers)]
        self._step = self._code.advance
        super().__init__(params, state, normals)
        # The first call of compiled code takes milliseconds; not in a tick, please.
        self.advance(OFF, 0, 0.0, 0.0, 0, 0.0, 0.001)
        self.state = state

    @property
    def state(self) -> WaveBotState:
        """The plant's state, rebuilt from the array."""
        state: WaveBotState = self._code.unpack(self._state.tolist())
        return state

    @state.setter
    def state(self, state: WaveBotState) -> None:
        self._state[:] = lift.numbers(state)

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        excitation_now: float,
        excitation_next: float,
        tick: int,
        elevation: float,
        dt: float,
    ) -> Readings:
        """Step to ``tick`` and give what the sensors read there."""
        current, enable, target, move, trigger, surge, hold, conducting = actuation
        read: Readings = self._step(
            self._x,
            current,
            enable,
            target,
            move,
            trigger,
            surge,
            hold,
            conducting,
            fresh,
            excitation_now,
            excitation_next,
            tick,
            elevation,
            dt,
        )
        return read


def _code(params: WaveBotParams, state: WaveBotState) -> Any:
    names = lift.words(params) | lift.words(state) | {Actuation}
    imports = [f"from {kind.__module__} import {kind.__name__}" for kind in names]
    after_state = len(lift.numbers(state))
    source = _SOURCE.format(
        imports="\n".join([*sorted(imports), "from sim_plant.wavebot import sample, step"]),
        params=lift.unpacking(params, "x", after_state),
        normals=after_state + len(lift.numbers(params)),
        state=lift.unpacking(state, "x"),
        store="\n    ".join(lift.packing(state, "state", "x")),
    )
    return lift.load("plant_step", source, _LIFTED)
