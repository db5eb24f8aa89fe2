"""The compiled step of the WaveBot's plant: the same functions and bits in less time.

The interpreted plant takes more time than the loop that it tests.
"""

from typing import Any

import numpy as np

from rig.compilation import lifting
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
from sim_plant.stepper import Stepper, StepperInputs
from sim_plant.wavebot import NO_EXCITATION, Excitation, Hoist, Probes, WaveBotParams, WaveBotState

LIFTED_MODULES = (
    analyser, body, bus, cots_drive, custom_drive, drive, electrics, magnetic_spring, pto, sensors,
    stator_force, surge, wavebot,
)  # fmt: skip

# One array holds all numbers (each array argument costs 0.2 us a tick): the state, the excitation
# at the present tick, the length of the step, the constants, the noise table. The function returns
# a plain tuple: making the NamedTuple outside costs a third of its conversion by numba.
_SOURCE_TEMPLATE = '''"""Generated: one tick of the plant on an array of its numbers."""

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
    actuation = Actuation(a0, a1, a2, a3, 0, a5, a6, a7)
    state = step(params, state, actuation, fresh, now, after, x[{dt}])
    {store}
    read = sample(params, state, tick, elevation, x[{normals}:])
    return {read}


def unpack(x):
    return {state}
'''


class CompiledStepper(Stepper):
    """A `Stepper` that runs compiled, on one array."""

    def __init__(self, start: StepperInputs) -> None:
        state = lifting.flatten(start.state)
        constants = lifting.flatten(start.params)
        moment = [*lifting.flatten(NO_EXCITATION), start.dt]
        self._code = _compile_step(start)
        self._x = np.array([*state, *moment, *constants, *start.normals])
        self._state = self._x[: len(state)]
        self._moment = self._x[len(state) : len(state) + len(NO_EXCITATION)]
        first = len(state) + len(moment)
        self._constants = self._x[first : first + len(constants)]
        probes, hoist = len(Probes._fields), len(Hoist._fields)
        self._probes = self._state[-probes:]  # the last numbers of the state, the hoist before them
        self._hoist = self._state[-probes - hoist : -probes]
        self._step = self._code.advance
        super().__init__(start)
        # The first call of compiled code takes milliseconds, so it must not be in a tick.
        self.advance(OFF, 0, 0.0, 0.0, 0, 0.0)
        self.state, self.excitation = start.state, NO_EXCITATION

    @property
    def params(self) -> WaveBotParams:
        """The constants that were set last."""
        return self._params

    @params.setter
    def params(self, params: WaveBotParams) -> None:
        self._params = params
        self._constants[:] = lifting.flatten(params)

    @property
    def state(self) -> WaveBotState:
        """The plant's state, rebuilt from the array."""
        state: WaveBotState = self._code.unpack(self._state.tolist())
        return state

    @state.setter
    def state(self, state: WaveBotState) -> None:
        self._state[:] = lifting.flatten(state)

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
        """Step to ``tick`` with the excitation in heave and surge; return the sensors' readings."""
        current, enable, target, move, _, surge_current, surge_enable, conducting = actuation
        return tuple.__new__(
            Readings,
            self._step(
                self._x, current, enable, target, move, surge_current, surge_enable, conducting,
                fresh, heave, surge, tick, elevation,
            ),
        )  # fmt: skip

    def motion(self) -> tuple[float, float]:
        """Return the present heave position and velocity."""
        return float(self._state[0]), float(self._state[1])

    def set_hoist(self, hoist: Hoist) -> None:
        """Impose heave in the following steps, or leave it free."""
        self._hoist[:] = hoist

    def set_probes(self, probes: Probes) -> None:
        """Set a new sample of the basin probes."""
        self._probes[:] = probes


def _compile_step(start: StepperInputs) -> Any:
    params, state = start.params, start.state
    names = lifting.tuple_types(params) | lifting.tuple_types(state) | {Actuation, Excitation}
    imports = [f"from {kind.__module__} import {kind.__name__}" for kind in names]
    after_state = len(lifting.flatten(state))
    after_moment = after_state + len(NO_EXCITATION) + 1
    store = [
        *lifting.pack_source(state, "state", "x"),
        *(f"x[{after_state + i}] = {name}" for i, name in enumerate(("heave", "surge"))),
    ]
    source = _SOURCE_TEMPLATE.format(
        imports="\n".join([*sorted(imports), "from sim_plant.wavebot import sample, step"]),
        params=lifting.unpack_source(params, "x", after_moment),
        normals=after_moment + len(lifting.flatten(params)),
        state=lifting.unpack_source(state, "x"),
        now=lifting.unpack_source(NO_EXCITATION, "x", after_state),
        dt=after_moment - 1,
        store="\n    ".join(store),
        read="(" + ", ".join(f"read[{i}]" for i in range(len(Readings._fields))) + ")",
    )
    return lifting.load("plant_step", source, LIFTED_MODULES)
