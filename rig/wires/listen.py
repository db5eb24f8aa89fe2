"""Listening to a rig's wires without sending anything on them.

On a CAN bus every program receives the heartbeats, emergencies and process data of all nodes. A
serial port belongs to one program, and network devices send only to a program that asks.
"""

import time
from contextlib import closing
from typing import NamedTuple

from drivers.canopen.link import LinkError
from drivers.canopen.service import Service
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import CanBus
from rig.wires.job import wiring_of
from rig.wires.wire_check import bus_problem, listening_problem

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
    nodes = {name: drive.node for name, drive in wiring.drives().items()}
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
