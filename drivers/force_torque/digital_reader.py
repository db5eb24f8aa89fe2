"""The conversation with an ATI Digital F/T: stop, calibration, start, stream, and again.

    opened -> STOPPING (jam, quiet) -> READING (calibration) -> STARTING (yes) -> STREAMING
                  ^---- no answer, no sample for too long: after a pause that doubles ----'

The box's samples carry no number and no time. A sample's age counts from the look before the one
that found it, because it may have come right after that; bytes of which a port's buffer had no room
are seen as a place lost and found again, not as a count.
"""

from typing import NamedTuple

from drivers.back_off import BackOff
from drivers.errors import CodecError
from drivers.force_torque import digital_ft, load
from drivers.force_torque.digital_ft_calibration import (
    FIRST_REGISTER,
    MOST_REGISTERS,
    REGISTERS,
    Calibration,
    decode_calibration,
    decode_registers,
    read_registers,
    scaling,
)
from drivers.force_torque.load import Phase, Reading
from drivers.force_torque.wrench import Scale, Six, calibrated, in_si

PAUSE_FIRST, PAUSE_MOST = 0.1, 5.0  # s between attempts to bring the stream up
_NEVER = -1e9  # s, before any clock began
_ASKS = (
    (FIRST_REGISTER, MOST_REGISTERS),
    (FIRST_REGISTER + MOST_REGISTERS, REGISTERS - MOST_REGISTERS),
)
_START = digital_ft.command(digital_ft.STREAM, digital_ft.START_STREAM)
_YES = digital_ft.command(digital_ft.STREAM, digital_ft.DONE)
_KEEP = 1024  # bytes of an answer, at most; the longest has 255


class Settings(NamedTuple):
    """One box with one sensor."""

    name: str  # for people
    serial: str  # of the sensor, as the box must tell it; another one is refused
    force_unit: str  # of the calibration, from the sensor's certificate
    torque_unit: str
    rail: int  # gauge count from which it is saturated, 1 to 32767; not confirmed, so the rig's
    quiet: float  # s without a byte after a jam until the box listens again, > 0
    answer: float  # s, in which an answer must have come, > 0
    silence: float  # s without a good sum from which the stream is started anew, > 0


class DigitalReader:
    """The conversation with one box."""

    def __init__(self, settings: Settings) -> None:
        """CodecError for units or times that cannot be."""
        if min(settings.quiet, settings.answer, settings.silence) <= 0.0 or settings.rail < 1:
            raise CodecError(settings.name, "times and rail", "above 0", settings)
        self.starts = 0  # times that the stream came up
        self.samples = self.faulty = self.saturated = 0
        self.calibration: Calibration | None = None  # as the box told it
        self._settings = settings
        self._scale: Scale | None = None
        self._stream = digital_ft.start()
        self._tare = load.untared()
        self._phase = Phase.STOPPING
        self._trouble = "not started yet"
        self._back_off = BackOff(PAUSE_FIRST, PAUSE_MOST)
        self._buffer, self._block = b"", b""
        self._said: float | None = None  # when the message of this phase went out
        self._heard = self._before = self._looked = self._sampled = self._summed = _NEVER
        self._gauges = load.NO_BIAS
        self._railed = self._fault = 0

    @property
    def counts(self) -> digital_ft.State:
        """What went wrong in the stream so far: bytes dropped, places lost."""
        return self._stream

    def tare(self, samples: int) -> None:
        """Take the mean of the next good samples as what reads 0."""
        self._tare = load.begin_tare(self._tare, samples)

    def untare(self) -> None:
        """Read as the calibration has it."""
        self._tare = load.untared()

    def opened(self, now: float) -> None:
        """The line opened: begin with a stop, the box may be streaming."""
        self._looked = now
        self._enter(Phase.STOPPING)

    def take(self, data: bytes, now: float) -> None:
        """Bytes that came, split anyhow; call it with none when none came."""
        if now > self._looked:
            self._before, self._looked = self._looked, now
        if not data:
            return
        self._heard = now
        if self._phase is Phase.STREAMING:
            self._feed(data, now)
        elif self._phase in (Phase.READING, Phase.STARTING) and self._said is not None:
            self._buffer = (self._buffer + data)[-_KEEP:]
            self._answered(now)

    def speak(self, now: float) -> bytes:
        """The one message to send now; mostly empty."""
        settings, said = self._settings, self._said
        if self._phase is Phase.REFUSED:
            return b""
        if self._phase is Phase.STREAMING:
            if now - self._summed > settings.silence:
                self._fail(now, f"no sample for {settings.silence:g} s")
            return b""
        if said is not None and self._phase is not Phase.STOPPING:
            if now - said > settings.answer:
                asked = "the calibration" if self._phase is Phase.READING else "the start"
                self._fail(now, f"no answer to {asked} in {settings.answer:g} s")
            return b""
        if self._phase is Phase.STOPPING:
            if not self._back_off.ready(now):
                return b""
            if said is None or now - said > settings.answer + settings.quiet:
                self._said = now
                return digital_ft.jam()
            if now - max(said, self._heard) < settings.quiet:
                return b""
            self._enter(Phase.READING)
        self._said, self._buffer = now, b""
        if self._phase is Phase.STARTING:
            return _START
        return read_registers(*_ASKS[1 if self._block else 0])

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        wrench = load.NOTHING
        if self.calibration is not None and self._scale is not None and self._sampled > _NEVER:
            counts = calibrated(self.calibration.matrix, self._gauges, self._tare.bias)
            wrench = in_si(self._scale, counts)
        return Reading(wrench, now - self._sampled, self._railed, self._fault, self._phase)

    def explain(self, now: float) -> str:
        """Why there is no good sample, for people; empty if there is one."""
        said = [self._trouble] if self._trouble else []
        if self._phase is Phase.STREAMING and now - self._sampled > self._settings.silence:
            said.append(f"no good sample for {self._settings.silence:g} s")
        if self._fault:
            said.append("the box reports a status error")
        if self._railed:
            gauges = " ".join(f"G{n}" for n in range(6) if self._railed >> n & 1)
            said.append(f"saturated: {gauges}")
        return f"{self._settings.name}: {'; '.join(said)}" if said else ""

    def _enter(self, phase: Phase) -> None:
        self._phase, self._said, self._buffer, self._block = phase, None, b"", b""

    def _fail(self, now: float, why: str) -> None:
        self._trouble = why
        self._back_off.failed(now)
        self._enter(Phase.STOPPING)

    def _answered(self, now: float) -> None:
        """An answer, or the first part of one."""
        if self._phase is Phase.STARTING:
            at = self._buffer.find(_YES)
            if at >= 0:
                rest = self._buffer[at + len(_YES) :]
                self.starts += 1
                self._enter(Phase.STREAMING)
                fresh = digital_ft.start_at_sample()
                self._stream = fresh._replace(
                    dropped=self._stream.dropped, searches=self._stream.searches
                )
                self._summed = now
                self._feed(rest, now)
            return
        _, registers = _ASKS[1 if self._block else 0]
        if len(self._buffer) < 5 + 2 * registers:
            return  # an exception is shorter, and ends as no answer
        try:
            self._block += decode_registers(registers, self._buffer)
            self._said = None
            if len(self._block) == 2 * REGISTERS:
                self._learn(decode_calibration(self._block))
        except CodecError as error:
            self._fail(now, str(error))

    def _learn(self, calibration: Calibration) -> None:
        settings = self._settings
        scale = scaling(calibration, settings.force_unit, settings.torque_unit)
        if calibration.serial != settings.serial:
            self._trouble = f"is sensor {calibration.serial!r}, not {settings.serial!r}"
            self._enter(Phase.REFUSED)
            return
        self.calibration, self._scale = calibration, scale
        self._enter(Phase.STARTING)

    def _feed(self, data: bytes, now: float) -> None:
        self._stream, samples = digital_ft.feed(self._stream, data)
        rail, good = self._settings.rail, None
        for sample in samples:
            self._fault, self._railed = sample.fault, digital_ft.saturated(sample, rail)
            if self._fault:
                self.faulty += 1
            elif self._railed:
                self.saturated += 1
            else:
                good = sample.gauges
                if self._tare.left:
                    self._tare = load.take_tare(self._tare, _floats(good))
        if samples:
            self.samples += len(samples)
            self._summed = now
            self._trouble = ""
            self._back_off.worked()
        if good is not None:
            self._gauges, self._sampled = _floats(good), self._before


def _floats(gauges: tuple[int, int, int, int, int, int]) -> Six:
    a, b, c, d, e, f = gauges
    return float(a), float(b), float(c), float(d), float(e), float(f)
