"""The plan of a campaign: rows, segments and set points that the loop executes.

A plan consists of the tare (calm water, drive off), the preparation of drive and moving parts, the
lead-in while the sea builds up, and then settle, measure and tail for each row. The wave maker
runs from the first segment of the lead-in; the wave clock counts its seconds. Before a row for
which a part of the rig moves, its combination is held for an extra interval (MASK4 report (Sandia),
section 3.2.3).

A campaign with several seeds measures all rows in the sea of the first one, then in those of the
others. The waves start anew with each sea, so each has a plan of its own, a stage of the run.

In an adaptive campaign the rows of the matrix are candidates. After the lead-in and after each row
the plan waits until one of them is chosen (`rig.campaign.choosing`), and goes on with its segments.

Without rows (a wave calibration) there is only a lead-in and one window of whole repeat periods;
the drive stays off.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from rig.campaign.kind import (
    AnyCampaign,
    AnyPlan,
    CampaignKind,
    CampaignRow,
    PhaseSeconds,
    Plan,
    Wait,
)
from rig.campaign.set_points import row_setting, zero_setting
from rig.config.adaptive import AdaptiveRows
from rig.config.campaign_file import BaseCampaignFile
from rig.config.rig_file import BaseRigFile
from rig.config.sea import RegularSea
from rig.planning.order import Order, PointRepetition, order_points
from rig.planning.point import Point
from rig.planning.segments import PlanSegment, cut_into_ticks, phase_seconds
from rig.planning.tank import end_before_reflection, tank_times
from rig.planning.windows import RowWindows, repeat_period
from rig.realtime.sequence import ASSESSED, NO_ROW, WAIT_KNOWN, WAIT_ORDER, WAIT_SETTLED, Phase

_ENDLESS = 1.0e9  # s: longer than any run


class PlanInputs(Protocol):
    """The parts of a campaign that its plan depends on."""

    @property
    def kind(self) -> CampaignKind:
        """The kind of rig's part of campaigns."""

    @property
    def file(self) -> BaseCampaignFile:
        """The campaign file."""

    @property
    def rig(self) -> BaseRigFile:
        """The rig file."""

    @property
    def plant(self) -> Mapping[str, Any]:
        """The file of the simulated plant, as read."""

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of the matrix; empty for a wave calibration."""


class Measured(NamedTuple):
    """The part of a campaign that the stages of its run before have measured."""

    rows: frozenset[int] = frozenset()  # complete
    periods: Mapping[int, int] = {}  # whole periods of other rows, by row

    def as_record(self) -> dict[str, Any]:
        """Return the rows as JSON values, in the plan of the stage after."""
        return {"rows": sorted(self.rows), "periods": {str(r): n for r, n in self.periods.items()}}


NOTHING = Measured()
_LATE_TICKS = 2  # a row ends with a bin of the repeat period, up to a tick after its length in s
RESUMED = "resumed"  # key of a recorded plan with what the stages before have measured


def measured_before(plan: Mapping[str, Any]) -> Measured:
    """Return the rows that a recorded plan leaves out."""
    record = plan.get(RESUMED) or {}
    periods = {int(row): count for row, count in record.get("periods", {}).items()}
    return Measured(frozenset(record.get("rows", ())), periods)


def build_plan(campaign: PlanInputs, measured: Measured = NOTHING) -> AnyPlan:
    """Return the plan of a campaign that passed all checks of `open_campaign`.

    Its segments are those of the first seed with rows that are not ``measured``, without what is
    measured; its rows are those of the whole campaign. Raises `WindowError` if the window of a row
    does not fit.
    """
    stages = stage_plans(campaign)
    chosen = next(
        (each for each in stages if any(row.row not in measured.rows for row in each.rows)),
        stages[0],
    )
    rows = tuple(row for stage in stages for row in stage.rows)
    adaptive = campaign.file.adaptive
    if measured.rows or measured.periods or adaptive is not None:
        chosen = _plan_of_seed(campaign, chosen.seed, chosen.rows[0].row, measured, adaptive)
    return chosen._replace(rows=rows)


def all_rows(campaign: AnyCampaign) -> AnyCampaign:
    """Return the campaign that runs each row of the matrix, also of an adaptive one."""
    return campaign._replace(file=campaign.file.model_copy(update={"adaptive": None}))


def stage_plans(campaign: PlanInputs) -> list[AnyPlan]:
    """Return the plan of each seed of a campaign, each with the rows of that seed.

    Of an adaptive campaign it is the plan of all candidates, one after the other.
    """
    plans: list[AnyPlan] = []
    for seed in campaign.file.seeds:
        first_row = sum(len(plan.rows) for plan in plans)
        plans.append(_plan_of_seed(campaign, seed, first_row, NOTHING))
    return plans


def _plan_of_seed(
    campaign: PlanInputs,
    seed: int,
    first_row: int,
    measured: Measured,
    adaptive: AdaptiveRows | None = None,
) -> AnyPlan:
    """Return the plan of the rows of a seed, the first of which has a number.

    ``adaptive``: of an adaptive campaign; its durations are those of the most and the fewest rows.
    """
    kind, file, rig, points = campaign.kind, campaign.file, campaign.rig, campaign.points
    windows = kind.windows(file)
    rows: tuple[CampaignRow[Any], ...] = ()
    if points:
        places = kind.places(rig, points)
        rows = tuple(
            CampaignRow(
                row,
                repetition.point,
                repetition.repetition,
                seed,
                places[repetition.point],
                row_setting(kind, file, rig, points[repetition.point]),
                windows.periods,
                windows.measure,
                windows.measure if windows.least_measure is None else windows.least_measure,
            )
            for row, repetition in enumerate(order_rows(file, places, seed), first_row)
        )
        left = [row for row in rows if row.row not in measured.rows]
        plan_segments = _row_segments(campaign, left, windows, measured.periods)
        if adaptive is not None:
            plan_segments = _with_choices(kind, file, rig, left, windows, plan_segments)
    else:
        plan_segments = _calibration_segments(file, windows)
    if file.tank is not None:
        plan_segments = end_before_reflection(file.tank, file.sea, plan_segments)
        measuring = (s for s in plan_segments if s.phase is Phase.MEASURE)
        lengths = {s.row: s.seconds for s in measuring if not s.wait}
        rows = tuple(_measured(row, lengths.get(row.row, row.measure), file) for row in rows)
    rate = float(rig.rate_hz)
    segments, _, settings = cut_into_ticks(plan_segments, rate)
    fewest = plan_segments
    if adaptive is not None:
        done = len(measured.rows)
        fewest = _of_rows(plan_segments, left[: max(adaptive.first_rows - done, 0)])
        plan_segments = _of_rows(plan_segments, left[: max(adaptive.max_rows - done, 0)])
    longest = cut_into_ticks([_at_its_longest(each) for each in plan_segments], rate)
    seconds, ticks = phase_seconds(longest, rate), longest.segments.ticks
    phases = (seconds[Phase[name.upper()]] for name in PhaseSeconds._fields)
    planned = longest.plan_segments
    moves = sum(1 for each in planned if each.phase is Phase.MOVING and each.row != NO_ROW)
    return Plan(
        rows,
        segments,
        kind.set_points(file, rig, settings),
        1.0 / rate,
        sum(ticks) / rate,
        sum(n for n, each in zip(ticks, planned, strict=True) if each.waves) / rate,
        moves,
        PhaseSeconds(*phases),
        file.axis_laws,
        rig,
        seed,
        sum(cut_into_ticks(fewest, rate).segments.ticks) / rate,
    )


def _measured(row: CampaignRow[Any], seconds: float, file: BaseCampaignFile) -> CampaignRow[Any]:
    """Return a row whose window may have been shortened, with the whole periods in it."""
    if seconds == row.measure:
        return row
    period = repeat_period(file.sea) or seconds
    periods = round(seconds / period)
    whole = math.isclose(seconds, periods * period)
    return row._replace(measure=seconds, least_measure=seconds, periods=periods * whole)


def _at_its_longest(segment: PlanSegment[Any]) -> PlanSegment[Any]:
    """Return a segment with its longest time, where the measured motion or power ends it."""
    return segment._replace(seconds=segment.timeout) if segment.wait & ASSESSED else segment


def order_rows(file: BaseCampaignFile, places: Any, seed: int) -> tuple[PointRepetition, ...]:
    """Return the sequence of points and repetitions, from the place for each point.

    ``seed``: of a random order.
    """
    orders: dict[str, Order] = {"as given": "as given", "random": "random"}
    order = orders.get(file.order, "least travel")
    return order_points(places, order, file.repeat, seed)


def _calibration_segments(file: BaseCampaignFile, windows: RowWindows) -> list[PlanSegment[Any]]:
    """Return lead-in and one window: the wave maker runs, the probes are read, power is off."""
    zero = zero_setting(file)
    return [
        PlanSegment(NO_ROW, Phase.LEAD_IN, file.start.lead_in_s, zero, drive=0),
        PlanSegment(NO_ROW, Phase.MEASURE, windows.measure, zero, drive=0),
        PlanSegment(NO_ROW, Phase.DONE, 0.0, zero, waves=0, drive=0),
    ]


def _row_segments(
    campaign: PlanInputs,
    rows: Sequence[CampaignRow[Any]],
    windows: RowWindows,
    done: Mapping[int, int],
) -> list[PlanSegment[Any]]:
    """Return the segments of the rows, of which some periods are ``done``."""
    kind, file, rig = campaign.kind, campaign.file, campaign.rig
    period = windows.measure / max(windows.periods, 1)
    settling = _settling_seconds(campaign, rows, windows)
    margin = _LATE_TICKS / rig.rate_hz if windows.bin else 0.0
    lead_in = kind.lead_in(file, rows[0].setting)
    first = lead_in[0][1]
    plan_segments = [
        PlanSegment(NO_ROW, Phase.TARE, file.tare_duration, first, waves=0, drive=0),
        _waiting(NO_ROW, kind.prepare(file, rig, first), waves=0),
        *_lead_in_segments(file, lead_in, _lead_in_seconds(campaign, rows[0])),
    ]
    before = rows[0].setting
    for row, (settle, least_settle) in zip(rows, settling, strict=True):
        move = kind.move(file, rig, before, row.setting, max(windows.move, 1.0 / rig.rate_hz))
        before = row.setting
        plan_segments += [
            *([] if move is None else [_waiting(row.row, move)]),
            _segment(row, Phase.SETTLE, settle + margin, least_settle, WAIT_SETTLED),
            _segment(
                row,
                Phase.MEASURE,
                windows.measure - period * done.get(row.row, 0) + margin,
                windows.least_measure,
                WAIT_KNOWN,
            ),
            PlanSegment(row.row, Phase.TAIL, windows.tail, row.setting),
        ]
    last = kind.last(file, before)
    return [*plan_segments, PlanSegment(NO_ROW, Phase.DONE, 0.0, last, waves=0, drive=0)]


def _with_choices(
    kind: CampaignKind,
    file: BaseCampaignFile,
    rig: BaseRigFile,
    rows: Sequence[CampaignRow[Any]],
    windows: RowWindows,
    plan_segments: Sequence[PlanSegment[Any]],
) -> list[PlanSegment[Any]]:
    """Return the segments of candidates: each may follow any other, and is followed by a choice.

    A part that moves between rows may then come from any place, so each row waits for it, for the
    extra interval at least.
    """
    tick = 1.0 / rig.rate_hz
    several = len({row.place for row in rows}) > 1
    by_number = {row.row: row for row in rows}
    found: list[PlanSegment[Any]] = []
    before = NO_ROW
    for segment in plan_segments:
        starts = segment.row not in (before, NO_ROW)
        if found and (starts or segment.phase is Phase.DONE):
            last = found[-1].setpoint
            found.append(PlanSegment(NO_ROW, Phase.CHOICE, tick, last, WAIT_ORDER, _ENDLESS))
        if starts and several:
            wait = kind.prepare(file, rig, by_number[segment.row].setting)
            wait = wait._replace(seconds=max(wait.seconds, windows.move))
            found.append(_waiting(segment.row, wait))
        if not (several and segment.phase is Phase.MOVING and segment.row != NO_ROW):
            found.append(segment)
        before = segment.row
    return found


def _of_rows(
    plan_segments: Sequence[PlanSegment[Any]], rows: Sequence[CampaignRow[Any]]
) -> list[PlanSegment[Any]]:
    """Return the segments of some rows, and those that belong to no row."""
    numbers = {NO_ROW, *(row.row for row in rows)}
    return [
        segment
        for segment in plan_segments
        if segment.row in numbers and segment.phase is not Phase.CHOICE
    ]


def _settling_seconds(
    campaign: PlanInputs, rows: Sequence[CampaignRow[Any]], windows: RowWindows
) -> list[tuple[float, float | None]]:
    """Return the longest settling time of each row, s, and the least one if it may end before."""
    if not windows.models_settle:
        return [(windows.settle, windows.least_settle)] * len(rows)
    least, longest = windows.least_settle or 0.0, windows.settle - windows.bin
    times = (min(max(each, least), longest) for each in _transients(campaign, rows))
    return [(each + windows.bin, each if windows.bin else None) for each in times]


def _transients(campaign: PlanInputs, rows: Sequence[CampaignRow[Any]]) -> Sequence[float]:
    """Return how long transients last in each row, s, in the model of the rig.

    `rig.campaign.assessed` refuses the campaigns of a kind without a model.
    """
    transients = campaign.kind.transients
    return [math.inf] * len(rows) if transients is None else transients(campaign, rows)


def _lead_in_seconds(campaign: PlanInputs, first: CampaignRow[Any]) -> float | None:
    """Return the least time from the wave maker's start to the first row, s; None if it is fixed.

    In an irregular sea the waves must have their full height at the device, and the transients of
    their begin must be over.
    """
    file = campaign.file
    if file.start.lead_in != "measured":
        return None
    if isinstance(file.sea, RegularSea) or file.tank is None:
        return file.start.least_lead_in_s
    times = tank_times(file.tank, file.sea)
    full = math.inf if times is None else times.full
    return max(full + _transients(campaign, [first])[0], file.start.least_lead_in_s)


def _segment(
    row: CampaignRow[Any], phase: Phase, seconds: float, least: float | None, condition: int
) -> PlanSegment[Any]:
    """Return a segment of a row; with a ``least`` time a condition may end it after that."""
    if least is None:
        return PlanSegment(row.row, phase, seconds, row.setting)
    return PlanSegment(row.row, phase, least, row.setting, condition, seconds)


def _lead_in_segments(
    file: BaseCampaignFile, parts: Sequence[tuple[float, Any]], least: float | None
) -> list[PlanSegment[Any]]:
    """Return the segments of the lead-in's parts.

    With a ``least`` time (s) the last one ends after it in an irregular sea, and in a regular one
    once the motion has settled.
    """
    segments = [PlanSegment(NO_ROW, Phase.LEAD_IN, *part) for part in parts]
    if least is not None:
        seconds = segments[-1].seconds
        before = file.start.lead_in_s - seconds
        segments[-1] = segments[-1]._replace(seconds=min(max(least - before, 0.0), seconds))
        if isinstance(file.sea, RegularSea):
            segments[-1] = segments[-1]._replace(wait=WAIT_SETTLED, timeout=seconds)
    return segments


def _waiting(row: int, wait: Wait, waves: int = 1) -> PlanSegment[Any]:
    setting, seconds, conditions, timeout = wait
    return PlanSegment(row, Phase.MOVING, seconds, setting, conditions, timeout, waves)
