"""The conversation with a Compax3 servo drive: power, set-points through objects, actual values.

    on_open -> identified (`_?`) -> POWER_OFF written -> OFF -> [enable request] POWER_OFF,
    set-point 0, ENABLED -> ENABLING -> confirmed by the status -> ON: set-point and actual values
    alternate

Disabled from any phase by: an error, a set-point that is not finite or not renewed in time, a
refusal, a status that is too old, a port that was opened again. Enabled only by a new request, and
out of an error only if `acknowledge` was called before that request: the edge that powers the axis
acknowledges the error, and where it does no more than that, a second edge follows on the same
request.
As far as is known, a drive that receives nothing keeps its last set-point: if the cable breaks, the
drive's own program or the hard-wired chain must stop it, not this class.
"""

import math

from drivers.compax3 import objects
from drivers.compax3.codec import NO_ADDRESS, Kind, Record, error_number
from drivers.compax3.requests import Requests
from drivers.compax3.servo_signals import NOT_READ, Phase, ServoReading, ServoSettings
from drivers.errors import CodecError

_NEVER = -1e9  # s, earlier than any clock reading
_OFF = float(objects.POWER_OFF)


class Servo:
    """The conversation with one drive."""

    def __init__(self, settings: ServoSettings) -> None:
        """Check the settings and encode the fixed records; CodecError for invalid settings."""
        if (
            min(
                settings.limit,
                settings.set_point_timeout,
                settings.max_status_age,
                settings.enable_timeout,
            )
            <= 0.0
        ):
            raise CodecError(settings.name, "limit and times", "above 0", settings)
        self._settings, self._address = settings, settings.address
        self._cyclic = (settings.status, *settings.actual)
        self._values_request = objects.encode_read(self._cyclic, self._address)
        self._error_request = objects.encode_read((settings.error,), self._address)
        self._power_off = objects.encode_set_point(settings.control, _OFF, self._address)
        self._power_on = objects.encode_set_point(
            settings.control, float(settings.enabled), self._address
        )
        self._zero = objects.encode_set_point(settings.set_point, 0.0, self._address)
        name = settings.name
        self.requests = Requests(name, self._address, settings.identity, settings.timing)
        self._phase = Phase.UNKNOWN
        self._pending_writes: list[bytes] = []  # writes not acknowledged yet, in order
        self._outstanding = b""  # the request without an answer yet
        self._requested_at = self._sample_time = self._commanded_at = self._enabled_at = _NEVER
        self._status = objects.decode_status(0)._replace(powerless=1)
        self._values: tuple[float, ...] = (0.0,) * len(settings.actual)
        self._error = 0
        self._target, self._enable, self._limited = 0.0, 0, 0
        self._acknowledged = False  # True: the next request may acknowledge an error
        self._acknowledging = False  # True: this request acknowledges an error that may still show
        self._error_unread = False  # True: the error's number must be read
        self._set_point_sent = False  # True: a set-point was sent since the last values request
        self._reason = ""

    def command(self, set_point: float, enable: int, now: float) -> None:
        """Renew the set-point (SI); each rising edge of ``enable`` is one request to enable.

        A set-point that is not finite disables the drive; one beyond the limit is clamped.
        """
        limit = self._settings.limit
        self._commanded_at = now
        rises, self._enable = enable == 1 and self._enable == 0, enable
        if not math.isfinite(set_point):
            self._disable("")
            self._reason = f"set-point {set_point} is not finite"
            return
        self._target = max(-limit, min(set_point, limit))
        self._limited = 1 if self._target != set_point else 0
        if enable != 1:
            self._disable("")
        elif rises:
            self._start_enabling(now)

    def acknowledge(self) -> None:
        """Permit the next request to acknowledge an error; it powers nothing by itself."""
        self._acknowledged = True

    def on_open(self, now: float) -> None:
        """Disable the drive first after the port was opened, whatever it did before."""
        self._disable("the port was opened again")
        self._phase, self._outstanding = Phase.UNKNOWN, b""
        self._pending_writes = [self._power_off, self._zero]
        self.requests.on_open(now)

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes, split anywhere; call it with none when none came."""
        self._check_deadlines(now)  # also while the line is closed
        answer = self.requests.receive(data, now)
        if answer is None:
            return
        request, self._outstanding = self._outstanding, b""
        try:
            self._process_answer(request, answer)
        except CodecError as error:
            self.requests.distrust(now, str(error))

    def next_message(self, now: float) -> bytes:
        """Return the record to send now, in one write; often empty."""
        self._check_deadlines(now)
        # Never write to a drive that has not been identified.
        stop_pending = self._pending_writes[:1] == [self._power_off] and self.requests.name
        recovery = self.requests.recovery_message(now, self._power_off if stop_pending else b"")
        if not self.requests.is_identified:
            self._outstanding = b""
            return recovery
        if self._phase is Phase.UNKNOWN:
            self._phase = Phase.OFF
        if not self.requests.is_ready:
            return b""
        self._outstanding = self._next_request()
        self._requested_at = now
        return self.requests.begin_request(self._outstanding, now)

    def read(self, now: float) -> ServoReading:
        """Return the last status and values with their age at ``now`` (s)."""
        return ServoReading(
            self._values,
            1 - self._status.powerless,
            1 if self._phase is Phase.ON else 0,
            self._error,
            self._limited,
            now - self._sample_time,
            self._phase,
        )

    def explain(self, now: float) -> str:
        """Return why the drive is disabled or silent, for people; empty if it is not."""
        problems = []
        if self.requests.problem:
            problems.append(self.requests.problem)
        if self._error:
            unread = self._error == NOT_READ
            problems.append("in error" if unread else objects.error_name(self._error))
        if not problems and now - self._sample_time > self._settings.max_status_age:
            problems.append(f"no status for {self._settings.max_status_age:g} s")
        if self._reason:
            problems.append(self._reason)
        address = "" if self._address == NO_ADDRESS else f" (address {self._address})"
        return f"{self._settings.name}{address}: {'; '.join(problems)}" if problems else ""

    def _start_enabling(self, now: float) -> None:
        faulty = self._status.no_error == 0
        if self._phase is not Phase.OFF or now - self._sample_time > self._settings.max_status_age:
            self._reason = "enable requested without a fresh status"
        elif faulty and not self._acknowledged:
            self._reason = "enable requested without an acknowledgement of the error"
        else:
            self._phase, self._enabled_at, self._reason = Phase.ENABLING, now, ""
            self._acknowledging, self._acknowledged = faulty, False
            self._pending_writes = [self._power_off, self._zero, self._power_on]

    def _disable(self, reason: str) -> None:
        """Disable the drive if it is on or being enabled."""
        if self._phase in (Phase.ENABLING, Phase.ON):
            self._phase, self._reason = Phase.OFF, reason
            self._pending_writes = [self._power_off, self._zero]

    def _check_deadlines(self, now: float) -> None:
        """Disable the drive when a deadline has passed."""
        settings = self._settings
        if self._phase not in (Phase.ENABLING, Phase.ON):
            return
        if now - self._commanded_at > settings.set_point_timeout:
            self._disable(f"set-point not renewed in {settings.set_point_timeout:g} s")
        elif now - self._sample_time > settings.max_status_age:
            self._disable(f"no status for {settings.max_status_age:g} s")
        elif self._phase is Phase.ENABLING and now - self._enabled_at > settings.enable_timeout:
            self._disable(f"not powered {settings.enable_timeout:g} s after the request")

    def _next_request(self) -> bytes:
        """Return the next request: first pending writes, then set-point and values in turn."""
        if self._pending_writes:
            return self._pending_writes[0]
        if self._error_unread:
            return self._error_request
        if self._phase is Phase.ON and not self._set_point_sent:
            self._set_point_sent = True
            return objects.encode_set_point(self._settings.set_point, self._target, self._address)
        self._set_point_sent = False
        return self._values_request

    def _process_answer(self, request: bytes, answer: Record) -> None:
        refused = error_number(answer)
        if request == self._error_request:
            self._error_unread = False
            if not refused:
                (number,) = objects.decode_actual_values((self._settings.error,), answer)
                self._error = int(number) or NOT_READ
        elif request == self._values_request:
            if refused:
                self._reason = f"actual values refused: {objects.error_name(refused)}"
                return
            status, *values = objects.decode_actual_values(self._cyclic, answer)
            self._update_status(objects.decode_status(status))
            self._sample_time, self._values = self._requested_at, tuple(values)
        elif answer.kind is not Kind.ACK and not refused:
            raise CodecError(self._settings.name, "answer to a write", "ACK", answer.kind.name)
        else:
            if self._pending_writes[:1] == [request]:
                del self._pending_writes[0]
            if refused:
                self._disable("")
                written = (
                    "control word" if request in (self._power_off, self._power_on) else "set-point"
                )
                self._reason = f"{written} refused: {objects.error_name(refused)}"

    def _update_status(self, status: objects.Status) -> None:
        """Update phase and error after a fresh status."""
        self._status = status
        if self._pending_writes:
            return  # the status is older than these writes
        if status.no_error == 1:
            self._error, self._error_unread = 0, False
        elif self._error == 0:
            self._error, self._error_unread = NOT_READ, True
        if self._phase is Phase.OFF:
            if status.powerless == 0:
                self._pending_writes = [self._power_off]  # commanded off, but still powered
        elif status.no_error == 0:
            if not (self._phase is Phase.ENABLING and self._acknowledging):
                self._disable("disabled by the drive's error")
        elif status.powerless == 0:
            self._phase = Phase.ON
        elif self._acknowledging:  # the edge acknowledged the error without powering: send another
            self._acknowledging = False
            self._pending_writes = [self._power_off, self._zero, self._power_on]
        elif self._phase is Phase.ON:
            self._disable("the drive removed its power")
