"""Lifting of pure step functions into compiled code, by numba.

The functions stay plain Python; `register_jitable` makes the very same ones callable from compiled
code. numba's own cache checks only the file of the compiled function and would return a stale law
after an edit elsewhere, so the name of the cache folder is a hash of every lifted source, numba's
version and the processor.

Compiled code takes one float64 array per tree of NamedTuples, because passing a NamedTuple costs
more than the step itself; the code that unpacks and packs the arrays is generated from an example
of the tree.
"""

import importlib
import importlib.util
import inspect
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")  # SVML functions differ in the last bit

import numba
from numba.extending import register_jitable

from rig.compilation import column, column_type  # noqa: F401  compiled code takes columns
from rig.compilation.cache_folder import cache_root, code_folder, write_atomically

Floats = npt.NDArray[np.float64]


def _import_numba_without_blas() -> None:
    """Import numba's array functions without scipy.linalg, their source of BLAS.

    Lifted functions multiply no matrices, and importing scipy.linalg takes a third of a second.
    """
    module = "scipy.linalg"
    if module in sys.modules:
        return
    sys.modules[module] = None  # type: ignore[assignment]  # makes the import raise ImportError
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules[module]


_import_numba_without_blas()


def lift(modules: Iterable[ModuleType]) -> None:
    """Make every plain function of the modules callable from compiled code."""
    for module in modules:
        for function in vars(module).values():
            if inspect.isfunction(function) and function.__module__ == module.__name__:
                register_jitable(forceinline=True)(function)


def lift_functions(functions: Iterable[Any]) -> None:
    """Make functions callable from compiled code; those of a column are so by their type."""
    for function in functions:
        if function.__module__ != column.__name__:
            register_jitable(forceinline=True)(function)


def load(
    name: str,
    source: str,
    modules: Iterable[ModuleType],
    folder: Path | None = None,
) -> ModuleType:
    """Import generated source whose compiled functions are cached on disk.

    The folder of the source is named by a hash of all its inputs, so an edit of any lifted module
    leads to a new folder. If it cannot be written, a temporary folder is used and the code is
    compiled each time. ``folder`` is that of modules which the caller has lifted.
    """
    modules = tuple(modules)
    lift(modules)
    path = (folder or code_folder(source, modules)) / f"{name}.py"
    if not path.exists():
        try:
            write_atomically(path, source)
        except OSError:
            path = Path(tempfile.mkdtemp(prefix="wec-rig-")) / path.name
            write_atomically(path, source)
    spec = importlib.util.spec_from_file_location(f"lifted_{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # numba finds cached code by module name
    spec.loader.exec_module(module)
    return module


def flatten(tree: Any) -> list[float]:
    """Return all numbers of a tree of tuples in order; ints are exact below 2^53."""
    if isinstance(tree, tuple):
        return [number for item in tree for number in flatten(item)]
    return [float(tree)]


def unpack_source(tree: Any, array: str, start: int = 0) -> str:
    """Return the source of an expression that rebuilds ``tree`` from an array of its numbers."""
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


def pack_source(tree: Any, value: str, array: str) -> list[str]:
    """Return source lines that write the numbers of ``value`` (of shape ``tree``) to an array."""
    leaves: list[str] = []

    def collect(member: Any, expression: str) -> None:
        if isinstance(member, tuple):
            for i, item in enumerate(member):
                collect(item, f"{expression}[{i}]")
        else:
            leaves.append(expression)

    collect(tree, value)
    return [f"{array}[{i}] = {leaf}" for i, leaf in enumerate(leaves)]


def tuple_types(tree: Any) -> set[type]:
    """Return every NamedTuple type in a tree, which generated source has to import."""
    if not isinstance(tree, tuple):
        return set()
    types = {type(tree)} - {tuple}
    for member in tree:
        types |= tuple_types(member)
    return types


def compilation_problem(function: Callable[..., Any], *arguments: Any) -> str:
    """Return in one line why a function cannot be compiled for arguments; empty if it can."""
    try:
        numba.njit(function)(*arguments)
    except numba.core.errors.NumbaError as error:
        return first_reason(str(error))
    except Exception as error:  # noqa: BLE001  numba raises errors of its own insides, too
        return f"{type(error).__name__}: {error}".splitlines()[0]
    return ""


_OUTER_ERROR = "Failed in nopython mode pipeline"  # of a function that calls the one at fault


def first_reason(text: str) -> str:
    """Return numba's reason without its stack of candidates, and the place in the source."""
    lines = [line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines()]
    places = [line for line in lines if line.startswith("File ") and ", line " in line]
    heading = ("Failed in", "During:", "There are", "- Of which", "Overload", "File ", "No impl")
    reasons = [line for line in lines if line and not line.startswith(heading)]
    known = [
        line
        for line in lines
        if ("Error" in line or "Unknown attribute" in line) and _OUTER_ERROR not in line
    ]
    reason = next(iter([*known, *reasons]), "unknown reason")
    # The innermost place stands first; calls of generated code lead to it.
    place = next(
        (line for line in places if cache_root().name not in line), places[-1] if places else ""
    )
    place = place.rstrip(":")
    return f"{reason} ({place})" if place else reason
