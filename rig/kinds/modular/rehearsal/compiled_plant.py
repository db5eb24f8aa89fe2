"""The compiled step of a plant of coupled modes: the same functions and bits in less time.

The sizes are numbers in an array, not constants of the source: one compilation serves all rigs.
"""

from collections.abc import Sequence

import numpy as np

from rig.compilation import lifting
from sim_plant import magnetic_spring, sensors, stator_force
from sim_plant.modes import plant, readings, springs
from sim_plant.modes.plant import ModesParams
from sim_plant.modes.world import Stepper
from sim_plant.parts import (
    bus,
    drag,
    drive,
    end_stop,
    friction,
    gear,
    hydraulic,
    linear_motor,
    mooring_line,
    spring,
)  # fmt: skip

LIFTED_MODULES = (
    bus, drag, drive, end_stop, friction, gear, hydraulic, linear_motor, mooring_line,
    magnetic_spring, stator_force, spring, springs, sensors, plant, readings,
)  # fmt: skip

_INTEGERS = ("source", "partner")
_SIZES = ("modes", "axes", "states", "line_count", "spring_count", "bus_count", "sensor_count")
_SEQUENCES = tuple(name for name in ModesParams._fields if name not in _SIZES)

# Slices of two arrays are made in compiled code: each array argument costs 0.2 us a tick.
_SOURCE = '''"""Generated: one tick of sim_plant.modes.plant on arrays."""

from numba import float64, int64, njit

from sim_plant.modes.plant import ModesParams, step
from sim_plant.modes.readings import sample


@njit((float64[::1], int64[::1], float64[::1], float64[::1], int64, int64, float64, float64),
      cache=True)
def advance(numbers, whole, inputs, readings, fresh, tick, elevation, dt):
    {slices}
    params = ModesParams({fields})
    state = numbers[whole[{state}] : whole[{state} + 1]]
    normals = numbers[whole[{state} + 1] :]
    n = params.modes
    excitation = inputs[:n]
    following = inputs[n : 2 * n]
    if fresh >= 0:
        step(params, state, inputs[2 * n :], fresh, excitation, following, dt)
    sample(params, state, tick, elevation, normals, readings)
    for i in range(n):
        excitation[i] = following[i]
'''


def _source() -> str:
    """Return the source; `whole` has the sizes, the starts of all slices, then the integers."""
    floats = [name for name in _SEQUENCES if name not in _INTEGERS]
    starts = len(_SIZES)
    lines, fields = [], {}
    for k, name in enumerate(floats):
        lines.append(f"f{k} = numbers[whole[{starts + k}] : whole[{starts + k + 1}]]")
        fields[name] = f"f{k}"
    state = starts + len(floats)
    integers = state + 3
    for k, name in enumerate(_INTEGERS):
        first = f"{integers} + {k} * whole[{_SIZES.index('states')}]"
        lines.append(f"i{k} = whole[{first} : {first} + whole[{_SIZES.index('states')}]]")
        fields[name] = f"i{k}"
    fields |= {name: f"whole[{k}]" for k, name in enumerate(_SIZES)}
    ordered = ", ".join(fields[name] for name in ModesParams._fields)
    return _SOURCE.format(slices="\n    ".join(lines), fields=ordered, state=state)


class CompiledStepper(Stepper):
    """A `Stepper` that runs compiled, on arrays."""

    def __init__(
        self, params: ModesParams, state: list[float], normals: Sequence[float], dt: float
    ) -> None:
        super().__init__(params, state, normals, dt)
        floats = [getattr(params, name) for name in _SEQUENCES if name not in _INTEGERS]
        parts = [*floats, self.state, normals]
        starts = np.cumsum([0, *map(len, parts)])
        integers = [number for name in _INTEGERS for number in getattr(params, name)]
        sizes = [getattr(params, name) for name in _SIZES]
        self._numbers = np.concatenate([np.asarray(part, np.float64) for part in parts])
        self._whole = np.array([*sizes, *starts, *integers], np.int64)
        self._array = self._numbers[starts[len(floats)] : starts[len(floats) + 1]]
        n = params.modes
        self._inputs = np.zeros(2 * n + 2 * params.axes)
        self._present = self._inputs[:n]
        self._following = self._inputs[n : 2 * n]
        self._drives = self._inputs[2 * n :]
        self._output = np.zeros(len(self._readings))
        self._advance = lifting.load("modes_step", _source(), LIFTED_MODULES).advance
        self.readings(0, 0.0)  # the first call takes milliseconds, so it must not be in a tick

    def set_excitation(self, excitation: Sequence[float]) -> None:
        """Set the excitation of the modes at the present tick, N or N m."""
        self._present[:] = excitation
        self._following[:] = excitation

    def advance(
        self,
        drives: Sequence[float],
        fresh: int,
        excitation: Sequence[float],
        tick: int,
        elevation: float,
    ) -> tuple[float, ...]:
        """Step to `tick` with the excitation there; return the readings."""
        self._drives[:] = drives
        self._following[:] = excitation
        self._call(fresh, tick, elevation)
        return tuple(self._output.tolist())

    def readings(self, tick: int, elevation: float) -> tuple[float, ...]:
        """Return the sensor readings at the present state."""
        self._following[:] = self._present
        self._call(-1, tick, elevation)
        return tuple(self._output.tolist())

    def numbers(self) -> list[float]:
        """Return the present state."""
        numbers: list[float] = self._array.tolist()
        return numbers

    def set_motion(self, position: Sequence[float], velocity: Sequence[float]) -> None:
        """Set positions and velocities of the modes, and of the motors that move with them."""
        state = self.numbers()
        plant.place(self._params, state, position, velocity)
        self._array[:] = state

    def _call(self, fresh: int, tick: int, elevation: float) -> None:
        self._advance(
            self._numbers, self._whole, self._inputs, self._output, fresh, tick, elevation, self._dt
        )
