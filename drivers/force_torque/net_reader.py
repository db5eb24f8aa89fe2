"""The conversation with an ATI Net F/T: stop, start, stream of datagrams, repeat.

    on_open -> STOPPING (stop, quiet) -> STARTING -> STREAMING
                  ^-- record timeout: again after a pause that doubles --'

The box serves one client, the last one that sent a start, and does not notify the previous one: a
stream taken over by another client looks like an interrupted one. The pause keeps two clients from
restarting the stream in turn without limit. A record's age counts from the poll before the one that
received it. If the sensor's sample rate is known, its sample count also reveals delays on the way,
and a record with an unchanged count is not a new sample: the age grows when the sensor stops while
the box keeps sending.
"""

from typing import NamedTuple

from drivers import clock_offset
from drivers.back_off import BackOff
from drivers.errors import CodecError
from drivers.force_torque import load, net_ft
from drivers.force_torque.load import LoadCellReading, Phase
from drivers.force_torque.net_ft import Command, Record, Request, StatusBits
from drivers.force_torque.wrench import Scale, Vector6, to_si

MIN_PAUSE, MAX_PAUSE = 0.1, 5.0  # s between attempts to bring the stream up
MAX_CLOCK_JUMP = 0.5  # s; a larger step between the clocks means that the sensor's count restarted
_WINDOW = 1.0  # s, of the clock comparison
_NEVER = -1e9  # s, earlier than any clock reading
_STOP = net_ft.encode_request(Request(Command.STOP, 0))
_BIAS = net_ft.encode_request(Request(Command.BIAS, 0))


class NetFtSettings(NamedTuple):
    """One box."""

    name: str  # for people
    scale: Scale  # SI per count, from the box's calibration
    bits: StatusBits  # meaning of the status bits
    buffered: int  # 1: several records per datagram
    sample_rate: float  # Hz at which the sensor counts its samples (ft_sequence); 0: unknown
    quiet_time: float  # s after a stop until all datagrams of the old stream have arrived, > 0
    silence_timeout: float  # s without a record until the stream is restarted, > 0


class NetReader:
    """The conversation with one box."""

    def __init__(self, settings: NetFtSettings) -> None:
        """Check the settings: CodecError for a time that is not above 0, or a rate below 0."""
        if min(settings.quiet_time, settings.silence_timeout) <= 0.0 or settings.sample_rate < 0.0:
            raise CodecError(settings.name, "times", "above 0", settings)
        self.starts = 0  # successful starts of the stream
        self.records = self.faulty = self.saturated = self.broken = 0
        self.missing = self.repeated = self.bad_datagrams = 0  # see net_ft.State, all streams
        self.unchanged = 0  # records without a new sample of the sensor; not used
        self.stray = 0  # datagrams received while none was expected; not used
        self._settings = settings
        start = Command.START_BUFFERED if settings.buffered == 1 else Command.START
        self._start = net_ft.encode_request(Request(start, 0))
        self._stream = net_ft.start()
        self._offset = clock_offset.start()
        self._tare = load.no_tare()
        self._box_tare_pending = False
        self._phase = Phase.STOPPING
        self._problem = "not started yet"
        self._back_off = BackOff(MIN_PAUSE, MAX_PAUSE)
        self._sent_at: float | None = None  # time of this phase's message; None: not sent yet
        self._previous_poll = self._last_poll = self._sample_time = self._last_record_at = _NEVER
        self._counts: Vector6 = load.NO_BIAS
        self._saturated_bits = self._fault = self._status = 0
        self._count_stalled = False  # True: the last record had no new sample
        self._last_ft_sequence = -1  # ft_sequence of the last record, -1 before the first

    def tare(self, records: int) -> None:
        """Start a host tare: the mean of the next good records becomes the zero of the reading."""
        self._tare = load.begin_tare(self._tare, records)

    def clear_tare(self) -> None:
        """Remove the host tare: read as the box sends, its own bias included."""
        self._tare = load.no_tare()

    def tare_box(self) -> None:
        """Send a bias command: the box sets the present load to 0.

        The box does not acknowledge it; check the wrench. The host's tare is removed, because it
        was measured from another zero.
        """
        self._box_tare_pending, self._tare = True, load.no_tare()

    def on_open(self, now: float) -> None:
        """Begin with a stop after the socket was opened, because the box may be streaming."""
        self._last_poll = now
        self._enter(Phase.STOPPING)

    def receive(self, data: bytes, now: float) -> None:
        """Process one received datagram; call it with none when none came."""
        if now > self._last_poll:
            self._previous_poll, self._last_poll = self._last_poll, now
        if not data:
            return
        if self._phase not in (Phase.STARTING, Phase.STREAMING) or self._sent_at is None:
            self.stray += 1
            return
        stream = self._stream
        self._stream, records = net_ft.feed(stream, data)
        self.missing += self._stream.missing - stream.missing
        self.repeated += self._stream.repeated - stream.repeated
        self.bad_datagrams += self._stream.bad_datagrams - stream.bad_datagrams
        for record in records:
            if self._is_unchanged(record):
                self.unchanged += 1
            else:
                self._evaluate(record, self._measured_at(record, now))
        if records:
            self._last_record_at, self._problem = now, ""
            if self._phase is Phase.STARTING:
                self.starts += 1
                self._phase = Phase.STREAMING
            self._back_off.record_success()

    def next_message(self, now: float) -> bytes:
        """Return the datagram to send now, often empty."""
        settings, sent_at = self._settings, self._sent_at
        if self._phase in (Phase.STARTING, Phase.STREAMING) and sent_at is not None:
            if now - max(sent_at, self._last_record_at) > settings.silence_timeout:
                self._problem = (
                    f"no record for {settings.silence_timeout:g} s (has another client started it?)"
                )
                self._back_off.record_failure(now)
                self._enter(Phase.STOPPING)
            elif self._box_tare_pending and self._phase is Phase.STREAMING:
                self._box_tare_pending = False
                return _BIAS
            return b""
        if sent_at is None:
            if not self._back_off.ready(now):
                return b""
            self._sent_at = now
            return _STOP
        if now - sent_at < settings.quiet_time:
            return b""
        self._enter(Phase.STARTING)
        self._sent_at, self._stream = now, net_ft.start()
        return self._start

    def read(self, now: float) -> LoadCellReading:
        """Return the last good record and its age at ``now`` (s)."""
        wrench = load.ZERO_WRENCH
        if self._sample_time > _NEVER:
            a, b, c, d, e, f = (
                count - tare for count, tare in zip(self._counts, self._tare.bias, strict=True)
            )
            wrench = to_si(self._settings.scale, (a, b, c, d, e, f))
        return LoadCellReading(
            wrench, now - self._sample_time, self._saturated_bits, self._fault, self._phase
        )

    def explain(self, now: float) -> str:
        """Return why there is no good record, for people; empty if there is one."""
        problems = [self._problem] if self._problem else []
        if (
            self._phase is Phase.STREAMING
            and now - self._sample_time > self._settings.silence_timeout
        ):
            problems.append(f"no good record for {self._settings.silence_timeout:g} s")
            if self._count_stalled:
                problems.append("the sensor's count of samples stands still")
        if self._fault:
            problems.append(f"the box's status is {self._status:#010x}")
        if self._saturated_bits:
            problems.append("saturated")
        return f"{self._settings.name}: {'; '.join(problems)}" if problems else ""

    def _enter(self, phase: Phase) -> None:
        self._phase, self._sent_at = phase, None

    def _is_unchanged(self, record: Record) -> bool:
        """Return True if the sensor's sample count equals that of the previous record."""
        self._count_stalled = (
            self._settings.sample_rate > 0.0 and record.ft_sequence == self._last_ft_sequence
        )
        self._last_ft_sequence = record.ft_sequence
        return self._count_stalled

    def _measured_at(self, record: Record, now: float) -> float:
        """Return the latest host time (s) that is certainly not after the measurement's arrival."""
        rate = self._settings.sample_rate
        if rate == 0.0:
            return self._previous_poll
        device = record.ft_sequence / rate
        known = self._offset.known
        if (
            known
            and not -MAX_CLOCK_JUMP
            <= now - clock_offset.to_host_time(self._offset, device)
            <= MAX_CLOCK_JUMP
        ):
            self._offset = clock_offset.start()
        self._offset = clock_offset.step(self._offset, _WINDOW, device, now)
        return min(self._previous_poll, clock_offset.to_host_time(self._offset, device))

    def _evaluate(self, record: Record, latched: float) -> None:
        self.records += 1
        self._status = record.status
        self._fault, self._saturated_bits, broken = net_ft.decode_status(
            self._settings.bits, record.status
        )
        self.saturated += self._saturated_bits
        self.broken += broken
        if self._fault:
            self.faulty += 1
            return
        self._counts, self._sample_time = net_ft.counts_as_floats(record), latched
        if self._tare.remaining:
            self._tare = load.add_tare_sample(self._tare, self._counts)
