"""Output of results: for people, or as JSON for programs."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rig.cli.exit_codes import OK


def print_json(values: Any) -> int:
    """Print JSON values in one line, and return the exit code of success."""
    print(json.dumps(values, ensure_ascii=False))
    return OK


def print_result(
    values: dict[str, Any], text: str, written: Iterable[Path], *, as_json: bool
) -> int:
    """Print a result and its files; JSON has them as ``written``. Return the code of success."""
    names = [str(path) for path in written]
    if as_json:
        return print_json({**values, "written": names})
    print(text)
    print("\n" + "\n".join(names))
    return OK
