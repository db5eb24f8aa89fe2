"""Access of compiled code to numbers and tables at an address (`rig.realtime.tick_memory`)."""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from rig.compilation.column_type import ColumnType

_LLVM: Any = vars(cgutils)["ir"]  # llvmlite.ir, with which numba builds its code


def _pointer(builder: Any, number: Any, address: Any, index: Any) -> Any:
    return builder.gep(builder.inttoptr(address, number.as_pointer()), [index])


def _loader(kind: Any, number: Any) -> Any:
    @intrinsic
    def load(context: Any, address: Any, index: Any) -> Any:
        def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.load(_pointer(builder, number, *arguments))

        return kind(types.int64, types.int64), code

    return load


def _storer(kind: Any, number: Any, allowed: tuple[type, ...]) -> Any:
    @intrinsic
    def store(context: Any, address: Any, index: Any, value: Any) -> Any:
        if not isinstance(value, allowed):
            raise TypingError(f"a number that starts as {kind} becomes {value}")

        def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            where, at, given = arguments
            builder.store(given, _pointer(builder, number, where, at))

        return types.void(types.int64, types.int64, kind), code

    return store


def _column_maker(kind: Any) -> Any:
    column = ColumnType(kind)

    @intrinsic
    def make(context: Any, address: Any, length: Any) -> Any:
        def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            proxy = cgutils.create_struct_proxy(column)(target, builder)
            proxy.data = builder.inttoptr(arguments[0], proxy.data.type)
            proxy.length = arguments[1]
            return proxy._getvalue()

        return column(types.int64, types.int64), code

    return make


load_float = _loader(types.float64, _LLVM.DoubleType())
load_int = _loader(types.int64, _LLVM.IntType(64))
store_float = _storer(
    types.float64, _LLVM.DoubleType(), (types.Float, types.Integer, types.Boolean)
)
store_int = _storer(types.int64, _LLVM.IntType(64), (types.Integer, types.Boolean))
float_column = _column_maker(types.float64)
int_column = _column_maker(types.int64)
