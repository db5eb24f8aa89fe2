"""Survey of all wires of a rig: the devices that answer, and what they report. It only reads.

The survey takes over the load cell's stream for a moment.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any, NamedTuple

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import LinkError as CanLinkError
from drivers.canopen.service import NodeIdentity, NodeStatus, Service
from drivers.cia402 import arming, error_codes, statusword
from drivers.cia402.arming import Mismatch, SetupStep
from drivers.compax3 import objects
from drivers.compax3.codec import error_number
from drivers.compax3.requests import Requests
from drivers.conversation import Conversation, Exchange
from drivers.errors import CodecError, LinkError
from drivers.force_torque import net_ft
from drivers.modbus import registers
from drivers.modbus.line import ExceptionResponseError, Line, LineError
from drivers.modbus.registers import RegisterBlock
from drivers.serial_link import SerialLink
from drivers.udp_link import UdpLink
from rig.wires import streams
from rig.wires.job import WiredJob
from rig.wires.messages import message_fields
from rig.wires.modbus_poller import (
    BUSY_PAUSE_S,
    PolledBlock,
    create_line,
    parse_blocks,
    retry_while_busy,
)
from rig.wires.segment_survey import SegmentSurvey, survey_segment
from rig.wires.wire_check import bus_problem, port_problem, tcp_problem


class SurveyedValue(NamedTuple):
    """One present value of a unit."""

    name: str
    value: float
    unit: str
    plausible: bool  # whether the value is plausible


class UnitSurvey(NamedTuple):
    """The survey of one block of registers of a Modbus unit."""

    name: str
    unit: int
    registers: str
    answers: bool
    answered_in_s: float  # from request to answer
    age: float | None  # s, from the request to the end of the line's survey; None: no answer
    written_by_run: bool  # so its content is no measurement
    values: tuple[SurveyedValue, ...] = ()
    trouble: str = ""


class LineSurvey(NamedTuple):
    """The survey of one line."""

    name: str
    kind: str  # tcp, rtu
    address: str
    trouble: str  # why the line is out of reach; empty: it is not
    units: tuple[UnitSurvey, ...]


def survey_line(name: str, config: dict[str, Any]) -> LineSurvey:
    """Survey every unit of a Modbus line; ``config`` is that of the line's poller."""
    settings = config["settings"]
    rtu = config["kind"] == "rtu"
    address = settings["port"] if rtu else f"{settings['host']}:{settings['port']}"
    why = port_problem(address) if rtu else tcp_problem(settings["host"], settings["port"])
    survey = LineSurvey(name, config["kind"], address, why, ())
    if why:
        return survey
    units: list[UnitSurvey] = []
    requested_at: list[float] = []
    line = create_line(config, [])
    try:
        for polled_block in parse_blocks(config):
            if not rtu:  # a silent unit costs the connection
                line.close()
                line = create_line(config, [])
            requested_at.append(time.monotonic())
            units.append(_survey_unit(line, polled_block))
            if line.open_count == 0:
                return survey._replace(trouble=units[-1].trouble)
    finally:
        line.close()
    now = time.monotonic()
    return survey._replace(
        units=tuple(
            unit._replace(age=now - at) if unit.answers else unit
            for unit, at in zip(units, requested_at, strict=True)
        )
    )


def _survey_unit(line: Line, polled_block: PolledBlock) -> UnitSurvey:
    block, requested_at = polled_block.block, time.monotonic()
    last = block.first + block.size - 1
    where = f"{block.table} {block.first}" + (f"-{last}" if block.size > 1 else "")
    written = polled_block.written
    survey = UnitSurvey(polled_block.name, block.unit, where, False, 0.0, None, written)
    try:
        raw = _read_block(line, block)
    except LineError as error:
        if written and isinstance(error, ExceptionResponseError):  # its outputs cannot be read
            return survey._replace(answers=True, answered_in_s=time.monotonic() - requested_at)
        return survey._replace(trouble=str(error).removeprefix(f"{line.name}: unit {block.unit}, "))
    survey = survey._replace(answers=True, answered_in_s=time.monotonic() - requested_at)
    if written:
        return survey
    try:
        numbers = registers.decode(block, raw, polled_block.high_word_first)
    except CodecError as error:
        return survey._replace(trouble=str(error))
    implausible = registers.implausible_values(block, numbers)
    values = tuple(
        SurveyedValue(name, number, unit, name not in implausible)
        for (name, unit), number in zip(polled_block.signals, numbers, strict=True)
    )
    text = ", ".join(f"{each.name} = {each.value:g}" for each in values if not each.plausible)
    hint = registers.implausible_hint(numbers)
    return survey._replace(values=values, trouble=f"{text} is implausible; {hint}" if text else "")


def _read_block(line: Line, block: RegisterBlock) -> list[int]:
    """Return a block's registers; repeat the request while the unit is busy."""
    attempts = retry_while_busy(lambda: line.read(block))
    while True:
        try:
            next(attempts)
        except StopIteration as end:
            raw: list[int] = end.value
            return raw
        time.sleep(BUSY_PAUSE_S)


SURVEY_TIMEOUT_S = 1.5  # s for each device to answer
_PAUSE_S = 0.001
_MAX_AGE_S = 0.2  # s
_STOP_REQUEST = net_ft.encode_request(net_ft.Request(net_ft.Command.STOP, 0))


class StreamSurvey(NamedTuple):
    """The survey of one device that has a wire of its own."""

    name: str
    address: str
    answers: bool
    identity: str = ""  # as the device reports it; empty: it reports none
    age: float | None = None  # s, of the values
    values: tuple[SurveyedValue, ...] = ()
    trouble: str = ""


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
    survey = StreamSurvey(kind, address, False)
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


SCAN_TIMEOUT_S = 0.4  # s in which every node of the bus must answer the first request
_HEARTBEAT_PERIODS = 2.5  # periods in which a heartbeat must come
_MAX_HEARTBEAT_WAIT_S = 3.0  # s of waiting for heartbeats
_POLL_INTERVAL_S = 0.02  # s
_ANSWER_TIMEOUT_S = 2.0  # s for one answer, which waits for process data during a run
_MASTER_LOST_BITS = 0x11  # generic and communication, in the error register


class NodeSurvey(NamedTuple):
    """The survey of one node of the rig; None for values that it did not give."""

    name: str
    node: int
    answers: bool = False
    identity: NodeIdentity = NodeIdentity(None, None, None, None, None, None, None)
    nmt: int | None = None  # `heartbeat.Nmt` in its heartbeat; None: none came
    heartbeat_age: float | None = None  # s
    heartbeat_every: float | None = None  # s, 0x1017; 0: it sends none
    error_code: int | None = None  # 0x603F
    statusword: int | None = None  # 0x6041
    emergency: int = 0  # code of the last emergency during the survey
    checked: int = 0  # number of compared objects
    wrong: tuple[Mismatch, ...] = ()  # objects that no run writes: a run would be refused
    unset: tuple[Mismatch, ...] = ()  # objects that every run writes before it arms
    trouble: tuple[str, ...] = ("does not answer",)

    @property
    def waits_for_master(self) -> bool:
        """Whether its only error is the lost master, as after every run."""
        only = (self.identity.error_register or 0) & ~_MASTER_LOST_BITS == 0
        return only and not self.error_code and self.statusword is not None


class BusSurvey(NamedTuple):
    """The survey of the CAN bus."""

    interface: str
    channel: str
    bit_rate: int  # bit/s
    planned_load: float  # of a run, in the worst case, 0 to 1
    trouble: str  # why the bus is out of reach; empty: it is not
    nodes: tuple[NodeSurvey, ...]
    unlisted_nodes: tuple[int, ...]  # on the bus, but not in the rig file


def survey_bus(config: dict[str, Any], load: float) -> BusSurvey:
    """Survey a CAN bus; ``config`` is that of its service process, ``load`` that of a run."""
    bus, nodes = BusSettings.from_json(config["bus"]), config["nodes"]
    absent = tuple(NodeSurvey(each["name"], each["node"]) for each in nodes)
    survey = BusSurvey(bus.interface, bus.channel, bus.bit_rate, load, "", absent, ())
    if why := bus_problem(bus):
        return survey._replace(trouble=why)
    try:
        with closing(Service(bus, _ANSWER_TIMEOUT_S)) as service:
            listed = {node_settings["node"] for node_settings in nodes}
            for node in listed:
                service.watch(node)
            unlisted = set(service.scan(SCAN_TIMEOUT_S)) - listed
            service.ignore_process_data()
            found = [_survey_node(service, node_settings) for node_settings in nodes]
            _wait_for_heartbeats(service, found)
            health, now = service.health(), time.monotonic()
            found = [_with_health(node, health[node.node], now) for node in found]
    except CanLinkError as error:
        return survey._replace(trouble=str(error))
    return survey._replace(nodes=tuple(found), unlisted_nodes=tuple(sorted(unlisted)))


def _survey_node(service: Service, settings: dict[str, Any]) -> NodeSurvey:
    """Read all objects of one node; its heartbeat is added later."""
    node, found = settings["node"], NodeSurvey(settings["name"], settings["node"])
    if service.read(node, 0x1000, 0, "u32") is None:
        return found
    steps = tuple(SetupStep(*step) for step in settings["steps"])
    present = arming.compare_present(
        steps, lambda step: service.read(node, step.object, step.sub, step.type)
    )
    heartbeat_ms = service.read(node, 0x1017, 0, "u16")
    found = found._replace(
        answers=True,
        identity=service.identity(node),
        heartbeat_every=None if heartbeat_ms is None else 1e-3 * heartbeat_ms,
        error_code=service.read(node, 0x603F, 0, "u16"),
        statusword=service.read(node, 0x6041, 0, "u16"),
        **present._asdict(),
    )
    missing_facts = [
        f"does not give {name}, without which its command has no scale"
        for name, index, sub, kind in settings["facts"]
        if service.read(node, index, sub, kind) is None
    ]
    return found._replace(
        trouble=(
            *_fault_texts(found),
            *arming.format_mismatches(present.wrong).splitlines(),
            *missing_facts,
        )
    )


def _fault_texts(found: NodeSurvey) -> Iterator[str]:
    code, register = found.error_code or 0, found.identity.error_register or 0
    if code:
        yield f"reports error {code:#06x}, {error_codes.meaning(code)}"
    elif register and not found.waits_for_master:
        yield f"has error register {register:#04x}, {error_register_text(register)}"
    status_word = found.statusword
    if status_word is None:
        yield "gives no statusword 0x6041"
    elif not code and statusword.decode(status_word) in (
        statusword.FAULT,
        statusword.FAULT_REACTION,
    ):
        yield f"is in fault: {statusword.describe(status_word)}"


def error_register_text(register: int) -> str:
    """Return the names of the set bits of an error register 0x1001."""
    return ", ".join(name for bit, name in enumerate(error_codes.REGISTER) if register >> bit & 1)


def _wait_for_heartbeats(service: Service, nodes: list[NodeSurvey]) -> None:
    """Wait until every node that sends heartbeats has sent one, or until a time-out."""
    until = {
        node.node: time.monotonic()
        + min(_MAX_HEARTBEAT_WAIT_S, _HEARTBEAT_PERIODS * node.heartbeat_every)
        for node in nodes
        if node.heartbeat_every
    }
    while until and time.monotonic() < max(until.values()):
        health = service.health()
        until = {node: end for node, end in until.items() if health[node].nmt < 0}
        time.sleep(_POLL_INTERVAL_S)


def _with_health(found: NodeSurvey, health: NodeStatus, now: float) -> NodeSurvey:
    heard = health.nmt >= 0
    trouble = list(found.trouble)
    if found.heartbeat_every and not heard:
        trouble.append(
            f"sends no heartbeat, though it is set up for one every {found.heartbeat_every:g} s"
        )
    return found._replace(
        nmt=health.nmt if heard else None,
        heartbeat_age=now - health.last_heartbeat if heard else None,
        emergency=health.code,
        trouble=tuple(trouble),
    )


class RigSurvey(NamedTuple):
    """The survey of all wires of a rig."""

    can: BusSurvey | None  # None: the rig has no CAN bus
    ethercat: SegmentSurvey | None  # None: the rig has no segment
    streams: tuple[StreamSurvey, ...]
    lines: tuple[LineSurvey, ...]

    @property
    def trouble(self) -> tuple[str, ...]:
        """Every device that does not answer or differs from the rig file; empty: none."""
        return tuple(self._trouble())

    def _trouble(self) -> Iterator[str]:
        if self.can is not None and self.can.trouble:
            yield f"CAN: {self.can.trouble}"
        elif self.can is not None:
            for node in self.can.nodes:
                yield from (f"{node.name} (node {node.node}) {text}" for text in node.trouble)
        if self.ethercat is not None:
            yield from self.ethercat.trouble
            for slave in self.ethercat.slaves:
                yield from (f"{slave.name} (slave {slave.place}) {text}" for text in slave.trouble)
        for stream in self.streams:
            if stream.trouble:
                yield f"{stream.name} at {stream.address}: {stream.trouble}"
        for line in self.lines:
            if line.trouble:
                yield f"line {line.name} at {line.address}: {line.trouble}"
                continue
            for unit in line.units:
                if unit.trouble:
                    yield f"{unit.name} (unit {unit.unit} on {line.name}): {unit.trouble}"


def survey(job: WiredJob) -> RigSurvey:
    """Survey every wire of a job; a wire out of reach is reported, no error is raised."""
    can = segment = None
    streams = [survey_stream(kind, settings) for kind, settings in job.loop_streams.items()]
    lines = []
    for process in job.io_processes:
        match process.module.rpartition(".")[2]:
            case "can_service":
                can = survey_bus(process.config, job.bus_load.total if job.bus_load else 0.0)
            case "segment_service":
                segment = survey_segment(process.config)
            case "stream_poller":
                config = process.config
                found = survey_stream(config["kind"], config["settings"])
                streams.append(found._replace(name=config["name"]))
            case "modbus_poller":
                lines.append(survey_line(process.name.removeprefix("line "), process.config))
    return RigSurvey(can, segment, tuple(streams), tuple(lines))
