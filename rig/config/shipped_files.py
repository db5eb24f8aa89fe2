"""Files that wec-rig ships (campaigns, sessions, rigs, plants, their input files), and their names.

The source tree keeps them in `configs/`, a wheel in `rig/configs/`. Programs only read them: an
installation may be read-only.
"""

import os
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from rig.regular_file import MAX_CONFIG_BYTES, read_regular

CAMPAIGNS, SESSIONS, RIGS, PLANTS = "campaigns", "sessions", "rigs", "plants"
LIMITS, SEAS, DEVICES, FAULTS = "limits", "seas", "devices", "faults"
KINDS = {
    CAMPAIGNS: "campaign",
    SESSIONS: "session",
    RIGS: "rig",
    PLANTS: "plant",
    LIMITS: "limits file",
    SEAS: "sea",
    DEVICES: "device file",
    FAULTS: "table of faults",
}
"""Folders whose files have names, and the noun for one such file."""

FILE_KEYS = {"rig": RIGS, "plant": PLANTS, "limits": LIMITS, "sea": SEAS, "device": DEVICES}
"""Keys of files that name another file, and the folder of the shipped files they may name."""

_SUFFIX = ".yaml"
_SENTENCE_END = re.compile(r"(?<=\.)\s+(?=[A-Z])")


class UnknownNameError(ValueError):
    """No file or no single shipped file has the given name; the message lists the names."""


class ShippedFile(NamedTuple):
    """A shipped file of one of `KINDS`."""

    kind: str  # a key of KINDS
    name: str
    path: Path

    @property
    def qualified_name(self) -> str:
        """Name with the kind, which is unique: campaigns/irregular."""
        return f"{self.kind}/{self.name}"


def shipped_folder() -> Path:
    """Return the folder of the shipped files."""
    installed = Path(str(resources.files("rig"))) / "configs"
    return installed if installed.is_dir() else installed.parents[1] / "configs"


def shipped_files(*kinds: str) -> list[ShippedFile]:
    """Return the shipped files of some kinds, by kind and name."""
    folder = shipped_folder()
    return [
        ShippedFile(kind, path.stem, path)
        for kind in kinds
        for path in sorted((folder / kind).glob(f"*{_SUFFIX}"))
    ]


def find_shipped(name: str, *kinds: str) -> ShippedFile:
    """Return the shipped file of a name or KIND/NAME.

    Raises `UnknownNameError` with the names of the shipped files of ``kinds`` if none has the name,
    or with the full names if files of several kinds have it.
    """
    shipped = shipped_files(*kinds)
    matches = [one for one in shipped if name in (one.name, one.qualified_name)]
    if len(matches) > 1:
        full_names = " or ".join(one.qualified_name for one in matches)
        nouns = " and a ".join(KINDS[one.kind] for one in matches)
        raise UnknownNameError(f"{name}: name of a shipped {nouns}; write {full_names}")
    if not matches:
        raise UnknownNameError(_no_match_text(name, shipped, kinds))
    return matches[0]


def find_file(name: Path, *kinds: str, folder: Path | None = None) -> Path | ShippedFile:
    """Return the file that a person or a file names: a path, or a shipped file of some kinds.

    A path is relative to ``folder``, that of the file with the name; None: the current one. An
    existing file comes first. Any other text with a suffix or a folder is a path, too, except
    KIND/NAME of a shipped file, and so is every text without ``kinds``. Raises `UnknownNameError`
    as `find_shipped` does.
    """
    path = name if folder is None else path_from(folder, str(name))
    is_folder = os.path.isdir(path)
    if not kinds or (os.path.exists(path) and not is_folder):
        return path
    try:
        return find_shipped(str(name), *kinds)
    except UnknownNameError as error:
        if len(name.parts) != 1 or name.suffix or is_folder:
            return path
        if os.path.isfile(f"{path}{_SUFFIX}"):
            hint = f"{name}{_SUFFIX} is here: write the whole file name"
            raise UnknownNameError(f"{hint}\n{error}") from None
        raise


def path_from(folder: Path, name: str) -> Path:
    """Return the path that a file in a folder names: relative to it, absolute, or from ``~``."""
    return Path(os.path.normpath(folder / os.path.expanduser(name)))


def local_copies(shipped: ShippedFile) -> list[Path]:
    """Return files in the current folder that look like edited copies of a shipped file."""
    file = f"{shipped.name}{_SUFFIX}"
    candidates = [Path(file), Path(shipped.kind, file)]
    return [path for path in candidates if path.is_file() and not path.samefile(shipped.path)]


def title(path: Path) -> str:
    """Return the first sentence of the comment at the head of a file, without its full stop."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return _SENTENCE_END.split(" ".join(lines), maxsplit=1)[0].removesuffix(".")


def _no_match_text(name: str, shipped: list[ShippedFile], kinds: tuple[str, ...]) -> str:
    """Return that nothing has the name, where it may be found instead, and the names there are."""
    lines = [f"{name}: no such file here, and no shipped {' or '.join(KINDS[k] for k in kinds)}"]
    others = [one for one in shipped_files(*KINDS) if one.name == name and one.kind not in kinds]
    lines += [f"there is a shipped {KINDS[one.kind]} {one.qualified_name}" for one in others]
    for kind in kinds:
        names = ", ".join(one.name for one in shipped if one.kind == kind)
        lines.append(f"shipped {kind}: {names or 'none'}")
    return "\n".join(lines)


class CopyResult(NamedTuple):
    """Files of a finished copy."""

    main: Path  # the file that was named
    written: list[Path]
    kept: list[Path]  # existed before


def referenced_files(path: Path) -> list[Path]:
    """Return a shipped file and every file that it refers to, directly or through others.

    A reference is any text value that is the name of an existing file, relative to its own file.
    """
    found = [path]
    for file in found:  # the list grows
        if file.suffix != ".yaml":
            continue
        text = read_regular(file, MAX_CONFIG_BYTES).decode("utf-8")
        for value in _texts_of(text):
            named = path_from(file.parent, value)
            if named not in found and named.is_file():
                found.append(named)
    return found


def copy_files(path: Path, folder: Path, *, keep_existing: bool = False) -> CopyResult:
    """Copy a shipped file and the files that it refers to into a folder.

    Files that exist with the same content stay. With ``keep_existing`` those with another content
    stay, too; without it the function raises FileExistsError with their names and writes nothing.
    """
    root = shipped_folder()
    copies = {source: folder / source.relative_to(root) for source in referenced_files(path)}
    contents = {source: source.read_bytes() for source in copies}
    present = [source for source, target in copies.items() if target.exists()]
    edited = [
        str(copies[source])
        for source in present
        if not copies[source].is_file() or copies[source].read_bytes() != contents[source]
    ]
    if edited and not keep_existing:
        raise FileExistsError(
            f"{', '.join(edited)}: exists and differs from the shipped file, so nothing was "
            "written; --keep-existing leaves such files as they are, --to FOLDER copies elsewhere"
        )
    written = []
    for source, target in copies.items():
        if source in present:
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as file:
            file.write(contents[source])
        written.append(target)
    return CopyResult(copies[path], written, [copies[source] for source in present])


@lru_cache(maxsize=64)
def _texts_of(text: str) -> tuple[str, ...]:
    """Return the text values of a YAML file."""
    return tuple(_text_values(YAML(typ="safe", pure=True).load(text)))


def _text_values(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict):
        for value in tree.values():
            yield from _text_values(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from _text_values(value)
