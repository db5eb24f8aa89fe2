"""The conversation with a Compax3 servo drive: power, set-points by its own objects, actual values.

    opened -> named (`_?`) -> POWER_OFF written -> OFF -> [asked up] set-point 0, POWER_OFF,
    ENABLED -> RISING -> status says so -> ON: set-point and actual values in turn

Down from anywhere: an error, a set-point that is no number or is not renewed in time, a refusal,
a status that is too old, a line that opened anew. Up only by a new request, and out of an error
only with an acknowledgement before that request: the edge that powers the axis acknowledges, and
where it does only that, a second one follows on the same request.
A drive that hears nothing keeps its last set-point as far as is known: what must stop it when the
cable breaks is the drive's own program or the hard-wired chain, not this.
"""

import math

from drivers.compax3 import objects
from drivers.compax3.codec import NO_ADDRESS, Kind, Record, refusal
from drivers.compax3.requests import Requests
from drivers.compax3.servo_signals import NOT_READ, Phase, Reading, Settings
from drivers.errors import CodecError

_NEVER = -1e9  # s, before any clock began
_OFF = float(objects.POWER_OFF)


class Servo:
    """The conversation with one drive."""

    def __init__(self, settings: Settings) -> None:
        """CodecError for settings that no record can carry."""
        if min(settings.limit, settings.expiry, settings.stale, settings.rising) <= 0.0:
            raise CodecError(settings.name, "limit and times", "above 0", settings)
        self._settings, self._address = settings, settings.address
        self._cyclic = (settings.status, *settings.actual)
        self._question = objects.ask(self._cyclic, self._address)
        self._error_question = objects.ask((settings.error,), self._address)
        self._power_off = objects.set_point(settings.control, _OFF, self._address)
        self._power_on = objects.set_point(settings.control, float(settings.enabled), self._address)
        self._zero = objects.set_point(settings.set_point, 0.0, self._address)
        who = settings.name
        self.requests = Requests(who, self._address, settings.identity, settings.timing)
        self._phase = Phase.UNKNOWN
        self._owed: list[bytes] = []  # writes to be acknowledged, in order
        self._out = b""  # the message whose answer is awaited
        self._asked = self._sampled = self._renewed = self._rose = _NEVER
        self._status = objects.status(0)._replace(powerless=1)
        self._values: tuple[float, ...] = (0.0,) * len(settings.actual)
        self._error = 0
        self._wanted, self._enable, self._held = 0.0, 0, 0
        self._acknowledged = False  # an error may be acknowledged by the next request
        self._clearing = False  # this request acknowledges one, so it may still show
        self._curious = False  # the error's number is to be read
        self._written = False  # a set-point went out since the last look
        self._why = ""

    def command(self, set_point: float, enable: int, now: float) -> None:
        """Renew the set-point (SI); each time ``enable`` rises is one request to go up.

        A set-point that is no number takes the drive down, beyond the limit it is cut.
        """
        limit = self._settings.limit
        self._renewed = now
        rises, self._enable = enable == 1 and self._enable == 0, enable
        if not math.isfinite(set_point):
            self._drop("")
            self._why = f"set-point {set_point} is no number"
            return
        self._wanted = max(-limit, min(set_point, limit))
        self._held = 1 if self._wanted != set_point else 0
        if enable != 1:
            self._drop("")
        elif rises:
            self._rise(now)

    def acknowledge(self) -> None:
        """Permit the next request to acknowledge an error; it powers nothing by itself."""
        self._acknowledged = True

    def opened(self, now: float) -> None:
        """The line opened: the drive is taken down first, whatever it did."""
        self._drop("the line opened anew")
        self._phase, self._out = Phase.UNKNOWN, b""
        self._owed = [self._power_off, self._zero]
        self.requests.opened(now)

    def take(self, data: bytes, now: float) -> None:
        """Bytes that came, split anyhow; call it with none when none came."""
        self._watch(now)  # also while the line is closed
        answer = self.requests.take(data, now)
        if answer is None:
            return
        asked, self._out = self._out, b""
        try:
            self._understand(asked, answer)
        except CodecError as error:
            self.requests.doubt(now, str(error))

    def speak(self, now: float) -> bytes:
        """The one record to send now, in one write; mostly empty."""
        self._watch(now)
        # To a drive that has not given its name, nothing is written.
        stops = self._owed[:1] == [self._power_off] and self.requests.name
        said = self.requests.upkeep(now, self._power_off if stops else b"")
        if not self.requests.known:
            self._out = b""
            return said
        if self._phase is Phase.UNKNOWN:
            self._phase = Phase.OFF
        if not self.requests.free:
            return b""
        self._out = self._next()
        self._asked = now
        return self.requests.ask(self._out, now)

    def read(self, now: float) -> Reading:
        """What is known at ``now`` (s)."""
        return Reading(
            self._values,
            1 - self._status.powerless,
            1 if self._phase is Phase.ON else 0,
            self._error,
            self._held,
            now - self._sampled,
            self._phase,
        )

    def explain(self, now: float) -> str:
        """Why the drive is down or silent, for people; empty if it is neither unasked."""
        said = []
        if self.requests.trouble:
            said.append(self.requests.trouble)
        if self._error:
            unread = self._error == NOT_READ
            said.append("in error" if unread else objects.error_name(self._error))
        if not said and now - self._sampled > self._settings.stale:
            said.append(f"no status for {self._settings.stale:g} s")
        if self._why:
            said.append(self._why)
        address = "" if self._address == NO_ADDRESS else f" (address {self._address})"
        return f"{self._settings.name}{address}: {'; '.join(said)}" if said else ""

    def _rise(self, now: float) -> None:
        faulty = self._status.no_error == 0
        if self._phase is not Phase.OFF or now - self._sampled > self._settings.stale:
            self._why = "asked up without a fresh status"
        elif faulty and not self._acknowledged:
            self._why = "asked up without an acknowledgement of the error"
        else:
            self._phase, self._rose, self._why = Phase.RISING, now, ""
            self._clearing, self._acknowledged = faulty, False
            self._owed = [self._power_off, self._zero, self._power_on]

    def _drop(self, why: str) -> None:
        """Take the drive down if it is up or on its way."""
        if self._phase in (Phase.RISING, Phase.ON):
            self._phase, self._why = Phase.OFF, why
            self._owed = [self._power_off, self._zero]

    def _watch(self, now: float) -> None:
        """Deadlines; whatever is over takes the drive down."""
        settings = self._settings
        if self._phase not in (Phase.RISING, Phase.ON):
            return
        if now - self._renewed > settings.expiry:
            self._drop(f"set-point not renewed in {settings.expiry:g} s")
        elif now - self._sampled > settings.stale:
            self._drop(f"no status for {settings.stale:g} s")
        elif self._phase is Phase.RISING and now - self._rose > settings.rising:
            self._drop(f"not powered {settings.rising:g} s after the request")

    def _next(self) -> bytes:
        """What to ask or write: first what is owed, then set-point and status in turn."""
        if self._owed:
            return self._owed[0]
        if self._curious:
            return self._error_question
        if self._phase is Phase.ON and not self._written:
            self._written = True
            return objects.set_point(self._settings.set_point, self._wanted, self._address)
        self._written = False
        return self._question

    def _understand(self, asked: bytes, answer: Record) -> None:
        refused = refusal(answer)
        if asked == self._error_question:
            self._curious = False
            if not refused:
                (number,) = objects.actual_values((self._settings.error,), answer)
                self._error = int(number) or NOT_READ
        elif asked == self._question:
            if refused:
                self._why = f"actual values refused: {objects.error_name(refused)}"
                return
            status, *values = objects.actual_values(self._cyclic, answer)
            self._judge(objects.status(status))
            self._sampled, self._values = self._asked, tuple(values)
        elif answer.kind is not Kind.ACK and not refused:
            raise CodecError(self._settings.name, "answer to a write", "ACK", answer.kind.name)
        else:
            if self._owed[:1] == [asked]:
                del self._owed[0]
            if refused:
                self._drop("")
                what = "control word" if asked in (self._power_off, self._power_on) else "set-point"
                self._why = f"{what} refused: {objects.error_name(refused)}"

    def _judge(self, status: objects.Status) -> None:
        """What a fresh status means for what was asked."""
        self._status = status
        if self._owed:
            return  # it is from before
        if status.no_error == 1:
            self._error, self._curious = 0, False
        elif self._error == 0:
            self._error, self._curious = NOT_READ, True
        if self._phase is Phase.OFF:
            if status.powerless == 0:
                self._owed = [self._power_off]  # it was told to be off, and is not yet
        elif status.no_error == 0:
            if not (self._phase is Phase.RISING and self._clearing):
                self._drop("taken down by the drive's error")
        elif status.powerless == 0:
            self._phase = Phase.ON
        elif self._clearing:  # this drive's edge acknowledged and did not power: a second one
            self._clearing = False
            self._owed = [self._power_off, self._zero, self._power_on]
        elif self._phase is Phase.ON:
            self._drop("the drive took its power off")
