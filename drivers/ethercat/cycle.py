"""One cycle of a segment: take the newest answer, then send the outputs.

    tick k:  receive (answers to frames up to k-1) ... outputs, frame k

So inputs are one tick old when they are used, which a model can include. Each answer carries the
number of its frame, so its age is known whatever happened on the way: after a stall, all that waits
is taken in one look, and the newest counts. Inputs whose working counter is wrong are not taken:
some slave did not see the frame, and its bytes are those that were sent. They age instead.
"""

from typing import NamedTuple, Protocol

from drivers.ethercat.frames import CyclicFrame
from drivers.ethercat.link import TICK_INDICES

OPERATIONAL = 8  # AL status of all slaves in this state, without an error
_STATE = 0x1F  # bits of state and error; above is the flag of a device's own number
_MAX_FRAMES = 256  # of one look; a wire that held back more is looked at again in the next tick
_NEVER = -1e9  # s, earlier than any clock reading
_OPEN = 1024  # frames whose time of sending is kept
AGE_STEP_S = 1e-4  # width of a class of ages
AGE_CLASSES = 500  # the last one has all older ones, too


class FrameLink(Protocol):
    """A transport of frames: `drivers.ethercat.link.Link`, or a test's."""

    frame: bytearray  # the received frame

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        ...

    def send(self, frame: bytearray) -> bool:
        """Send a frame without waiting; return whether it was accepted."""
        ...

    def receive(self) -> int:
        """Take one frame into `frame`; return its length, 0 if none has come."""
        ...

    def close(self) -> None:
        """Close the interface; cannot raise."""
        ...


class SegmentState(NamedTuple):
    """The newest answer, whether or not its inputs count."""

    wkc: int
    slaves: int
    al_status: int  # of all slaves, by bitwise or
    time_ns: int  # of the reference clock
    sent: float  # s, when its frame was sent

    def is_operational(self, slaves: int) -> bool:
        """Return whether all of a number of slaves answered, in OP and without an error."""
        return self.al_status & _STATE == OPERATIONAL and self.slaves == slaves


class SegmentCycle:
    """The process data of a segment."""

    def __init__(self, link: FrameLink, frame: CyclicFrame, wkc: int) -> None:
        """``wkc``: working counter of a frame that every slave has seen."""
        self.outputs = frame.outputs
        self.inputs = memoryview(bytearray(len(frame.outputs)))
        self.sampled = _NEVER  # s, when the frame of the inputs was sent
        self.state = SegmentState(0, 0, 0, 0, _NEVER)
        self.wrong_wkc = 0  # answers whose inputs did not count
        self.lost = 0  # frames without an answer when a later one came
        self.late = 0  # answers that came after a later one
        self.foreign = 0  # frames that are not ours
        self.ages = [0] * AGE_CLASSES  # looks by the age of the inputs, in steps of `AGE_STEP_S`
        self._link, self._frame, self._expected = link, frame, wkc
        self._sent_at = [_NEVER] * _OPEN
        self._sent = self._answered = 0  # numbers of frames

    def receive(self) -> float:
        """Take the newest answer; return the time (s) afterwards."""
        link, frame = self._link, self._frame
        for _ in range(_MAX_FRAMES):
            length = link.receive()
            if length == 0:
                break
            if not frame.is_answer(link.frame, length):
                self.foreign += 1
                continue
            answer = frame.read(link.frame)
            if not self._answered < answer.number <= self._sent:
                self.late += 1
                continue
            self.lost += answer.number - self._answered - 1
            self._answered = answer.number
            sent = self._time_of(answer.number)
            self.state = SegmentState(
                answer.wkc, answer.slaves, answer.al_status, answer.time_ns, sent
            )
            if answer.wkc != self._expected:
                self.wrong_wkc += 1
                continue
            self.inputs[:] = frame.process_data(link.frame)
            self.sampled = sent
        now = link.now()
        self.ages[min(int((now - self.sampled) / AGE_STEP_S), AGE_CLASSES - 1)] += 1
        return now

    def now(self) -> float:
        """Return the time of the link's clock, s."""
        return self._link.now()

    def send(self) -> None:
        """Send the outputs in a new frame."""
        link, number = self._link, self._sent + 1
        self._frame.set_number(TICK_INDICES[number % len(TICK_INDICES)], number)
        now = link.now()  # before the call, so that no input looks younger than it is
        if link.send(self._frame.bytes):
            self._sent = number
            self._sent_at[number % _OPEN] = now

    def statistics(self) -> dict[str, int | float]:
        """Return the numbers of frames so far, and ages of the inputs (s) at three ranks."""
        total, passed = sum(self.ages), 0
        ranks = {"age_p50_s": 0.5, "age_p99_s": 0.99, "age_p99_9_s": 0.999}
        found: dict[str, float] = {}
        for place, number in enumerate(self.ages):
            passed += number
            for name, share in ranks.items():
                if name not in found and total and passed >= share * total:
                    found[name] = (place + 1) * AGE_STEP_S
        return {
            "sent": self._sent,
            "lost": self.lost,
            "late": self.late,
            "wrong_working_counter": self.wrong_wkc,
            "foreign": self.foreign,
            "looks": total,
            **found,
        }

    def close(self) -> None:
        """Give the interface back; cannot raise."""
        self._link.close()

    def _time_of(self, number: int) -> float:
        return self._sent_at[number % _OPEN] if self._sent - number < _OPEN else _NEVER
