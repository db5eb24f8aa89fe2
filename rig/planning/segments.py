"""Conversion of plan segments in seconds to the table in ticks that the loop executes."""

from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

from rig.realtime.sequence import NO_ROW, Phase, Segments

S = TypeVar("S")


class PlanSegment(NamedTuple, Generic[S]):
    """One segment of a plan, with its duration in seconds."""

    row: int
    phase: Phase
    seconds: float
    setpoint: S  # hashable
    wait: int = 0
    timeout: float = 0.0  # s
    waves: int = 1
    drive: int = 1


class SegmentTable(NamedTuple, Generic[S]):
    """The table in ticks, the plan segments in it, and the set points that its indices refer to."""

    segments: Segments
    plan_segments: tuple[PlanSegment[S], ...]
    setpoints: tuple[S, ...]


def cut_into_ticks(plan_segments: Sequence[PlanSegment[S]], rate: float) -> SegmentTable[S]:
    """Return the segments in ticks at ``rate`` (Hz).

    The end times since the start of the plan are rounded, not the durations, so that rounding
    errors do not accumulate.
    """
    kept: list[PlanSegment[S]] = []
    ticks: list[int] = []
    clock, tick = 0.0, 0
    for segment in plan_segments:
        clock += segment.seconds
        length = round(clock * rate) - tick
        if length > 0 or segment.phase is Phase.DONE:  # an empty segment would take one tick
            kept.append(segment)
            ticks.append(length)
            tick += length
    table = tuple(dict.fromkeys(segment.setpoint for segment in kept))
    index = {setpoint: i for i, setpoint in enumerate(table)}
    segments = Segments(
        row=tuple(segment.row for segment in kept),
        phase=tuple(int(segment.phase) for segment in kept),
        ticks=tuple(ticks),
        wait=tuple(segment.wait for segment in kept),
        timeout=tuple(
            max(round(segment.timeout * rate), length) if segment.wait else 0
            for segment, length in zip(kept, ticks, strict=True)
        ),
        restart=_restarts(kept),
        drive=tuple(segment.drive for segment in kept),
        waves=tuple(segment.waves for segment in kept),
        setpoint=tuple(index[segment.setpoint] for segment in kept),
    )
    return SegmentTable(segments, tuple(kept), table)


def phase_seconds(table: SegmentTable[S], rate: float) -> dict[Phase, float]:
    """Return the planned duration of each phase, s."""
    seconds = dict.fromkeys(Phase, 0.0)
    for ticks, segment in zip(table.segments.ticks, table.plan_segments, strict=True):
        seconds[segment.phase] += ticks
    return {phase: ticks / rate for phase, ticks in seconds.items()}


def _restarts(kept: Sequence[PlanSegment[S]]) -> tuple[int, ...]:
    """Return the index at which each segment restarts: the first one of its row or of its phase."""
    first: dict[tuple[int, Phase | None], int] = {}
    restarts = []
    for i, segment in enumerate(kept):
        key = (segment.row, segment.phase if segment.row == NO_ROW else None)
        is_choice = segment.phase is Phase.CHOICE  # the next one of them follows another row
        restarts.append(i if is_choice else first.setdefault(key, i))
    return tuple(restarts)
