"""Spelling of pages: terms that neither the English dictionary nor docs/style/words.txt has."""

from __future__ import annotations

import re
from functools import cache

from spellchecker import SpellChecker

from .page_files import DOCS
from .prose import Finding, texts

OWN_TERMS = DOCS / "style" / "words.txt"
# The dictionary is American, the pages are British.
_BRITISH = (
    (r"is(e|ed|es|ing|ation|ations|er|ers)$", r"iz\1"),
    (r"ys(e|ed|es|ing|er|ers)$", r"yz\1"),
    (r"our", "or"),
    (r"re(s?)$", r"er\1"),
    (r"ll(ed|ing|er)$", r"l\1"),
    (r"ence$", "ense"),
)
_TERM = re.compile(r"(?<![\w./-])[A-Za-z][a-z]{2,}(?![\w/])")


@cache
def _dictionary() -> SpellChecker:
    return SpellChecker(distance=1)


@cache
def _own_terms() -> frozenset[str]:
    return frozenset(OWN_TERMS.read_text().split())


def is_known(term: str) -> bool:
    """Return whether a term in small letters is spelled as in American or British English."""
    forms = [term, *(re.sub(british, american, term) for british, american in _BRITISH)]
    return term in _own_terms() or any(each in _dictionary() for each in forms)


def unknown_terms(page: str) -> list[Finding]:
    """Return the terms of a page that are not known."""
    return [
        Finding(each.line, f"{term}: not in the dictionary, nor in docs/style/words.txt")
        for each in texts(page)
        for term in _TERM.findall(each.text)
        if not is_known(term.lower())
    ]
