"""Find and add the auxiliary rows of a MASK4 gain matrix. Pure functions over rows of floats.

MASK4 report (Sandia), 3.2.3: the first row is held for about 5 s and loads the set. The second row,
identical to the third, is held until 120 s. Where the spring rate changes, the new combination
occurs twice, the first time while the stator moves. Kp = -999 ends the matrix.
"""

from collections.abc import Sequence
from typing import NamedTuple

from rig.config.columns import END_MARK

RowValues = tuple[float, ...]


class RowRoles(NamedTuple):
    """Indices (from 0) of a file's rows by their role."""

    measured: tuple[int, ...]  # rows to be measured
    lead: tuple[int, ...]  # before the first measured row: load row, hold row
    doubled: tuple[int, ...]  # held while the stator moves; each is repeated by the next row
    not_doubled: tuple[int, ...]  # measured at once after a change of the spring rate
    repeated: tuple[int, ...]  # measured, and equal to the measured row before
    end: int | None  # the row with Kp = -999
    after_end: tuple[int, ...]  # rows after the end mark, never played


class UnknownLeadRowsError(ValueError):
    """The number of rows before the first measured one is unknown."""


def classify_rows(
    rows: Sequence[RowValues], kp: int, spring: int, lead: int | None = None
) -> RowRoles:
    """Return the role of each row; ``kp`` and ``spring`` are the indices of those columns.

    ``lead`` is the number of rows before the first measured one. Without it, the second row must
    equal the third, as in the report; otherwise the function raises `UnknownLeadRowsError`.
    """
    end = next((i for i, row in enumerate(rows) if row[kp] == END_MARK), None)
    used = rows if end is None else rows[:end]
    if lead is None:
        if len(used) < 3 or used[1] != used[2]:
            raise UnknownLeadRowsError
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
    return RowRoles(
        measured=tuple(measured),
        lead=tuple(range(min(lead, len(used)))),
        doubled=tuple(doubled),
        not_doubled=tuple(undoubled),
        repeated=tuple(repeated),
        end=end,
        after_end=tuple(range(end + 1, len(rows))) if end is not None else (),
    )


def add_auxiliary_rows(
    rows: Sequence[RowValues], kp: int, ki: int, spring: int
) -> tuple[RowValues, ...]:
    """Return the rows with all auxiliary rows added; `classify_rows` recovers exactly ``rows``.

    No row may have Kp = -999. The load row differs from the first row, because the change loads
    the set; its Kp is never positive and never the end mark. The end row keeps the spring rate.
    """
    first, last = rows[0], rows[-1]
    if first[ki] != 0.0:
        load = _replaced(first, {ki: 0.0})
    else:
        load = _replaced(first, {kp: 0.0 if first[kp] != 0.0 else -1.0})
    complete = [load, first]
    before = first
    for row in rows:
        if row[spring] != before[spring]:
            complete.append(row)
        complete.append(row)
        before = row
    return (*complete, _replaced(last, {kp: END_MARK, ki: 0.0}))


def _replaced(row: RowValues, changed: dict[int, float]) -> RowValues:
    return tuple(changed.get(i, value) for i, value in enumerate(row))
