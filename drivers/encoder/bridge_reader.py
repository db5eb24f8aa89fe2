"""What the encoder bridge says: two angles of many turns, each with its age on the host's clock.

The bridge only speaks. A sample's age comes from its own time stamp, so a frame that waited in a
buffer is as old as it is. Turns are counted on the bridge's time; when that began anew, the gap is
taken from the host's clock, and if the machine could have turned too far meanwhile the angle is
LOST and says so, until `begin_anew`.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers import clock_offset
from drivers.encoder import bridge, ssi, unwrap
from drivers.encoder.ssi import Protocol
from drivers.errors import CodecError

LEAP = 0.5  # s between the clocks that no delay explains: the bridge's clock was set anew
_NEVER = -1e9  # s, before any clock began
_MICRO = 1e-6
_AGAIN_US = 100_000  # a frame this little before the last one is an old one, no new clock


class Quality(IntEnum):
    """What became of the last word of an encoder."""

    GOOD = 0
    NEVER = 1  # none has come
    SILENT = 2  # the encoder did not answer its clock
    OTHER_PROTOCOL = 3  # the bridge reads it in another protocol than agreed
    INVALID = 4  # the encoder does not vouch for it, or parity or CRC speak against it
    STUCK = 5  # its own time stamp did not move on with the bridge's time
    JUMPED = 6  # not a count of one turn, back in time, or further than the speed allows
    LOST = 7  # turns are not knowable any more


class Channel(NamedTuple):
    """One encoder."""

    protocol: Protocol
    turns: unwrap.Params
    direction: float  # +1.0: the angle grows as the encoder counts, -1.0: against it
    stamp_slack: int = 50  # us by which its own time stamp may differ from the bridge's


class Settings(NamedTuple):
    """One bridge."""

    name: str  # for people
    motor: Channel
    shaft: Channel
    least_delay: float  # s from latching edge to the bytes being here, at best: line time, USB
    window: float  # s, of the clock comparison, > 0
    silent: float  # s without a frame from which the bridge is called silent, > 0


class Angle(NamedTuple):
    """One encoder at the moment of its last accepted word."""

    angle: float  # rad, turns included
    age: float  # s, since it was latched; very large before the first
    quality: Quality  # of the last word, accepted or not
    refused: int  # words not accepted so far


class Reading(NamedTuple):
    """Both encoders; equal ages mean one edge, so their difference is the twist."""

    motor: Angle
    shaft: Angle


_REFUSED = {
    unwrap.Outcome.ACCEPTED: Quality.GOOD,
    unwrap.Outcome.JUMPED: Quality.JUMPED,
    unwrap.Outcome.OUT_OF_TURN: Quality.JUMPED,
    unwrap.Outcome.BACK_IN_TIME: Quality.JUMPED,
    unwrap.Outcome.LOST: Quality.LOST,
}


class _Encoder:
    """One of the two."""

    def __init__(self, channel: Channel, silent: int) -> None:
        self._channel, self._silent = channel, silent
        self._turns = unwrap.start()
        self._latched = _NEVER  # host time of the last accepted word
        self._stamp = self._stamped = ssi.NOT_CARRIED  # the last stamp, and when (us) it was read
        self.quality, self.refused = Quality.NEVER, 0

    def begin_anew(self) -> None:
        self._turns, self._latched = unwrap.start(), _NEVER
        self.quality = Quality.NEVER

    def forget_stamp(self) -> None:
        self._stamp = ssi.NOT_CARRIED

    def take(
        self, status: int, protocol: Protocol, word: int, time_us: int, latched: float
    ) -> None:
        self.quality = self._judge(status, protocol, word, time_us)
        if self.quality is Quality.GOOD:
            self._latched = latched
        else:
            self.refused += 1

    def read(self, now: float) -> Angle:
        channel = self._channel
        turned = channel.direction * unwrap.angle(channel.turns, self._turns)
        return Angle(turned, now - self._latched, self.quality, self.refused)

    def _judge(self, status: int, protocol: Protocol, word: int, time_us: int) -> Quality:
        if self._turns.lost:
            return Quality.LOST
        if status & self._silent:
            return Quality.SILENT
        if protocol is not self._channel.protocol:
            return Quality.OTHER_PROTOCOL
        reading = ssi.decode(protocol, word)
        stuck = self._stuck(protocol, reading.stamp, time_us)
        if not ssi.trusted(reading):
            return Quality.INVALID
        if stuck:
            return Quality.STUCK
        self._turns, outcome = unwrap.step(
            self._channel.turns, self._turns, reading.position, time_us
        )
        return _REFUSED[outcome]

    def _stuck(self, protocol: Protocol, stamp: int, time_us: int) -> bool:
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

    def __init__(self, settings: Settings) -> None:
        """CodecError for times that are not above 0, or a direction that is not +-1."""
        if not (settings.window > 0.0 and settings.silent > 0.0 and settings.least_delay >= 0.0):
            raise CodecError(settings.name, "times", "above 0", settings)
        for channel in (settings.motor, settings.shaft):
            if channel.direction not in (1.0, -1.0):
                raise CodecError(settings.name, "direction", "1 or -1", channel.direction)
        self.restarts = 0  # times that the bridge's clock began anew
        self.repeated = 0  # frames that the line brought a second time; not used
        self._settings = settings
        self._stream = bridge.start()
        self._offset = clock_offset.start()
        self._motor = _Encoder(settings.motor, bridge.MOTOR_SILENT)
        self._shaft = _Encoder(settings.shaft, bridge.SHAFT_SILENT)
        self._epoch = 0  # us, added to the bridge's time so that it never goes back
        self._time = 0  # us, of the last frame, epoch included
        self._arrived = _NEVER  # host time of the last frame

    @property
    def counts(self) -> bridge.State:
        """What went wrong on the line so far: bytes dropped, frames bad, missing, repeated."""
        return self._stream

    def begin_anew(self) -> None:
        """Count turns from the next words on: both angles begin within one turn again."""
        self._motor.begin_anew()
        self._shaft.begin_anew()

    def opened(self, now: float) -> None:
        """The line opened: half a frame from before is void, the turns are not."""
        self._stream = self._stream._replace(pending=b"")

    def take(self, data: bytes, now: float) -> None:
        """Bytes that came, split anyhow."""
        if data:
            self._stream, frames = bridge.feed(self._stream, data)
            for frame in frames:
                self._take(frame, now)

    def speak(self, now: float) -> bytes:
        """Nothing: the bridge is not spoken to."""
        return b""

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        return Reading(self._motor.read(now), self._shaft.read(now))

    def explain(self, now: float) -> str:
        """Why there is no good angle, for people; empty if there are two."""
        if now - self._arrived > self._settings.silent:
            return f"{self._settings.name}: no frame for {self._settings.silent:g} s"
        pairs = (("motor", self._motor.quality), ("shaft", self._shaft.quality))
        said = [
            f"{which} encoder {quality.name.lower()}"
            for which, quality in pairs
            if quality is not Quality.GOOD
        ]
        return f"{self._settings.name}: {', '.join(said)}" if said else ""

    def _take(self, frame: bridge.Frame, now: float) -> None:
        device = frame.time_us * _MICRO
        known = self._offset.known
        leap = now - clock_offset.on_host(self._offset, device) if known else 0.0
        if frame.status & bridge.RESTARTED or not -LEAP <= leap <= LEAP:
            self.restarts += 1 if known else 0
            self._begin_clock(frame.time_us, now)
        elif known and frame.time_us + self._epoch < self._time:
            if frame.time_us + self._epoch > self._time - _AGAIN_US:
                self.repeated += 1
                return
            self.restarts += 1
            self._begin_clock(frame.time_us, now)
        self._offset = clock_offset.step(self._offset, self._settings.window, device, now)
        time_us = self._time = frame.time_us + self._epoch
        self._arrived = now
        taken = min(now, clock_offset.on_host(self._offset, device) - self._settings.least_delay)
        self._motor.take(frame.status, frame.motor_protocol, frame.motor_word, time_us, taken)
        self._shaft.take(frame.status, frame.shaft_protocol, frame.shaft_word, time_us, taken)

    def _begin_clock(self, time_us: int, now: float) -> None:
        """The bridge's clock is another one: go on where the host's says that we are."""
        gone = max(0.0, now - self._arrived) if self._offset.known else 0.0
        self._epoch = self._time + round(gone / _MICRO) - time_us
        self._offset = clock_offset.start()
        self._motor.forget_stamp()
        self._shaft.forget_stamp()
