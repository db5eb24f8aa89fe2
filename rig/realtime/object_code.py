"""Loading of compiled code without its compiler: ELF objects of x86-64 become Python functions.

The loop process must not import numba or LLVM: they take 50 MB of locked memory and most of a
second. The compiler emits its objects in the large code model, so every reference is an absolute
address of 8 bytes, and placing them in memory takes a few lines (System V ABI, AMD64 supplement,
section 4.4). Code is never writable and executable at the same time.
"""

import ctypes
import mmap
import platform
import struct
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, NamedTuple

MACHINE = "x86_64"
_X86_64 = 62  # e_machine
_RELOCATABLE = 1  # e_type
_ALLOCATED, _EXECUTABLE = 0x2, 0x4  # sh_flags
_RELOCATIONS, _SYMBOLS, _ZEROS = 4, 2, 8  # sh_type
_ABSOLUTE_64, _RELATIVE_64 = 1, 24  # relocation types
_UNDEFINED, _ABSOLUTE, _COMMON = 0, 0xFFF1, 0xFFF2  # st_shndx
_NO_ARGUMENTS = 0x0004  # METH_NOARGS
_REFERENCES_PER_STEP = 40  # 25 us
_HEADER = struct.Struct("<4sBB10xHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_RELOCATION = struct.Struct("<QQq")


class ObjectCodeError(ValueError):
    """An object that cannot be loaded here; the message gives the reason."""


class _Section(NamedTuple):
    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int
    entry_size: int


class _MethodDefinition(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


_LOADED: list["ObjectCode"] = []  # functions refer to their code, which therefore stays loaded


class ObjectCode:
    """Objects in memory, ready to run; they stay there until the process ends."""

    def __init__(self, objects: Iterable[bytes]) -> None:
        """Raise ObjectCodeError for another processor."""
        if not is_supported():
            raise ObjectCodeError(f"compiled for {MACHINE}, this is {platform.machine()}")
        self._contents = tuple(objects)
        self._symbols: dict[str, int] = {}
        self._memory: list[mmap.mmap] = []

    def load(self) -> Iterator[None]:
        """Place the objects and resolve their references to each other, Python and libm.

        The work is done in steps of well below a millisecond. Raises ObjectCodeError for damaged
        bytes or an unknown reference.
        """
        try:
            placed = []
            for content in self._contents:
                placed.append(_Object(content))
                yield
                placed[-1].place()
                self._symbols.update(placed[-1].exported())
                yield
            for each in placed:
                yield from each.resolve(self._symbols)
                self._memory.append(each.protect())
        except ObjectCodeError:
            raise
        except (struct.error, IndexError, ValueError) as error:
            raise ObjectCodeError(f"damaged object code: {error}") from error
        _LOADED.append(self)

    def ranges(self) -> list[tuple[int, int]]:
        """Return length and address of each memory that holds code."""
        return [(len(each), _address(each)) for each in self._memory]

    def function(self, symbol: str, own: bytes) -> Any:
        """Return the Python function of a symbol, as of `function_at`."""
        if symbol not in self._symbols:
            raise ObjectCodeError(f"damaged object code: no {symbol}")
        return function_at(self._symbols[symbol], own)


def is_supported() -> bool:
    """Return whether `ObjectCode` can load code for this processor."""
    return platform.machine() == MACHINE


def load_at_once(objects: Iterable[bytes]) -> ObjectCode:
    """Return loaded objects; errors as of `ObjectCode`."""
    code = ObjectCode(objects)
    for _ in code.load():
        pass
    return code


def function_at(address: int, own: bytes) -> Any:
    """Return the Python function at an address with the C signature of METH_NOARGS.

    ``own`` is its first argument, `self`. The code must stay in memory.
    """
    definition = _definition(address)  # the function refers to it
    create = ctypes.pythonapi.PyCFunction_NewEx
    create.restype = ctypes.py_object
    create.argtypes = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return create(ctypes.addressof(definition), own, None)


@cache
def _definition(address: int) -> _MethodDefinition:
    return _MethodDefinition(b"compiled", address, _NO_ARGUMENTS, None)


class _Object:
    """One relocatable ELF object."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        magic, width, order, kind, machine, *_, table, _, _, _, _, size, count, _ = (
            _HEADER.unpack_from(content)
        )
        if magic != b"\x7fELF" or (width, order) != (2, 1) or kind != _RELOCATABLE:
            raise ObjectCodeError("no relocatable ELF object of 64 bits")
        if machine != _X86_64:
            raise ObjectCodeError(f"compiled for ELF machine {machine}, allowed {_X86_64} (x86-64)")
        self._sections = [
            _Section(*_SECTION.unpack_from(content, table + i * size)) for i in range(count)
        ]
        symbols = next((each for each in self._sections if each.kind == _SYMBOLS), None)
        if symbols is None:
            raise ObjectCodeError("damaged object code: no symbols")
        names = self._sections[symbols.link]
        self._symbols = []
        for at in range(symbols.offset, symbols.offset + symbols.size, _SYMBOL.size):
            name, info, _, section, value, length = _SYMBOL.unpack_from(content, at)
            end = content.index(b"\0", names.offset + name)
            text = content[names.offset + name : end].decode()
            self._symbols.append((text, info >> 4, section, value, length))

    def place(self) -> None:
        """Copy the allocated sections into memory of their own."""
        self._starts: dict[int, int] = {}
        total = 0
        for index, each in enumerate(self._sections):
            if each.flags & _ALLOCATED:
                total = _aligned(total, each.alignment)
                self._starts[index] = total
                total += each.size
        self._commons: dict[int, int] = {}
        for index, (_, _, section, value, length) in enumerate(self._symbols):
            if section == _COMMON:  # its value is its alignment
                total = _aligned(total, value)
                self._commons[index] = total
                total += length
        self._map = mmap.mmap(-1, max(total, 1), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._base = _address(self._map)
        for index, start in self._starts.items():
            each = self._sections[index]
            if each.kind != _ZEROS:
                self._map[start : start + each.size] = self._content[
                    each.offset : each.offset + each.size
                ]

    def exported(self) -> dict[str, int]:
        """Return the addresses of the global symbols that the object defines."""
        return {
            name: self._base + self._starts[section] + value
            for name, binding, section, value, _ in self._symbols
            if binding != 0 and section in self._starts
        }

    def resolve(self, symbols: dict[str, int]) -> Iterator[None]:
        """Write the address of every reference, some at each step."""
        for table in self._sections:
            if table.kind != _RELOCATIONS or table.info not in self._starts:
                continue
            start = self._starts[table.info]
            for at in range(table.offset, table.offset + table.size, _RELOCATION.size):
                offset, info, addend = _RELOCATION.unpack_from(self._content, at)
                value = self._symbol_address(info >> 32, symbols) + addend
                kind = info & 0xFFFFFFFF
                if kind == _RELATIVE_64:
                    value -= self._base + start + offset
                elif kind != _ABSOLUTE_64:
                    raise ObjectCodeError(f"relocation of type {kind}; allowed 1 and 24")
                struct.pack_into("<Q", self._map, start + offset, value & 0xFFFFFFFFFFFFFFFF)
                if (at - table.offset) % (_REFERENCES_PER_STEP * _RELOCATION.size) == 0:
                    yield

    def _symbol_address(self, index: int, symbols: dict[str, int]) -> int:
        name, _, section, value, _ = self._symbols[index]
        if section == _COMMON:
            return self._base + self._commons[index]
        if section == _ABSOLUTE:
            return int(value)
        if section != _UNDEFINED:
            return self._base + self._starts[section] + int(value)
        return symbols[name] if name in symbols else _external_address(name)

    def protect(self) -> mmap.mmap:
        """Make the memory executable and no longer writable; return it."""
        protect = ctypes.CDLL(None, use_errno=True).mprotect
        executable = mmap.PROT_READ | mmap.PROT_EXEC
        length = ctypes.c_size_t(len(self._map))
        if protect(ctypes.c_void_p(self._base), length, executable) != 0:
            raise ObjectCodeError(f"memory cannot be executed: error {ctypes.get_errno()}")
        return self._map


def _address(memory: mmap.mmap) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(memory))


def _external_address(name: str) -> int:
    """Return the address of a function or variable of Python or the C library."""
    for library in (ctypes.pythonapi, ctypes.CDLL(None), ctypes.CDLL("libm.so.6")):
        try:
            found = ctypes.c_char.in_dll(library, name)
        except ValueError:
            continue
        return ctypes.addressof(found)
    raise ObjectCodeError(f"refers to {name}, which neither Python nor libm has")


def _aligned(value: int, alignment: int) -> int:
    return value if alignment <= 1 else -(-value // alignment) * alignment
