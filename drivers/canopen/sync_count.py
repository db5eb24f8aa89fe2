"""Which SYNC a frame answers: counted, because process data carry neither a time nor a number.

A device answers every SYNC (or every n-th) once and in order, so the n-th answer belongs to the
n-th SYNC however late it comes: what was held up on its way, and then comes in a heap, is as old
as it is. What a count cannot tell from an answer that is late is one that was lost. So when for a
whole window no answer caught up with the SYNCs, the ones that are open are given up as lost; until
then values are told older than they are, which is safe.
"""

from typing import NamedTuple

WINDOW = 128  # SYNCs in which an answer must have caught up, or what is open was lost
OPEN = 256  # SYNCs whose moment is kept; the answer to an older one is as old as can be
_NOTHING = -1  # no window has begun


class Answers(NamedTuple):
    """How far the answers of one kind (one COB-ID) have come."""

    answered: int  # number of the SYNC that the last one answers, from 1; 0: none has come
    fewest: int  # SYNCs since that one, at the fewest in this window
    until: int  # number of the SYNC that ends the window; -1: it begins with the next answer


def start() -> Answers:
    """Before the first answer."""
    return Answers(0, 0, _NOTHING)


def take(before: Answers, each: int, latest: int) -> Answers:
    """One answer more, of a device that answers every ``each``-th SYNC (1 or more).

    ``latest`` (0 or more) is the number of the last SYNC that it can be an answer to. The first one
    counts as an answer to that, and so does one too many: nothing says how often a device answered
    before it was listened to, or that a frame came twice.
    """
    answered, fewest, until = before
    number = min(answered + each, latest) if answered > 0 else latest
    late = latest - number
    if until == _NOTHING:
        return Answers(number, late, latest + WINDOW)
    fewest = min(fewest, late)
    if latest < until:
        return Answers(number, fewest, until)
    return Answers(number + fewest, 0, _NOTHING)
