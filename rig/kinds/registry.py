"""The kinds of rig: packages that hold all of a kind, found by the name in a rig file.

A kind is registered by an entry point of the group ``wec_rig.kinds``, whose name is the `kind` of a
rig file and whose value is the name of a package. `ROOMS` lists the modules of such a package, its
rooms, and the names in each; `rig.kinds.interface` describes them. A room is imported when it is
first used. The core names no kind: it finds one here and calls its rooms.
"""

import importlib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

from rig.plug_ins import Entry, Registry, error_text
from rig.realtime import cycle
from rig.realtime.reasons import MAX_NUMBER, PLUG_IN_NUMBER

GROUP = "wec_rig.kinds"

OWN_PACKAGES = {
    "wavebot": "rig.kinds.wavebot",
    "oswec bench": "rig.kinds.oswec_bench",
    "modular": "rig.kinds.modular",
}
"""The kinds of this distribution; they are entry points, too."""

REGISTRY = Registry(GROUP, "kind of rig", OWN_PACKAGES)

ROOMS = {
    "tick": ("find_kind", "Sense", "SENSE_IN_ROW"),
    "config": ("RigFile", "LimitsFile"),
    "recorded": ("recorded_task",),
    "hardware.job": ("build_job",),
    "rehearsal.emulation": ("emulate_rig", "emulate_task", "build_devices"),
    "tasks": ("TaskFile", "examine", "execution_task", "rehearsal_mode", "wired_mode"),
    "display": ("show_report", "plan_position", "detail_lines", "short_text", "total_duration"),
    "products": ("PROGRESS", "NO_PRODUCTS", "after_run", "summarise", "draw"),
}
"""The modules of a kind's package and the names that the core uses (`rig.kinds.interface`)."""


class KindError(ValueError):
    """A kind of rig that cannot be used; the message gives the reason."""


class RigKind(NamedTuple):
    """A kind of rig and its origin."""

    name: str  # the `kind` of a rig file
    package: str
    origin: str  # distribution and version

    @property
    def summary(self) -> str:
        """The first line of the package's documentation."""
        return (self.room("").__doc__ or "").strip().partition("\n")[0]

    def room(self, name: str) -> Any:
        """Return a module of the package (`ROOMS`); the package itself for an empty name.

        Raises KindError if it cannot be imported.
        """
        return import_room(self.package, name)


class Command(NamedTuple):
    """A command of the command line."""

    name: str  # of a group's command with that of the group: `new rig`
    module: str  # has the function `command`; imported when the command is used
    help: str  # one sentence


class RegisteredKind(NamedTuple):
    """An entry of the registry; a kind that cannot be used has a problem."""

    kind: RigKind
    problem: str  # empty for a usable kind


def find(name: str) -> RigKind:
    """Return the kind of a name.

    Raises KindError if there is none, two distributions register the name, or its package cannot be
    imported.
    """
    entry = REGISTRY.find(name)
    if entry is None:
        raise KindError(f"no kind of rig {name!r} is registered; allowed {', '.join(known())}")
    if duplicates := REGISTRY.duplicates(entry):
        raise KindError(duplicates)
    kind = _kind(entry)
    kind.room("")
    return kind


def known() -> list[str]:
    """Return the names of all registered kinds."""
    return REGISTRY.names()


def registered() -> tuple[RegisteredKind, ...]:
    """Return all registered kinds, also those that cannot be used."""
    listed = []
    for entry in REGISTRY.entries():
        problem = REGISTRY.duplicates(entry) or interface_problem(_kind(entry))
        listed.append(RegisteredKind(_kind(entry), problem))
    return tuple(listed)


def commands() -> tuple[Command, ...]:
    """Return the commands of all kinds that have the room `commands` and can be imported."""
    return tuple(command for room in optional_rooms("commands") for command in room.COMMANDS)


def optional_rooms(name: str) -> Iterator[Any]:
    """Yield the room of a name of every kind that has it and can be imported."""
    for entry in REGISTRY.entries():
        with suppress(KindError):
            yield import_room(entry.module, name)


def _kind(entry: Entry) -> RigKind:
    return RigKind(entry.name, entry.module, entry.origin)


def interface_problem(kind: RigKind) -> str:
    """Return all reasons why a package is no kind of rig; empty if it is one."""
    problems: dict[str, str] = {}
    for room, names in ROOMS.items():
        try:
            module = kind.room(room)
        except KindError as error:
            problems[room] = str(error)
            continue
        if missing := [name for name in names if not hasattr(module, name)]:
            problems[room] = f"{kind.package}.{room} lacks {', '.join(missing)}"
    if "tick" not in problems:
        problems["reasons"] = _reason_problem(kind)
    return "; ".join(dict.fromkeys(filter(None, problems.values())))  # one cause may fail all rooms


def _reason_problem(kind: RigKind) -> str:
    """Return why the kind's own reasons of a stop cannot be used; empty if they can."""
    try:
        cycle_kind = _cycle_kind(kind)
    except KindError as error:
        return str(error)
    try:
        reasons = cycle_kind.reason_table.reasons
    except ValueError as error:
        return f"{kind.package}.tick: {error}"
    own = {reason.number for reason in cycle_kind.reasons}
    if kind.package not in OWN_PACKAGES.values() and own and min(own) < PLUG_IN_NUMBER:
        name = next(reason.name for reason in reasons if reason.number == min(own))
        return (
            f"{kind.package}.tick: reason {min(own)} {name} has a number of this distribution; "
            f"allowed {PLUG_IN_NUMBER} .. {MAX_NUMBER}"
        )
    return ""


@cache
def import_room(package: str, name: str) -> ModuleType:
    """Return a module of a kind's package; KindError with file and line if the import fails."""
    module = f"{package}.{name}" if name else package
    try:
        return importlib.import_module(module)
    except Exception as error:
        absent = error.name if isinstance(error, ModuleNotFoundError) else None
        if absent and f"{module}.".startswith(f"{absent}."):  # the module or a package around it
            raise KindError(f"the kind of rig {package} has no module {absent}") from error
        raise KindError(f"the kind of rig {package} is unusable: {error_text(error)}") from error


def _cycle_kind(kind: RigKind) -> cycle.Kind:
    """Return the functions of a kind with its own law; KindError if they cannot be composed."""
    try:
        found: cycle.Kind = kind.room("tick").find_kind("")
    except KindError:
        raise
    except Exception as error:
        raise KindError(f"{kind.package}.tick: {error_text(error)}") from error
    return found


def row_types() -> list[type]:
    """Return the type of a log row of every kind whose room `tick` can be used.

    Every run asks for it, so no other room is imported.
    """
    types = []
    for entry in REGISTRY.entries():
        with suppress(KindError):
            types.append(_cycle_kind(_kind(entry)).row_type)
    return types
