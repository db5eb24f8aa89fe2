"""The plant's step, compiled: the same functions, the same bits, less time.

The interpreted plant costs more than the loop it is there to exercise.
"""

from typing import Any

import numpy as np

from rig.sweep import lifting
from sim_plant import (
    analyser,
    body,
    bus,
    cots_drive,
    custom_drive,
    drive,
    electrics,
    magnetic_spring,
    pto,
    sensors,
    stator_force,
    surge,
    wavebot,
)
from sim_plant.signals import OFF, Actuation, Readings
from sim_plant.stepper import Start, Stepper
from sim_plant.wavebot import STILL, Excitation, Hoist, Probes, WaveBotParams, WaveBotState

LIFTED = (
    analyser, body, bus, cots_drive, custom_drive, drive, electrics, magnetic_spring, pto, sensors,
    stator_force, surge, wavebot,
)  # fmt: skip

# One array holds all numbers (handing over each array costs 0.2 us a tick): the state, the
# excitation at the present tick, the length of the step, the constants, the noise table. A plain
# tuple comes back: making the NamedTuple out here costs a third of numba's own way.
_SOURCE = '''"""Generated: one tick of the plant on an array of its numbers."""

from numba import float64, int64, njit

{imports}

ACTUATION = (float64, int64, float64, int64, float64, int64, int64)
MOMENT = (int64, float64, float64, int64, float64)


@njit((float64[::1], *ACTUATION, *MOMENT), cache=True, error_model="numpy")
def advance(x, a0, a1, a2, a3, a5, a6, a7, fresh, heave, surge, tick, elevation):
    params = {params}
    state = {state}
    now = {now}
    after = Excitation(heave, surge)
    wires = Actuation(a0, a1, a2, a3, 0, a5, a6, a7)
    state = step(params, state, wires, fresh, now, after, x[{dt}])
    {store}
    read = sample(params, state, tick, elevation, x[{normals}:])
    return {read}


def unpack(x):
    return {state}
'''


class CompiledStepper(Stepper):
    """A `Stepper` that runs compiled, on one array."""

    def __init__(self, start: Start) -> None:
        state = lifting.numbers(start.state)
        constants = lifting.numbers(start.params)
        moment = [*lifting.numbers(STILL), start.dt]
        self._code = _code(start)
        self._x = np.array([*state, *moment, *constants, *start.normals])
        self._state = self._x[: len(state)]
        self._moment = self._x[len(state) : len(state) + len(STILL)]
        first = len(state) + len(moment)
        self._constants = self._x[first : first + len(constants)]
        probes, hoist = len(Probes._fields), len(Hoist._fields)
        self._probes = self._state[-probes:]  # the last words of the state, the hoist before them
        self._hoist = self._state[-probes - hoist : -probes]
        self._step = self._code.advance
        super().__init__(start)
        # The first call of compiled code takes milliseconds; not in a tick, please.
        self.advance(OFF, 0, 0.0, 0.0, 0, 0.0)
        self.state, self.excitation = start.state, STILL

    @property
    def params(self) -> WaveBotParams:
        """The constants as they were last set."""
        return self._params

    @params.setter
    def params(self, params: WaveBotParams) -> None:
        self._params = params
        self._constants[:] = lifting.numbers(params)

    @property
    def state(self) -> WaveBotState:
        """The plant's state, rebuilt from the array."""
        state: WaveBotState = self._code.unpack(self._state.tolist())
        return state

    @state.setter
    def state(self, state: WaveBotState) -> None:
        self._state[:] = lifting.numbers(state)

    @property
    def excitation(self) -> Excitation:
        """Excitation at the present tick."""
        return Excitation(*self._moment.tolist())

    @excitation.setter
    def excitation(self, excitation: Excitation) -> None:
        self._moment[:] = excitation

    def advance(
        self,
        actuation: Actuation,
        fresh: int,
        heave: float,
        surge: float,
        tick: int,
        elevation: float,
    ) -> Readings:
        """Step to ``tick``, where the waves excite with heave and surge; give what sensors read."""
        current, enable, target, move, _, aside, hold, conducting = actuation
        return tuple.__new__(
            Readings,
            self._step(
                self._x, current, enable, target, move, aside, hold, conducting,
                fresh, heave, surge, tick, elevation,
            ),
        )  # fmt: skip

    def motion(self) -> tuple[float, float]:
        """Give heave position and velocity now."""
        return float(self._state[0]), float(self._state[1])

    def hold(self, hoist: Hoist) -> None:
        """Impose heave in the steps to come, or leave it free."""
        self._hoist[:] = hoist

    def see(self, probes: Probes) -> None:
        """Put a new sample of the basin probes on the wire."""
        self._probes[:] = probes


def _code(start: Start) -> Any:
    params, state = start.params, start.state
    names = lifting.words(params) | lifting.words(state) | {Actuation, Excitation}
    imports = [f"from {kind.__module__} import {kind.__name__}" for kind in names]
    after_state = len(lifting.numbers(state))
    after_moment = after_state + len(STILL) + 1
    store = [
        *lifting.packing(state, "state", "x"),
        *(f"x[{after_state + i}] = {name}" for i, name in enumerate(("heave", "surge"))),
    ]
    source = _SOURCE.format(
        imports="\n".join([*sorted(imports), "from sim_plant.wavebot import sample, step"]),
        params=lifting.unpacking(params, "x", after_moment),
        normals=after_moment + len(lifting.numbers(params)),
        state=lifting.unpacking(state, "x"),
        now=lifting.unpacking(STILL, "x", after_state),
        dt=after_moment - 1,
        store="\n    ".join(store),
        read="(" + ", ".join(f"read[{i}]" for i in range(len(Readings._fields))) + ")",
    )
    return lifting.load("plant_step", source, LIFTED)
