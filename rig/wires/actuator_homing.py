"""Homing of a rig's actuators outside a run, one after the other."""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import Any, NamedTuple

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.service import Service
from drivers.errors import LinkError, ServiceError
from drivers.ethercat.service import Service as SegmentService
from rig.wires.can_service import home_node, restart_monitors, set_up_nodes
from rig.wires.job import WiredJob
from rig.wires.segment_service import home_slave, set_up_slaves
from rig.wires.wire_check import bus_problem

_BOOT_S = 10.0  # s from a reset to the node's boot message
_SERVICES = {"can_service": "nodes", "segment_service": "slaves"}  # key of their drives


class Homing(NamedTuple):
    """The outcome of the homing of one actuator."""

    name: str
    node: int  # on CAN; on EtherCAT its place in the line, from 1
    homed: bool  # the drive reports that it is homed
    moved: bool  # it homed now; False: it was homed already, or failed
    duration_s: float
    problem: str = ""


def actuator_nodes(job: WiredJob) -> tuple[dict[str, Any], ...]:
    """Return the set-up of the drives that can home, in the order of the rig file."""
    drives = (drive for kind, config in _services(job) for drive in config[_SERVICES[kind]])
    return tuple(drive for drive in drives if drive["homing"] is not None)


def _services(job: WiredJob) -> list[tuple[str, dict[str, Any]]]:
    """Return type and configuration of the services of the job's bus."""
    named = ((each.module.rpartition(".")[2], each.config) for each in job.io_processes)
    return [(kind, config) for kind, config in named if kind in _SERVICES]


def home_actuators(
    job: WiredJob,
    nodes: Sequence[dict[str, Any]],
    *,
    repeat: bool,
    stopped: Callable[[], bool],
    on_begin: Callable[[str], None] = lambda name: None,
) -> tuple[Homing, ...]:
    """Set up and home actuators over the bus; return the outcome of each.

    With ``repeat`` the drives restart first and so forget that they are homed, on CAN only.
    ``stopped`` returns True to abort: power is then removed, and the rest is left alone, as after a
    failure. ``on_begin`` gets each name before it moves. Raises LinkError or ServiceError if the
    bus cannot be opened or a node does not take its settings.
    """
    ((kind, config),) = _services(job)
    if kind == "segment_service":
        if repeat:
            raise ServiceError("drives on EtherCAT restart by their power switch only")
        with closing(SegmentService(config["interface"])) as segment:
            facts = set_up_slaves(segment, config)
            home = partial(home_slave, segment, config, facts)
            return _home_each(nodes, home, stopped, on_begin)
    bus = BusSettings.from_json(config["bus"])
    if problem := bus_problem(bus):
        raise LinkError(problem)
    with closing(Service(bus)) as service:
        for node in nodes if repeat else ():
            service.reset(node["node"], _BOOT_S, stopped)
        set_up_nodes(service, list(nodes))
        found = _home_each(nodes, partial(home_node, service), stopped, on_begin)
        # A drive with a problem keeps its monitor: it trips when our heartbeat ends.
        failed = [each.name for each in found if each.problem]
        restart_monitors(service, [node for node in nodes if node["name"] not in failed])
    return found


def _home_each(
    nodes: Sequence[dict[str, Any]],
    home: Callable[[dict[str, Any], Callable[[], bool]], bool],
    stopped: Callable[[], bool],
    on_begin: Callable[[str], None],
) -> tuple[Homing, ...]:
    found: list[Homing] = []
    for node in nodes:
        if stopped() or (found and found[-1].problem):
            break  # after a failure the bus or the operator may need attention first
        on_begin(node["name"])
        began, problem, moved = time.monotonic(), "", False
        try:
            moved = home(node, stopped)
        except OSError as error:  # of either bus
            problem = str(error)
        duration = time.monotonic() - began
        number = node["node"]
        found.append(Homing(node["name"], number, not problem, moved, duration, problem))
    return tuple(found)
