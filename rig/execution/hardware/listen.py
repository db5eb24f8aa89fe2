"""What can be learnt of a rig's wires without sending anything on them.

On a CAN bus every node is heard by everybody: its heartbeats, emergencies and process data. Serial
ports belong to one program, and network devices say nothing to who does not ask.
"""

import time
from typing import NamedTuple

from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service
from rig.config.any_rig_file import AnyRigFile
from rig.config.wiring import Wiring
from rig.execution.hardware.wire_check import bus_trouble, unheard

LISTEN = 2.5  # s: heartbeats of drives come every 0.1 to 1 s


class NodeHeard(NamedTuple):
    """One node of the rig, as it was heard."""

    name: str
    node: int
    sends: bool  # anything at all
    nmt: int | None  # `heartbeat.Nmt`; None: no heartbeat came
    heartbeat_age: float | None  # s
    emergency: int  # code of the last emergency; 0: none came


class Heard(NamedTuple):
    """What was heard, and what could not be listened to."""

    nodes: tuple[NodeHeard, ...]
    strangers: tuple[int, ...]  # nodes that send and are not in the rig file
    trouble: tuple[str, ...]


def listen(rig: AnyRigFile) -> Heard:
    """Listen to the rig's CAN bus for `LISTEN` seconds; nothing is sent on any wire."""
    wiring = rig.wiring
    if not isinstance(wiring, Wiring):
        return Heard((), (), ("none of the bench's wires can be listened to without sending",))
    can = wiring.can
    bus = Bus(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    if why := unheard(bus) or bus_trouble(bus):
        return Heard((), (), (f"CAN: {why}",))
    nodes = {name: getattr(wiring, name).node for name in ("heave", "surge", "stator")}
    try:
        service = Service(bus)
    except LinkError as error:
        return Heard((), (), (f"CAN: {error}",))
    try:
        for node in nodes.values():
            service.watch(node)
        sending = service.scan(LISTEN, ask=False)
        health, now = service.health(), time.monotonic()
    except LinkError as error:
        return Heard((), (), (f"CAN: {error}",))
    finally:
        service.close()
    heard = []
    for name, node in nodes.items():
        seen = health[node]
        beats = seen.nmt >= 0
        nmt, age = (seen.nmt, now - seen.heard) if beats else (None, None)
        heard.append(NodeHeard(name, node, node in sending, nmt, age, seen.code))
    silent = tuple(f"{one.name} (node {one.node}) sends nothing" for one in heard if not one.sends)
    return Heard(
        tuple(heard), tuple(sorted(set(sending) - {*nodes.values(), can.own_node})), silent
    )
