"""Compilation of a tick to object code that the loop process loads without a compiler."""

import fcntl
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from llvmlite import binding, ir

from rig.compilation import lifting
from rig.compilation.cache_folder import write_bytes_atomically
from rig.compilation.tick_source import TickSource
from rig.realtime.compiled_tick import (
    ENTRY,
    EXCEPTION_TEXT,
    FILES,
    is_complete,
    read_objects,
    with_checksum,
)
from rig.realtime.object_code import ObjectCodeError, function_at


class CompilationError(ValueError):
    """A tick that cannot be compiled; the message gives the reason."""


def compile_tick(source: TickSource) -> Path:
    """Return the folder with the object code of a tick; compile it if the cache does not have it.

    The first of several processes compiles. Raises CompilationError with the compiler's reason,
    OSError if the cache cannot be written.
    """
    folder = source.folder
    if is_complete(folder):
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not is_complete(folder):
            for name, content in zip(FILES, _compiled(source), strict=True):
                write_bytes_atomically(folder / name, with_checksum(content))
    return folder


def objects_of(source: TickSource) -> list[bytes]:
    """Return the object code of a tick, also if the cache cannot be written or is damaged."""
    try:
        return read_objects(compile_tick(source))
    except (OSError, ObjectCodeError):
        return list(_compiled(source))


def _compiled(source: TickSource) -> tuple[bytes, bytes]:
    lifting.lift_functions(source.functions)
    try:
        module = lifting.load("tick", source.text, (), folder=source.folder)
    except Exception as error:  # numba raises errors of its own insides, too
        raise CompilationError(lifting.first_reason(str(error))) from error
    return _objects(module.tick, lets_others_run=source.many_ticks)


class LinkedByCompiler:
    """Object code in memory on a processor for which only the compiler can link it."""

    def __init__(self, objects: Iterable[bytes]) -> None:
        """Place the objects."""
        module = binding.parse_assembly("")
        self._engine = binding.create_mcjit_compiler(module, _target_machine())
        for content in objects:
            self._engine.add_object_file(binding.ObjectFileRef.from_data(content))
        self._engine.finalize_object()

    def function(self, symbol: str, own: bytes) -> Any:
        """Return the Python function of a symbol, as of `rig.realtime.object_code.function_at`."""
        return function_at(self._engine.get_function_address(symbol), own)


def _objects(function: Any, *, lets_others_run: bool) -> tuple[bytes, bytes]:
    """Return the object code of a compiled function, and of its entry for Python."""
    (compiled,) = function.overloads.values()
    _, _, (code, *_) = compiled.library.serialize_using_object_code()
    return code, _entry(compiled.fndesc.llvm_func_name, lets_others_run=lets_others_run)


def _entry(symbol: str, *, lets_others_run: bool) -> bytes:
    """Return the object code of a C function for Python (METH_NOARGS) that calls the tick.

    Its first argument is a `bytes` with the address of the tick's memory. It returns the result of
    the tick, or raises if the tick did. With ``lets_others_run`` other threads of Python may run
    meanwhile.
    """
    module = ir.Module("entry")
    module.triple = binding.get_process_triple()
    pointer, status, number = ir.PointerType(), ir.IntType(32), ir.IntType(64)

    def declare(name: str, result: Any, *arguments: Any) -> Any:
        return ir.Function(module, ir.FunctionType(result, arguments), name)

    tick = declare(symbol, status, pointer, pointer, number)  # result, exception, memory
    new_int = declare("PyLong_FromLongLong", pointer, number)
    set_error = declare("PyErr_SetString", ir.VoidType(), pointer, pointer)
    error = ir.GlobalVariable(module, pointer, "PyExc_ArithmeticError")
    encoded = bytearray(f"{EXCEPTION_TEXT}\0".encode())
    text = ir.GlobalVariable(module, ir.ArrayType(ir.IntType(8), len(encoded)), "text")
    text.initializer = ir.Constant(text.value_type, encoded)
    text.linkage, text.global_constant = "internal", True

    entry = declare(ENTRY, pointer, pointer, pointer)
    builder = ir.IRBuilder(entry.append_basic_block())
    content = number(sys.getsizeof(b"") - 1)  # where a `bytes` has its bytes
    place = builder.gep(entry.args[0], [content], source_etype=ir.IntType(8))
    memory = builder.load(place, typ=number)
    result, exception = builder.alloca(number), builder.alloca(pointer)
    if lets_others_run:
        release = declare("PyEval_SaveThread", pointer)
        regain = declare("PyEval_RestoreThread", ir.VoidType(), pointer)
        thread = builder.call(release, [])
    ended = builder.call(tick, [result, exception, memory])
    if lets_others_run:
        builder.call(regain, [thread])
    with builder.if_then(builder.icmp_signed("!=", ended, status(0)), likely=False):
        builder.call(set_error, [builder.load(error, typ=pointer), text])
        builder.ret(pointer(None))
    builder.ret(builder.call(new_int, [builder.load(result, typ=number)]))
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    emit: Callable[[Any], bytes] = _target_machine().emit_object
    return emit(parsed)


def _target_machine() -> Any:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_default_triple()
    return target.create_target_machine(codemodel="large", reloc="static", opt=2)
