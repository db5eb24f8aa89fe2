"""The conversation with an ATI Digital F/T: stop, read the calibration, start, stream, repeat.

    on_open -> STOPPING (jam, quiet) -> READING (calibration) -> STARTING (confirmed) -> STREAMING
                  ^---- answer or sample timeout: again after a pause that doubles ----'

The box's samples carry no number and no time. A sample's age counts from the poll before the one
that received it, because it may have arrived right after that poll. Bytes lost in a full port
buffer appear as a search for the sample boundary, not as a count of lost samples.
"""

from typing import NamedTuple

from drivers.back_off import BackOff
from drivers.errors import CodecError
from drivers.force_torque import digital_ft, load
from drivers.force_torque.digital_ft_calibration import (
    FIRST_REGISTER,
    MAX_REGISTERS,
    REGISTERS,
    Calibration,
    calibration_scale,
    decode_calibration,
    decode_read,
    encode_read,
)
from drivers.force_torque.load import LoadCellReading, Phase
from drivers.force_torque.wrench import Scale, Vector6, apply_calibration, to_si

MIN_PAUSE, MAX_PAUSE = 0.1, 5.0  # s between attempts to bring the stream up
_NEVER = -1e9  # s, earlier than any clock reading
_REGISTER_READS = (
    (FIRST_REGISTER, MAX_REGISTERS),
    (FIRST_REGISTER + MAX_REGISTERS, REGISTERS - MAX_REGISTERS),
)
_START = digital_ft.encode_command(digital_ft.STREAM, digital_ft.START_STREAM)
_START_REPLY = digital_ft.encode_command(digital_ft.STREAM, digital_ft.SUCCESS)
_MAX_ANSWER = 1024  # bytes kept of an answer; the longest has 255


class DigitalFtSettings(NamedTuple):
    """One box with one sensor."""

    name: str  # for people
    serial: str  # serial number that the box must report; another sensor is refused
    force_unit: str  # of the calibration, from the sensor's certificate
    torque_unit: str
    rail: int  # gauge count of saturation, 1 to 32767; no default because it is not confirmed
    quiet_time: float  # s without a byte after a jam until the box accepts commands, > 0
    answer_timeout: float  # s, > 0
    silence_timeout: float  # s without a valid checksum until the stream is restarted, > 0


class DigitalReader:
    """The conversation with one box."""

    def __init__(self, settings: DigitalFtSettings) -> None:
        """Check the settings; CodecError for a time or rail that is not above 0."""
        if (
            min(settings.quiet_time, settings.answer_timeout, settings.silence_timeout) <= 0.0
            or settings.rail < 1
        ):
            raise CodecError(settings.name, "times and rail", "above 0", settings)
        self.starts = 0  # successful starts of the stream
        self.samples = self.faulty = self.saturated = 0
        self.calibration: Calibration | None = None  # as read from the box
        self._settings = settings
        self._scale: Scale | None = None
        self._stream = digital_ft.start()
        self._tare = load.no_tare()
        self._phase = Phase.STOPPING
        self._problem = "not started yet"
        self._back_off = BackOff(MIN_PAUSE, MAX_PAUSE)
        self._buffer, self._block = b"", b""
        self._sent_at: float | None = None  # time of this phase's message; None: not sent yet
        self._last_byte_at = self._previous_poll = self._last_poll = self._sample_time = (
            self._last_valid_at
        ) = _NEVER
        self._gauges = load.NO_BIAS
        self._saturated_bits = self._fault = 0

    @property
    def error_counts(self) -> digital_ft.State:
        """Return the stream's state with its counts of dropped bytes and searches."""
        return self._stream

    def tare(self, samples: int) -> None:
        """Start a tare: the mean of the next good samples becomes the zero of the reading."""
        self._tare = load.begin_tare(self._tare, samples)

    def clear_tare(self) -> None:
        """Remove the tare: read as calibrated."""
        self._tare = load.no_tare()

    def on_open(self, now: float) -> None:
        """Begin with a stop after the port was opened, because the box may be streaming."""
        self._last_poll = now
        self._enter(Phase.STOPPING)

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes, split anywhere; call it with none when none came."""
        if now > self._last_poll:
            self._previous_poll, self._last_poll = self._last_poll, now
        if not data:
            return
        self._last_byte_at = now
        if self._phase is Phase.STREAMING:
            self._feed(data, now)
        elif self._phase in (Phase.READING, Phase.STARTING) and self._sent_at is not None:
            self._buffer = (self._buffer + data)[-_MAX_ANSWER:]
            self._receive_answer(now)

    def next_message(self, now: float) -> bytes:
        """Return the message to send now, often empty."""
        settings, sent_at = self._settings, self._sent_at
        if self._phase is Phase.REFUSED:
            return b""
        if self._phase is Phase.STREAMING:
            if now - self._last_valid_at > settings.silence_timeout:
                self._restart(now, f"no sample for {settings.silence_timeout:g} s")
            return b""
        if sent_at is not None and self._phase is not Phase.STOPPING:
            if now - sent_at > settings.answer_timeout:
                request = "the calibration" if self._phase is Phase.READING else "the start"
                self._restart(now, f"no answer to {request} in {settings.answer_timeout:g} s")
            return b""
        if self._phase is Phase.STOPPING:
            if not self._back_off.ready(now):
                return b""
            if sent_at is None or now - sent_at > settings.answer_timeout + settings.quiet_time:
                self._sent_at = now
                return digital_ft.encode_jam()
            if now - max(sent_at, self._last_byte_at) < settings.quiet_time:
                return b""
            self._enter(Phase.READING)
        self._sent_at, self._buffer = now, b""
        if self._phase is Phase.STARTING:
            return _START
        return encode_read(*_REGISTER_READS[1 if self._block else 0])

    def read(self, now: float) -> LoadCellReading:
        """Return the last good sample and its age at ``now`` (s)."""
        wrench = load.ZERO_WRENCH
        if self.calibration is not None and self._scale is not None and self._sample_time > _NEVER:
            counts = apply_calibration(self.calibration.matrix, self._gauges, self._tare.bias)
            wrench = to_si(self._scale, counts)
        return LoadCellReading(
            wrench, now - self._sample_time, self._saturated_bits, self._fault, self._phase
        )

    def explain(self, now: float) -> str:
        """Return why there is no good sample, for people; empty if there is one."""
        problems = [self._problem] if self._problem else []
        if (
            self._phase is Phase.STREAMING
            and now - self._sample_time > self._settings.silence_timeout
        ):
            problems.append(f"no good sample for {self._settings.silence_timeout:g} s")
        if self._fault:
            problems.append("the box reports a status error")
        if self._saturated_bits:
            gauges = " ".join(f"G{n}" for n in range(6) if self._saturated_bits >> n & 1)
            problems.append(f"saturated: {gauges}")
        return f"{self._settings.name}: {'; '.join(problems)}" if problems else ""

    def _enter(self, phase: Phase) -> None:
        self._phase, self._sent_at, self._buffer, self._block = phase, None, b"", b""

    def _restart(self, now: float, reason: str) -> None:
        self._problem = reason
        self._back_off.record_failure(now)
        self._enter(Phase.STOPPING)

    def _receive_answer(self, now: float) -> None:
        """Process an answer, or the first part of one."""
        if self._phase is Phase.STARTING:
            at = self._buffer.find(_START_REPLY)
            if at >= 0:
                rest = self._buffer[at + len(_START_REPLY) :]
                self.starts += 1
                self._enter(Phase.STREAMING)
                fresh = digital_ft.start_at_sample()
                self._stream = fresh._replace(
                    dropped=self._stream.dropped, searches=self._stream.searches
                )
                self._last_valid_at = now
                self._feed(rest, now)
            return
        _, registers = _REGISTER_READS[1 if self._block else 0]
        if len(self._buffer) < 5 + 2 * registers:
            return  # a Modbus exception is shorter and ends as a timeout
        try:
            self._block += decode_read(registers, self._buffer)
            self._sent_at = None
            if len(self._block) == 2 * REGISTERS:
                self._use_calibration(decode_calibration(self._block))
        except CodecError as error:
            self._restart(now, str(error))

    def _use_calibration(self, calibration: Calibration) -> None:
        settings = self._settings
        scale = calibration_scale(calibration, settings.force_unit, settings.torque_unit)
        if calibration.serial != settings.serial:
            self._problem = f"is sensor {calibration.serial!r}, not {settings.serial!r}"
            self._enter(Phase.REFUSED)
            return
        self.calibration, self._scale = calibration, scale
        self._enter(Phase.STARTING)

    def _feed(self, data: bytes, now: float) -> None:
        self._stream, samples = digital_ft.feed(self._stream, data)
        rail, good = self._settings.rail, None
        for sample in samples:
            self._fault, self._saturated_bits = (
                sample.fault,
                digital_ft.saturated_gauges(sample, rail),
            )
            if self._fault:
                self.faulty += 1
            elif self._saturated_bits:
                self.saturated += 1
            else:
                good = sample.gauges
                if self._tare.remaining:
                    self._tare = load.add_tare_sample(self._tare, _floats(good))
        if samples:
            self.samples += len(samples)
            self._last_valid_at = now
            self._problem = ""
            self._back_off.record_success()
        if good is not None:
            self._gauges, self._sample_time = _floats(good), self._previous_poll


def _floats(gauges: tuple[int, int, int, int, int, int]) -> Vector6:
    a, b, c, d, e, f = gauges
    return float(a), float(b), float(c), float(d), float(e), float(f)
