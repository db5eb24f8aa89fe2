"""Fenced blocks of a page, as docs/explanation/writing_pages.md describes them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

LANGUAGES = ("console", "python", "yaml", "text", "csv", "matlab", "c")
RUN = ("console", "python", "yaml", "csv")
_FENCE = re.compile(r"^(?P<indent> *)```(?P<info>.*)$")
_TITLE = re.compile(r'title="([^"]*)"')
_NOT_RUN = re.compile(r"<!-- not run: (?P<reason>.+?) -->")
ADDED = " (added)"


class Block(NamedTuple):
    """A fenced block."""

    language: str
    title: str  # name of the file that it is written to; empty: none
    is_added: bool  # its text is added to the file
    body: list[str]  # its lines, without the indentation of the fence
    line: int  # of the page, of the opening fence, from 1
    indent: str
    not_run: str  # the reason why it cannot run here; empty: it runs

    @property
    def text(self) -> str:
        """The text between the fences."""
        return "".join(f"{line}\n" for line in self.body)


class Command(NamedTuple):
    """A command of a console block, and the output that the page shows."""

    text: str  # may have several lines
    shown: list[str]
    line: int  # of the page


def blocks(page: str) -> list[Block]:
    """Return the blocks of a page; ValueError for a fence without an end."""
    found: list[Block] = []
    lines = page.splitlines()
    number = 0
    while number < len(lines):
        fence = _FENCE.match(lines[number])
        number += 1
        if not fence:
            continue
        start, indent = number, fence["indent"]
        while number < len(lines) and lines[number] != f"{indent}```":
            number += 1
        if number == len(lines):
            raise ValueError(f"line {start}: the block has no end")
        info, before = fence["info"], lines[start - 2].strip() if start > 1 else ""
        title = match[1] if (match := _TITLE.search(info)) else ""
        reason = match["reason"] if (match := _NOT_RUN.fullmatch(before)) else ""
        body = [line.removeprefix(indent) for line in lines[start:number]]
        name = title.removesuffix(ADDED)
        language = info.partition(" ")[0]
        found.append(Block(language, name, name != title, body, start, indent, reason))
        number += 1
    return found


def file_of(page: Path, name: str) -> str:
    """Return the text of a file that a page's blocks write; StopIteration: none does."""
    return next(each.text for each in blocks(page.read_text()) if each.title == name)


def commands(block: Block) -> list[Command]:
    """Return the commands of a console block: lines after `$ `, continued after `\\` by `> `."""
    found: list[Command] = []
    for number, line in enumerate(block.body, start=block.line + 1):
        if line.startswith("$ "):
            found.append(Command(line[2:], [], number))
        elif (
            found
            and line.startswith("> ")
            and found[-1].text.endswith("\\")
            and not found[-1].shown
        ):
            found[-1] = found[-1]._replace(text=f"{found[-1].text}\n{line[2:]}")
        elif found:
            found[-1].shown.append(line)
        else:
            raise ValueError(f"line {number}: output before any command")
    return found
