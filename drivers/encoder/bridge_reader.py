"""Reader of the encoder bridge: two multi-turn angles, each with its age on the host's clock.

The bridge only sends. A sample's age is computed from its own time stamp, so a frame that waited
in a buffer gets its true age. Turns are counted on the bridge's clock. When that clock restarts,
the host's clock gives the length of the gap; if the shaft could have turned too far meanwhile,
the angle has the quality LOST until `reset_turns`.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers import clock_offset
from drivers.encoder import bridge, ssi, unwrap
from drivers.encoder.ssi import SsiProtocol
from drivers.errors import CodecError

MAX_CLOCK_JUMP = 0.5  # s; a larger step between the clocks means that the bridge's clock restarted
_NEVER = -1e9  # s, earlier than any clock reading
_MICRO = 1e-6
_REPEAT_WINDOW_US = 100_000  # a frame at most this much older than the last is a repeated one


class Quality(IntEnum):
    """Quality of the last word of an encoder."""

    GOOD = 0
    NEVER = 1  # no word received yet
    SILENT = 2  # the encoder did not answer its clock
    OTHER_PROTOCOL = 3  # the bridge reads it in another protocol than configured
    INVALID = 4  # the encoder flags it as invalid, or its parity or CRC is wrong
    STUCK = 5  # the encoder's time stamp did not advance with the bridge's clock
    JUMPED = 6  # outside one turn, back in time, or further than the speed limit allows
    LOST = 7  # the number of turns is unknown


class EncoderChannel(NamedTuple):
    """One encoder."""

    protocol: SsiProtocol
    unwrap_params: unwrap.Params
    direction: float  # +1.0: the angle grows as the encoder counts, -1.0: against it
    stamp_slack: int = 50  # us by which the encoder's time stamp may differ from the bridge's


class BridgeSettings(NamedTuple):
    """One bridge."""

    name: str  # for people
    motor: EncoderChannel
    shaft: EncoderChannel
    min_delay: float  # s from the latching edge to the received bytes, at least: line time, USB
    window: float  # s, of the clock comparison, > 0
    silence_timeout: float  # s without a frame until the bridge counts as silent, > 0


class EncoderAngle(NamedTuple):
    """Angle of one encoder at its last accepted word."""

    angle: float  # rad, turns included
    age: float  # s since the word was latched; very large before the first
    quality: Quality  # of the last word, accepted or not
    rejected: int  # number of rejected words


class BridgeReading(NamedTuple):
    """Angles of both encoders; with equal ages (same edge) their difference is the twist."""

    motor: EncoderAngle
    shaft: EncoderAngle


_OUTCOME_QUALITY = {
    unwrap.Outcome.ACCEPTED: Quality.GOOD,
    unwrap.Outcome.JUMPED: Quality.JUMPED,
    unwrap.Outcome.OUT_OF_TURN: Quality.JUMPED,
    unwrap.Outcome.BACK_IN_TIME: Quality.JUMPED,
    unwrap.Outcome.LOST: Quality.LOST,
}


class _Encoder:
    """State of one of the two encoders."""

    def __init__(self, channel: EncoderChannel, silent: int) -> None:
        self._channel, self._silent_bit = channel, silent
        self._turns = unwrap.start()
        self._latched = _NEVER  # host time of the last accepted word
        self._stamp = self._stamped = ssi.NOT_CARRIED  # last time stamp, and its bridge time (us)
        self.quality, self.rejected = Quality.NEVER, 0

    def reset_turns(self) -> None:
        self._turns, self._latched = unwrap.start(), _NEVER
        self.quality = Quality.NEVER

    def forget_stamp(self) -> None:
        self._stamp = ssi.NOT_CARRIED

    def receive(
        self, status: int, protocol: SsiProtocol, word: int, time_us: int, latched: float
    ) -> None:
        self.quality = self._evaluate(status, protocol, word, time_us)
        if self.quality is Quality.GOOD:
            self._latched = latched
        else:
            self.rejected += 1

    def read(self, now: float) -> EncoderAngle:
        channel = self._channel
        turned = channel.direction * unwrap.angle(channel.unwrap_params, self._turns)
        return EncoderAngle(turned, now - self._latched, self.quality, self.rejected)

    def _evaluate(self, status: int, protocol: SsiProtocol, word: int, time_us: int) -> Quality:
        if self._turns.lost:
            return Quality.LOST
        if status & self._silent_bit:
            return Quality.SILENT
        if protocol is not self._channel.protocol:
            return Quality.OTHER_PROTOCOL
        reading = ssi.decode(protocol, word)
        stuck = self._is_stuck(protocol, reading.stamp, time_us)
        if not ssi.is_trusted(reading):
            return Quality.INVALID
        if stuck:
            return Quality.STUCK
        self._turns, outcome = unwrap.step(
            self._channel.unwrap_params, self._turns, reading.position, time_us
        )
        return _OUTCOME_QUALITY[outcome]

    def _is_stuck(self, protocol: SsiProtocol, stamp: int, time_us: int) -> bool:
        if stamp == ssi.NOT_CARRIED:
            return False
        earlier, since = self._stamp, time_us - self._stamped
        self._stamp, self._stamped = stamp, time_us
        if earlier == ssi.NOT_CARRIED:
            return False
        wrap = ssi.STAMP_STEPS * ssi.STAMP_STEP_US[protocol]
        off = (ssi.stamp_gap_us(protocol, earlier, stamp) - since) % wrap
        return min(off, wrap - off) > self._channel.stamp_slack


class BridgeReader:
    """The conversation with one bridge."""

    def __init__(self, settings: BridgeSettings) -> None:
        """Check the settings: CodecError unless times are above 0 and directions are +-1."""
        if not (
            settings.window > 0.0 and settings.silence_timeout > 0.0 and settings.min_delay >= 0.0
        ):
            raise CodecError(settings.name, "times", "above 0", settings)
        for channel in (settings.motor, settings.shaft):
            if channel.direction not in (1.0, -1.0):
                raise CodecError(settings.name, "direction", "1 or -1", channel.direction)
        self.restarts = 0  # restarts of the bridge's clock
        self.repeated = 0  # frames received a second time; not used
        self._settings = settings
        self._stream = bridge.start()
        self._offset = clock_offset.start()
        self._motor = _Encoder(settings.motor, bridge.MOTOR_SILENT)
        self._shaft = _Encoder(settings.shaft, bridge.SHAFT_SILENT)
        self._epoch = 0  # us, added to the bridge's time so that it never decreases
        self._time = 0  # us, time of the last frame, epoch included
        self._arrived = _NEVER  # host time of the last frame

    @property
    def error_counts(self) -> bridge.State:
        """Return the stream's state with its counts of dropped bytes, bad and missing frames."""
        return self._stream

    def reset_turns(self) -> None:
        """Restart counting of turns: both angles begin within one turn at the next words."""
        self._motor.reset_turns()
        self._shaft.reset_turns()

    def on_open(self, now: float) -> None:
        """Discard a partial frame from before the port was opened; keep the turns."""
        self._stream = self._stream._replace(pending=b"")

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes, split anywhere."""
        if data:
            self._stream, frames = bridge.feed(self._stream, data)
            for frame in frames:
                self._receive_frame(frame, now)

    def next_message(self, now: float) -> bytes:
        """Return no message: the bridge accepts no commands."""
        return b""

    def read(self, now: float) -> BridgeReading:
        """Return the angles with their ages at ``now`` (s)."""
        return BridgeReading(self._motor.read(now), self._shaft.read(now))

    def explain(self, now: float) -> str:
        """Return why an angle is missing or bad, for people; empty if both are good."""
        if now - self._arrived > self._settings.silence_timeout:
            return f"{self._settings.name}: no frame for {self._settings.silence_timeout:g} s"
        pairs = (("motor", self._motor.quality), ("shaft", self._shaft.quality))
        problems = [
            f"{which} encoder {quality.name.lower()}"
            for which, quality in pairs
            if quality is not Quality.GOOD
        ]
        return f"{self._settings.name}: {', '.join(problems)}" if problems else ""

    def _receive_frame(self, frame: bridge.Frame, now: float) -> None:
        device = frame.time_us * _MICRO
        known = self._offset.known
        clock_jump = now - clock_offset.to_host_time(self._offset, device) if known else 0.0
        if frame.status & bridge.RESTARTED or not -MAX_CLOCK_JUMP <= clock_jump <= MAX_CLOCK_JUMP:
            self.restarts += 1 if known else 0
            self._restart_clock(frame.time_us, now)
        elif known and frame.time_us + self._epoch < self._time:
            if frame.time_us + self._epoch > self._time - _REPEAT_WINDOW_US:
                self.repeated += 1
                return
            self.restarts += 1
            self._restart_clock(frame.time_us, now)
        self._offset = clock_offset.step(self._offset, self._settings.window, device, now)
        time_us = self._time = frame.time_us + self._epoch
        self._arrived = now
        latched = min(
            now, clock_offset.to_host_time(self._offset, device) - self._settings.min_delay
        )
        self._motor.receive(frame.status, frame.motor_protocol, frame.motor_word, time_us, latched)
        self._shaft.receive(frame.status, frame.shaft_protocol, frame.shaft_word, time_us, latched)

    def _restart_clock(self, time_us: int, now: float) -> None:
        """Restart the comparison with a new bridge clock; the host's clock bridges the gap."""
        elapsed = max(0.0, now - self._arrived) if self._offset.known else 0.0
        self._epoch = self._time + round(elapsed / _MICRO) - time_us
        self._offset = clock_offset.start()
        self._motor.forget_stamp()
        self._shaft.forget_stamp()
