"""The cycle of a rig compiled to object code that the loop process loads without a compiler.

The cycle is `rig.realtime.cycle.make` of the kind, with the functions that it calls in plain
Python. The generated function reads parameters, state and readings from the memory of a tick
(`rig.realtime.tick_memory`), and stores state, command and row there.
"""

import hashlib
import inspect
import marshal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from llvmlite import binding, ir

from rig.compilation import lifting, memory_access
from rig.compilation.cache_folder import write_bytes_atomically
from rig.realtime import cycle, tick_memory
from rig.realtime.compiled_tick import ENTRY, FILES
from rig.realtime.tick_memory import Table, TickMemory
from rig.recording.row_layout import leaves

_SOURCE = '''"""Generated: one tick of a rig on its memory. Functions without a source: {generated}."""

import importlib

from numba import njit
from numba.extending import register_jitable

{imports}
from rig.compilation.memory_access import *
from rig.realtime import cycle

find_kind = importlib.import_module("{tick}").find_kind
step = register_jitable(forceinline=True)(cycle.make(find_kind({law!r})))


@njit("int64(int64)", error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def tick(m):
    header = {header}
    params = {params}
    state = {state}
    sense = {sense}
    timing = cycle.Timing(header.lateness, header.work, header.skipped)
    state, command, row = step(
        params, state, sense, header.request, header.tick, timing, header.periods, header.dt
    )
    out = header.row
    {stores}
    return state.safety.mode
'''
_FAILED = "the compiled tick raised an exception"


class UncompilableError(ValueError):
    """A cycle that cannot be compiled; the message gives the reason."""


def compile_tick(tick: str, law: str, params: cycle.Params, sense: Any, dt: float) -> Path:
    """Return the folder with the object code of a cycle, compiled if the cache does not have it.

    ``tick``: package of the kind's tick; ``law``: for its `find_kind`; ``sense``: an example.
    Raises UncompilableError with the reason.
    """
    kind = sys.modules[tick].find_kind(law)
    source, modules = tick_source(tick, law, kind, params, sense, dt)
    folder = lifting.cache_folder(source, modules)
    if all((folder / name).exists() for name in FILES):
        return folder
    try:
        module = lifting.load("tick", source, ())
        objects = _objects(module.tick)
    except Exception as error:  # numba raises what it likes
        raise UncompilableError(str(error)) from error
    for name, content in zip(FILES, objects, strict=True):
        write_bytes_atomically(folder / name, content)
    return folder


def tick_source(
    tick: str, law: str, kind: cycle.Kind, params: cycle.Params, sense: Any, dt: float
) -> tuple[str, tuple[ModuleType, ...]]:
    """Return the source of the tick, and the modules on which its code depends; lift them."""
    step = cycle.make(kind)
    state = cycle.start(kind, params, 0)
    _, command, _ = step(params, state, sense, 0, 0, cycle.Timing(0.0, 0.0, 0), 1, dt)
    memory = TickMemory(params, state, sense, command, dt)
    names: dict[type, str] = {}
    trees = dict(zip(memory.sections._fields, memory.sections, strict=True))
    starts = dict(zip(memory.sections._fields, memory.starts, strict=True))
    loads = {name: _load(trees[name], starts[name] // 8, names)[0] for name in trees}
    stores = [
        *_stores(state, "state", starts["state"] // 8),
        *_stores(command, "command", starts["command"] // 8),
        *(
            f"store_{'int' if leaf.code == 'q' else 'float'}(out, {i}, row.{leaf.name})"
            for i, leaf in enumerate(leaves(kind.row_type))
        ),
    ]
    found = list(reachable(step))
    modules = {sys.modules[each.__module__] for each in found if each.__module__ in sys.modules}
    modules |= {sys.modules[kind.__module__] for kind in names}
    lifting.lift_functions(found[1:])
    source = _SOURCE.format(
        imports="\n".join(
            f"from {kind.__module__} import {kind.__qualname__} as {name}"
            for kind, name in names.items()
        ),
        tick=tick,
        law=law,
        generated=_digest(each for each in found if each.__module__ not in sys.modules),
        stores="\n    ".join(stores),
        **{name: loads[name] for name in ("header", "params", "state", "sense")},
    )
    fixed = (memory_access, tick_memory, sys.modules[__name__])
    return source, (*fixed, *sorted(modules, key=lambda module: module.__name__))


def _load(tree: Any, at: int, names: dict[type, str]) -> tuple[str, int]:
    """Return the expression that reads a tree from number ``at`` on, and the number after it."""
    if isinstance(tree, Table):
        kind = "int" if tree.code == "q" else "float"
        return f"{kind}_column(load_int(m, {at}), load_int(m, {at + 1}))", at + 2
    if not isinstance(tree, tuple):
        return f"load_{'int' if isinstance(tree, int) else 'float'}(m, {at})", at + 1
    parts = []
    for member in tree:
        part, at = _load(member, at, names)
        parts.append(part)
    if not tick_memory.is_named(tree):
        return f"({''.join(f'{part}, ' for part in parts)})", at
    name = names.setdefault(type(tree), f"T{len(names)}")
    return f"{name}({', '.join(parts)})", at


def _stores(tree: Any, name: str, at: int) -> Iterator[str]:
    """Yield the statements that store a tree from number ``at`` on."""
    places = iter(range(at, sys.maxsize))

    def visit(part: Any, text: str) -> Iterator[str]:
        if isinstance(part, tuple):
            for i, member in enumerate(part):
                yield from visit(member, f"{text}[{i}]")
        else:
            yield f"store_{'int' if isinstance(part, int) else 'float'}(m, {next(places)}, {text})"

    return visit(tree, name)


def reachable(function: Any) -> Iterator[FunctionType]:
    """Yield a function and all plain functions that it may call, each once."""
    seen: set[Any] = set()
    waiting = [function]
    while waiting:
        each = waiting.pop()
        if each in seen or not inspect.isfunction(each):
            continue
        seen.add(each)
        yield each
        for cell in each.__closure__ or ():
            waiting.append(cell.cell_contents)
        names = set(_names(each.__code__))
        for name in names:
            value = each.__globals__.get(name)
            if isinstance(value, ModuleType):
                waiting += [getattr(value, attribute, None) for attribute in names]
            else:
                waiting.append(value)


def _digest(functions: Iterable[FunctionType]) -> str:
    """Return a hash of functions that have no source, by their byte code."""
    codes = sorted(marshal.dumps(each.__code__) for each in functions)
    return hashlib.sha256(b"".join(codes)).hexdigest()


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _objects(function: Any) -> tuple[bytes, bytes]:
    """Return the object code of a compiled function, and of its entry for Python."""
    (compiled,) = function.overloads.values()
    _, kind, (code, *_) = compiled.library.serialize_using_object_code()
    assert kind == "object" or code
    return code, _entry(compiled.fndesc.llvm_func_name)


def _entry(symbol: str) -> bytes:
    """Return the object code of a function for METH_NOARGS that calls the tick.

    Its first argument is a `bytes` with the address of the memory. It returns the tick's result,
    or raises if the tick did.
    """
    module = ir.Module("entry")
    module.triple = binding.get_process_triple()
    pointer, status, number = ir.PointerType(), ir.IntType(32), ir.IntType(64)
    call = ir.FunctionType(status, [pointer, pointer, number])
    tick = ir.Function(module, call, symbol)
    from_int = ir.Function(module, ir.FunctionType(pointer, [number]), "PyLong_FromLongLong")
    fail = ir.Function(
        module, ir.FunctionType(ir.VoidType(), [pointer, pointer]), "PyErr_SetString"
    )
    error = ir.GlobalVariable(module, pointer, "PyExc_ArithmeticError")
    text = ir.Constant(
        ir.ArrayType(ir.IntType(8), len(_FAILED) + 1), bytearray(f"{_FAILED}\0".encode())
    )
    message = ir.GlobalVariable(module, text.type, "message")
    message.initializer, message.global_constant, message.linkage = text, True, "internal"
    entry = ir.Function(module, ir.FunctionType(pointer, [pointer, pointer]), ENTRY)
    builder = ir.IRBuilder(entry.append_basic_block())
    offset = ir.Constant(number, sys.getsizeof(b"") - 1)  # of the bytes in a `bytes`
    place = builder.gep(entry.args[0], [offset], source_etype=ir.IntType(8))
    memory = builder.load(place, typ=number)
    result, exception = builder.alloca(number), builder.alloca(pointer)
    ended = builder.call(tick, [result, exception, memory])
    with builder.if_then(builder.icmp_signed("!=", ended, status(0)), likely=False):
        builder.call(fail, [builder.load(error, typ=pointer), message])
        builder.ret(pointer(None))
    builder.ret(builder.call(from_int, [builder.load(result, typ=number)]))
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    machine = binding.Target.from_default_triple().create_target_machine(
        codemodel="large", reloc="static", opt=2
    )
    return bytes(machine.emit_object(parsed))
