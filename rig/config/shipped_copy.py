"""Copies of shipped files with every file that they refer to, for people to edit.

A copy has the folders of the original (`campaigns/`, `rigs/`, `limits/`, ...), so that the relative
file names inside the files stay valid and no text changes.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from rig.config.shipped_files import shipped_folder
from rig.regular_file import MAX_CONFIG_BYTES, read_regular


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
        for value in _text_values(YAML(typ="safe", pure=True).load(text)):
            named = Path(os.path.normpath(file.parent / value))
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


def _text_values(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict):
        for value in tree.values():
            yield from _text_values(value)
    elif isinstance(tree, list):
        for value in tree:
            yield from _text_values(value)
