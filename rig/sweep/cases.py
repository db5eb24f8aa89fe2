"""The cases of a sweep: which there are, and what running one of them gives.

A case is a row of the campaign with one value of every parameter: power on, tare, a lead-in of its
own, then the row. It stands alone, so cases may run in any order and anywhere. Run in sequence, a
case is the whole campaign with one value of every parameter, row after row as in the basin.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

from rig.analysis.rows import NOT_RUN, reduce_window
from rig.config.campaign_file import CampaignFile
from rig.planning.campaign import Campaign, CampaignRow, Plan, build_plan
from rig.planning.campaign.windows import repeat_period
from rig.sweep import InterruptedSweepError
from rig.sweep.parameters import Chosen, Files, Over

if TYPE_CHECKING:
    from rig.sweep.simulation import RowSimulation, Subject

_KEPT_OPEN = 4  # variants whose tables are held at a time: memory does not grow with their number
LEAD_IN = 15.0
"""Seconds from the first wave to a row that runs alone, unless told otherwise. The simulated wave
maker takes 5 s to bring the sea on; what is left of its onset after 15 s changes no mean power by
more than a row's own noise (tests/batch/test_sweep_rows.py), while a basin needs minutes."""


class Case(NamedTuple):
    """One run of the compiled loop."""

    number: int  # from 0, rows changing fastest
    variant: int  # number of the combination of values
    row: int  # of the campaign's plan; -1: all of them in sequence


class Outcome(NamedTuple):
    """What a case gave."""

    case: int
    rows: tuple[dict[str, Any], ...]  # as `rig.analysis.rows.reduced` gives them
    seconds: float  # simulated
    failed: str  # why there is nothing; empty if there is


class SweepRequest(NamedTuple):
    """What a sweep is asked to run; plain values, so that it can be sent elsewhere."""

    campaign: str  # path
    parameters: tuple[Over, ...]
    sequential: bool
    lead_in: float  # s


class _Variant(NamedTuple):
    campaign: Campaign
    plan: Plan  # of the whole campaign
    subject: "Subject"
    period_ticks: float | None


class Cases:
    """The cases of a sweep, to be run from several threads."""

    def __init__(self, asked: SweepRequest, rows: tuple[CampaignRow, ...], files: Files) -> None:
        """``rows`` are those of the campaign as its file has it, by which cases are known."""
        self.asked = asked
        self.shape = tuple(len(over.values) for over in asked.parameters)
        # A repetition would give the same numbers: the noise of a simulation is its seed's.
        once = tuple(row for row in rows if row.repetition == 0)
        self.rows = rows if asked.sequential else once
        self._files = files
        self._known = {(row.point, row.repetition): row.row for row in rows}
        self._points = {row.row: row.point for row in rows}
        self._opening = Lock()
        self._variant = lru_cache(_KEPT_OPEN)(self._open)

    def __len__(self) -> int:
        return math.prod(self.shape) * (1 if self.asked.sequential else len(self.rows))

    def __iter__(self) -> Iterator[Case]:
        rows = [-1] if self.asked.sequential else [row.row for row in self.rows]
        pairs = itertools.product(range(math.prod(self.shape)), rows)
        return (Case(number, variant, row) for number, (variant, row) in enumerate(pairs))

    def chosen(self, variant: int) -> Chosen:
        """The values of a combination; the last parameter's change fastest."""
        values = itertools.product(*(over.values for over in self.asked.parameters))
        return tuple(
            zip(self.asked.parameters, next(itertools.islice(values, variant, None)), strict=True)
        )

    def prepare(self) -> None:
        """Have the loop compiled, which takes a minute the first time on a host."""
        with self._opening:
            variant = self._variant(0)
        variant.subject.prepare(variant.plan)

    def run(self, case: Case, go_on: Callable[[], bool] = lambda: True) -> Outcome:
        """Run a case; one that cannot be run says why. Raises `InterruptedWalkError`."""
        try:
            return self._ran(case, go_on)
        except InterruptedSweepError:
            raise
        except Exception as error:  # noqa: BLE001  the other cases are run all the same
            return Outcome(case.number, (), 0.0, str(error) or type(error).__name__)

    def _ran(self, case: Case, go_on: Callable[[], bool]) -> Outcome:
        with self._opening:  # that two threads do not open the same
            variant = self._variant(case.variant)
        campaign = variant.campaign
        if self.asked.sequential:
            planned, stator = variant.plan, None
        else:
            point = campaign.points[self._points[case.row]]
            planned = build_plan(alone(campaign.file, self.asked.lead_in), campaign.rig, (point,))
            stator = planned.rows[0].stator_position
        walk = variant.subject.walk(planned, go_on, stator)
        rows = []
        for row, given in zip(
            planned.rows, table(walk, planned, variant.period_ticks), strict=True
        ):
            known = case.row if case.row >= 0 else self._known[row.point, row.repetition]
            rows.append({**given, "row": known})
        return Outcome(case.number, tuple(rows), walk.seconds, "")

    def _open(self, variant: int) -> _Variant:
        from rig.sweep.simulation import Subject  # noqa: PLC0415 - numba; who runs nothing waits not

        campaign = self._files.opened(self.chosen(variant))
        planned = build_plan(campaign.file, campaign.rig, campaign.points)
        period = repeat_period(campaign.file.sea)
        ticks = period / planned.dt if period else None
        return _Variant(campaign, planned, Subject(campaign, planned), ticks)


def table(walk: "RowSimulation", planned: Plan, period_ticks: float | None) -> list[dict[str, Any]]:
    """Each row of a plan as it came out of its walk, in the words of the row table.

    ``period_ticks``: the sea's repeat period, None if it has none.
    """
    found = {}
    for window in walk:
        found[window.row] = reduce_window(window, period_ticks)  # the last attempt counts
    nothing = {"state": NOT_RUN, "incomplete_reason": f"run stopped: {walk.reason.name}"}
    return [
        {
            **found.get(row.row, nothing),
            "stator": row.stator_position,
            **row.setting._asdict(),
        }
        for row in planned.rows
    ]


def alone(file: CampaignFile, lead_in: float) -> CampaignFile:
    """A campaign whose one row is run once, after a lead-in of so many seconds."""
    first = min(file.start.set_point_s, lead_in)
    start = file.start.model_copy(update={"lead_in_s": lead_in, "set_point_s": first})
    return file.model_copy(update={"start": start, "repeat": 1})
