"""The source of a rig's compiled tick, and the folder that holds its code; without the compiler.

The tick is `rig.realtime.cycle.make` of the kind with all the functions that it calls, which stay
plain Python. The generated function reads parameters, state and readings from the memory of a tick
(`rig.realtime.tick_memory`), and stores state, command and row there; or it executes many ticks
together with a simulated plant (`rig.realtime.coupled_ticks`).
"""

import hashlib
import importlib
import inspect
import sys
from collections.abc import Iterable, Iterator
from enum import Enum
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from rig.compilation.cache_folder import bound_texts, bound_values, code_folder, code_text
from rig.realtime import coupled_ticks, cycle, tick_memory
from rig.realtime.coupled_ticks import Coupling
from rig.realtime.safety import STOP_0
from rig.realtime.sequence import CHOICE
from rig.realtime.tick_memory import FlatMemory, Table
from rig.recording.row_layout import leaves

_HEAD = '''"""Generated: ticks of a rig on their memory.

{generated}
"""

import importlib

from numba import njit
from numba.extending import register_jitable

{imports}
from rig.compilation.memory_access import *
from rig.realtime import cycle

find_kind = importlib.import_module("{tick}").find_kind
step = register_jitable(forceinline=True)(cycle.make(find_kind({law!r})))
{accesses}
store_row = storer({row})
'''

_TICK = """

@njit("int64(int64)", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def tick(m):
    header = load_header(m)
    timing = cycle.Timing(header.lateness, header.work, header.skipped)
    state, command, row = step(
        load_params(m + {at_params}), load_state(m + {at_state}), load_sense(m + {at_sense}),
        header.request, header.tick, timing, header.periods, header.dt,
    )
    store_row(header.row, row)
    store_state(m + {at_state}, state)
    store_command(m + {at_command}, command)
    return state.safety.mode
"""

# Parameters are loaded once a call: loaded in each tick, they would cost a third of its time. The
# state stays in memory from tick to tick: as a variable of the loop, all its numbers would be alive
# at once, and the compiler would take many minutes.
_COUPLED = """
{plant_imports}

NO_TIMING = cycle.Timing(0.0, 0.0, 0)
store_executed = storer(INT)


@register_jitable(forceinline=True)
def tick_once(m, header, params, plant, tick, out):
    device = load_device(m + {at_device})
    dt = header.dt
    if tick > 0:
        device = {advance}
    sensed = {sense_plant}
    state, command, row = step(
        params, load_state(m + {at_state}), sensed, header.request, tick, NO_TIMING, 1, dt,
    )
    device, interrupted = {actuate}
    store_row(out, row)
    store_state(m + {at_state}, state)
    store_device(m + {at_device}, device)
    awaits = params.segments.phase[state.sequence.segment] == {choice}
    return 1 if interrupted or awaits or state.safety.mode == {stop_0} else 0


@njit("int64(int64)", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def tick(m):
    header = load_header(m)
    params = load_params(m + {at_params})
    plant = load_plant(m + {at_plant})
    tick, out, ended = header.tick, header.row, 0
    end = tick + header.max_ticks
    while tick < end and ended == 0:
        ended = tick_once(m, header, params, plant, tick, out)
        tick += 1
        store_executed(m + {at_executed}, tick - header.tick)
        out += {row_size}
    return tick - header.tick
"""


_WRITTEN = ("state", "command", "device")  # sections that ticks change
_NUMBERS = {"d": "FLOAT", "q": "INT"}


class PlantCode(NamedTuple):
    """A simulated plant's part of compiled ticks of loop and plant.

    The expressions are source text over ``plant`` (constants), ``device`` (state), ``tick`` and
    ``dt``.
    """

    functions: tuple[Any, ...]  # that the expressions call, each by its own name
    advance: str = "advance_plant(plant, device, tick, dt)"  # the device one tick later
    sense: str = "sense(device.in_transit[0], plant.age)"  # the loop's input
    actuate: str = "actuate(plant, device, command, dt)"
    """Over ``command``, too: the device, and whether the ticks are to be interrupted."""

    @property
    def imports(self) -> str:
        """The lines that import the functions."""
        return "\n".join(f"from {f.__module__} import {f.__name__}" for f in self.functions)


class TickSource(NamedTuple):
    """The source of a tick, and the functions and modules that it needs."""

    text: str
    functions: tuple[FunctionType, ...]  # plain functions that it calls
    modules: tuple[ModuleType, ...]  # that it depends on
    many_ticks: bool  # of a call; other threads may run meanwhile

    @property
    def folder(self) -> Path:
        """The folder of the code on this host, which exists once it is compiled."""
        return code_folder(self.text, self.modules)


def tick_source(
    tick: str, law: str, params: cycle.Params, dt: float, kind: cycle.Kind | None = None
) -> TickSource:
    """Return the source for the package of a kind's tick, its law, and parameters.

    ``kind``: by default that of the package for the law. Raises ValueError for a kind that cannot
    be compiled because its ``sense_type`` is not known.
    """
    kind = kind or importlib.import_module(tick).find_kind(law)
    if kind.sense_type is None:
        raise ValueError(f"{tick} does not give the type of its readings (Kind.sense_type)")
    memory = tick_memory.of_kind(kind, params, cycle.start(kind, params, 0), dt)
    return _source(_TICK, tick, law, kind, memory, ())


def coupled_source(
    tick: str, law: str, params: cycle.Params, coupling: Coupling, code: PlantCode
) -> TickSource:
    """Return the source of the ticks of a kind together with a simulated plant."""
    kind: cycle.Kind = importlib.import_module(tick).find_kind(law)
    memory = coupled_ticks.memory_of(params, cycle.start(kind, params, 0), coupling)
    return _source(
        _COUPLED,
        tick,
        law,
        kind,
        memory,
        code.functions,
        plant_imports=code.imports,
        advance=code.advance,
        sense_plant=code.sense,
        actuate=code.actuate,
        stop_0=STOP_0,
        choice=CHOICE,
        at_executed=memory.start_of("header", "executed"),
    )


def _source(
    body: str,
    tick: str,
    law: str,
    kind: cycle.Kind,
    memory: FlatMemory,
    others: Iterable[Any],
    **texts: Any,
) -> TickSource:
    """Return the source with a body; ``others``: functions that it calls besides the cycle's."""
    names: dict[type, str] = {}
    accesses = []
    for name, (tree, start, _) in memory.sections.items():
        kind_of_section = _numba_type(tree, names)
        accesses.append(f"load_{name} = loader({kind_of_section})")
        if name in _WRITTEN:
            accesses.append(f"store_{name} = storer({kind_of_section})")
        texts[f"at_{name}"] = start
    row = leaves(kind.row_type)
    needed = dependencies(kind, others, names)
    text = (_HEAD + body).format(
        imports="\n".join(
            f"from {each.__module__} import {each.__qualname__} as {name}"
            for each, name in names.items()
        ),
        generated=f"Byte code of its functions without a file: {needed.digest}",
        tick=tick,
        law=law,
        accesses="\n".join(accesses),
        row=f"plain({', '.join(_NUMBERS[leaf.code] for leaf in row)})",
        row_size=8 * len(row),
        **texts,
    )
    own = (tick_memory, sys.modules[__name__])
    return TickSource(text, needed.functions, (*own, *needed.modules), body is _COUPLED)


def _numba_type(tree: Any, names: dict[type, str]) -> str:
    """Return the expression of the type of a tree (`rig.compilation.memory_access`)."""
    if isinstance(tree, Table):
        return f"{_NUMBERS[tree.code]}S"
    if not isinstance(tree, tuple):
        return _NUMBERS["q" if isinstance(tree, int) else "d"]
    parts = [_numba_type(member, names) for member in tree]
    if not tick_memory.is_named(tree):
        return f"plain({', '.join(parts)})"
    name = names.setdefault(type(tree), f"T{len(names)}")
    return f"record({', '.join([name, *parts])})"


class Dependencies(NamedTuple):
    """All that compiled ticks of a kind are made of."""

    functions: tuple[FunctionType, ...]  # plain functions, besides the cycle's step
    modules: tuple[ModuleType, ...]  # of functions, types and constants
    digest: str  # of functions that were written by the program, and of values in closures


def dependencies(
    kind: cycle.Kind, others: Iterable[Any], known: Iterable[type] = ()
) -> Dependencies:
    """Return what the cycle of a kind and ``others``, functions and types, depend on.

    ``known``: further types.
    """
    step = cycle.make(kind)
    found = all_of((step, *others), known)
    return found._replace(functions=tuple(each for each in found.functions if each is not step))


def all_of(first: Iterable[Any], known: Iterable[type] = ()) -> Dependencies:
    """Return what functions and types depend on, the functions themselves included."""
    called = list(reachable(*first))
    used = {each.__name__ for each in called if isinstance(each, ModuleType)}
    called = [each for each in called if not isinstance(each, ModuleType)]
    owners = (used | {each.__module__ for each in (*called, *known)}) & sys.modules.keys()
    functions = tuple(each for each in called if inspect.isfunction(each))
    modules = tuple(sys.modules[name] for name in sorted(owners))
    return Dependencies(functions, modules, _digest(functions))


def reachable(*first: Any) -> Iterator[Any]:
    """Yield functions and types, and all that they may use, each once.

    That is plain functions, types of NamedTuples, enumerations, and modules of this project or of a
    user from which a function reads, also modules in packages and those of functions that a user
    has compiled.
    """
    seen: set[Any] = set()
    waiting = [*first]
    while waiting:
        each = waiting.pop()
        compiled = getattr(each, "py_func", None)  # by a user
        each = compiled or each
        is_type = isinstance(each, type) and issubclass(each, tuple | Enum)
        if not (is_type or inspect.isfunction(each)) or each in seen:
            continue
        seen.add(each)
        if compiled is None:
            yield each
        if is_type:
            continue
        values, modules = _values_and_modules(each)
        if compiled is not None:
            modules.add(sys.modules[each.__module__])
        waiting += values
        yield from modules - seen
        seen |= modules


def _values_and_modules(function: FunctionType) -> tuple[list[Any], set[ModuleType]]:
    """Return the values that a function may use, and the modules from which it reads them."""
    values, names = bound_values(function), set(_names(function.__code__))
    waiting = [function.__globals__.get(name) for name in names]
    modules: set[ModuleType] = set()
    while waiting:
        value = waiting.pop()
        if not isinstance(value, ModuleType):
            values.append(value)
        elif value not in modules:
            modules.add(value)
            waiting += [getattr(value, name, None) for name in names]
    return values, {*filter(_has_own_source, modules)}


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _has_own_source(module: ModuleType) -> bool:
    """Return whether a module is neither built in nor of a library whose version is in the hash."""
    root = module.__name__.partition(".")[0]
    return root not in (*sys.stdlib_module_names, "numba", "numpy") and hasattr(module, "__file__")


def _digest(functions: Iterable[FunctionType]) -> str:
    """Return a hash of functions without a file, and of the constants bound to all of them."""
    texts = []
    for each in functions:
        if each.__code__.co_filename.startswith("<"):
            texts.append(code_text(each.__code__))
        texts += [f"{each.__name__} {text}" for text in bound_texts(each)]
    return hashlib.sha256("\n".join(sorted(texts)).encode()).hexdigest()
