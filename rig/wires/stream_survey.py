"""Survey of the devices that have a wire of their own. It only reads.

It takes over the load cell's stream for a moment.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from drivers.compax3 import objects
from drivers.compax3.codec import error_number
from drivers.compax3.requests import Requests
from drivers.conversation import Conversation, Exchange
from drivers.errors import CodecError, LinkError
from drivers.force_torque import net_ft
from drivers.serial_link import SerialLink
from drivers.udp_link import UdpLink
from rig.wires import streams
from rig.wires.line_survey import SurveyedValue
from rig.wires.messages import message_fields
from rig.wires.wire_check import port_problem

SURVEY_TIMEOUT_S = 1.5  # s for each device to answer
_PAUSE_S = 0.001
_MAX_AGE_S = 0.2  # s
_STOP_REQUEST = net_ft.encode_request(net_ft.Request(net_ft.Command.STOP, 0))


class StreamSurvey(NamedTuple):
    """The survey of one device that has a wire of its own."""

    name: str
    address: str
    answers: bool
    identity: str  # as the device reports it; empty: it reports none
    age: float | None  # s, of the values
    values: tuple[SurveyedValue, ...]
    trouble: str


class _ServoIdentity(NamedTuple):
    """Identity and state as the drive reports them."""

    name: str
    status: objects.Status
    current: float  # A
    error: int  # its number; `objects.NO_ERROR` for none


class _ServoIdentification:
    """The conversation of one survey; finished when `identity` is set."""

    def __init__(self, config: dict[str, Any]) -> None:
        """``config``: as for `rig.wires.streams.servo_stream`.

        CodecError for impossible values.
        """
        settings = streams.servo_settings(config)
        channels = (settings.status, *settings.actual)
        self.identity: _ServoIdentity | None = None
        self.requests = Requests(
            settings.name, settings.address, settings.identity, settings.timing
        )
        self._name = settings.name
        self._channels = (channels, (settings.error,))
        self._requests = tuple(objects.encode_read(one, settings.address) for one in self._channels)
        self._values: list[float] = []
        self._refused = ""

    def on_open(self, now: float) -> None:
        """Begin with the request for the drive's name."""
        self.requests.on_open(now)
        self._values = []

    def receive(self, data: bytes, now: float) -> None:
        """Process an answer or a part of one."""
        answer = self.requests.receive(data, now)
        if answer is None:
            return
        if code := error_number(answer):
            self._refused = f"actual values refused: {objects.error_name(code)}"
            return
        try:
            self._values += objects.decode_actual_values(
                self._channels[1 if self._values else 0], answer
            )
            if len(self._values) == 3:
                status_word, current, error = self._values
                status = objects.decode_status(status_word)
                self.identity = _ServoIdentity(self.requests.name, status, current, int(error))
        except CodecError as error:
            self._values = []
            self.requests.distrust(now, str(error))

    def next_message(self, now: float) -> bytes:
        """Return the next request."""
        data = self.requests.recovery_message(now, b"")
        if data or not self.requests.is_ready or self.identity is not None or self._refused:
            return data
        return self.requests.begin_request(self._requests[1 if self._values else 0], now)

    def explain(self, now: float) -> str:
        """Return why there is no identity; empty if nothing is wrong."""
        trouble = self.requests.problem or self._refused
        return f"{self._name}: {trouble}" if trouble else ""


def survey_stream(kind: str, settings: dict[str, Any]) -> StreamSurvey:
    """Survey a device of its own wire; a wire out of reach is reported, no error is raised."""
    address = f"{settings['host']}:{settings['port']}" if "host" in settings else settings["port"]
    survey = StreamSurvey(kind, address, False, "", None, (), "")
    if "host" not in settings and (why := port_problem(address)):
        return survey._replace(trouble=why)
    stream = streams.create_stream(kind, settings, {})
    try:
        stream.link.open()
    except LinkError as error:
        return survey._replace(trouble=str(error).removeprefix(f"{stream.link.name}: "))
    try:
        if kind == "servo":
            return _survey_servo(survey, stream.link, _ServoIdentification(settings))
        return _survey_sending_device(survey, stream)
    finally:
        if kind == "load_cell":
            stream.link.send(_STOP_REQUEST)
        stream.link.close()


def _survey_sending_device(survey: StreamSurvey, stream: streams.Stream) -> StreamSurvey:
    """Survey a device that sends by itself, by its first message."""

    def fresh(now: float) -> bool:
        message = stream.read_message(now)
        return message is not None and now - message.stamp < _MAX_AGE_S

    now = _converse_until(stream.link, stream.conversation, fresh)
    message, trouble = stream.read_message(now), stream.conversation.explain(now)
    if message is None:
        return survey._replace(trouble=trouble or stream.link.problem)
    *values, stamp = message
    surveyed = tuple(
        SurveyedValue(name, float(value), unit, True)
        for (name, unit), value in zip(message_fields(type(message)), values, strict=False)
    )
    return survey._replace(answers=True, age=now - stamp, values=surveyed, trouble=trouble)


def _survey_servo(
    survey: StreamSurvey, link: SerialLink | UdpLink, query: _ServoIdentification
) -> StreamSurvey:
    began = time.monotonic()
    now = _converse_until(link, query, lambda now: query.identity is not None)
    if query.identity is None:
        return survey._replace(
            identity=query.requests.name,
            trouble=query.explain(now) or "does not report its identity",
        )
    name, status, current, error = query.identity
    values = (
        SurveyedValue("powered", 1.0 - status.powerless, "flag", status.powerless == 1),
        SurveyedValue("current", current, "A", True),
    )
    trouble = "" if status.no_error == 1 else f"is in error: {objects.error_name(error)}"
    return survey._replace(
        answers=True, identity=name, age=now - began, values=values, trouble=trouble
    )


def _converse_until(
    link: SerialLink | UdpLink, conversation: Conversation, condition: Callable[[float], bool]
) -> float:
    """Converse until a condition holds or the survey times out; return the time."""
    exchange, until = Exchange(link, conversation), time.monotonic() + SURVEY_TIMEOUT_S
    while not condition(now := exchange.step()) and now < until:
        time.sleep(_PAUSE_S)
    return now
