"""Names and prose use the terms of the field, not the words that the glossary replaced."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("controllers", "drivers", "rig", "sim_plant")


def relative_name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def parse_file(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), relative_name(path))


# Private words that the glossary of this project replaced by the field's terms.
PRIVATE_WORDS = frozenset(
    [
        "told",
        "tell",
        "tells",
        "untold",
        "say",
        "says",
        "said",
        "word",
        "words",
        "rung",
        "rungs",
        "companion",
        "companions",
        "wanted",
        "asked",
        "foretold",
        "foreseen",
        "foretell",
        "pushed",
        "doubt",
        "doubts",
        "overs",
        "made",
        "again",
        "combed",
        "aside",
        "spent",
        "held",
        "bearable",
        "astray",
        "patience",
        "walk",
        "walks",
        "walked",
        "guests",
        "beside",
    ]
)
# The rules of prose that hold everywhere are those of the documentation's linter.
PROSE_RULES = YAML(typ="safe").load(ROOT / "docs" / "style" / "prose.yaml")
PROSE = re.compile(rf"\b({'|'.join(PROSE_RULES['everywhere'])})\b", re.IGNORECASE)
PROSE_FILES = [
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml")),
    *(path for path in (ROOT / "configs").rglob("*.yaml")),
]
EXAMPLES = (Path(__file__), ROOT / "tests" / "docs" / "test_prose.py")  # of violations
# Records of earlier runs, which readers know by their names of then.
EARLIER_NAMES = {
    "rig/recording/runs/folder.py": {"rung"},  # the execution mode, before 2026-12
}
WIRE_WORDS = re.compile(  # terms of protocols and manuals
    r"(status|control|error|motor|shaft|ssi|register|enabled|high)_words?(_|$)|word_(order|bits)"
)
REAL_TERMS = {
    "connection_made": "asyncio's name",
    "flap_held": "field of the log",
    "made_once": "results made once for all processes of a test run",
    "PRIVATE_WORDS": "the list itself",
    "private_words": "the function below",
    "test_private_words_are_found": "its test",
    "test_names_have_no_private_words": "its test",
    "WIRE_WORDS": "the list itself",
}
# `word` is a register or an encoder's word there.
WIRE_CODE = ("drivers/", "sim_plant/emulators/", "tests/drivers/", "tests/emulators/", "tests/hil/")


def declared_names(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Yield name and line of variables, classes, fields, functions and parameters."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
        if isinstance(node, ast.arguments):
            several = (*node.posonlyargs, *node.args, *node.kwonlyargs, node.vararg, node.kwarg)
            yield from ((one.arg, one.lineno) for one in several if one)


def private_words(name: str, file: str) -> set[str]:
    """Return the private words in a name of a file."""
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower().strip("_")
    found = PRIVATE_WORDS & set(snake.split("_"))
    if name in REAL_TERMS or WIRE_WORDS.search(snake):
        return set()
    if name.startswith("test_"):  # a sentence
        return {each for each in found if PROSE.fullmatch(each)}
    if file.startswith("tests/") and file.startswith(WIRE_CODE):
        return found - {"word", "words"}
    return found - {"word"} if file.startswith(WIRE_CODE) else found


@pytest.mark.parametrize("package", [*PACKAGES, "tests", "benchmarks"])
def test_names_have_no_private_words(package: str) -> None:
    found = [
        f"{relative_name(path)}:{line}: {name}"
        for path in (ROOT / package).rglob("*.py")
        for name, line in declared_names(parse_file(path))
        if private_words(name, relative_name(path))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("name", "file", "found"),
    [
        ("_told", "rig/cli/main.py", {"told"}),
        ("EncoderWord", "rig/config/wiring.py", {"word"}),
        ("WordOrder", "rig/config/wiring.py", set()),
        ("STATUS_WORD", "drivers/compax3/objects.py", set()),
        ("word", "drivers/encoder/ssi.py", set()),
        ("held_words", "drivers/encoder/ssi.py", {"held", "words"}),
        ("threshold", "rig/cli/main.py", set()),
        ("words", "tests/drivers/test_udp_link.py", set()),
        ("test_a_row_is_read_again", "tests/record/test_recover.py", set()),
        ("test_a_told_row", "tests/record/test_recover.py", {"told"}),
    ],
)
def test_private_words_are_found(name: str, file: str, found: set[str]) -> None:
    assert private_words(name, file) == found


def prose_findings(text: str) -> set[str]:
    """Return the private words in a text."""
    return {match.group().lower() for match in PROSE.finditer(text)}


@pytest.mark.parametrize("folder", [*PACKAGES, "tests", "benchmarks", "documents"])
def test_prose_has_no_private_words(folder: str) -> None:
    """Messages, docstrings and comments in code; documents, and comments of configurations."""
    files = PROSE_FILES if folder == "documents" else (ROOT / folder).rglob("*.py")
    found = [
        f"{relative_name(path)}:{number}: {', '.join(sorted(terms))}"
        for path in files
        if path not in EXAMPLES
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if (terms := prose_findings(line) - EARLIER_NAMES.get(relative_name(path), set()))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("the drive is told its target", {"told"}),
        ("Companions end last.", {"companions"}),
        ("nothing is to be had", {"is to be had"}),
        ("the companion form of a state space", set()),
        ("a threshold, rungless", set()),
    ],
)
def test_private_words_in_prose_are_found(text: str, found: set[str]) -> None:
    assert prose_findings(text) == found


# Sentences that need a second reading: passive riddles and subjects without a noun. CHANGELOG.md is
# a record of its time.
RIDDLES = re.compile(rf"\b({'|'.join(PROSE_RULES['riddles'])})\b", re.IGNORECASE)
RIDDLE_FILES = [
    *(path for path in PROSE_FILES if path.suffix == ".md"),
    *(ROOT / "configs" / "faults").glob("*.yaml"),
]


def riddles(text: str) -> list[str]:
    """Return the riddles of a text; a line may break within one, a paragraph may not."""
    paragraphs = re.split(r"\n\s*\n", re.sub(r"^\s*# ", "", text, flags=re.MULTILINE))
    return [
        match.group().lower()
        for paragraph in paragraphs
        for match in RIDDLES.finditer(" ".join(paragraph.split()))
    ]


@pytest.mark.parametrize("path", RIDDLE_FILES, ids=relative_name)
def test_pages_and_fault_tables_have_no_riddles(path: Path) -> None:
    assert riddles(path.read_text()) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("what is written is read back", ["what is written is"]),
        ("What is asked\n  for comes by it", ["what is asked for comes"]),
        ("it is asked for the\n# stream again\n# and again", ["asked for", "again and again"]),
        ("## What is not detected\n\nThe drive is silent.", []),
        ("the task and what it was", []),
    ],
)
def test_riddles_are_found(text: str, found: list[str]) -> None:
    assert riddles(text) == found
