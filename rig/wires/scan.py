"""Scan of an unknown wire, and listening to a rig's wires without sending anything on them.

The scan covers CAN nodes 1 to 127 and Modbus units 1 to 247. It sends only reads: of 0x1000 and the
identity on CAN, of one register on Modbus.

On a CAN bus every program receives the heartbeats, emergencies and process data of all nodes. A
serial port belongs to one program, and network devices send only to a program that asks.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import NamedTuple

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import LinkError
from drivers.canopen.service import NodeIdentity, Service
from drivers.modbus.line import (
    EXCEPTION_TEXTS,
    VENDOR_SPECIFIC,
    ClosedLineError,
    ExceptionResponseError,
    Line,
    LineError,
    RtuSettings,
    TcpSettings,
)
from drivers.modbus.registers import RegisterBlock
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import CanBus, wiring_of
from rig.wires.wire_check import bus_problem, listening_problem, port_problem, tcp_problem

_GATEWAY_EXCEPTIONS = (10, 11)  # of a gateway: no path to the unit, no answer from it


class UnitResponse(NamedTuple):
    """The result of a request to one Modbus unit."""

    unit: int
    answers: bool
    duration: float  # s
    answer: str  # empty: none came


def scan_nodes(bus: BusSettings, timeout_s: float) -> dict[int, NodeIdentity]:
    """Return the nodes that answer within ``timeout_s``; LinkError if the bus is out of reach."""
    if why := bus_problem(bus):
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {why}")
    with closing(Service(bus)) as service:
        return {node: service.identity(node) for node in service.scan(timeout_s)}


def listen_for_nodes(bus: BusSettings, timeout_s: float) -> tuple[int, ...]:
    """Return the nodes of a bus that send by themselves within ``timeout_s``; send nothing.

    LinkError if the bus is out of reach, or can only be opened by sending to its adapter.
    """
    if why := listening_problem(bus) or bus_problem(bus):
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {why}")
    with closing(Service(bus)) as service:
        return service.scan(timeout_s, send_requests=False)


def scan_units(
    settings: TcpSettings | RtuSettings, numbers: Sequence[int], register: int
) -> Iterator[UnitResponse]:
    """Read one holding register of each unit in turn; GoneError if the line cannot be opened."""
    if isinstance(settings, RtuSettings):
        if why := port_problem(settings.port):
            raise ClosedLineError(f"{settings.port} {why}")
    elif why := tcp_problem(settings.host, settings.port):
        raise ClosedLineError(f"{settings.host}:{settings.port}: {why}")
    line = Line(settings)
    try:
        for unit in numbers:
            yield _request_register(line, RegisterBlock(unit, "holding", register, 1, ()))
            if isinstance(settings, TcpSettings):  # a silent unit costs the connection, and a pause
                line.close()
                line = Line(settings)
    finally:
        line.close()


def _request_register(line: Line, block: RegisterBlock) -> UnitResponse:
    began = time.monotonic()
    answers, answer = True, ""
    try:
        (value,) = line.read(block)
        answer = f"register {block.first} reads {value} ({value:#06x})"
    except ExceptionResponseError as error:
        answers = error.code not in _GATEWAY_EXCEPTIONS
        answer = f"exception {error.code}, {EXCEPTION_TEXTS.get(error.code, VENDOR_SPECIFIC)}"
    except ClosedLineError:
        raise
    except LineError:
        answers = False
    return UnitResponse(block.unit, answers, time.monotonic() - began, answer if answers else "")


LISTEN_S = 2.5  # s: heartbeats of drives come every 0.1 to 1 s


class NodeActivity(NamedTuple):
    """The received messages of one node of the rig."""

    name: str
    node: int
    sends: bool  # anything at all
    nmt: int | None  # `heartbeat.Nmt`; None: no heartbeat came
    heartbeat_age: float | None  # s
    emergency: int  # code of the last emergency; 0: none came


class BusActivity(NamedTuple):
    """The received messages of a bus, and why others could not be received."""

    nodes: tuple[NodeActivity, ...]
    unlisted_nodes: tuple[int, ...]  # nodes that send but are not in the rig file
    trouble: tuple[str, ...]


def listen(rig: BaseRigFile) -> BusActivity:
    """Listen to the rig's CAN bus for `LISTEN_S` seconds; nothing is sent on any wire."""
    wiring = wiring_of(rig)
    can = next((wire.part for wire in wiring.wires() if isinstance(wire.part, CanBus)), None)
    if can is None:
        return BusActivity((), (), ("none of the rig's wires can be listened to without sending",))
    bus = can.settings()
    if why := listening_problem(bus) or bus_problem(bus):
        return BusActivity((), (), (f"CAN: {why}",))
    nodes = {name: drive.can_node.node for name, drive in wiring.drives().items()}
    try:
        with closing(Service(bus)) as service:
            for node in nodes.values():
                service.watch(node)
            sending = service.scan(LISTEN_S, send_requests=False)
            health, now = service.health(), time.monotonic()
    except LinkError as error:
        return BusActivity((), (), (f"CAN: {error}",))
    activity = []
    for name, node in nodes.items():
        node_health = health[node]
        beats = node_health.nmt >= 0
        nmt, age = (node_health.nmt, now - node_health.last_heartbeat) if beats else (None, None)
        activity.append(NodeActivity(name, node, node in sending, nmt, age, node_health.code))
    silent = tuple(
        f"{one.name} (node {one.node}) sends nothing" for one in activity if not one.sends
    )
    return BusActivity(
        tuple(activity), tuple(sorted(set(sending) - {*nodes.values(), can.own_node})), silent
    )
