"""The costly tests, of which a run of the test command takes one of equal parts."""

from __future__ import annotations

from pathlib import Path

LIST = "costly_tests.txt"
COSTLY_PARTS = 40


def costly_parts(root: Path) -> dict[tuple[str, bool], int]:
    """Return the part of each costly file or single test, by its name and whether in real time.

    Parts are equal in processor time, and those of tests in real time in their duration.
    """
    lines = (root / "tests" / LIST).read_text().splitlines()
    costly = [line.split(maxsplit=2) for line in lines if line[:1] != "#"]
    parts = {}
    for column, in_real_time in enumerate((False, True)):
        seconds = [0] * COSTLY_PARTS
        for each in sorted(costly, key=lambda each: -int(each[column])):
            at = seconds.index(min(seconds))  # the dearest first, each to the part that has least
            seconds[at] += int(each[column])
            parts[each[-1], in_real_time] = at
    return parts


def part_of(parts: dict[tuple[str, bool], int], nodeid: str, *, in_real_time: bool) -> int | None:
    """Return the part of a test: its own, else that of its file; None: it runs every time."""
    file = nodeid.partition("::")[0]
    return parts.get((nodeid, in_real_time), parts.get((file, in_real_time)))
