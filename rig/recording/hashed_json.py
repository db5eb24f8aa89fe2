"""JSON files with a hash of their contents: a changed or damaged file is no file."""

import hashlib
import json
from pathlib import Path
from typing import Any

from rig.recording.runs import create

_SHA = "sha256"


def digest(value: Any) -> str:
    """Return the SHA-256 of JSON values, in hexadecimal digits."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def write(folder: Path, name: str, content: dict[str, Any]) -> None:
    """Write contents with their hash; raises OSError and leaves no partial file behind."""
    create.write_json(folder, name, content | {_SHA: digest(content)})


def read(path: Path) -> dict[str, Any] | None:
    """Return the contents of a file without its hash; None if it is missing or was changed."""
    try:
        content: dict[str, Any] = json.loads(path.read_text())
        found = content.pop(_SHA)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return content if found == digest(content) else None
