"""The pages of the documentation."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def path_of(page: str) -> Path:
    """Return the file of a page: of docs/, or the README."""
    return ROOT / page if page == "README.md" else DOCS / page


def all_pages() -> list[str]:
    """Return README and all pages of docs/; decisions are records of their time."""
    found = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    return ["README.md", *sorted(each for each in found if "decisions/" not in each)]
