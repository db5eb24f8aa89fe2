"""Survey of the devices on a bench's wires.

The survey only reads. It takes over the load cell's stream for a moment.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from drivers.compax3 import objects
from drivers.conversation import Conversation, Exchange
from drivers.errors import LinkError
from drivers.force_torque import net_ft
from drivers.serial_link import SerialLink
from drivers.udp_link import UdpLink
from rig.kinds.oswec_bench.hardware.job import BenchJob
from rig.wires import streams
from rig.wires.line_survey import (
    LineSurvey,
    SurveyedValue,
    message_units,
    survey_line,
    unit_troubles,
)
from rig.wires.servo_survey import ServoIdentification
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


class BenchSurvey(NamedTuple):
    """The survey of all wires of a bench."""

    streams: tuple[StreamSurvey, ...]
    lines: tuple[LineSurvey, ...]
    at: float  # s, monotonic, end of the survey

    @property
    def trouble(self) -> tuple[str, ...]:
        """Every device that does not answer or is in error; empty if there is none."""
        return tuple(self._trouble())

    def _trouble(self) -> Iterator[str]:
        for stream in self.streams:
            if stream.trouble:
                yield f"{stream.name} at {stream.address}: {stream.trouble}"
        for line in self.lines:
            yield from unit_troubles(line)


def survey_bench(job: BenchJob) -> BenchSurvey:
    """Survey every wire of a bench's job; a wire out of reach is reported, no error is raised."""
    surveys, lines = [_survey_stream("encoders", job.devices["encoders"])], []
    for process in job.io_processes:
        if process.module == "rig.wires.stream_poller":
            surveys.append(_survey_stream(process.config["kind"], process.config["settings"]))
        else:
            lines.append(survey_line(process.name.removeprefix("line "), process.config))
    return BenchSurvey(tuple(surveys), tuple(lines), time.monotonic())


def _survey_stream(kind: str, settings: dict[str, Any]) -> StreamSurvey:
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
            return _survey_servo(survey, stream.link, ServoIdentification(settings))
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
    units = message_units(type(message))
    surveyed = tuple(
        SurveyedValue(name, float(value), units[name], True)
        for name, value in zip(message._fields, values, strict=False)
    )
    return survey._replace(answers=True, age=now - stamp, values=surveyed, trouble=trouble)


def _survey_servo(
    survey: StreamSurvey, link: SerialLink | UdpLink, query: ServoIdentification
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
