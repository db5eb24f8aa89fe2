"""Scan of an unknown wire: CAN nodes 1 to 127, Modbus units 1 to 247.

The scan sends only reads: of 0x1000 and the identity on CAN, of one register on Modbus.
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
from rig.wires.wire_check import bus_problem, listening_problem, port_problem, tcp_problem

_GATEWAY_EXCEPTIONS = (10, 11)  # of a gateway: no path to the unit, no answer from it


class DetectedNode(NamedTuple):
    """One CAN node that answers or sends."""

    node: int
    identity: NodeIdentity


class UnitResponse(NamedTuple):
    """The result of a request to one Modbus unit."""

    unit: int
    answers: bool
    duration: float  # s
    answer: str  # empty: none came


def scan_nodes(bus: BusSettings, timeout_s: float) -> tuple[DetectedNode, ...]:
    """Return the nodes that answer within ``timeout_s``; LinkError if the bus is out of reach."""
    if why := bus_problem(bus):
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {why}")
    with closing(Service(bus)) as service:
        return tuple(DetectedNode(node, service.identity(node)) for node in service.scan(timeout_s))


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
