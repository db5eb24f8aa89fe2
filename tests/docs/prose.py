"""Linter of prose: the rules of docs/style/prose.yaml, sentence lengths and reading grades.

`python -m tests.docs.prose [PAGE...]` checks README and docs/; it exits with 1 if there are
findings. With --report it prints the figures of each page.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from .page_files import DOCS, all_pages, path_of

RULES = DOCS / "style" / "prose.yaml"
BEFORE = DOCS / "style" / "before.json"
SECTIONS = ("everywhere", "riddles", "project", "wordy", "vague")

_CODE = re.compile(r"(`+).+?\1")
_LINK = re.compile(r"!?\[(?P<text>[^\]]*)\]\([^)]*\)(\{[^}]*\})?")
_COMMENT = re.compile(r"<!--.*?-->|<[/a-z][^>]*>", re.DOTALL)
_SENTENCE_END = re.compile(r"(?<=[.!?])[\"')*_]*\s+(?=[\"'(*_]*[A-Z0-9`])|(?<=[.!?])$")
_ITEM = re.compile(r"^\s*([-*+]|\d+\.)\s+")
_TERM = re.compile(r"[A-Za-z][A-Za-z'’-]*|\d[\d.,]*")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|etc|vs|Fig|Eq|No|cf|approx)\.")
_PASSIVE = re.compile(
    r"\b(is|are|was|were|be|been|being)\s+(\w+ly\s+)?(\w{3,}ed|written|given|taken|shown|known|made|"
    r"built|sent|read|run|kept|held|set|put|drawn|chosen|left|found)\b",
    re.IGNORECASE,
)


class Text(NamedTuple):
    """A paragraph, heading, list item or table cell of a page."""

    line: int  # of the page, from 1
    kind: str  # paragraph, heading, cell
    text: str  # one line, code replaced by a noun


class Finding(NamedTuple):
    """A violation of a rule."""

    line: int
    text: str


class Figures(NamedTuple):
    """Figures of a page's paragraphs and list items; headings, tables and code are left out."""

    terms: int
    sentences: int
    mean_sentence: float  # in terms
    long_sentences: int  # above the maximum
    grade: float  # Flesch and Kincaid's reading grade
    passive_percent: float  # of the sentences
    findings: int


@cache
def rules() -> dict[str, Any]:
    """Return the content of the rules file."""
    found: dict[str, Any] = YAML(typ="safe").load(RULES)
    return found


@cache
def _patterns() -> tuple[tuple[re.Pattern[str], str], ...]:
    return tuple(
        (re.compile(rf"(?<![\w-])({pattern})(?![\w-])", re.IGNORECASE), better)
        for section in SECTIONS
        for pattern, better in rules()[section].items()
    )


def texts(page: str) -> list[Text]:
    """Return the texts of a Markdown page, without its code."""
    page = _COMMENT.sub(lambda match: "\n" * match.group().count("\n"), page)
    found: list[Text] = []
    part: list[str] = []
    start, fence = 0, False

    def end_paragraph() -> None:
        if part:
            found.append(Text(start, "paragraph", _plain(" ".join(part))))
            part.clear()

    for number, raw in enumerate(page.splitlines(), start=1):
        line = raw.strip()
        if line.startswith("```"):
            fence = not fence
            end_paragraph()
        elif fence or not line or (raw.startswith("    ") and not part):
            end_paragraph()
        elif line.startswith("#"):
            end_paragraph()
            found.append(Text(number, "heading", _plain(line.lstrip("# "))))
        elif line.startswith("|"):
            end_paragraph()
            cells = re.split(r"(?<!\\)\|", line.strip("|"))
            found += [
                Text(number, "cell", _plain(each.strip()))
                for each in cells
                if re.search(r"[A-Za-z]", each)
            ]
        else:
            if _ITEM.match(raw) or not part:
                end_paragraph()
                start = number
            part.append(_ITEM.sub("", line).lstrip("> "))
    end_paragraph()
    return found


def _plain(text: str) -> str:
    text = _CODE.sub("Code", text)
    text = _LINK.sub(lambda match: match["text"], text)
    return re.sub(r"\*\*|__|(?<!\w)[*_]|[*_](?!\w)", "", text)


def sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph."""
    plain = _ABBREVIATION.sub(r"\1", text)
    return [each for each in _SENTENCE_END.split(plain) if each and _TERM.search(each)]


def count_terms(text: str) -> int:
    """Return the number of terms of a text; numbers count."""
    return len(_TERM.findall(text))


def syllables(term: str) -> int:
    """Return the number of syllables of an English term, by its groups of vowels."""
    term = re.sub(r"[^a-z]", "", term.lower())
    if not term:
        return 1
    count = len(re.findall(r"[aeiouy]+", term))
    if re.search(r"[^l]e$|[^aeioudt]ed$|[^aeiouscxz]es$", term) and not re.search(
        r"[aeiouy]e$", term
    ):
        count -= 1
    count += len(re.findall(r"i[ao](?!n)|eo|u[ao](?!u)|(?<!q)ua", re.sub("[tcgs]io", "", term)))
    return max(count, 1)


def reading_grade(parts: list[str]) -> float:
    """Return the reading grade of sentences (Kincaid et al., 1975): years of school."""
    terms = [term for each in parts for term in _TERM.findall(each)]
    if not terms:
        return 0.0
    every = sum(map(syllables, terms))
    return 0.39 * len(terms) / len(parts) + 11.8 * every / len(terms) - 15.59


def lint(page: str) -> list[Finding]:
    """Return the violations of a page."""
    found = []
    limit = rules()["max_sentence"]
    for each in texts(page):
        for pattern, better in _patterns():
            for match in pattern.finditer(each.text):
                found.append(Finding(each.line, f'"{match.group()}": use {better}'))
        if each.kind == "paragraph":
            for sentence in sentences(each.text):
                if (length := count_terms(sentence)) > limit:
                    start = " ".join(sentence.split()[:8])
                    found.append(
                        Finding(each.line, f'"{start} ...": {length} words; at most {limit}')
                    )
    return sorted(found)


def figures(page: str) -> Figures:
    """Return the figures of a page."""
    parts = [
        sentence
        for each in texts(page)
        if each.kind == "paragraph"
        for sentence in sentences(each.text)
    ]
    lengths = [count_terms(each) for each in parts]
    passive = sum(bool(_PASSIVE.search(each)) for each in parts)
    return Figures(
        terms=sum(lengths),
        sentences=len(parts),
        mean_sentence=round(sum(lengths) / max(len(parts), 1), 1),
        long_sentences=sum(each > rules()["max_sentence"] for each in lengths),
        grade=round(reading_grade(parts), 1),
        passive_percent=round(100 * passive / max(len(parts), 1)),
        findings=len(lint(page)),
    )


def report(pages: list[str]) -> dict[str, dict[str, float]]:
    """Return the figures of pages by name, and of all together under "total"."""
    contents = {each: path_of(each).read_text() for each in pages}
    found = {name: figures(text)._asdict() for name, text in contents.items()}
    return found | {"total": figures("\n\n".join(contents.values()))._asdict()}


def _print_report(found: dict[str, dict[str, float]]) -> None:
    columns = Figures._fields
    print(f"{'page':40}" + "".join(f"{each:>16}" for each in columns))
    for name, values in found.items():
        print(f"{name:40}" + "".join(f"{values[each]:>16g}" for each in columns))


def main(arguments: list[str]) -> int:
    """Lint pages, or report their figures; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.docs.prose", description=__doc__)
    parser.add_argument("pages", nargs="*", help="of docs/, or README.md; default: all")
    parser.add_argument("--report", action="store_true", help="print figures, before and after")
    parser.add_argument("--store", type=Path, help="write the figures of all pages as JSON")
    options = parser.parse_args(arguments)
    named = [each.removeprefix("docs/") for each in options.pages]
    if options.store:
        options.store.write_text(json.dumps(report(all_pages()), indent=1) + "\n")
        return 0
    if options.report:
        _print_report(report(named or all_pages()))
        before = json.loads(BEFORE.read_text())["total"]
        _print_report({"total before the rewriting": before})
        return 0
    found = [
        f"{path_of(page).relative_to(DOCS.parent)}:{each.line}: {each.text}"
        for page in named or all_pages()
        for each in lint(path_of(page).read_text())
    ]
    print("\n".join(found) or "prose: no findings")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
