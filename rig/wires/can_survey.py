"""Survey of a CAN bus: the nodes that answer, and whether their objects are as required.

The survey only reads.
"""

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any, NamedTuple

from drivers.canopen import arming, emcy, statusword
from drivers.canopen.arming import Mismatch, SetupStep
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.drive_objects import Access
from drivers.canopen.link import LinkError
from drivers.canopen.service import NodeIdentity, NodeStatus, Service
from rig.wires.wire_check import bus_problem

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
    answers: bool
    identity: NodeIdentity
    nmt: int | None  # `heartbeat.Nmt` in its heartbeat; None: none came
    heartbeat_age: float | None  # s
    heartbeat_every: float | None  # s, 0x1017; 0: it sends none
    error_code: int | None  # 0x603F
    statusword: int | None  # 0x6041
    emergency: int  # code of the last emergency during the survey
    checked: int  # number of compared objects
    wrong: tuple[Mismatch, ...]  # objects that no run writes: a run would be refused
    unset: tuple[Mismatch, ...]  # objects that every run writes before it arms
    trouble: tuple[str, ...]

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


def bus_troubles(can: BusSurvey) -> Iterator[str]:
    """Yield the problems of a bus that is out of reach, or those of its nodes."""
    if can.trouble:
        yield f"CAN: {can.trouble}"
        return
    for node in can.nodes:
        for text in node.trouble:
            yield f"{node.name} (node {node.node}) {text}"


def survey_bus(config: dict[str, Any], load: float) -> BusSurvey:
    """Survey a CAN bus; ``config`` is that of its service process, ``load`` that of a run."""
    bus, nodes = BusSettings.from_json(config["bus"]), config["nodes"]
    absent = tuple(_silent_node(node_settings) for node_settings in nodes)
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
    except LinkError as error:
        return survey._replace(trouble=str(error))
    return survey._replace(nodes=tuple(found), unlisted_nodes=tuple(sorted(unlisted)))


def _silent_node(settings: dict[str, Any]) -> NodeSurvey:
    unknown = NodeIdentity(None, None, None, None, None, None, None)
    return NodeSurvey(
        settings["name"], settings["node"], False, unknown, None, None, None, None, None, 0, 0,
        (), (), ("does not answer",),
    )  # fmt: skip


def _survey_node(service: Service, settings: dict[str, Any]) -> NodeSurvey:
    """Read all objects of one node; its heartbeat is added later."""
    node, found = settings["node"], _silent_node(settings)
    if service.read(node, 0x1000, 0, "u32") is None:
        return found
    steps = tuple(SetupStep(*step) for step in settings["steps"])
    verified_objects = arming.read_back(steps)
    answers = {
        (s.object, s.sub): service.read(node, s.object, s.sub, s.type) for s in verified_objects
    }
    verified = {(s.object, s.sub) for s in verified_objects if s.access == Access.VERIFY}
    mismatches = arming.compare(steps, answers)
    wrong = tuple(m for m in mismatches if (m.object, m.sub) in verified)
    heartbeat_ms = service.read(node, 0x1017, 0, "u16")
    found = found._replace(
        answers=True,
        identity=service.identity(node),
        heartbeat_every=None if heartbeat_ms is None else 1e-3 * heartbeat_ms,
        error_code=service.read(node, 0x603F, 0, "u16"),
        statusword=service.read(node, 0x6041, 0, "u16"),
        checked=len(verified_objects),
        wrong=wrong,
        unset=tuple(m for m in mismatches if (m.object, m.sub) not in verified),
    )
    missing_facts = [
        f"does not give {name}, without which its command has no scale"
        for name, index, sub, kind in settings["facts"]
        if service.read(node, index, sub, kind) is None
    ]
    return found._replace(
        trouble=(
            *_fault_texts(found),
            *arming.format_mismatches(wrong).splitlines(),
            *missing_facts,
        )
    )


def _fault_texts(found: NodeSurvey) -> Iterator[str]:
    code, register = found.error_code or 0, found.identity.error_register or 0
    if code:
        yield f"reports error {code:#06x}, {emcy.meaning(code)}"
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
    return ", ".join(name for bit, name in enumerate(emcy.REGISTER) if register >> bit & 1)


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
