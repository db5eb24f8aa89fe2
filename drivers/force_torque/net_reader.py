"""The conversation with an ATI Net F/T: stop, start, stream of datagrams, and again.

    opened -> STOPPING (stop, quiet) -> STARTING -> STREAMING
                  ^-- no record for too long: after a pause that doubles --'

The box serves one client, whoever asked last, and says nothing to the one before: a stream that is
taken away looks like one that was cut. The pause keeps two clients from fighting over it at full
speed. A record's age counts from the look before the one that found it; where the sensor's sample
rate is known, its own count of samples shows what was held up on the way as well. A record with the
count of the one before is no new sample: a sensor that hangs behind a box that talks grows old.
"""

from typing import NamedTuple

from drivers import clock_offset
from drivers.back_off import BackOff
from drivers.errors import CodecError
from drivers.force_torque import load, net_ft
from drivers.force_torque.load import Phase, Reading
from drivers.force_torque.net_ft import Command, Record, Request, StatusBits
from drivers.force_torque.wrench import Scale, Six, in_si

PAUSE_FIRST, PAUSE_MOST = 0.1, 5.0  # s between attempts to bring the stream up
LEAP = 0.5  # s between the clocks that no delay explains: the sensor's count began anew
_WINDOW = 1.0  # s, of the clock comparison
_NEVER = -1e9  # s, before any clock began
_STOP = net_ft.encode_request(Request(Command.STOP, 0))
_BIAS = net_ft.encode_request(Request(Command.BIAS, 0))


class Settings(NamedTuple):
    """One box."""

    name: str  # for people
    scale: Scale  # SI per count, as the box's calibration says
    bits: StatusBits  # what its status means
    buffered: int  # 1: several records a datagram
    rate: float  # Hz at which the sensor counts its samples (ft_sequence); 0: not known
    quiet: float  # s after a stop until nothing of the old stream is on its way, > 0
    silence: float  # s without a record from which the stream is started anew, > 0


class NetReader:
    """The conversation with one box."""

    def __init__(self, settings: Settings) -> None:
        """CodecError for times or a rate that cannot be."""
        if min(settings.quiet, settings.silence) <= 0.0 or settings.rate < 0.0:
            raise CodecError(settings.name, "times", "above 0", settings)
        self.starts = 0  # times that the stream came up
        self.records = self.faulty = self.saturated = self.broken = 0
        self.missing = self.repeated = self.bad_datagrams = 0  # see net_ft.State, of all streams
        self.stood = 0  # records in which the sensor had taken no new sample; not used
        self.stray = 0  # datagrams that came while none was expected; not used
        self._settings = settings
        start = Command.START_BUFFERED if settings.buffered == 1 else Command.START
        self._start = net_ft.encode_request(Request(start, 0))
        self._stream = net_ft.start()
        self._offset = clock_offset.start()
        self._tare = load.untared()
        self._box_tare = False  # to be sent
        self._phase = Phase.STOPPING
        self._trouble = "not started yet"
        self._back_off = BackOff(PAUSE_FIRST, PAUSE_MOST)
        self._said: float | None = None  # when the message of this phase went out
        self._before = self._looked = self._sampled = self._came = _NEVER
        self._counts: Six = load.NO_BIAS
        self._railed = self._fault = self._status = 0
        self._standing = False  # the last record had no new sample
        self._taken = -1  # ft_sequence of the last record, -1 before the first

    def tare(self, records: int) -> None:
        """Take the mean of the next good records as what reads 0, on this side."""
        self._tare = load.begin_tare(self._tare, records)

    def untare(self) -> None:
        """Read as the box has it, its own bias included."""
        self._tare = load.untared()

    def tare_box(self) -> None:
        """Have the box call the present load 0. It acknowledges nothing: look at the wrench.

        The host's own bias is taken back, because it was measured from another zero.
        """
        self._box_tare, self._tare = True, load.untared()

    def opened(self, now: float) -> None:
        """The socket opened: begin with a stop, a stream may be on its way."""
        self._looked = now
        self._enter(Phase.STOPPING)

    def take(self, data: bytes, now: float) -> None:
        """One datagram that came; call it with none when none came."""
        if now > self._looked:
            self._before, self._looked = self._looked, now
        if not data:
            return
        if self._phase not in (Phase.STARTING, Phase.STREAMING) or self._said is None:
            self.stray += 1
            return
        stream = self._stream
        self._stream, records = net_ft.feed(stream, data)
        self.missing += self._stream.missing - stream.missing
        self.repeated += self._stream.repeated - stream.repeated
        self.bad_datagrams += self._stream.bad_datagrams - stream.bad_datagrams
        for record in records:
            if self._stands(record):
                self.stood += 1
            else:
                self._judge(record, self._latched(record, now))
        if records:
            self._came, self._trouble = now, ""
            if self._phase is Phase.STARTING:
                self.starts += 1
                self._phase = Phase.STREAMING
            self._back_off.worked()

    def speak(self, now: float) -> bytes:
        """The one datagram to send now; mostly empty."""
        settings, said = self._settings, self._said
        if self._phase in (Phase.STARTING, Phase.STREAMING) and said is not None:
            if now - max(said, self._came) > settings.silence:
                self._trouble = f"no record for {settings.silence:g} s (has another client asked?)"
                self._back_off.failed(now)
                self._enter(Phase.STOPPING)
            elif self._box_tare and self._phase is Phase.STREAMING:
                self._box_tare = False
                return _BIAS
            return b""
        if said is None:
            if not self._back_off.ready(now):
                return b""
            self._said = now
            return _STOP
        if now - said < settings.quiet:
            return b""
        self._enter(Phase.STARTING)
        self._said, self._stream = now, net_ft.start()
        return self._start

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        wrench = load.NOTHING
        if self._sampled > _NEVER:
            a, b, c, d, e, f = (
                count - tare for count, tare in zip(self._counts, self._tare.bias, strict=True)
            )
            wrench = in_si(self._settings.scale, (a, b, c, d, e, f))
        return Reading(wrench, now - self._sampled, self._railed, self._fault, self._phase)

    def explain(self, now: float) -> str:
        """Why there is no good record, for people; empty if there is one."""
        said = [self._trouble] if self._trouble else []
        if self._phase is Phase.STREAMING and now - self._sampled > self._settings.silence:
            said.append(f"no good record for {self._settings.silence:g} s")
            if self._standing:
                said.append("the sensor's count of samples stands still")
        if self._fault:
            said.append(f"the box's status is {self._status:#010x}")
        if self._railed:
            said.append("saturated")
        return f"{self._settings.name}: {'; '.join(said)}" if said else ""

    def _enter(self, phase: Phase) -> None:
        self._phase, self._said = phase, None

    def _stands(self, record: Record) -> bool:
        """Whether the sensor has taken no sample since the record before, as far as it tells."""
        self._standing = self._settings.rate > 0.0 and record.ft_sequence == self._taken
        self._taken = record.ft_sequence
        return self._standing

    def _latched(self, record: Record, now: float) -> float:
        """When (s) it was measured at the latest."""
        rate = self._settings.rate
        if rate == 0.0:
            return self._before
        device = record.ft_sequence / rate
        known = self._offset.known
        if known and not -LEAP <= now - clock_offset.on_host(self._offset, device) <= LEAP:
            self._offset = clock_offset.start()
        self._offset = clock_offset.step(self._offset, _WINDOW, device, now)
        return min(self._before, clock_offset.on_host(self._offset, device))

    def _judge(self, record: Record, latched: float) -> None:
        self.records += 1
        self._status = record.status
        self._fault, self._railed, broken = net_ft.faults(self._settings.bits, record.status)
        self.saturated += self._railed
        self.broken += broken
        if self._fault:
            self.faulty += 1
            return
        self._counts, self._sampled = net_ft.floats(record), latched
        if self._tare.left:
            self._tare = load.take_tare(self._tare, self._counts)
