"""The text of a campaign file that extends another one with a list of rows as its matrix."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from rig.config.yaml_source import load_mapping

_MAX_BASE_NAME = 52  # characters of the base's name in a derived one


def derived_name(name: str, suffix: str) -> str:
    """Return the name of a campaign that is derived from another one, perhaps again."""
    return name if name.endswith(suffix) else f"{name[:_MAX_BASE_NAME]}{suffix}"


def row_text(row: Mapping[str, float | str]) -> str:
    """Return a row of a matrix as it stands in a list: columns by key."""
    texts = (
        f"{key}: {json.dumps(value) if isinstance(value, str) else format(value, '.10g')}"
        for key, value in row.items()
    )
    return "{" + ", ".join(texts) + "}"


def derived_text(
    base: Path,
    path: Path,
    header: Iterable[str],
    keys: Sequence[str],
    rows: Iterable[tuple[Mapping[str, float | str], str]],
) -> str:
    """Return the text of a campaign file at ``path`` that extends ``base``.

    ``header``: comments; ``keys``: lines of the keys that differ; ``rows``: columns of the matrix
    by key, and a comment for each row.
    """
    mapping, _ = load_mapping(base, inline=("sea", "tank"))
    inherited = mapping.get("matrix") or {}
    lines = [
        *(f"# {line}" for line in header),
        f"extends: {json.dumps(os.path.relpath(base.resolve(), path.resolve().parent))}",
        *keys,
        *("adaptive:" for key in mapping if key == "adaptive"),  # removed: all rows are to run
        "matrix:",
        *(f"  {form}:" for form in ("grid", "csv") if form in inherited),
        "  list:",
    ]
    comments = {row_text(row): comment for row, comment in rows}
    widest = max(map(len, comments))
    lines += [f"    - {text:<{widest}}  # {comment}" for text, comment in comments.items()]
    return "\n".join(lines) + "\n"
