"""The service end of a CAN bus beside the loop: set nodes up, then watch them.

Before it says "ready", every node has been written to and read back, homed where the rig file wants
that, and let into OPERATIONAL. A mismatch refuses by name. What it reads for the loop (the scale of
a drive's current) goes along with "ready".
"""

import json
import time
from typing import Any

from drivers.canopen import cia402, homing
from drivers.canopen.arming import Step, refusal
from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import LinkError
from drivers.canopen.service import Service, ServiceError
from rig.execution.hardware.messages import NodeHealth
from rig.processes import handover
from rig.processes.io_process import report, run, until_ended
from rig.processes.mailbox import Mailbox
from rig.realtime import scheduling

_LOOK = 0.02  # s between looks at the nodes' health
_TELL = 5.0  # s between two lines about a deaf service


def serve(job: dict[str, Any]) -> None:
    """Set up and watch until terminated, or until the loop has ended."""
    config, ended = job["config"], until_ended(job["lifeline"])
    slots = {name: Mailbox(fd, NodeHealth) for name, fd in job["mailboxes"].items()}
    if refused := scheduling.acquire_for_io():
        report(event="say", text=f"no priority over other work: {refused}")
    interface, channel, bit_rate, options = config["bus"]
    bus = Bus(interface, channel, bit_rate, tuple((key, value) for key, value in options))
    nodes = config["nodes"]
    try:
        service = Service(bus)
    except LinkError as error:
        report(event="refused", why=str(error))
        return
    try:
        try:
            facts = _set_up(service, nodes, ended)
            service.narrow()
            for one in nodes:
                service.start(one["node"])
        except ServiceError as error:
            report(event="refused", why=str(error))
            return
        _watch(service, nodes, slots)
        report(event="ready", facts=facts)
        told = -_TELL
        while not ended():
            time.sleep(_LOOK)
            try:
                _watch(service, nodes, slots)
            except LinkError as error:  # the slots grow old, and the loop stops for their age
                if time.monotonic() - told > _TELL:
                    told = time.monotonic()
                    report(event="say", text=str(error))
        for one in nodes:
            service.stop(one["node"])
    finally:
        service.close()


def _set_up(service: Service, nodes: list[dict[str, Any]], stopped: Any) -> dict[str, Any]:
    facts: dict[str, Any] = {}
    wrong = []
    for one in nodes:
        service.watch(one["node"])
        steps = tuple(Step(*step) for step in one["steps"])
        mismatches = service.set_up(one["node"], steps)
        if mismatches:
            wrong.append(f"{one['name']} (node {one['node']}):\n{refusal(mismatches)}")
        found = {
            name: service.read(one["node"], index, sub, kind)
            for name, index, sub, kind in one["facts"]
        }
        missing = [name for name, value in found.items() if value is None]
        if missing:
            wrong.append(f"{one['name']} (node {one['node']}) does not give {', '.join(missing)}")
        facts[one["name"]] = found
    if wrong:
        raise ServiceError("\n".join(wrong))
    for one in nodes:
        if one["homing"] is not None:
            machine, deadlines = one["homing"]
            service.home(
                one["node"],
                handover.loads(cia402.Params, json.dumps(machine)),
                handover.loads(homing.Params, json.dumps(deadlines)),
                stopped,
            )
    return facts


def _watch(service: Service, nodes: list[dict[str, Any]], slots: dict[str, Mailbox]) -> None:
    health = service.health()
    now = time.monotonic()
    for one in nodes:
        known = health[one["node"]]
        slots[f"{one['name']}_health"].post(
            NodeHealth(known.nmt, known.heard, known.boots, known.code, known.emergencies, now)
        )


if __name__ == "__main__":
    run(serve)
