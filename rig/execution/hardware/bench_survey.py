"""Who answers on a bench's wires. It only reads, and takes the load cell's stream for a moment."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from drivers.compax3 import objects
from drivers.conversation import Conversation, Exchange
from drivers.errors import LinkError
from drivers.force_torque import net_ft
from drivers.serial_link import SerialLink
from drivers.udp_link import UdpLink
from rig.execution.hardware import streams
from rig.execution.hardware.bench_job import Job
from rig.execution.hardware.line_survey import (
    LineFound,
    ValueFound,
    look_at_line,
    unit_troubles,
    units_of,
)
from rig.execution.hardware.servo_survey import ServoLook
from rig.execution.hardware.wire_check import port_trouble

LOOK = 1.5  # s for each device to say something
_PAUSE = 0.001
_YOUNG = 0.2  # s
_STOP = net_ft.encode_request(net_ft.Request(net_ft.Command.STOP, 0))


class StreamFound(NamedTuple):
    """One device that has a wire of its own."""

    name: str
    address: str
    answers: bool
    identity: str  # as it tells it; empty where it tells none
    age: float | None  # s, of its values
    values: tuple[ValueFound, ...]
    trouble: str


class BenchFound(NamedTuple):
    """All wires of a bench."""

    streams: tuple[StreamFound, ...]
    lines: tuple[LineFound, ...]
    at: float  # s, monotonic, when all had been looked at

    @property
    def trouble(self) -> tuple[str, ...]:
        """Everything that does not answer, or is in error; empty if all is well."""
        return tuple(self._trouble())

    def _trouble(self) -> Iterator[str]:
        for one in self.streams:
            if one.trouble:
                yield f"{one.name} at {one.address}: {one.trouble}"
        for line in self.lines:
            yield from unit_troubles(line)


def survey_bench(job: Job) -> BenchFound:
    """Look at every wire of a bench's job; what cannot be reached is told, never raised."""
    found, lines = [_stream("encoders", job.devices["encoders"])], []
    for companion in job.io_processes:
        if companion.module == "rig.execution.hardware.stream_poller":
            found.append(_stream(companion.config["kind"], companion.config["told"]))
        else:
            lines.append(look_at_line(companion.name.removeprefix("line "), companion.config))
    return BenchFound(tuple(found), tuple(lines), time.monotonic())


def _stream(kind: str, told: dict[str, Any]) -> StreamFound:
    address = f"{told['host']}:{told['port']}" if "host" in told else told["port"]
    found = StreamFound(kind, address, False, "", None, (), "")
    if "host" not in told and (why := port_trouble(address)):
        return found._replace(trouble=why)
    stream = streams.made(kind, told, {})
    try:
        stream.link.open()
    except LinkError as error:
        return found._replace(trouble=str(error).removeprefix(f"{stream.link.name}: "))
    try:
        if kind == "servo":
            return _servo(found, stream.link, ServoLook(told))
        return _listened(found, stream)
    finally:
        if kind == "load_cell":
            stream.link.send(_STOP)
        stream.link.close()


def _listened(found: StreamFound, stream: streams.Stream) -> StreamFound:
    """The first word of a device that speaks by itself."""

    def young(now: float) -> bool:
        word = stream.tell(now)
        return word is not None and now - word.stamp < _YOUNG

    now = _until(stream.link, stream.talk, young)
    word, trouble = stream.tell(now), stream.talk.explain(now)
    if word is None:
        return found._replace(trouble=trouble or stream.link.trouble)
    *values, stamp = word
    units = units_of(type(word))
    told = tuple(
        ValueFound(name, float(value), units[name], True)
        for name, value in zip(word._fields, values, strict=False)
    )
    return found._replace(answers=True, age=now - stamp, values=told, trouble=trouble)


def _servo(found: StreamFound, link: SerialLink | UdpLink, look: ServoLook) -> StreamFound:
    began = time.monotonic()
    now = _until(link, look, lambda now: look.told is not None)
    if look.told is None:
        return found._replace(
            identity=look.requests.name, trouble=look.explain(now) or "says nothing of itself"
        )
    name, status, current, error = look.told
    values = (
        ValueFound("powered", 1.0 - status.powerless, "flag", status.powerless == 1),
        ValueFound("current", current, "A", True),
    )
    trouble = "" if status.no_error == 1 else f"is in error: {objects.error_name(error)}"
    return found._replace(
        answers=True, identity=name, age=now - began, values=values, trouble=trouble
    )


def _until(link: SerialLink | UdpLink, talk: Conversation, true: Callable[[float], bool]) -> float:
    """Converse until something is true, or for as long as a look takes; gives the time."""
    exchange, until = Exchange(link, talk), time.monotonic() + LOOK
    while not true(now := exchange.turn()) and now < until:
        time.sleep(_PAUSE)
    return now
