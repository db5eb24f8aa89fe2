"""What was made of a sweep's finished cases, so that it is not made again where nothing changed."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rig.recording.runs.create import write_json
from rig.sweep.journal import NAME as CASES

NAME = "made.json"


def store(
    folder: Path, out: Path, measured: Path | None, files: Iterable[Path], told: dict[str, Any]
) -> None:
    """Keep what a sweep said of its result ``out``, and which ``files`` it wrote for it.

    ``measured``: the run that was drawn on top. Raises OSError where a file is gone.
    """
    of = _of(folder, out, measured)
    write_json(folder, NAME, {"of": of, "files": _stand(files), "told": told})


def load(folder: Path, out: Path) -> dict[str, Any] | None:
    """What was said, if cases and files are still those of then; None: it has to be made.

    Code, campaign and values need no look: the folder is named by them. What had a run drawn on top
    is made anew, and so is everything once a file is missing or was written to.
    """
    try:
        noted = json.loads((folder / NAME).read_text())
        stands = noted["of"] == _of(folder, out, None)
        told: dict[str, Any] = noted["told"]
        files = noted["files"]
        return told if stands and files == _stand(map(Path, files)) else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _of(folder: Path, out: Path, measured: Path | None) -> dict[str, Any]:
    return {
        "folder": str(folder),  # as it was asked for: what is said names its files so
        "out": str(out.resolve()),  # a relative one is another from elsewhere
        "measured": str(measured) if measured else None,
        "cases": hashlib.sha256((folder / CASES).read_bytes()).hexdigest(),
    }


def _stand(files: Iterable[Path]) -> dict[str, list[int]]:
    """Size and time of the last change (ns) of each file, by its whole path."""
    found = {}
    for path in files:
        told = path.stat()
        found[str(path.resolve())] = [told.st_size, told.st_mtime_ns]
    return found
