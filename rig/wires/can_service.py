"""The I/O process for the service functions of a CAN bus: set up the nodes, then monitor them.

Before it reports "ready", it writes every node's objects and reads them back, homes the nodes for
which the rig file requires it, and starts all nodes (OPERATIONAL). On a mismatch it refuses and
names the node. The report "ready" contains values that the loop needs, such as the scale of a
drive's current.
"""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Any

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service
from drivers.cia402.arming import SetupStep, format_mismatches
from drivers.cia402.homing_run import HomingSettings
from drivers.errors import ServiceError
from rig.processes import handover
from rig.processes.io_process import end_condition, run_io_process
from rig.processes.mailbox import Mailbox
from rig.processes.messages import IoJob, Notice, Ready, report
from rig.wires.messages import HEALTH_SUFFIX, NodeHealth, open_mailboxes

_POLL_INTERVAL_S = 0.02  # s between two posts of the nodes' health
_REPORT_INTERVAL_S = 5.0  # s between two messages about a lost bus


def serve(job: IoJob) -> None:
    """Set up and monitor the nodes until terminated or until the loop has ended."""
    config, ended = job.config, end_condition(job.lifeline)
    slots, nodes = open_mailboxes(job.mailboxes), config["nodes"]
    with closing(Service(BusSettings.from_json(config["bus"]))) as service:
        facts = set_up_nodes(service, nodes)
        homing_nodes = [node for node in nodes if node["homes"]]
        for node in homing_nodes:
            home_node(service, node, ended)
        restart_monitors(service, nodes if homing_nodes else [])
        service.ignore_process_data()
        for node in nodes:
            service.start(node["node"])
        _post_health(service, nodes, slots)
        report(Ready(facts))
        last_report = -_REPORT_INTERVAL_S
        while not ended():
            time.sleep(_POLL_INTERVAL_S)
            try:
                _post_health(service, nodes, slots)
            except LinkError as error:  # the health messages age, and the loop stops for it
                if time.monotonic() - last_report > _REPORT_INTERVAL_S:
                    last_report = time.monotonic()
                    report(Notice(str(error)))
        for node in nodes:
            service.stop(node["node"])


def set_up_nodes(service: Service, nodes: list[dict[str, Any]]) -> dict[str, Any]:
    """Set up the nodes (`can_nodes`); return the values read for the loop by node name.

    ServiceError lists every node that does not take its settings.
    """
    facts: dict[str, Any] = {}
    problems = []
    for node in nodes:
        service.watch(node["node"])
        steps = tuple(SetupStep(*step) for step in node["steps"])
        mismatches = service.set_up(node["node"], steps)
        if mismatches:
            problems.append(
                f"{node['name']} (node {node['node']}):\n{format_mismatches(mismatches)}"
            )
        values = {
            name: service.read(node["node"], index, sub, kind)
            for name, index, sub, kind in node["facts"]
        }
        missing = [name for name, value in values.items() if value is None]
        if missing:
            problems.append(
                f"{node['name']} (node {node['node']}) does not give {', '.join(missing)}"
            )
        facts[node["name"]] = values
    if problems:
        raise ServiceError("\n".join(problems))
    return facts


def home_node(service: Service, node: dict[str, Any], stopped: Callable[[], bool]) -> bool:
    """Home a node; return whether it moved. ServiceError names the failure, as `Service.home`."""
    settings = handover.loads(HomingSettings, json.dumps(node["homing"]))
    return service.home(node["node"], settings, stopped, node["monitor"][0])


def restart_monitors(service: Service, nodes: Sequence[dict[str, Any]]) -> None:
    """Let nodes wait for the loop's first heartbeat: those of the homing have ended."""
    for node in nodes:
        service.restart_monitor(node["node"], node["monitor"][1])


def _post_health(service: Service, nodes: list[dict[str, Any]], slots: dict[str, Mailbox]) -> None:
    health = service.health()
    now = time.monotonic()
    for node in nodes:
        one = health[node["node"]]
        slots[f"{node['name']}{HEALTH_SUFFIX}"].post(NodeHealth(one.last_heartbeat, one.boots, now))


if __name__ == "__main__":
    run_io_process(serve)
