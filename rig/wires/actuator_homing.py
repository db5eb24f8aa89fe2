"""Homing of a rig's actuators outside a run, one after the other."""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any, NamedTuple

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service, ServiceError
from rig.wires.can_service import home_node, restart_monitors, set_up_nodes
from rig.wires.job import WiredJob
from rig.wires.wire_check import bus_problem

_BOOT_S = 10.0  # s from a reset to the node's boot message


class Homing(NamedTuple):
    """The outcome of the homing of one actuator."""

    name: str
    node: int
    homed: bool  # the drive reports that it is homed
    moved: bool  # it homed now; False: it was homed already, or failed
    duration_s: float
    problem: str = ""


def actuator_nodes(job: WiredJob) -> tuple[dict[str, Any], ...]:
    """Return the set-up of the nodes that can home, in the order of the rig file."""
    configs = (p.config for p in job.io_processes if p.module.endswith(".can_service"))
    nodes = (node for config in configs for node in config["nodes"])
    return tuple(node for node in nodes if node["homing"] is not None)


def home_actuators(
    job: WiredJob,
    nodes: Sequence[dict[str, Any]],
    *,
    repeat: bool,
    stopped: Callable[[], bool],
    on_begin: Callable[[str], None] = lambda name: None,
) -> tuple[Homing, ...]:
    """Set up and home actuators over the bus; return the outcome of each.

    With ``repeat`` the drives restart first and so forget that they are homed. ``stopped`` returns
    True to abort: power is then removed, and the rest is left alone, as after a failure.
    ``on_begin`` gets each name before it moves. Raises LinkError or ServiceError if the bus cannot
    be opened or a node does not take its settings.
    """
    (config,) = (p.config["bus"] for p in job.io_processes if p.module.endswith(".can_service"))
    bus = BusSettings.from_json(config)
    if problem := bus_problem(bus):
        raise LinkError(problem)
    found: list[Homing] = []
    with closing(Service(bus)) as service:
        for node in nodes if repeat else ():
            service.reset(node["node"], _BOOT_S, stopped)
        set_up_nodes(service, list(nodes))
        for node in nodes:
            if stopped() or (found and found[-1].problem):
                break  # after a failure the bus or the operator may need attention first
            on_begin(node["name"])
            began, problem, moved = time.monotonic(), "", False
            try:
                moved = home_node(service, node, stopped)
            except (ServiceError, LinkError) as error:
                problem = str(error)
            duration = time.monotonic() - began
            found.append(Homing(node["name"], node["node"], not problem, moved, duration, problem))
        # A drive with a problem keeps its monitor: it trips when our heartbeat ends.
        failed = [each.name for each in found if each.problem]
        restart_monitors(service, [node for node in nodes if node["name"] not in failed])
    return tuple(found)
