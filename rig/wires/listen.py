"""Listening to a rig's wires without sending anything on them.

On a CAN bus every program receives the heartbeats, emergencies and process data of all nodes. A
serial port belongs to one program, and network devices send only to a program that asks.
"""

import time
from typing import NamedTuple

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service
from rig.config.rig_file import BaseRigFile
from rig.config.wiring import Wiring
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
    unexpected_nodes: tuple[int, ...]  # nodes that send but are not in the rig file
    trouble: tuple[str, ...]


def listen(rig: BaseRigFile) -> BusActivity:
    """Listen to the rig's CAN bus for `LISTEN_S` seconds; nothing is sent on any wire."""
    wiring = rig.wiring
    if not isinstance(wiring, Wiring):
        return BusActivity(
            (), (), ("none of the bench's wires can be listened to without sending",)
        )
    can = wiring.can
    bus = BusSettings(can.interface, can.channel, can.bit_rate, tuple(can.options.items()))
    if why := listening_problem(bus) or bus_problem(bus):
        return BusActivity((), (), (f"CAN: {why}",))
    nodes = {name: getattr(wiring, name).node for name in ("heave", "surge", "stator")}
    try:
        service = Service(bus)
    except LinkError as error:
        return BusActivity((), (), (f"CAN: {error}",))
    try:
        for node in nodes.values():
            service.watch(node)
        sending = service.scan(LISTEN_S, send_requests=False)
        health, now = service.health(), time.monotonic()
    except LinkError as error:
        return BusActivity((), (), (f"CAN: {error}",))
    finally:
        service.close()
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
