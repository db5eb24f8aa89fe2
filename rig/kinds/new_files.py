"""New files of `rig new`, none of which overwrites another one."""

from collections.abc import Iterable, Mapping
from pathlib import Path


def write_new(files: Mapping[Path, str | bytes], problems: Iterable[str] = ()) -> list[Path]:
    """Write new files and return their paths.

    Raises ValueError with ``problems`` and the names of the files that exist; then it writes none.
    """
    found = list(problems)
    found += [f"{path}: exists; nothing is overwritten" for path in files if path.exists()]
    if found:
        raise ValueError("\n".join(found))
    for path, content in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
    return list(files)
