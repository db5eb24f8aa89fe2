"""The measured windows of a run, found by row id and phase as the rig logged them.

One window is held at a time, so a run of many hours needs no more memory than its longest row.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from rig.runs import reader
from rig.runs.mcap_file import Records
from rig.safety import Mode, Reason
from rig.sequence import Phase

PLACE = ("plan.row", "plan.phase", "plan.attempt")
ALWAYS = (*PLACE, "tick", "safety.mode", "safety.reason")


class Window(NamedTuple):
    """The MEASURE ticks of one attempt at a row."""

    row: int
    attempt: int
    data: Records
    cut_short: str  # why the window is not whole; empty if it is

    @property
    def span(self) -> int:
        """Ticks from its first to its last, lost ones included."""
        return int(self.data["tick"][-1] - self.data["tick"][0]) + 1


class _Open:
    """A window whose end has not been seen yet."""

    def __init__(self, row: int, attempt: int) -> None:
        self.row = row
        self.attempt = attempt
        self.pieces: list[Records] = []

    def closed(self, why: str) -> Window:
        data: Records = np.concatenate(self.pieces)
        if (data["safety.mode"] != Mode.RUN).any():
            why = "held or stopped"
        return Window(self.row, self.attempt, data, why)


def _packed(block: Records, dtype: np.dtype[Any]) -> Records:
    out = np.empty(len(block), dtype)
    for name in dtype.names or ():
        out[name] = block[name]
    return out


def _stretches(block: Records) -> Iterator[tuple[int, int]]:
    """Index ranges over which row, phase and attempt stay the same."""
    changed = np.zeros(len(block) - 1, bool)
    for name in PLACE:
        values = block[name]
        changed |= values[1:] != values[:-1]
    edges = [0, *(np.flatnonzero(changed) + 1).tolist(), len(block)]
    yield from pairwise(edges)


def _left_early(row: int, after: Any) -> str:
    """Why a window followed by this tick is not whole, or an empty text."""
    if after["plan.phase"] == Phase.DONE and after["safety.reason"] not in (
        Reason.NONE,
        Reason.PLAN_END,
    ):
        return f"run stopped: {Reason(int(after['safety.reason'])).name}"
    if after["plan.row"] == row and after["plan.phase"] < Phase.MEASURE:
        return "started over"
    return ""


def windows(run: reader.Source, fields: list[str]) -> Iterator[Window]:
    """Every attempt at measuring a row, in the order of the run, with the named fields.

    Tick, place in the plan and state of the safety machine are always among the fields. KeyError
    if the run has no such fields.
    """
    names = reader.choose(run.leaves, [*ALWAYS, *fields])
    kinds = {leaf.name: "<f8" if leaf.code == "d" else "<i8" for leaf in run.leaves}
    return cut(reader.blocks(run), np.dtype([(name, kinds[name]) for name in names]))


def cut(blocks: Iterable[Records], dtype: np.dtype[Any]) -> Iterator[Window]:
    """The windows in blocks of ticks, with the fields of ``dtype``, `ALWAYS` among them."""
    now: _Open | None = None
    for block in blocks:
        for begin, end in _stretches(block):
            first = block[begin]
            row, attempt = int(first["plan.row"]), int(first["plan.attempt"])
            measuring = first["plan.phase"] == Phase.MEASURE
            if now and not (measuring and (row, attempt) == (now.row, now.attempt)):
                yield now.closed(_left_early(now.row, first))
                now = None
            if measuring:
                now = now or _Open(row, attempt)
                now.pieces.append(_packed(block[begin:end], dtype))
    if now:
        yield now.closed("the log ends here")
