"""The compiled step of a simulated plant, generated from its `step` and `sample` functions."""

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

import numpy as np

from rig.compilation import lifting

# One array holds all numbers (each array argument costs 0.2 us a tick): the state, the length of
# the step, the constants, the noise table. The function returns a plain tuple: making the
# NamedTuple outside costs a third of its conversion by numba.
_SOURCE_TEMPLATE = '''"""Generated: one tick of {module} on an array of its numbers."""

from numba import float64, int64, njit

{imports}


@njit((float64[::1], {types}), cache=True)
def advance(x, {arguments}):
    params = {params}
    state = {state}
    dt = x[{dt}]
    normals = x[{normals}:]
    {body}
    {store}
    return {read}


def unpack(x):
    return {state}
'''


class PlantStep:
    """A compiled step and the array on which it works."""

    def __init__(
        self,
        module: ModuleType,
        lifted: Iterable[ModuleType],
        arguments: Mapping[str, str],
        body: Iterable[str],
        *,
        state: Any,
        params: Any,
        dt: float,
        normals: Iterable[float],
        imported: Iterable[type],
        reading: type,
    ) -> None:
        """Compile the step, or load it from the cache.

        ``module``: defines `step` and `sample`. ``arguments``: name and numba type of each. Lines
        of the ``body`` read these, `params`, `state`, `dt` and `normals`; they set `state` and
        `read`, a ``reading``. ``imported``: types that they use.
        """
        numbers, constants = lifting.flatten(state), lifting.flatten(params)
        first = len(numbers) + 1
        types = lifting.tuple_types(params) | lifting.tuple_types(state) | set(imported)
        imports = sorted(f"from {kind.__module__} import {kind.__name__}" for kind in types)
        source = _SOURCE_TEMPLATE.format(
            module=module.__name__,
            imports="\n".join([*imports, f"from {module.__name__} import sample, step"]),
            types=", ".join(arguments.values()),
            arguments=", ".join(arguments),
            params=lifting.unpack_source(params, "x", first),
            state=lifting.unpack_source(state, "x"),
            dt=len(numbers),
            normals=first + len(constants),
            body="\n    ".join(body),
            store="\n    ".join(lifting.pack_source(state, "state", "x")),
            read="(" + ", ".join(f"read[{i}]" for i in range(len(reading._fields))) + ")",  # type: ignore[attr-defined]
        )
        name = f"{module.__name__.rpartition('.')[2]}_step"
        self.code = lifting.load(name, source, lifted)
        self.array = np.array([*numbers, dt, *constants, *normals])
        self.numbers = self.array[: len(numbers)]  # of the state
        self.constants = self.array[first : first + len(constants)]
        # The first call of compiled code takes milliseconds, so it must not be in a tick.
        self.code.advance(self.array, *(0 for _ in arguments))
        self.state = state

    @property
    def state(self) -> Any:
        """The state, rebuilt from the array."""
        return self.code.unpack(self.numbers.tolist())

    @state.setter
    def state(self, state: Any) -> None:
        self.numbers[:] = lifting.flatten(state)
