"""Compilation of a tick to object code that the loop process loads without a compiler."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from llvmlite import binding, ir

from rig.compilation import lifting
from rig.compilation.cache_folder import write_bytes_atomically
from rig.compilation.tick_source import TickSource
from rig.realtime.compiled_tick import ENTRY, FILES, is_complete

_FAILED = "the compiled tick raised an exception"


class CompilationError(ValueError):
    """A tick that cannot be compiled; the message gives the reason."""


def compile_tick(source: TickSource) -> Path:
    """Return the folder with the object code of a tick; compile it if the cache does not have it.

    Raises CompilationError with the compiler's reason, OSError if the cache cannot be written.
    """
    folder = source.folder
    if is_complete(folder):
        return folder
    lifting.lift_functions(source.functions)
    try:
        module = lifting.load("tick", source.text, (), folder=folder)
    except Exception as error:  # numba raises errors of its own insides, too
        raise CompilationError(lifting.first_reason(str(error))) from error
    for name, content in zip(FILES, _objects(module.tick), strict=True):
        write_bytes_atomically(folder / name, content)
    return folder


def _objects(function: Any) -> tuple[bytes, bytes]:
    """Return the object code of a compiled function, and of its entry for Python."""
    (compiled,) = function.overloads.values()
    _, _, (code, *_) = compiled.library.serialize_using_object_code()
    return code, _entry(compiled.fndesc.llvm_func_name)


def _entry(symbol: str) -> bytes:
    """Return the object code of a C function for Python (METH_NOARGS) that calls the tick.

    Its first argument is a `bytes` with the address of the tick's memory. It returns the result of
    the tick, or raises if the tick did.
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
    encoded = bytearray(f"{_FAILED}\0".encode())
    text = ir.GlobalVariable(module, ir.ArrayType(ir.IntType(8), len(encoded)), "text")
    text.initializer = ir.Constant(text.value_type, encoded)
    text.linkage, text.global_constant = "internal", True

    entry = declare(ENTRY, pointer, pointer, pointer)
    builder = ir.IRBuilder(entry.append_basic_block())
    content = number(sys.getsizeof(b"") - 1)  # where a `bytes` has its bytes
    place = builder.gep(entry.args[0], [content], source_etype=ir.IntType(8))
    memory = builder.load(place, typ=number)
    result, exception = builder.alloca(number), builder.alloca(pointer)
    ended = builder.call(tick, [result, exception, memory])
    with builder.if_then(builder.icmp_signed("!=", ended, status(0)), likely=False):
        builder.call(set_error, [builder.load(error, typ=pointer), text])
        builder.ret(pointer(None))
    builder.ret(builder.call(new_int, [builder.load(result, typ=number)]))
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    machine = binding.Target.from_default_triple().create_target_machine(
        codemodel="large", reloc="static", opt=2
    )
    emit: Callable[[Any], bytes] = machine.emit_object
    return emit(parsed)
