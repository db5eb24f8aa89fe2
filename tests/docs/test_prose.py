"""Prose of all pages follows docs/style/prose.yaml; the linter finds each violation."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.docs import prose, spelling
from tests.docs.page_files import DOCS, ROOT, all_pages, path_of


@pytest.mark.parametrize("page", all_pages())
def test_a_page_follows_the_rules(page: str) -> None:
    assert prose.lint(path_of(page).read_text()) == []


@pytest.mark.parametrize("page", all_pages())
def test_spelling(page: str) -> None:
    assert spelling.unknown_terms(path_of(page).read_text()) == []


def test_no_text_has_a_known_misspelling() -> None:
    command = [
        *(sys.executable, "-m", "codespell_lib", "docs", "README.md", "CONTRIBUTING.md"),
        *("CHANGELOG.md", "rig", "controllers", "drivers", "sim_plant", "configs"),
        *("--skip", "*.js,*.json,*.svg,*.eds,*.pyc,*.nc,*.ipynb,prose.yaml"),
        *("--ignore-words", str(DOCS / "style" / "not_misspelled.txt")),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout + done.stderr == ""


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("The drive is told its target.", "told"),
        ("What is written is read back.", "What is written is"),
        ("We do this in order to win.", "in order to"),
        ("It is very\nfast.", "very"),
        ("A " + "long " * 29 + "sentence.", "31 words"),
        ("- An item with patience.", "patience"),
        ("| a | cell of words |\n|---|---|", "words"),
        ("## A rung", "rung"),
    ],
)
def test_violations_are_found(text: str, finding: str) -> None:
    (found,) = prose.lint(f"# Title\n\n{text}\n")
    assert finding in found.text
    assert found.line in (3, 4)


@pytest.mark.parametrize(
    "text",
    [
        "The status word has 16 bits.",
        "The companion form of a state space.",
        "A threshold of 1 N.",
        "`told` is a name.",
        "```text\nHe told her in order to win very much.\n```",
        "A " + "long " * 27 + "sentence. Another one follows.",
        "It runs rather than waits.",
        "<!-- in order to hide -->",
        "See [Signs](told.md).",
    ],
)
def test_plain_texts_have_no_finding(text: str) -> None:
    assert prose.lint(f"# Title\n\n{text}\n") == []


def test_the_reading_grade_is_that_of_published_examples() -> None:
    """Examples with published counts: 13 words of 24 syllables; 6 words of 6 (grade -1.45)."""
    platypus = "The Australian platypus is seemingly a hybrid of a mammal and reptilian creature."
    assert sum(map(prose.syllables, platypus.rstrip(".").split())) == 24
    assert prose.reading_grade([platypus]) == pytest.approx(0.39 * 13 + 11.8 * 24 / 13 - 15.59)
    assert prose.reading_grade(["The cat sat on the mat."]) == pytest.approx(-1.45)


def test_figures_count_sentences_of_paragraphs_and_items_alone() -> None:
    page = "# A title\n\nOne two three. Four `five six` seven!\n\n- Eight nine.\n\n| a | b |\n"
    found = prose.figures(page)
    assert (found.terms, found.sentences, found.mean_sentence) == (8, 3, 2.7)


def test_the_figures_before_the_rewriting_are_stored() -> None:
    stored = json.loads(prose.BEFORE.read_text())
    assert stored["total"]["sentences"] == pytest.approx(
        sum(each["sentences"] for name, each in stored.items() if name != "total"), rel=0.01
    )
    assert stored["total"].keys() == set(prose.Figures._fields)


@pytest.mark.parametrize(
    ("term", "known"),
    [
        ("behaviour", True),
        ("analyser", True),
        ("linearisation", True),
        ("impedances", True),
        ("tranducer", False),
        ("callibration", False),
        ("frequancy", False),
    ],
)
def test_misspelled_terms_are_unknown(term: str, *, known: bool) -> None:
    assert spelling.is_known(term) is known
