"""Matching of answers to SYNCs by counting, because process data carry neither time nor number.

A device answers every SYNC (or every n-th) once and in order, so the n-th answer belongs to the
n-th SYNC however late it arrives: answers that were delayed and arrive together get their true
ages. Counting cannot distinguish a late answer from a lost one. So if for a whole window no answer
catches up with the SYNCs, the open ones count as lost; until then the ages are too large, which is
safe.
"""

from typing import NamedTuple

WINDOW = 128  # SYNCs within which an answer must catch up, else the open ones count as lost
MAX_OPEN = 256  # SYNCs whose send time is stored; answers to older ones get the largest age
_NO_WINDOW = -1  # no window has begun


class AnswerCount(NamedTuple):
    """Progress of the answers with one COB-ID."""

    answered: int  # number of the SYNC that the last answer belongs to, from 1; 0: no answer yet
    min_open: int  # smallest number of later SYNCs at an answer of this window
    window_end: int  # number of the SYNC that ends the window; -1: the next answer begins one


def start() -> AnswerCount:
    """Return the state before the first answer."""
    return AnswerCount(0, 0, _NO_WINDOW)


def record_answer(count: AnswerCount, divider: int, latest: int) -> AnswerCount:
    """Return the state after one more answer of a device that answers every ``divider``-th SYNC.

    ``divider`` >= 1; ``latest`` (0 or more) is the number of the last SYNC that it can answer. The
    first answer counts as an answer to that SYNC, and so does a surplus one: a device may have
    answered before we listened, or a frame may arrive twice.
    """
    answered, min_open, window_end = count
    number = answered + divider
    if answered == 0 or number > latest:
        number = latest
    open_syncs = latest - number
    if window_end == _NO_WINDOW:
        return AnswerCount(number, open_syncs, latest + WINDOW)
    min_open = min(min_open, open_syncs)
    if latest < window_end:
        return AnswerCount(number, min_open, window_end)
    return AnswerCount(number + min_open, 0, _NO_WINDOW)
