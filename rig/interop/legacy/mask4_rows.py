"""The auxiliary rows of a MASK4 gain matrix: found, and put in. Pure functions over rows of floats.

MASK4 report (Sandia), 3.2.3: a first row held for about 5 s loads the set; a second, identical to
the third, is held until 120 s; where the spring rate changes, the new combination stands twice,
the first time for as long as the stator moves; Kp = -999 ends the matrix.
"""

from collections.abc import Sequence
from typing import NamedTuple

from rig.config.columns import END_MARK

Values = tuple[float, ...]


class Found(NamedTuple):
    """What each row of a file is, by its index from 0."""

    rows: tuple[int, ...]  # to be measured
    lead: tuple[int, ...]  # before the first of those: load row, hold row
    doubled: tuple[int, ...]  # held while the stator moves; each stands again right after
    undoubled: tuple[int, ...]  # measured at once after a change of the spring rate
    repeated: tuple[int, ...]  # measured, and equal to the measured row before
    end: int | None  # the row with Kp = -999
    after: tuple[int, ...]  # rows that nobody gets to


class UnknownLeadError(ValueError):
    """It cannot be told how many rows stand before the first one to be measured."""


def structure(rows: Sequence[Values], kp: int, spring: int, lead: int | None = None) -> Found:
    """What each row is; ``kp`` and ``spring`` are the indices of those columns.

    ``lead``: how many rows stand before the first one to be measured. If it is not given, the
    second row must equal the third, as in the report; `UnknownLeadError` if it does not.
    """
    end = next((i for i, row in enumerate(rows) if row[kp] == END_MARK), None)
    used = rows if end is None else rows[:end]
    if lead is None:
        if len(used) < 3 or used[1] != used[2]:
            raise UnknownLeadError
        lead = 2
    measured, doubled, undoubled, repeated = [], list[int](), list[int](), list[int]()
    for i in range(lead, len(used)):
        changed = i > lead and used[i][spring] != used[i - 1][spring]
        if changed and i + 1 < len(used) and used[i + 1] == used[i]:
            doubled.append(i)
            continue
        if changed:
            undoubled.append(i)
        elif i > lead and used[i] == used[i - 1] and i - 1 not in doubled:
            repeated.append(i)
        measured.append(i)
    return Found(
        rows=tuple(measured),
        lead=tuple(range(min(lead, len(used)))),
        doubled=tuple(doubled),
        undoubled=tuple(undoubled),
        repeated=tuple(repeated),
        end=end,
        after=tuple(range(end + 1, len(rows))) if end is not None else (),
    )


def wrapped(rows: Sequence[Values], kp: int, ki: int, spring: int) -> tuple[Values, ...]:
    """The rows with all auxiliary rows around them: `structure` finds exactly ``rows`` again.

    No row may have Kp = -999. The load row differs from the first row, because the change loads
    the set; it absorbs no less than nothing and is never the end mark. The end row keeps the
    spring where it is.
    """
    first, last = rows[0], rows[-1]
    if first[ki] != 0.0:
        load = _with(first, {ki: 0.0})
    else:
        load = _with(first, {kp: 0.0 if first[kp] != 0.0 else -1.0})
    found = [load, first]
    before = first
    for row in rows:
        if row[spring] != before[spring]:
            found.append(row)
        found.append(row)
        before = row
    return (*found, _with(last, {kp: END_MARK, ki: 0.0}))


def _with(row: Values, changed: dict[int, float]) -> Values:
    return tuple(changed.get(i, value) for i, value in enumerate(row))
