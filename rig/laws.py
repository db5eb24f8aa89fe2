"""The registry of control laws: modules of `controllers.law` by name or by path.

A law is registered by an entry point of the group ``wec_rig.laws``, whose value names its module,
or a campaign or rig file gives the path of its file. The file's sha256 identifies a law: processes
and records compare it. The module runs in the loop process, so it imports the standard library
only.
"""

import hashlib
import importlib
import inspect
import json
import linecache
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from controllers.law import Column, Parameter
from rig.law_choice import CHOICE, choice_module
from rig.plug_ins import DISTRIBUTION, Entry, Registry, error_text

GROUP = "wec_rig.laws"

OWN_MODULES = {
    "impedance": "controllers.impedance",
    "velocity table": "controllers.velocity_table",
    "nonlinear damping": "controllers.nonlinear_damping",
    "latching": "controllers.latching",
    "declutching": "controllers.declutching",
    "positioning": "controllers.positioning",
}
"""The laws of this distribution; they are entry points, too."""

REGISTRY = Registry(GROUP, "law", OWN_MODULES)

_ARGUMENTS = {"params": 3, "start": 1, "step": 7, "linear": 3}
_OPTIONAL = ("linear",)
NAMES = {"COLUMNS", "PARAMETERS", "SetPoint", "Params", "State", "params", "start", "step"}
"""Names that the module of every law has."""


class LawError(ValueError):
    """A law that cannot be used; the message lists every reason."""


class Law(NamedTuple):
    """A law and its origin."""

    name: str  # as registered, or the name of its file without .py
    module: Any  # as `controllers.law` describes it
    origin: str  # distribution and version, or path
    path: str  # of its file
    sha256: str  # of its file
    is_file: bool  # given by its path, not registered
    parts: tuple["Law", ...] = ()  # of a choice among laws (`choice`)

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns that the law adds to the gain matrix."""
        columns: tuple[Column, ...] = self.module.COLUMNS
        return columns

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The constants that a campaign file gives."""
        parameters: tuple[Parameter, ...] = self.module.PARAMETERS
        return parameters

    @property
    def members(self) -> tuple["Law", ...]:
        """The laws of a choice, or this one alone."""
        return self.parts or (self,)

    def chosen(self, values: Any) -> "Law":
        """Return the law that acts at a set point: this one, or one of a choice."""
        return self.parts[int(getattr(values, CHOICE, 0.0))] if self.parts else self

    def in_force(self, params: Any, set_point: Any) -> tuple["Law", Any, Any]:
        """Return the law that acts at a set point, with its Params and its SetPoint."""
        if not self.parts:
            return self, params, set_point
        number = int(set_point.law)
        law = self.parts[number]
        return law, getattr(params, f"law_{number}"), law.set_point(set_point)

    @property
    def linear(self) -> Callable[..., complex] | None:
        """The force per velocity of a linear law; None for a law without a linear form."""
        return getattr(self.module, "linear", None)

    def set_point(self, values: Any) -> Any:
        """Return the law's SetPoint from an object with an attribute for each column's name."""
        return self.module.SetPoint(*(getattr(values, column.name) for column in self.columns))

    @property
    def is_own(self) -> bool:
        """Whether the law, or each law of a choice, is one of this distribution."""
        return all(not each.is_file and each.name in OWN_MODULES for each in self.members)

    @property
    def reference(self) -> str:
        """The text that finds the law again on this host: its name or its path."""
        return self.path if self.is_file else self.name

    def record(self) -> dict[str, Any]:
        """Return the law as a run records it, as JSON values."""
        return {
            "name": self.name,
            "origin": self.origin,
            "sha256": self.sha256,
            "file": self.is_file,
        }


class RegisteredLaw(NamedTuple):
    """An entry of the registry; a law that cannot be used has a problem."""

    name: str
    origin: str
    law: Law | None
    problem: str  # empty for a usable law


def is_path(text: str) -> bool:
    """Return whether a text names a law by its file."""
    return text.endswith(".py")


def find(text: str) -> Law:
    """Return the law of a name, or of the path of its file.

    Raises LawError if there is none, two distributions register the name, the import fails, or the
    module lacks a part of the interface.
    """
    if is_path(text):
        return load_file(Path(text))
    entry = REGISTRY.find(text)
    if entry is None:
        known = ", ".join(REGISTRY.names())
        raise LawError(f"no law {text!r} is registered; allowed {known}, or the path of a .py file")
    return _load_entry(entry)


def choice(laws: Sequence[Law]) -> Law:
    """Return the choice among laws, one of which acts at a time (`rig.law_choice`).

    Raises LawError for a law given twice, or if columns or parameters of two laws do not fit.
    """
    names = [law.name for law in laws]
    if len(set(names)) < len(names):
        raise LawError(f"{', '.join(names)}: each law of a choice must have a name of its own")
    text = ", ".join(names)
    try:
        module = choice_module({law.name: law.module for law in laws})
    except ValueError as error:
        raise LawError(f"the laws {text} are no choice: {error}") from None
    digest = hashlib.sha256("".join(law.sha256 for law in laws).encode()).hexdigest()
    origin = "; ".join(dict.fromkeys(law.origin for law in laws))
    is_file = any(law.is_file for law in laws)
    return _checked(Law(text, module, origin, "", digest, is_file, tuple(laws)))


def own(name: str) -> Law:
    """Return a law of this distribution without a search of the installed distributions."""
    return _import_law(Entry(name, OWN_MODULES[name], DISTRIBUTION))


def load_file(path: Path) -> Law:
    """Return the law in a file; LawError if it cannot be read or lacks a part of the interface."""
    try:
        source = path.read_bytes()
    except OSError as error:
        raise LawError(f"the law {path} cannot be read: {error.strerror or error}") from None
    return load_source(source, path)


def load_source(source: bytes, path: Path) -> Law:
    """Return the law of a source text; ``path`` is its file, which may be gone by now."""
    digest = hashlib.sha256(source).hexdigest()
    return _checked(
        Law(path.stem, _execute(source, path, digest), str(path), str(path), digest, True)
    )


def registered() -> tuple[RegisteredLaw, ...]:
    """Return all registered laws, also those that cannot be used, sorted by origin and name."""
    listed = []
    for entry in REGISTRY.entries():
        law, problem = None, ""
        try:
            law = _load_entry(entry)
        except LawError as error:
            problem = str(error)
        listed.append(RegisteredLaw(entry.name, entry.origin, law, problem))
    return tuple(listed)


def to_request(law: Law) -> str:
    """Return a law as text for another process of this host: reference and sha256 of each part."""
    return json.dumps([[each.reference, each.sha256] for each in law.members])


def from_request(text: str) -> Law:
    """Return the law that another process requests; LawError if a file has another sha256."""
    found = [_requested(reference, sha256) for reference, sha256 in json.loads(text)]
    return found[0] if len(found) == 1 else choice(found)


def _requested(reference: str, sha256: str) -> Law:
    law = find(reference)
    if law.sha256 != sha256:
        raise LawError(
            f"the file of the law {reference} ({law.path}) changed after the check: sha256 "
            f"{law.sha256[:12]}, not {sha256[:12]}; check the campaign again"
        )
    return law


def source_text(law: Law) -> str:
    """Return the source text of a law as it was loaded, also after its file has changed.

    Of a choice, the result is JSON text with the sources of the laws from files by sha256.
    """
    if law.parts:
        return json.dumps({each.sha256: source_text(each) for each in law.parts if each.is_file})
    return inspect.getsource(law.module)


def _load_entry(entry: Entry) -> Law:
    """Return the law of an entry; LawError if its name is ambiguous or the law unusable."""
    if duplicates := REGISTRY.duplicates(entry):
        raise LawError(duplicates)
    return _import_law(entry)


@cache
def _import_law(entry: Entry) -> Law:
    try:
        module = importlib.import_module(entry.module)
    except Exception as error:
        raise LawError(_failed_text(f"{entry.name!r} of {entry.origin}", error, "")) from error
    path = str(module.__file__ or "")
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return _checked(Law(entry.name, module, entry.origin, path, digest, False))


def _execute(source: bytes, path: Path, digest: str) -> ModuleType:
    """Return the module of a law's source, named by its hash; equal sources share a module."""
    name = f"wec_rig_law_{digest[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except Exception as error:  # a law's file may raise anything
        del sys.modules[name]
        raise LawError(_failed_text(str(path), error, str(path))) from error
    # `inspect.getsource` reads this text, also after the file is edited or gone.
    lines = source.decode("utf-8").splitlines(keepends=True)
    linecache.cache[str(path)] = (len(source), None, lines, str(path))
    return module


def _failed_text(law: str, error: Exception, path: str) -> str:
    """Return the message for a law that raised, with the line of its file."""
    return f"the law {law} cannot be imported: {error_text(error, path)}"


# --- the interface


def _checked(law: Law) -> Law:
    problems = list(interface_problems(law.module))
    if problems:
        raise LawError(f"{law.path or law.name} is not a law: " + "; ".join(problems))
    return law


def interface_problems(module: Any) -> Iterator[str]:
    """Yield what a module lacks to be a law (`controllers.law`)."""
    for name, count in _ARGUMENTS.items():
        function = getattr(module, name, None)
        if function is None and name in _OPTIONAL:
            continue
        if not callable(function):
            yield f"the function {name} is missing"
            continue
        code = getattr(function, "__code__", None)
        if code is not None and code.co_argcount != count:
            yield f"the function {name} takes {code.co_argcount} arguments, not {count}"
    for name, item in (("COLUMNS", Column), ("PARAMETERS", Parameter)):
        given = getattr(module, name, None)
        if not isinstance(given, tuple) or not all(isinstance(each, item) for each in given):
            yield f"{name} is not a tuple of controllers.law.{item.__name__}"
        else:
            yield from _entry_problems(name, given)
    for name in ("SetPoint", "Params", "State"):
        part = getattr(module, name, None)
        if not (isinstance(part, type) and hasattr(part, "_fields")):
            yield f"the NamedTuple {name} is missing"
            continue
        try:
            yield from _leaf_problems(name, part, name)
        except (NameError, TypeError) as error:
            yield f"{name}: an annotation cannot be evaluated ({error})"
    yield from _set_point_problems(module)


def _entry_problems(name: str, given: Any) -> Iterator[str]:
    keys = [each.key for each in given]
    for key in sorted({key for key in keys if keys.count(key) > 1}):
        yield f"{name} has the key {key} twice"
    for each in given:
        if not each.key.isidentifier() or each.key in ("use", "zc"):
            yield f"{name}: {each.key!r} cannot be a key of a file"
        if not (each.low <= each.high and math.isfinite(each.low) and math.isfinite(each.high)):
            yield f"{name}: the range of {each.key} is {each.low:g} .. {each.high:g}"


def _set_point_problems(module: Any) -> Iterator[str]:
    set_point, columns = getattr(module, "SetPoint", None), getattr(module, "COLUMNS", ())
    fields = getattr(set_point, "_fields", None)
    if fields is None or not isinstance(columns, tuple):
        return
    names = tuple(getattr(column, "name", None) for column in columns)
    if fields != names:
        yield f"COLUMNS have the names {_listed(names)}, but SetPoint the fields {_listed(fields)}"
    with suppress(NameError, TypeError):  # an annotation without a meaning is a problem already
        hints = get_type_hints(set_point)
        yield from (f"SetPoint.{name} is not a float" for name in fields if hints[name] is int)


def _listed(names: Any) -> str:
    return ", ".join(map(str, names)) or "(none)"


def _leaf_problems(path: str, hint: Any, root: str) -> Iterator[str]:
    """Yield the leaves of a type that are neither float nor int."""
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    if hint is float or hint is int:
        return
    if get_origin(hint) is tuple:
        arguments = [each for each in get_args(hint) if each is not ...]
        if root == "Params" and get_args(hint)[-1:] != (...,):
            yield f"{path} is a tuple of fixed length; allowed tuple[float, ...] or a NamedTuple"
        for i, each in enumerate(arguments):
            yield from _leaf_problems(f"{path}[{i}]", each, root)
        return
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        hints = get_type_hints(hint, include_extras=True)
        for field in hint._fields:
            yield from _leaf_problems(f"{path}.{field}", hints[field], root)
        return
    name = getattr(hint, "__name__", str(hint))
    yield f"{path} is of type {name}; allowed float, int, and NamedTuples or tuples of them"
