"""The raw socket on a real pair of interfaces, in a network namespace of its own, without root."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from drivers.errors import LinkError
from drivers.ethercat.link import Link

PAIR = "ip link add one type veth peer name two && ip link set one up && ip link set two up && "
SCRIPT = """
import socket, time
from drivers.ethercat.frames import Command, CyclicFrame, Datagram, encode
from drivers.ethercat.link import Link

far = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x88A4))
far.bind(("two", 0x88A4))
far.settimeout(5.0)
link = Link("one")

def arrived(count):
    frames, end = [], time.monotonic() + 5.0
    while len(frames) < count and time.monotonic() < end:
        length = link.receive()
        if length:
            frames.append(bytes(link.frame[:length]))
    time.sleep(0.01)
    return frames + ([bytes(link.frame)] if link.receive() else [])

began = time.monotonic()
assert link.receive() == 0
assert time.monotonic() - began < 0.05  # it does not wait
frame = CyclicFrame(40, None)
frame.set_number(20, 7)
assert link.send(frame.bytes)
sent = far.recv(2000)
assert sent == bytes(frame.bytes)
# What this host sends is not heard; of what comes, only frames with an index of the loop.
assert link.receive() == 0
tags = (0, 15, 16, 20, 255)
for tag in tags:
    far.send(encode((Datagram(Command.BRD, tag, 0, bytes(2)),)))
assert [each[17] for each in arrived(3)] == [16, 20, 255]
far.send(bytes(12) + b"\\x08\\x00" + bytes(60))  # another protocol
far.send(sent)
assert arrived(1) == [sent]
assert (link.unsent, link.errors) == (0, 0)
link.close()
print("heard")
"""


@pytest.mark.skipif(
    shutil.which("unshare") is None or shutil.which("ip") is None, reason="no unshare, or no ip"
)
def test_only_frames_of_the_loop_are_heard() -> None:
    command = ["unshare", "-Urn", "sh", "-c", f"{PAIR} exec {sys.executable} -c '{SCRIPT}'"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "unshare" in done.stderr:
        pytest.skip(f"no user namespaces: {done.stderr.strip()}")
    assert (done.returncode, done.stdout, done.stderr) == (0, "heard\n", "")


def test_an_absent_interface_is_named() -> None:
    with pytest.raises(LinkError, match=r"^EtherCAT on nowhere: (No such device|raw sockets)"):
        Link("nowhere")
