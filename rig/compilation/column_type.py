"""The type of a `rig.compilation.column.Column` in compiled code: a pointer and a length."""

import operator
import os
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    overload,
    register_model,
    typeof_impl,
    unbox,
)

from rig.compilation.column import Column, prefetch

_LLVM: Any = vars(cgutils)["ir"]  # llvmlite.ir, with which numba builds its code
BOUNDS_CHECKED = os.environ.get("NUMBA_BOUNDSCHECK", "0") not in ("", "0")


class ColumnType(types.Type):
    """The type of a `Column` in compiled code."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(name=f"Column({dtype})")


@typeof_impl.register(Column)
def _typeof(value: Column, _: Any) -> ColumnType:
    return ColumnType(types.int64 if value.array.dtype == np.int64 else types.float64)


@register_model(ColumnType)
class _ColumnModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        members = [("data", types.CPointer(kind.dtype)), ("length", types.int64)]
        super().__init__(manager, kind, members)


@unbox(ColumnType)
def _unbox(kind: Any, value: Any, c: Any) -> NativeValue:
    proxy = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    numbers = []
    for name in ("address", "length"):
        attribute = c.pyapi.object_getattr_string(value, name)
        numbers.append(c.pyapi.long_as_longlong(attribute))
        c.pyapi.decref(attribute)
    proxy.data = c.builder.inttoptr(numbers[0], proxy.data.type)
    proxy.length = numbers[1]
    return NativeValue(
        proxy._getvalue(), is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred())
    )


@intrinsic
def _length(context: Any, column: Any) -> Any:
    def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        proxy = cgutils.create_struct_proxy(signature.args[0])(target, builder, value=arguments[0])
        return proxy.length

    return types.int64(column), code


@intrinsic
def _load(context: Any, column: Any, index: Any) -> Any:
    def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        proxy = cgutils.create_struct_proxy(signature.args[0])(target, builder, value=arguments[0])
        return builder.load(builder.gep(proxy.data, [arguments[1]]))

    return column.dtype(column, types.int64), code


@intrinsic
def _store(context: Any, column: Any, index: Any, number: Any) -> Any:
    def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        proxy = cgutils.create_struct_proxy(signature.args[0])(target, builder, value=arguments[0])
        builder.store(arguments[2], builder.gep(proxy.data, [arguments[1]]))

    return types.void(column, types.int64, column.dtype), code


@intrinsic
def _issue_prefetch(context: Any, column: Any, index: Any) -> Any:
    def code(target: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        proxy = cgutils.create_struct_proxy(signature.args[0])(target, builder, value=arguments[0])
        place = builder.bitcast(builder.gep(proxy.data, [arguments[1]]), cgutils.voidptr_t)
        flag = _LLVM.IntType(32)
        kind = _LLVM.FunctionType(_LLVM.VoidType(), [cgutils.voidptr_t, flag, flag, flag])
        fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        builder.call(fetch, [place, flag(0), flag(3), flag(1)])

    return types.void(column, types.int64), code


@overload(len)
def _len(column: Any) -> Any:
    def length(column: Any) -> Any:
        return _length(column)

    return length if isinstance(column, ColumnType) else None


@overload(operator.getitem)
def _getitem(column: Any, index: Any) -> Any:
    def at(column: Any, index: Any) -> Any:
        return _load(column, index)

    def checked(column: Any, index: Any) -> Any:
        if not 0 <= index < _length(column):
            raise IndexError("index out of a column's range")
        return _load(column, index)

    if not isinstance(column, ColumnType):
        return None
    return checked if BOUNDS_CHECKED else at


@overload(operator.setitem)
def _setitem(column: Any, index: Any, number: Any) -> Any:
    def put(column: Any, index: Any, number: Any) -> None:
        _store(column, index, number)

    def checked(column: Any, index: Any, number: Any) -> None:
        if not 0 <= index < _length(column):
            raise IndexError("index out of a column's range")
        _store(column, index, number)

    if not isinstance(column, ColumnType):
        return None
    return checked if BOUNDS_CHECKED else put


@overload(prefetch)
def _prefetch(column: Any, index: Any) -> Any:
    def bring(column: Any, index: Any) -> None:
        _issue_prefetch(column, index)

    return bring
