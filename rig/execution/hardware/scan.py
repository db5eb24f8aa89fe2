"""Who is on a wire of which nothing is known: CAN nodes 1 to 127, Modbus units 1 to 247.

Only reads are sent: of 0x1000 and the identity on CAN, of one register on Modbus.
"""

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import LinkError
from drivers.canopen.service import Identity, Service
from drivers.modbus.line import (
    EXCEPTIONS,
    MAKERS_OWN,
    GoneError,
    Line,
    LineError,
    RefusedError,
    Rtu,
    Tcp,
)
from drivers.modbus.registers import Block
from rig.execution.hardware.wire_check import bus_trouble, port_trouble, tcp_trouble, unheard

_BEHIND_NOTHING = (10, 11)  # exceptions of a gateway: no way to the unit, no answer from it


class NodeHeard(NamedTuple):
    """One CAN node that answers or sends."""

    node: int
    identity: Identity


class UnitAsked(NamedTuple):
    """What came of asking one Modbus unit."""

    unit: int
    answers: bool
    took: float  # s
    said: str  # what the answer was; empty without one


def nodes(bus: Bus, patience: float) -> tuple[NodeHeard, ...]:
    """The nodes of a bus that answer within ``patience`` (s); LinkError if it is out of reach."""
    if why := bus_trouble(bus):
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {why}")
    service = Service(bus)
    try:
        return tuple(NodeHeard(node, service.identity(node)) for node in service.scan(patience))
    finally:
        service.close()


def heard(bus: Bus, patience: float) -> tuple[int, ...]:
    """The nodes of a bus that send by themselves within ``patience`` (s); nothing is sent to them.

    LinkError if the bus is out of reach, or can only be opened by sending to its adapter.
    """
    if why := unheard(bus) or bus_trouble(bus):
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {why}")
    service = Service(bus)
    try:
        return service.scan(patience, ask=False)
    finally:
        service.close()


def units(settings: Tcp | Rtu, numbers: Sequence[int], register: int) -> Iterator[UnitAsked]:
    """Ask unit after unit for one holding register; GoneError if the line cannot be opened."""
    if isinstance(settings, Rtu):
        if why := port_trouble(settings.port):
            raise GoneError(f"{settings.port} {why}")
    elif why := tcp_trouble(settings.host, settings.port):
        raise GoneError(f"{settings.host}:{settings.port}: {why}")
    line = Line(settings)
    try:
        for unit in numbers:
            yield _asked(line, Block(unit, "holding", register, 1, ()))
            if isinstance(settings, Tcp):  # a silent unit costs the connection, and a pause
                line.close()
                line = Line(settings)
    finally:
        line.close()


def _asked(line: Line, block: Block) -> UnitAsked:
    began = time.monotonic()
    answers, said = True, ""
    try:
        (value,) = line.read(block)
        said = f"register {block.first} reads {value} ({value:#06x})"
    except RefusedError as error:
        answers = error.code not in _BEHIND_NOTHING
        said = f"exception {error.code}, {EXCEPTIONS.get(error.code, MAKERS_OWN)}"
    except GoneError:
        raise
    except LineError:
        answers = False
    return UnitAsked(block.unit, answers, time.monotonic() - began, said if answers else "")
