"""The segment as one of the emulators of an event loop, before a raw socket; prints what came back.

`unshare -Urn python wire_process.py`: needs network and user namespaces of its own, or root.
"""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from frame_master import BRD, DEVICES, datagram, frame

from sim_plant.emulators.ethercat import wire as wires
from sim_plant.emulators.ethercat.line import BenchLine
from sim_plant.emulators.ethercat.wire import Wire
from sim_plant.emulators.link_faults import Severity
from sim_plant.emulators.running import running
from sim_plant.emulators.schedule import precise_loop

ENDS = "wiremaster", "wireslaves"
FRAMES = 40


def question(index: int) -> bytes:
    return frame(datagram(BRD, 0, b"\0\0", index))


async def replies(master: socket.socket, count: int, period: float) -> list[tuple[int, float]]:
    """Send frames at a rate; return index and time since sending of each that comes back."""
    sent: dict[int, float] = {}
    got: list[tuple[int, float]] = []
    end = time.monotonic() + count * period + 0.15
    due = time.monotonic()
    while time.monotonic() < end:
        if len(sent) < count and time.monotonic() >= due:
            due += period
            sent[len(sent)] = time.monotonic()
            master.send(question(len(sent) - 1))
        await asyncio.sleep(0.0005)
        while True:
            try:
                data = master.recv(2000)
            except BlockingIOError:
                break
            got.append((data[17], time.monotonic() - sent[data[17]]))
    return got


async def watch() -> dict[str, Any]:
    line = BenchLine(["coupler", "digital_in"], DEVICES, wires.clock)
    capture = Path(sys.argv[1])
    wire = Wire(line.segment, ENDS[1], capture=capture)
    seen: dict[str, Any] = {}
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x88A4)) as master:
        master.bind((ENDS[0], 0x88A4))
        master.setblocking(False)
        async with running({"segment": wire}) as addresses:
            seen["addresses"] = addresses
            seen["healthy"] = await replies(master, FRAMES, 0.002)
            for fault, severity in (
                ("drop", Severity(drop=0.5)),
                ("duplicate", Severity(duplicate=1.0)),
                ("delay", Severity(delay=0.01)),
            ):
                wire.link.set_severity(severity, toward="device")
                wire.link.switch(fault, toward="device")
                seen[fault] = await replies(master, FRAMES, 0.002)
                wire.link.switch(fault, False, toward="device")
            line.segment.inject("stall", 0.025)
            await asyncio.sleep(0.002)  # until the next poll
            seen["stall"] = await replies(master, FRAMES, 0.002)
            seen["after"] = await replies(master, FRAMES, 0.002)
            master.send(b"\xff" * 12 + b"\x88\xa4" + bytes(46))
            await asyncio.sleep(0.02)
            seen["malformed"] = line.segment.malformed
            seen["frames"] = line.segment.frames
    return seen


if __name__ == "__main__":
    first, second = ENDS
    subprocess.run(["ip", "link", "add", first, "type", "veth", "peer", "name", second], check=True)
    for end_name in ENDS:
        subprocess.run(["ip", "link", "set", end_name, "up"], check=True)
    print(json.dumps(precise_loop().run_until_complete(watch())))
