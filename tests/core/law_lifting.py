"""One law compiled by rig/compilation/lifting.py, for comparison with the interpreted law."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from controllers import biquads, blocks
from rig.compilation import lifting

DT = 0.001
Inputs = tuple[Any, ...]

_SOURCE = '''"""Generated: one tick of a law on arrays of its numbers."""

import numpy
from numba import njit

{imports}


@njit(cache=True, error_model="numpy")
def tick({arguments}):
    params = {params}
    state = {state}
    {result} = step({call})
    out = numpy.empty({size})
    {store}
    return out
'''


class Law(NamedTuple):
    """A law with inputs and outputs of its step."""

    module: ModuleType
    params: Any
    start: Any
    inputs: Callable[[np.random.Generator, int], Inputs]  # of one tick
    returns: str = "state, given"  # outputs of `step`: one of them or both
    takes_dt: bool = True  # `step` takes dt
    table: str = ""  # field of params that is an array in compiled code
    min_outcomes: int = 1000  # different outcomes required in a test


def interpreted(law: Law, state: Any, inputs: Inputs) -> Any:
    """Return the law's result for a state and inputs."""
    return law.module.step(law.params, state, *inputs, *((DT,) if law.takes_dt else ()))


def state_of(law: Law, returned: Any) -> Any:
    """Return the new state in the result of `step`."""
    return returned[0] if law.returns == "state, given" else returned


def same_bits(one: list[float], other: list[float]) -> bool:
    """Return whether both are equal bit by bit, all NaNs being equal."""
    return len(one) == len(other) and all(
        (math.isnan(a) and math.isnan(b)) or struct.pack("d", a) == struct.pack("d", b)
        for a, b in zip(one, other, strict=True)
    )


def compiled(law: Law) -> Callable[[Any, Inputs], list[float]]:
    """Return the compiled tick: state and inputs -> the numbers of the result of `step`."""
    example = law.inputs(np.random.default_rng(0), 0)
    returned = interpreted(law, law.start, example)
    parts, fixed = [], []
    for name, part in zip(law.params._fields, law.params, strict=True):
        parts.append("table" if name == law.table else lifting.unpack_source(part, "x", len(fixed)))
        fixed += [] if name == law.table else lifting.flatten(part)
    at = len(fixed) + len(lifting.flatten(law.start))
    call = ["params", "state"]
    for one in example:
        call.append(lifting.unpack_source(one, "x", at))
        at += len(lifting.flatten(one))
    if law.takes_dt:
        call.append(repr(DT))
    names = (
        lifting.tuple_types(law.params)
        | lifting.tuple_types(law.start)
        | lifting.tuple_types(example)
    )
    imports = sorted(f"from {kind.__module__} import {kind.__name__}" for kind in names)
    store = lifting.pack_source(returned, f"({law.returns})", "out")
    source = _SOURCE.format(
        imports="\n".join([*imports, f"from {law.module.__name__} import step"]),
        arguments="x, table" if law.table else "x",
        params=f"{type(law.params).__name__}({', '.join(parts)})",
        state=lifting.unpack_source(law.start, "x", len(fixed)),
        result=law.returns,
        call=", ".join(call),
        size=len(store),
        store="\n    ".join(store),
    )
    name = law.module.__name__.replace(".", "_")
    code = lifting.load(name, source, (blocks, biquads, law.module))
    table = (np.array(getattr(law.params, law.table)),) if law.table else ()

    def tick(state: Any, inputs: Inputs) -> list[float]:
        x = np.array([*fixed, *lifting.flatten(state), *lifting.flatten(inputs)])
        return [float(number) for number in code.tick(x, *table)]

    return tick
