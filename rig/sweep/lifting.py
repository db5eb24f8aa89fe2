"""Lifting pure step functions into compiled code: the only file that imports numba.

The functions stay plain Python; `register_jitable` makes the very same ones callable from compiled
code. numba's own cache looks only at the file of the compiled function and would serve a stale law
after an edit elsewhere, so the cache folder is named by a hash of every lifted source, numba's
version and the processor.

Compiled code is called with one float64 array a tree of NamedTuples, because handing over a
NamedTuple costs more than the step itself; the code that unpacks and packs the arrays is generated
from an example of the tree.
"""

import hashlib
import importlib
import importlib.util
import inspect
import os
import platform
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")  # its functions differ in the last bit

import numba
from numba.extending import register_jitable

from rig.sweep.cache_folder import cache_root, processor, write

Floats = npt.NDArray[np.float64]


def _spare_blas() -> None:
    """Load numba's array functions without scipy.linalg, which they take BLAS from.

    Nothing that is lifted multiplies matrices, and scipy.linalg is a third of a second.
    """
    wanted = "scipy.linalg"
    if wanted in sys.modules:
        return
    sys.modules[wanted] = None  # type: ignore[assignment]  # "cannot be imported", as Python says it
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules[wanted]


_spare_blas()


def lift(modules: Iterable[ModuleType]) -> None:
    """Make every plain function of the modules callable from compiled code."""
    for module in modules:
        for function in vars(module).values():
            if inspect.isfunction(function) and function.__module__ == module.__name__:
                register_jitable(forceinline=True)(function)


def load(
    name: str, source: str, modules: Iterable[ModuleType], beside: Iterable[ModuleType] = ()
) -> ModuleType:
    """Import generated source whose compiled functions are cached on disk.

    The source stands in a folder named by what it was made from, so an edit of any lifted module,
    or of those ``beside`` (types and constants that compiled code knows), is a new folder. Where
    it cannot be written, a temporary one serves: compiled anew each time.
    """
    modules = tuple(modules)
    lift(modules)
    path = cache_folder(source, (*modules, *beside)) / f"{name}.py"
    if not path.exists():
        try:
            write(path, source)
        except OSError:
            path = Path(tempfile.mkdtemp(prefix="wec-rig-")) / path.name
            write(path, source)
    spec = importlib.util.spec_from_file_location(f"lifted_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba looks its cached code up by module name
    spec.loader.exec_module(module)
    return module


def numbers(tree: Any) -> list[float]:
    """All numbers of a tree of tuples in order; ints are exact below 2^53."""
    if isinstance(tree, tuple):
        return [number for item in tree for number in numbers(item)]
    return [float(tree)]


def unpacking(tree: Any, array: str, start: int = 0) -> str:
    """Source of an expression that rebuilds ``tree`` from an array of its numbers."""
    text, _ = _unpack(tree, array, start)
    return text


def _unpack(tree: Any, array: str, at: int) -> tuple[str, int]:
    if not isinstance(tree, tuple):
        item = f"{array}[{at}]"
        return (item if isinstance(tree, float) else f"int({item})"), at + 1
    parts = []
    for member in tree:
        part, at = _unpack(member, array, at)
        parts.append(part)
    inside = ", ".join(parts)
    name = "" if type(tree) is tuple else type(tree).__name__
    if name:
        return f"{name}({inside})", at
    return (f"({inside},)" if parts else "()"), at


def packing(tree: Any, value: str, array: str) -> list[str]:
    """Source lines that write the numbers of ``value``, shaped like ``tree``, into an array."""
    leaves: list[str] = []

    def walk(member: Any, expression: str) -> None:
        if isinstance(member, tuple):
            for i, item in enumerate(member):
                walk(item, f"{expression}[{i}]")
        else:
            leaves.append(expression)

    walk(tree, value)
    return [f"{array}[{i}] = {leaf}" for i, leaf in enumerate(leaves)]


def words(tree: Any) -> set[type]:
    """Every NamedTuple type in a tree: what generated source has to import."""
    if not isinstance(tree, tuple):
        return set()
    found = {type(tree)} - {tuple}
    for member in tree:
        found |= words(member)
    return found


def cache_folder(source: str, modules: Iterable[ModuleType]) -> Path:
    """Folder of what is compiled from a source and these modules, by this numba for this host."""
    checked = os.environ.get("NUMBA_BOUNDSCHECK", "")  # another code, which numba does not tell
    told = [source, numba.__version__, np.__version__, sys.version, platform.machine(), processor()]
    for module in (sys.modules[__name__], *modules):
        told += [inspect.getsource(module), *_as_run(module)]
    told.append(checked)
    return cache_root() / hashlib.sha256("\0".join(told).encode()).hexdigest()[:24]


def _as_run(module: ModuleType) -> Iterator[str]:
    """The functions and numbers of a module as this process has them.

    A process that read the module before its source was edited has other ones than the source says:
    what it compiles must not be found by those that read it afterwards.
    """
    for name, value in sorted(vars(module).items()):
        if inspect.isfunction(value) and value.__module__ == module.__name__:
            yield f"{name} {_operations(value.__code__)}"
        elif isinstance(value, type) and issubclass(value, tuple):
            yield f"{name} {getattr(value, '_fields', ())}"
        elif not name.startswith("__") and _is_plain(value):
            yield f"{name} {value!r}"


def _operations(code: CodeType) -> str:
    """What a function does, without where it stands."""
    inside = [_operations(each) for each in code.co_consts if isinstance(each, CodeType)]
    constants = [repr(each) for each in code.co_consts if _is_plain(each)]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants} {inside}"


def _is_plain(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, int | float | str)


def is_compiled(folder: Path) -> bool:
    """Whether anything compiled is kept there already."""
    return any(folder.glob("**/*.nbi"))
