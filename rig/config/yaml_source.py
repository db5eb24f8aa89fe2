"""Reading of YAML files that keeps the file and line of every value.

The files are YAML 1.2 (`1e3` is a number, `on` is text); duplicate keys are refused. A file may
extend another one with `extends: other.yaml`, relative to itself, or by the name of a shipped file
of its own sort. Mappings are then merged key by key, and every other value is replaced. An empty
value (`key:`) removes an inherited key. A mapping whose `kind` changes is replaced as a whole,
because the keys of one kind have no meaning in another. Keys listed in ``inline`` may name a file
that holds their mapping: the mapping replaces the name, and its values keep their own file and
line. Such a key may be deeper in the file: `line.*.device` is that of every entry of a list.
"""

import errno
import os
import stat
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from rig.config.esi import EsiError, read_esi
from rig.config.problems import ConfigError, Problem, display_path, format_key, format_value
from rig.config.shipped_files import (
    CAMPAIGNS,
    FILE_KEYS,
    KINDS,
    SESSIONS,
    UnknownNameError,
    find_file,
)
from rig.regular_file import MAX_CONFIG_BYTES, read_regular

KeyPath = tuple[str | int, ...]


class SourceLocation(NamedTuple):
    """A line of a file."""

    path: Path
    line: int  # from 1


class SourceMap:
    """File and line of each value of a merged mapping.

    Calling the map with a key path returns the `SourceLocation` of that key. For a missing key it
    returns the location of the nearest enclosing mapping, so that a missing key is reported on
    the line of its mapping.
    """

    def __init__(
        self,
        path: Path,
        places: dict[KeyPath, SourceLocation],
        files: tuple[Path, ...],
        inlined: Mapping[Path, str] | None = None,
    ) -> None:
        self.path = path
        self.locations = places
        self.files = files  # every file read: the named one first, then the files it extends
        self.inlined = dict(inlined or {})  # those that hold the mapping of a single key, and it

    def __call__(self, key: KeyPath = ()) -> SourceLocation:
        """Return the location of a key, or of the nearest enclosing key that exists."""
        for length in range(len(key), 0, -1):
            location = self.locations.get(key[:length])
            if location is not None:
                return location
        return self.locations.get((), SourceLocation(self.path, 1))

    def resolve_path(self, key: KeyPath, name: str, *kinds: str, allowed: str = "") -> Path:
        """Return the path of the file that ``key`` names.

        A path is relative to the file with that key, absolute, or from ``~``. Else the name is that
        of a shipped file of ``kinds``; an existing file comes first. Raises `ConfigError` for a
        name that neither has. ``allowed`` is what else the key may have, for the message.
        """
        try:
            found = find_file(Path(name), *kinds, folder=self(key).path.parent)
        except UnknownNameError as error:
            message = str(error).replace("\n", "; ").replace(" here", " in this folder")
            message += f"; {allowed} is allowed, too" if allowed else ""
            raise ConfigError([self.problem(key, name, message)]) from None
        return found if isinstance(found, Path) else found.path

    def existing_path(self, key: KeyPath, name: str, *kinds: str, allowed: str = "") -> Path:
        """Return the path of a file as `resolve_path` does.

        Raises `ConfigError` if there is no such file, too, or if it is a folder.
        """
        path = self.resolve_path(key, name, *kinds, allowed=allowed)
        try:
            if not stat.S_ISDIR(path.stat().st_mode):
                return path
            reason = os.strerror(errno.EISDIR)
        except OSError as error:
            reason = error.strerror or type(error).__name__
        except ValueError as error:
            reason = str(error)
        nouns = " or ".join(KINDS[kind] for kind in kinds)
        names = f", or the name of a shipped {nouns}" if kinds else ""
        allowed = f"{allowed} or " if allowed else ""
        allowed += f"the path of a file, relative to this one{names}"
        message = f"cannot read {display_path(path)}: {reason}; allowed {allowed}"
        raise ConfigError([self.problem(key, name, message)])

    def problem(self, key: KeyPath, value: object, message: str) -> Problem:
        """Return a problem with the file and line of a key."""
        location = self(key)
        return Problem(display_path(location.path), location.line, format_key(key), value, message)


_TAG = "tag:yaml.org,2002:"

MAX_LEVELS = 50
"""Maximum nesting depth of a file."""

MAX_NODES = 100_000
"""Maximum number of keys and values of a file, with all aliases expanded."""

_TOO_DEEP = f"nested too deeply; allowed at most {MAX_LEVELS} levels"
_TOO_MANY = f"too many keys and values; allowed at most {MAX_NODES}, with aliases written out"


def load_mapping(
    path: Path,
    named_at: SourceLocation | None = None,
    key: str = "",
    inline: tuple[str, ...] = (),
    kinds: tuple[str, ...] = (),
) -> tuple[dict[str, Any], SourceMap]:
    """Return the merged plain mapping of a file, and the file and line of each value.

    ``named_at`` and ``key`` are the location and the key that name the file; a file that cannot be
    read is reported there. ``inline`` lists the keys that may name a file with their mapping.
    ``kinds`` are those of the shipped files that it may extend by name; they follow from the key,
    and without one the file is a campaign or session. Raises `ConfigError` with every syntax
    problem.
    """
    if not kinds:
        kinds = kinds_of(key) if key else (CAMPAIGNS, SESSIONS)
    return _load(Path(path), named_at, key, (), inline, kinds)


def kinds_of(key: str) -> tuple[str, ...]:
    """Return the kinds of the shipped files that a key may name."""
    return (FILE_KEYS[key],) if key in FILE_KEYS else ()


def _load(
    path: Path,
    named_at: SourceLocation | None,
    key: str,
    chain: tuple[Path, ...],
    inline: tuple[str, ...] = (),
    kinds: tuple[str, ...] = (),
) -> tuple[dict[str, Any], SourceMap]:
    """Load a file; ``chain`` holds the files that led to it, to detect circular references."""
    resolved = path.resolve()
    at = named_at or SourceLocation(path, 1)
    if resolved in chain:
        cycle = " -> ".join(p.name for p in (*chain[chain.index(resolved) :], resolved))
        raise ConfigError([_problem(at, "extends", path, f"files extend in a circle: {cycle}")])
    root = _compose(path, at, key)
    reader = _Reader(path)
    tree = reader.value(root, ())
    if reader.problems:
        raise ConfigError(reader.problems)
    if not isinstance(tree, dict):
        message = f"the file holds {format_value(tree)}, not a mapping"
        raise ConfigError([_problem(SourceLocation(path, 1), "", tree, message)])
    locate = SourceMap(path, reader.locations, (path,))
    base = tree.pop("extends", None)
    at = locate(("extends",))
    if isinstance(base, str):
        base_path = locate.existing_path(("extends",), base, *kinds)
    locate.locations.pop(("extends",), None)
    inlined_keys = _inline_files(tree, locate, inline, (*chain, resolved))
    if base is None:
        return tree, locate
    if not isinstance(base, str):
        message = f"{format_value(base)} is not a file name"
        raise ConfigError([_problem(at, "extends", base, message)])
    inherited, origin = _load(base_path, at, "extends", (*chain, resolved), inline, kinds)
    locations = dict(origin.locations)
    for name in inlined_keys & inherited.keys():
        del inherited[name]  # an inlined file replaces an inherited mapping, it does not change it
        _remove_locations(locations, (name,))
    _merge(inherited, tree, locations, locate.locations, ())
    locations[()] = locate.locations[()]
    used = {location.path for location in locations.values()}
    holding = origin.inlined | locate.inlined
    inlined = {path: key for path, key in holding.items() if path in used}
    unused = holding.keys() - used
    files = tuple(dict.fromkeys(p for p in (*locate.files, *origin.files) if p not in unused))
    return inherited, SourceMap(path, locations, files, inlined)


def _inline_files(
    tree: dict[str, Any], locate: SourceMap, inline: tuple[str, ...], chain: tuple[Path, ...]
) -> set[str]:
    """Replace file names by the mappings in those files; return the keys that named a file."""
    places = [place for pattern in inline for place in _places(tree, tuple(pattern.split(".")))]
    for key, holder in sorted(places, key=lambda place: str(place[0])):
        name = str(key[-1])
        kinds = kinds_of(name)
        file, mark, part = holder[name].partition("#")
        path = locate.existing_path(key, file, *kinds, allowed="a mapping")
        if mark or path.suffix == ".xml":
            mapping, origin = _load_esi(path, part, locate, key)
        else:
            mapping, origin = _load(path, locate(key), name, chain, kinds=kinds)
        holder[name] = mapping
        locate.locations.update({(*key, *each): place for each, place in origin.locations.items()})
        locate.files += origin.files
        locate.inlined |= dict.fromkeys(origin.files, name)
    return {str(key[0]) for key, _ in places if len(key) == 1}


def _load_esi(
    path: Path, part: str, locate: SourceMap, key: KeyPath
) -> tuple[dict[str, Any], SourceMap]:
    """Return a slave of an ESI file as a mapping; all its values are at the file's first line."""
    try:
        mapping = read_esi(path, part)
    except (EsiError, OSError) as error:
        raise ConfigError([locate.problem(key, str(path), f"{path.name}: {error}")]) from None
    return mapping, SourceMap(path, {(): SourceLocation(path, 1)}, (path,))


def _places(
    tree: Any, pattern: tuple[str, ...], at: KeyPath = ()
) -> Iterator[tuple[KeyPath, dict[str, Any]]]:
    """Yield each key that has a file name, and the mapping with the key; `*`: of any list."""
    first, *rest = pattern
    if first == "*":
        for number, item in enumerate(tree if isinstance(tree, list) else ()):
            yield from _places(item, tuple(rest), (*at, number))
    elif isinstance(tree, dict) and rest:
        yield from _places(tree.get(first), tuple(rest), (*at, first))
    elif isinstance(tree, dict) and isinstance(tree.get(first), str):
        yield (*at, first), tree


def _merge(
    base: dict[str, Any],
    override: dict[str, Any],
    locations: dict[KeyPath, SourceLocation],
    override_locations: dict[KeyPath, SourceLocation],
    at: KeyPath,
) -> None:
    """Merge ``override`` into ``base``, and the locations of its values into ``locations``."""
    for key, value in override.items():
        key_path = (*at, key)
        old = base.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and _same_kind(old, value):
            locations[key_path] = override_locations[key_path]
            _merge(old, value, locations, override_locations, key_path)
            continue
        _remove_locations(locations, key_path)
        if value is None and key in base:
            del base[key]
            continue
        base[key] = value
        depth = len(key_path)
        locations.update({k: p for k, p in override_locations.items() if k[:depth] == key_path})


def _remove_locations(locations: dict[KeyPath, SourceLocation], at: KeyPath) -> None:
    """Remove the locations of a key and of all keys below it."""
    for key_path in [k for k in locations if k[: len(at)] == at]:
        del locations[key_path]


def _same_kind(old: dict[str, Any], new: dict[str, Any]) -> bool:
    return "kind" not in new or new["kind"] == old.get("kind")


def _compose(path: Path, named_at: SourceLocation, key: str) -> Node | None:
    try:
        text = read_regular(path, MAX_CONFIG_BYTES).decode("utf-8-sig")
    except OSError as error:
        reason = error.strerror or type(error).__name__
        message = f"cannot read {display_path(path)}: {reason}"
        raise ConfigError([_problem(named_at, key, str(path), message)]) from None
    except UnicodeDecodeError as error:
        message = f"the file is not UTF-8 text (byte {error.start})"
        raise ConfigError([_problem(SourceLocation(path, 1), "", None, message)]) from None
    try:
        return _nodes(text)
    except _FileTooLargeError as error:
        location = SourceLocation(path, error.problem_mark.line + 1)
        raise ConfigError([_problem(location, "", None, str(error.problem))]) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else 1
        message = f"YAML syntax: {error.problem or error.context or 'not readable'}"
        raise ConfigError([_problem(SourceLocation(path, line), "", None, message)]) from None
    except YAMLError as error:
        message = f"YAML syntax: {(str(error).splitlines() or ['not readable'])[0]}"
        raise ConfigError([_problem(SourceLocation(path, 1), "", None, message)]) from None


@lru_cache(maxsize=64)
def _nodes(text: str) -> Node | None:
    """Return the composed nodes of a file, which nothing changes; files are read repeatedly."""
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _Composer
    node: Node | None = yaml.compose(text)
    return node


class _FileTooLargeError(ComposerError):
    """The file has more levels or nodes than any configuration needs."""


class _Composer(Composer):
    """A composer that stops at a file that would cause a RecursionError or take minutes."""

    levels = nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.nodes += 1
        self.levels += 1
        if self.levels > MAX_LEVELS or self.nodes > MAX_NODES:
            message = _TOO_DEEP if self.levels > MAX_LEVELS else _TOO_MANY
            mark = self.parser.peek_event().start_mark
            raise _FileTooLargeError(problem=message, problem_mark=mark)
        node = super().compose_node(parent, index)
        self.levels -= 1
        return node


class _Reader:
    """Converts composed nodes to plain values and records the line of each value."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.locations: dict[KeyPath, SourceLocation] = {(): SourceLocation(path, 1)}
        self.problems: list[Problem] = []
        self.constructor = YAML(typ="safe", pure=True).constructor
        self.nodes = 0

    def value(self, node: Node | None, at: KeyPath, ancestors: tuple[int, ...] = ()) -> Any:
        """Return the plain value of a node; ``ancestors`` are the ids of the enclosing nodes."""
        if node is None:
            return None
        if id(node) in ancestors:
            self.add_problem(node, at, "an alias that contains itself")
            return None
        self.nodes += 1  # each use of an alias counts in full: nine lines can expand to a billion
        if len(ancestors) >= MAX_LEVELS or self.nodes > MAX_NODES:
            self.add_problem(node, at, _TOO_DEEP if len(ancestors) >= MAX_LEVELS else _TOO_MANY)
            raise ConfigError(self.problems)
        if isinstance(node, MappingNode):
            return self.mapping(node, at, (*ancestors, id(node)))
        if isinstance(node, SequenceNode):
            items = []
            for i, item in enumerate(node.value):
                self.locations[(*at, i)] = SourceLocation(self.path, item.start_mark.line + 1)
                items.append(self.value(item, (*at, i), (*ancestors, id(node))))
            return items
        if isinstance(node, ScalarNode):
            return self.scalar(node, at)
        raise TypeError(f"YAML has no node of type {type(node).__name__}")

    def mapping(self, node: MappingNode, at: KeyPath, ancestors: tuple[int, ...]) -> dict[str, Any]:
        """Return the plain mapping of a node; duplicate keys and merge keys are problems."""
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                self.add_problem(key_node, at, "a key must be plain text, not a list or mapping")
                continue
            key = str(key_node.value)
            key_path = (*at, key)
            if key in values:
                first = self.locations[key_path].line
                self.add_problem(key_node, key_path, f"duplicate key, first on line {first}")
                continue
            if key == "<<":
                self.add_problem(key_node, key_path, "merge keys are not supported; use extends")
                continue
            self.locations[key_path] = SourceLocation(self.path, key_node.start_mark.line + 1)
            values[key] = self.value(value_node, key_path, ancestors)
        return values

    def scalar(self, node: ScalarNode, at: KeyPath) -> Any:
        """Return the plain value of a scalar node."""
        kind = str(node.tag).removeprefix(_TAG)
        if kind in ("str", "timestamp"):  # no field of these files is a date object: keep the text
            return str(node.value)
        if kind == "null":
            return None
        try:
            if kind == "bool":
                return bool(self.constructor.construct_yaml_bool(node))
            if kind == "int":
                integer = int(self.constructor.construct_yaml_int(node))
                if abs(integer) >= 2**63:  # does not fit the int64 of a log
                    self.add_problem(node, at, "a whole number of more than 64 bits")
                return integer
            if kind == "float":
                return float(self.constructor.construct_yaml_float(node))
        except ValueError:
            self.add_problem(node, at, f"{node.value!r} is not a number")
            return None
        self.add_problem(node, at, f"the tag {node.tag} is not supported")
        return None

    def add_problem(self, node: Node, at: KeyPath, message: str) -> None:
        """Record a problem at the line of a node."""
        location = SourceLocation(self.path, node.start_mark.line + 1)
        self.problems.append(_problem(location, format_key(at), None, message))


def _problem(location: SourceLocation, key: str, value: object, message: str) -> Problem:
    return Problem(display_path(location.path), location.line, key, value, message)
