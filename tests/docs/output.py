"""Comparison of output that a page shows with real output."""

from __future__ import annotations

import difflib
import re

OMITTED = "..."

VARYING = (
    ("run", r"\b20\d{6}T\d{6}Z"),  # beginning of a run's name
    ("date and time", r"\b20\d\d-\d\d-\d\d([ T]\d\d:\d\d(:\d\d)?( UTC|Z)?)?\b"),
    ("address", r"127\.0\.0\.1:\d+"),
    ("version", r"\b\d+\.\d+\.\d+(\.dev\d+)?( \([0-9a-f]{12}(, with local changes)?\))?"),
    ("digest", r"(?<![0-9A-Za-z])[0-9a-f]{12,64}(?![0-9A-Za-z])"),
    ("host", r"(?<=^host     )\S+"),
    ("pace", r"\b[\d.,]+ (x|times) real time"),
    ("seconds that a command took", r"\b(in|took|after|left at) \d[\d.:]* (s|ms|min)\b"),
    ("lateness", r"\b(p50|p99|max) \d+"),
    ("process", r"\bprocess \d+"),
    ("size", r"\b[\d.]+ [kMG]B\b"),
)
"""Parts that vary from run to run, host to host or version to version, with their patterns."""

_PROGRESS = re.compile(  # how often a run prints it varies, and whether the loop is compiled
    r"\d+:\d\d of \d+:\d\d rig time|compiling the loop, about a minute"
)
_PATTERNS = [(name, re.compile(pattern, re.MULTILINE)) for name, pattern in VARYING]


def normalise(lines: list[str]) -> list[str]:
    """Return lines with each varying part replaced by its name, without spaces at their ends."""
    text = "\n".join(line.rstrip() for line in lines)
    for name, pattern in _PATTERNS:
        text = pattern.sub(f"<{name}>", text)
    return [re.sub(r"(?<=\S) {2,}", "  ", line) for line in text.split("\n")]


def last_states(text: str) -> list[str]:
    """Return the lines of a terminal's output: of a line that is written over, its last state.

    Lines of progress are left out.
    """
    lines = [line.rstrip("\r").rpartition("\r")[2].rstrip() for line in text.split("\n")]
    lines = [line for line in lines if not _PROGRESS.match(line)]
    while lines and not lines[-1]:
        lines.pop()
    return lines


def matches(shown: list[str], real: list[str]) -> bool:
    """Return whether shown lines are the real ones, where a line `...` stands for any lines."""
    parts: list[list[str]] = [[]]
    for line in normalise(shown):
        if line.strip() == OMITTED:
            parts.append([])
        else:
            parts[-1].append(line)
    rest = normalise(real)
    if len(parts) == 1:
        return parts[0] == rest
    first, *middle, last = parts
    if rest[: len(first)] != first or len(rest) < len(first) + len(last):
        return False
    rest = rest[len(first) : len(rest) - len(last)] if last else rest[len(first) :]
    if last and normalise(real)[-len(last) :] != last:
        return False
    for part in middle:
        at = next((i for i in range(len(rest)) if rest[i : i + len(part)] == part), None)
        if at is None:
            return False
        rest = rest[at + len(part) :]
    return True


def difference(shown: list[str], real: list[str]) -> str:
    """Return how normalised lines differ."""
    return "\n".join(
        difflib.unified_diff(normalise(shown), normalise(real), "page", "program", lineterm="", n=1)
    )
