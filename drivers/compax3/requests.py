"""Sequential requests to a Compax3, protected against late answers.

Answers carry no number, so a late answer looks like the answer to the next request. Therefore,
after the port was opened or an answer timed out, no answer is accepted until the drive has answered
`_?` with its name, a text that no binary answer can be mistaken for. Answers arrive in order, so
all late ones arrive before the name and are discarded. The answer to `_?` may itself be late: a
name counts only while no earlier `_?` is unanswered. If one is, no request is sent until all are
answered, or until the line has been quiet for ten times `answer_timeout`, which means that they
were lost. So the answers of a drive slower than `answer_timeout` are never accepted; a drive that
lost a `_?` is accepted again somewhat later.

The drive discards a record whose bytes are more than 5 ms apart, and so does the host: before a new
start it waits until the line has been quiet for longer than that and than the slowest answer. This
wait is limited, because a stop must be sent even on a line that is never quiet.
"""

from typing import NamedTuple

from drivers.compax3 import stream
from drivers.compax3.codec import Record, error_number
from drivers.compax3.text import IDENTIFY, Reply, ReplyKind, encode_line
from drivers.errors import CodecError

GAP = 0.005  # s, largest gap between two bytes of a message; source: manual 192-120100, 5.2
_BABBLE_FACTOR = 4.0  # times `quiet_time`: longest wait for a quiet line before sending
_LOST_FACTOR = 10.0  # times `answer_timeout` of silence: an unanswered `_?` counts as lost
_TOO_LATE = "answers, but later"
_NEVER = -1e9  # s, earlier than any clock reading


class Timing(NamedTuple):
    """Timeouts of the line; no defaults, because the drive's own times are not confirmed."""

    answer_timeout: float  # s, > 0
    quiet_time: float  # s without a byte after which no late answer can arrive, > GAP


class Requests:
    """Sends one request at a time and matches its answer; the caller chooses the requests."""

    def __init__(self, device: str, address: int, identity: str, timing: Timing) -> None:
        """Check the timing (CodecError); ``identity``: required start of the drive's name."""
        if not (timing.answer_timeout > 0.0 and timing.quiet_time > GAP):
            raise CodecError(device, "timing", f"answer > 0 and quiet > {GAP:g} s", timing)
        self.name = ""  # name that the drive answered; empty before the answer
        self.late = self.timeouts = self.refusals = 0
        self.problem = "has not answered yet"  # empty while it answers
        self._device, self._identity, self._timing = device, identity, timing
        self._identify = encode_line(IDENTIFY, address)
        self._stream = stream.start()
        self._identified = False  # True: named itself since answers were last distrusted
        self._sent_at: float | None = None  # send time of the outstanding request, s
        self._open_identifications = 0  # number of unanswered `_?`
        self._draining = False  # True: wait for the answers to all earlier `_?`
        self._last_byte_at = _NEVER
        self._distrusted_since = _NEVER  # s, time since which no answer is accepted
        self._last_sent_at = _NEVER

    @property
    def dropped(self) -> int:
        """Return the count of bytes outside messages plus that of invalid messages."""
        return self._stream.dropped + self._stream.bad_records + self._stream.bad_lines

    @property
    def is_ready(self) -> bool:
        """Return True when a request may be sent now."""
        return self._identified and self._sent_at is None

    @property
    def is_identified(self) -> bool:
        """Return True while answers are accepted."""
        return self._identified

    def on_open(self, now: float) -> None:
        """Discard everything outstanding after the port was opened."""
        fresh = stream.start()
        self._stream = fresh._replace(
            dropped=self._stream.dropped,
            bad_records=self._stream.bad_records,
            bad_lines=self._stream.bad_lines,
        )
        self._last_byte_at, self._open_identifications, self._draining = _NEVER, 0, False
        self._distrust(now, "has not answered yet")

    def receive(self, data: bytes, now: float) -> Record | None:
        """Process received bytes; return the answer to the outstanding request once complete."""
        messages: list[Record | Reply] = []
        if self._stream.pending and now - self._last_byte_at > GAP:
            self._stream, messages = stream.flush_stalled(self._stream)
        if data:
            self._last_byte_at = now
            self._stream, more = stream.feed(self._stream, data)
            messages += more
        answer: Record | None = None
        for message in messages:
            if not self._identified:
                self._check_identity(message)
            elif isinstance(message, Record) and self._sent_at is not None and answer is None:
                answer = message
                self.refusals += 1 if error_number(message) else 0
            else:
                self.late += 1
        if answer is not None:
            self._sent_at = None
        return answer

    def begin_request(self, message: bytes, now: float) -> bytes:
        """Return the message and record it as sent now; only while `is_ready`."""
        self._sent_at = self._last_sent_at = now
        return message

    def recovery_message(self, now: float, pending_stop: bytes) -> bytes:
        """Return the message that restores trust in the answers; empty if none is due.

        ``pending_stop``: a stop to send before the identification, although its answer cannot be
        accepted; empty for none.
        """
        sent_at = self._sent_at
        if sent_at is not None and now - sent_at > self._timing.answer_timeout:
            self.timeouts += 1
            late_problem = (
                self.problem if self._open_identifications and not self._identified else ""
            )
            reason = f"no answer in {self._timing.answer_timeout:g} s"
            self._distrust(now, late_problem if late_problem.startswith(_TOO_LATE) else reason)
            if pending_stop:
                self._last_sent_at = now
                return pending_stop
        if self._identified or self._sent_at is not None:
            return b""
        quiet = self._timing.quiet_time
        if now - self._last_sent_at <= quiet:
            return b""
        if (
            now - self._last_byte_at <= quiet
            and now - self._distrusted_since <= _BABBLE_FACTOR * quiet
        ):
            return b""
        if pending_stop and self._last_sent_at < self._distrusted_since:
            self._last_sent_at = now
            return pending_stop
        if self._draining:
            if (
                self._open_identifications
                and now - self._last_byte_at <= _LOST_FACTOR * self._timing.answer_timeout
            ):
                return b""
            self._open_identifications, self._draining = 0, False
        self._sent_at = self._last_sent_at = now
        self._open_identifications += 1
        return self._identify

    def distrust(self, now: float, reason: str) -> None:
        """Reject all answers until the drive has identified itself again."""
        self._distrust(now, reason)

    def _distrust(self, now: float, reason: str) -> None:
        self._identified, self._sent_at, self._distrusted_since = False, None, now
        self.problem = reason

    def _check_identity(self, message: Record | Reply) -> None:
        if isinstance(message, Reply):
            self._open_identifications = max(
                0, self._open_identifications - 1
            )  # answers come in order
        if not (isinstance(message, Reply) and message.kind is ReplyKind.TEXT):
            self.late += 1
        elif not message.text.startswith(self._identity):
            self.problem = f"calls itself {message.text!r}, not {self._identity!r}"
            self._sent_at = None  # identify again, in case this was a stray text
        elif self._open_identifications or self._sent_at is None:
            self.late += 1
            self._sent_at, self._draining = None, True
            self.problem = f"{_TOO_LATE} than {self._timing.answer_timeout:g} s"
        else:
            self.name, self.problem = message.text, ""
            self._identified, self._sent_at = True, None
