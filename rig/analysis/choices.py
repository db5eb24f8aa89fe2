"""The choices of an adaptive campaign: which row, why, and how well the best one was known."""

import math
from typing import NamedTuple

from rig.realtime.sequence import NO_ROW
from rig.recording.journal import read_journal
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.windows import ADAPTIVE

_CHOSEN, _END = "next_row", "finish"


class ChosenRow(NamedTuple):
    """A row that was chosen while the campaign ran, or its end."""

    row: int  # `NO_ROW`: the end
    why: str
    best: int  # row recommended before it; `NO_ROW`: none
    regret: float  # W, that this one was expected to give away; NaN: unknown

    @property
    def is_last(self) -> bool:
        """Whether the campaign itself came to its end: not a person, and not a failure."""
        return self.row == NO_ROW and self.best != NO_ROW


def choices_of(run_facts: RunInfo) -> tuple[ChosenRow, ...]:
    """Return the choices of a run in the order of time, also those before it was resumed; empty
    for other campaigns."""
    if ADAPTIVE not in run_facts.plan:
        return ()
    found = []
    for entry in read_journal(run_facts.earlier_journals + b"\n" + run_facts.journal):
        if not entry.accepted or entry.request not in (_CHOSEN, _END):
            continue
        given, regret = entry.arguments, entry.arguments.get("regret_w")
        by = "" if entry.origin == "campaign" else f"chosen by {entry.person}"
        found.append(
            ChosenRow(
                int(given.get("row", NO_ROW)),
                str(given.get("why") or by),
                int(given.get("best", NO_ROW)),
                math.nan if regret is None else float(regret),
            )
        )
    return tuple(found)


def choice_texts(run_facts: RunInfo) -> tuple[str, ...]:
    """Return a line about each choice; empty for other campaigns."""
    return tuple(
        f"{'end' if each.row == NO_ROW else f'row {each.row}'}: {each.why}"
        for each in choices_of(run_facts)
    )
