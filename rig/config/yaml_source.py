"""Reading a YAML file so that every value still knows the file and line it came from.

YAML 1.2 (`1e3` is a number, `on` is text), duplicate keys refused. A file may say
`extends: other.yaml`, relative to itself: mappings are merged key by key, everything else is
replaced; an empty value (`key:`) takes an inherited key out; a mapping whose `kind` changes is
replaced whole, because the keys of one kind mean nothing to another. Where the reader allows it
(``inline``), a key may name a file that holds its mapping: that mapping then stands in its place,
and its values still know their own file and line.
"""

import os
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from rig.config.places import KeyPath, Locate, Place
from rig.config.problems import ConfigError, Problem, key_text, shown, value_text
from rig.regular_file import CONFIG_MOST, read_regular

__all__ = ["KeyPath", "Locate", "Place", "load_mapping"]

_TAG = "tag:yaml.org,2002:"

MOST_LEVELS = 50
"""Deepest nesting of a file."""

MOST_NODES = 100_000
"""Most keys and values of a file, each alias counted with all it stands for."""

_TOO_DEEP = f"nested too deeply; allowed at most {MOST_LEVELS} levels"
_TOO_MANY = f"too many keys and values; allowed at most {MOST_NODES}, with aliases written out"


def load_mapping(
    path: Path, asked: Place | None = None, key: str = "", inline: tuple[str, ...] = ()
) -> tuple[dict[str, Any], Locate]:
    """Merged plain mapping of a file and of all it extends, and where each value stands.

    ``asked`` and ``key`` are the place and the key that name the file; a file that cannot be read
    is reported there. ``inline`` are the keys that may name a file with their mapping.
    Raises `ConfigError` with every problem of syntax.
    """
    return _load(Path(path), asked, key, (), inline)


def _load(
    path: Path, asked: Place | None, key: str, chain: tuple[Path, ...], inline: tuple[str, ...] = ()
) -> tuple[dict[str, Any], Locate]:
    here = path.resolve()
    at = asked or Place(path, 1)
    if here in chain:
        round_trip = " -> ".join(p.name for p in (*chain[chain.index(here) :], here))
        raise ConfigError(
            [_problem(at, "extends", path, f"files extend in a circle: {round_trip}")]
        )
    root = _compose(path, at, key)
    reader = _Reader(path)
    tree = reader.value(root, ())
    if reader.problems:
        raise ConfigError(reader.problems)
    if not isinstance(tree, dict):
        raise ConfigError(
            [
                _problem(
                    Place(path, 1), "", tree, f"the file holds {value_text(tree)}, not a mapping"
                )
            ]
        )
    locate = Locate(path, reader.places, (path,))
    base = tree.pop("extends", None)
    at = locate(("extends",))
    locate.places.pop(("extends",), None)
    named = _inline(tree, locate, inline, (*chain, here))
    if base is None:
        return tree, locate
    if not isinstance(base, str):
        raise ConfigError([_problem(at, "extends", base, f"{value_text(base)} is not a file name")])
    below = Path(os.path.normpath(path.parent / base))
    inherited, origin = _load(below, at, "extends", (*chain, here), inline)
    places = dict(origin.places)
    for name in named & inherited.keys():
        del inherited[name]  # a file stands for itself, not for a change of another
        _forget(places, (name,))
    _merge(inherited, tree, places, locate.places, ())
    places[()] = locate.places[()]
    used = {place.path for place in places.values()}
    inlined = tuple(p for p in (*locate.inlined, *origin.inlined) if p in used)
    passed = (*locate.files, *origin.files)
    unused = {*locate.inlined, *origin.inlined} - used
    files = tuple(dict.fromkeys(p for p in passed if p not in unused))
    return inherited, Locate(path, places, files, inlined)


def _inline(
    tree: dict[str, Any], locate: Locate, inline: tuple[str, ...], chain: tuple[Path, ...]
) -> set[str]:
    """Put the mapping of a file where its name stands; gives the keys that name one."""
    named = {name for name in inline if isinstance(tree.get(name), str)}
    for name in sorted(named):
        at = (name,)
        path = locate.file(at, tree[name])
        if not path.is_file():
            message = f"cannot read {shown(path)}: no such file; allowed a mapping or a file of one"
            raise ConfigError([locate.problem(at, tree[name], message)])
        mapping, origin = _load(path, locate(at), name, chain)
        tree[name] = mapping
        locate.places.update({(name, *key): place for key, place in origin.places.items()})
        locate.files += origin.files
        locate.inlined += origin.files
    return named


def _merge(
    base: dict[str, Any],
    over: dict[str, Any],
    places: dict[KeyPath, Place],
    over_places: dict[KeyPath, Place],
    at: KeyPath,
) -> None:
    for key, value in over.items():
        here = (*at, key)
        old = base.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and _same_kind(old, value):
            places[here] = over_places[here]
            _merge(old, value, places, over_places, here)
            continue
        _forget(places, here)
        if value is None and key in base:
            del base[key]
            continue
        base[key] = value
        places.update({k: p for k, p in over_places.items() if k[: len(here)] == here})


def _forget(places: dict[KeyPath, Place], at: KeyPath) -> None:
    """Take out the places of a key and of all below it."""
    for gone in [k for k in places if k[: len(at)] == at]:
        del places[gone]


def _same_kind(old: dict[str, Any], new: dict[str, Any]) -> bool:
    return "kind" not in new or new["kind"] == old.get("kind")


def _compose(path: Path, asked: Place, key: str) -> Node | None:
    try:
        text = read_regular(path, CONFIG_MOST).decode("utf-8-sig")
    except OSError as error:
        reason = error.strerror or type(error).__name__
        message = f"cannot read {shown(path)}: {reason}"
        raise ConfigError([_problem(asked, key, str(path), message)]) from None
    except UnicodeDecodeError as error:
        message = f"the file is not UTF-8 text (byte {error.start})"
        raise ConfigError([_problem(Place(path, 1), "", None, message)]) from None
    try:
        yaml = YAML(typ="safe", pure=True)
        yaml.Composer = _Composer
        node: Node | None = yaml.compose(text)
    except _TooMuchError as error:
        place = Place(path, error.problem_mark.line + 1)
        raise ConfigError([_problem(place, "", None, str(error.problem))]) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else 1
        message = f"YAML syntax: {error.problem or error.context or 'not readable'}"
        raise ConfigError([_problem(Place(path, line), "", None, message)]) from None
    except YAMLError as error:
        first = (str(error).splitlines() or ["not readable"])[0]
        raise ConfigError([_problem(Place(path, 1), "", None, f"YAML syntax: {first}")]) from None
    return node


class _TooMuchError(ComposerError):
    """A file larger than any configuration."""


class _Composer(Composer):
    """Gives up on a file that would end in a RecursionError, or only after minutes."""

    levels = nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.nodes += 1
        self.levels += 1
        if self.levels > MOST_LEVELS or self.nodes > MOST_NODES:
            said = _TOO_DEEP if self.levels > MOST_LEVELS else _TOO_MANY
            raise _TooMuchError(problem=said, problem_mark=self.parser.peek_event().start_mark)
        node = super().compose_node(parent, index)
        self.levels -= 1
        return node


class _Reader:
    """Turns composed nodes into plain values and notes the line of each."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.places: dict[KeyPath, Place] = {(): Place(path, 1)}
        self.problems: list[Problem] = []
        self.construct = YAML(typ="safe", pure=True).constructor
        self.nodes = 0

    def value(self, node: Node | None, at: KeyPath, inside: tuple[int, ...] = ()) -> Any:
        if node is None:
            return None
        if id(node) in inside:
            self.refuse(node, at, "an alias that contains itself")
            return None
        self.nodes += 1  # aliases count with all they stand for: nine lines can mean a billion
        if len(inside) >= MOST_LEVELS or self.nodes > MOST_NODES:
            self.refuse(node, at, _TOO_DEEP if len(inside) >= MOST_LEVELS else _TOO_MANY)
            raise ConfigError(self.problems)
        if isinstance(node, MappingNode):
            return self.mapping(node, at, (*inside, id(node)))
        if isinstance(node, SequenceNode):
            items = []
            for i, item in enumerate(node.value):
                self.places[(*at, i)] = Place(self.path, item.start_mark.line + 1)
                items.append(self.value(item, (*at, i), (*inside, id(node))))
            return items
        if isinstance(node, ScalarNode):
            return self.scalar(node, at)
        raise TypeError(f"YAML has no node of type {type(node).__name__}")

    def mapping(self, node: MappingNode, at: KeyPath, inside: tuple[int, ...]) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                self.refuse(key_node, at, "a key must be a word")
                continue
            key = str(key_node.value)
            here = (*at, key)
            if key in values:
                first = self.places[here].line
                self.refuse(key_node, here, f"the key stands twice, first on line {first}")
                continue
            if key == "<<":
                self.refuse(key_node, here, "merge keys are not read; use extends")
                continue
            self.places[here] = Place(self.path, key_node.start_mark.line + 1)
            values[key] = self.value(value_node, here, inside)
        return values

    def scalar(self, node: ScalarNode, at: KeyPath) -> Any:
        kind = str(node.tag).removeprefix(_TAG)
        if kind in ("str", "timestamp"):  # a date is text: nothing here is a date
            return str(node.value)
        if kind == "null":
            return None
        try:
            if kind == "bool":
                return bool(self.construct.construct_yaml_bool(node))
            if kind == "int":
                whole = int(self.construct.construct_yaml_int(node))
                if abs(whole) >= 2**63:  # no float or int64 of a log could hold it
                    self.refuse(node, at, "a whole number of more than 64 bits")
                return whole
            if kind == "float":
                return float(self.construct.construct_yaml_float(node))
        except ValueError:
            self.refuse(node, at, f"{node.value!r} is not a number")
            return None
        self.refuse(node, at, f"the tag {node.tag} is not read")
        return None

    def refuse(self, node: Node, at: KeyPath, message: str) -> None:
        place = Place(self.path, node.start_mark.line + 1)
        self.problems.append(_problem(place, key_text(at), None, message))


def _problem(place: Place, key: str, value: object, message: str) -> Problem:
    return Problem(shown(place.path), place.line, key, value, message)
