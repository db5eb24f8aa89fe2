"""A new kind of rig in a distribution of its own: the example kind under another name.

The example, `rig/templates/kind`, is a complete package named after its kind, `winch`; a new kind
is a copy in which that name is replaced wherever it occurs. So the example is valid Python, checked
and tested as it is.
"""

import keyword
import re
from collections.abc import Iterator
from importlib import metadata, resources
from importlib.util import find_spec
from pathlib import Path

from ruamel.yaml import YAML

from rig import laws
from rig.kinds import registry
from rig.kinds.new_files import write_new
from rig.plug_ins import DISTRIBUTION

EXAMPLE = "winch"
MAX_LENGTH = 24  # so that no line of the example becomes too long

_NAME = re.compile(rf"[a-z][a-z0-9_]{{0,{MAX_LENGTH - 1}}}")
_NOT_COPIED = {"__pycache__", ".pytest_cache", ".ruff_cache", ".mypy_cache"}


def write_kind(name: str, folder: Path) -> list[Path]:
    """Write the package of a new kind below ``folder``, and return its files.

    Raises ValueError with every reason why the name cannot be used or a file not be written.
    """
    files = {folder / path: text for path, text in kind_files(name).items()}
    return write_new(files, name_problems(name, folder))


def kind_files(name: str) -> dict[Path, str]:
    """Return the texts of a new kind's files by their paths, which begin with its folder."""
    root = Path(str(resources.files("rig"))) / "templates" / "kind"
    project = Path(f"wec_{name}")
    return {
        project / _renamed(str(source.relative_to(root)), name): _renamed(
            source.read_text(encoding="utf-8"), name
        )
        for source in sorted(root.rglob("*"))
        if source.is_file() and not _NOT_COPIED & set(source.parts)
    }


def name_problems(name: str, folder: Path) -> Iterator[str]:
    """Yield why a new kind cannot have a name; ``folder`` is that of the new files."""
    if not _NAME.fullmatch(name):
        yield (
            f"{name!r} cannot be the name of a kind; allowed [a-z][a-z0-9_]*, at most {MAX_LENGTH} "
            "characters"
        )
        return
    if keyword.iskeyword(name) or YAML(typ="safe", pure=True).load(name) != name:
        yield f"{name!r} has another meaning in Python or YAML; allowed any other name"
    for names, noun in ((registry.REGISTRY, "kind of rig"), (laws.REGISTRY, "law")):
        entry = names.find(name)
        if entry is not None:
            yield f"{entry.origin} has a {noun} {name!r} ({entry.module}); allowed any other name"
    package = f"wec_{name}"
    if _is_installed(package.replace("_", "-")):
        yield f"a distribution {package.replace('_', '-')} is installed; allowed any other name"
    spec = None if (folder / package).exists() else find_spec(package)
    if spec is not None and spec.origin:
        yield f"a package {package} exists ({spec.origin}); allowed any other name"


def _renamed(text: str, name: str) -> str:
    """Return a text of the example with another kind's name; distributions are written with -."""
    text = text.replace(f"wec-{EXAMPLE}", f"wec-{name.replace('_', '-')}")
    return text.replace(EXAMPLE, name)


def _is_installed(distribution: str) -> bool:
    try:
        metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return distribution == DISTRIBUTION
    return True
