"""From pieces in seconds to the table of ticks that the loop walks."""

from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

from rig.realtime.sequence import NO_ROW, Phase, Segments

S = TypeVar("S")


class Piece(NamedTuple, Generic[S]):
    """One stretch of a plan, in seconds; a segment once it is cut into ticks."""

    row: int
    phase: Phase
    seconds: float
    setpoint: S  # hashable
    wait: int = 0
    timeout: float = 0.0  # s
    waves: int = 1
    drive: int = 1


class Cut(NamedTuple, Generic[S]):
    """The table, the pieces that are in it, and the set points its indices mean."""

    segments: Segments
    pieces: tuple[Piece[S], ...]
    setpoints: tuple[S, ...]


def cut_into_ticks(pieces: Sequence[Piece[S]], rate: float) -> Cut[S]:
    """Segments at ``rate`` (Hz): ends are rounded on the plan's own clock, so nothing drifts."""
    kept: list[Piece[S]] = []
    ticks: list[int] = []
    clock, tick = 0.0, 0
    for piece in pieces:
        clock += piece.seconds
        length = round(clock * rate) - tick
        if length > 0 or piece.phase is Phase.DONE:  # a segment of no ticks would still take one
            kept.append(piece)
            ticks.append(length)
            tick += length
    table = tuple(dict.fromkeys(piece.setpoint for piece in kept))
    index = {setpoint: i for i, setpoint in enumerate(table)}
    segments = Segments(
        row=tuple(piece.row for piece in kept),
        phase=tuple(int(piece.phase) for piece in kept),
        ticks=tuple(ticks),
        wait=tuple(piece.wait for piece in kept),
        timeout=tuple(
            max(round(piece.timeout * rate), length) if piece.wait else 0
            for piece, length in zip(kept, ticks, strict=True)
        ),
        restart=_restarts(kept),
        drive=tuple(piece.drive for piece in kept),
        waves=tuple(piece.waves for piece in kept),
        setpoint=tuple(index[piece.setpoint] for piece in kept),
    )
    return Cut(segments, tuple(kept), table)


def _restarts(kept: Sequence[Piece[S]]) -> tuple[int, ...]:
    """Where each segment starts over: its row's first segment, or the first of its phase."""
    first: dict[tuple[int, Phase | None], int] = {}
    found = []
    for i, piece in enumerate(kept):
        key = (piece.row, piece.phase if piece.row == NO_ROW else None)
        found.append(first.setdefault(key, i))
    return tuple(found)
