"""One question at a time to a Compax3, and never a late answer taken for a new one.

Answers carry no number, so an answer that is late looks like that to the next question. Therefore,
after the line opened or an answer failed to come in time, nothing is believed until the drive has
answered `_?` with its name: a text, which no binary answer can be mistaken for. Answers come in
order, so whatever was late has come before it and is thrown away. `_?` itself may be answered late:
a name counts only when no earlier `_?` is still to be answered. If one is, nothing more is asked
until all are answered, or until the line was quiet for ten times `answer`: then they were lost. So
a drive later than `answer` is never believed, and one that lost a `_?` a little later.

The drive gives up a record whose bytes are 5 ms apart, and so does this side: before a new start
the line is quiet for longer than that and than the slowest answer, but it is not waited for for
ever: on a line that babbles a stop must still get out.
"""

from typing import NamedTuple

from drivers.compax3 import stream
from drivers.compax3.codec import Record, refusal
from drivers.compax3.text import IDENTIFY, Answer, Reply, encode_line
from drivers.errors import CodecError

GAP = 0.005  # s between two bytes of a message, at most; source: manual 192-120100, 5.2
_BABBLE = 4.0  # times the quiet time after which a line that is never quiet is spoken on
_LOST = 10.0  # times `answer`: after such a silence an unanswered `_?` was lost
_TOO_LATE = "answers, but later"
_NEVER = -1e9  # s, before any clock began


class Timing(NamedTuple):
    """What is waited for; the drive's own times are not confirmed, so they are the rig's to say."""

    answer: float  # s, in which an answer must have come, > 0
    quiet: float  # s without a byte after which no late answer is on its way, > GAP


class Requests:
    """The line's discipline; what is asked is decided elsewhere."""

    def __init__(self, who: str, address: int, identity: str, timing: Timing) -> None:
        """``identity``: what the drive's name must begin with. CodecError for a useless timing."""
        if not (timing.answer > 0.0 and timing.quiet > GAP):
            raise CodecError(who, "timing", f"answer > 0 and quiet > {GAP:g} s", timing)
        self.name = ""  # as the drive gave it, empty while it has not
        self.late = self.timeouts = self.refusals = 0
        self.trouble = "has not answered yet"  # empty while it answers
        self._who, self._identity, self._timing = who, identity, timing
        self._identify = encode_line(IDENTIFY, address)
        self._stream = stream.start()
        self._known = False  # the drive has given its name since the last doubt
        self._asked: float | None = None  # when the outstanding question went out
        self._names = 0  # how many `_?` have no answer yet
        self._draining = False  # one was answered out of turn: the others are waited for
        self._heard = _NEVER
        self._doubt = _NEVER  # since when nothing is believed
        self._spoken = _NEVER

    @property
    def dropped(self) -> int:
        """Bytes that belonged to no message, and messages with a wrong sum."""
        return self._stream.dropped + self._stream.bad_records + self._stream.bad_lines

    @property
    def free(self) -> bool:
        """True when a question may be asked now."""
        return self._known and self._asked is None

    @property
    def known(self) -> bool:
        """True while answers are believed."""
        return self._known

    def opened(self, now: float) -> None:
        """The line opened: whatever was under way is not any more."""
        fresh = stream.start()
        self._stream = fresh._replace(
            dropped=self._stream.dropped,
            bad_records=self._stream.bad_records,
            bad_lines=self._stream.bad_lines,
        )
        self._heard, self._names, self._draining = _NEVER, 0, False
        self._distrust(now, "has not answered yet")

    def take(self, data: bytes, now: float) -> Record | None:
        """Take in what came; gives the answer to the outstanding question when it is complete."""
        messages: list[Record | Reply] = []
        if self._stream.pending and now - self._heard > GAP:
            self._stream, messages = stream.pause(self._stream)
        if data:
            self._heard = now
            self._stream, more = stream.feed(self._stream, data)
            messages += more
        answer: Record | None = None
        for message in messages:
            if not self._known:
                self._look_for_name(message)
            elif isinstance(message, Record) and self._asked is not None and answer is None:
                answer = message
                self.refusals += 1 if refusal(message) else 0
            else:
                self.late += 1
        if answer is not None:
            self._asked = None
        return answer

    def ask(self, message: bytes, now: float) -> bytes:
        """The question goes out now; only while `free`."""
        self._asked = self._spoken = now
        return message

    def upkeep(self, now: float, owed: bytes) -> bytes:
        """What must be sent to be believed again, if that is what is lacking.

        ``owed``: a message that goes out before the name is asked for although its answer cannot be
        believed (a stop), empty for none.
        """
        asked = self._asked
        if asked is not None and now - asked > self._timing.answer:
            self.timeouts += 1
            late = self.trouble if self._names and not self._known else ""
            why = f"no answer in {self._timing.answer:g} s"
            self._distrust(now, late if late.startswith(_TOO_LATE) else why)
            if owed:
                self._spoken = now
                return owed
        if self._known or self._asked is not None:
            return b""
        quiet = self._timing.quiet
        if now - self._spoken <= quiet:
            return b""
        if now - self._heard <= quiet and now - self._doubt <= _BABBLE * quiet:
            return b""
        if owed and self._spoken < self._doubt:
            self._spoken = now
            return owed
        if self._draining:
            if self._names and now - self._heard <= _LOST * self._timing.answer:
                return b""
            self._names, self._draining = 0, False
        self._asked = self._spoken = now
        self._names += 1
        return self._identify

    def doubt(self, now: float, why: str) -> None:
        """An answer made no sense: believe nothing until the drive has given its name again."""
        self._distrust(now, why)

    def _distrust(self, now: float, why: str) -> None:
        self._known, self._asked, self._doubt = False, None, now
        self.trouble = why

    def _look_for_name(self, message: Record | Reply) -> None:
        if isinstance(message, Reply):
            self._names = max(0, self._names - 1)  # answers come in order
        if not (isinstance(message, Reply) and message.answer is Answer.TEXT):
            self.late += 1
        elif not message.text.startswith(self._identity):
            self.trouble = f"calls itself {message.text!r}, not {self._identity!r}"
            self._asked = None  # asked again, in case it was a stray text
        elif self._names or self._asked is None:
            self.late += 1
            self._asked, self._draining = None, True
            self.trouble = f"{_TOO_LATE} than {self._timing.answer:g} s"
        else:
            self.name, self.trouble = message.text, ""
            self._known, self._asked = True, None
