"""The pages of the documentation, and those that are not yet rewritten."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

NOT_REWRITTEN = frozenset([])
"""Pages whose blocks need not run and whose prose is not linted; a rewritten page leaves them."""


def path_of(page: str) -> Path:
    """Return the file of a page: of docs/, or the README."""
    return ROOT / page if page == "README.md" else DOCS / page


def all_pages() -> list[str]:
    """Return README and all pages of docs/; decisions are records of their time."""
    found = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    return ["README.md", *sorted(each for each in found if "decisions/" not in each)]


def rewritten_pages() -> list[str]:
    """Return the pages that the checks of blocks and prose hold for."""
    return [each for each in all_pages() if each not in NOT_REWRITTEN]
