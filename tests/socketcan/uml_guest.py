"""The first process of the guest: mount, load CAN, make vcan0, run a command, switch off.

Started by the guest's kernel, never by hand, with one word: JSON in base64. The root folder is the
host's, read-only; what the command writes goes to memory and is gone in the end.
Only the standard library, and no tool beside it (kmod and iproute2 need not be installed).
"""

from __future__ import annotations

import base64
import ctypes
import fcntl
import json
import os
import platform
import socket
import struct
import subprocess
import sys
import traceback
from pathlib import Path

UP = "guest: up"
STATUS = "guest: the command ended with"  # then its exit status: the launcher reads it
MODULES = (
    "net/can/can.ko",
    "net/can/can-raw.ko",
    "net/can/can-bcm.ko",
    "drivers/net/can/dev/can-dev.ko",
    "drivers/net/can/vcan.ko",
    "drivers/net/can/slcan/slcan.ko",
)
MOUNTS = (  # kind, where
    ("proc", "/proc"),
    ("sysfs", "/sys"),
    ("tmpfs", "/run"),
    ("devpts", "/dev/pts"),
    ("tmpfs", "/dev/shm"),
)
FINIT_MODULE = {"x86_64": 313, "aarch64": 273}  # numbers of the system call
POWER_OFF = 0x4321FEDC
UP_FLAG = 0x1

_libc = ctypes.CDLL(None, use_errno=True)


def _done(result: int, what: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")


def mount(kind: str, where: str) -> None:
    if not os.path.isdir(where):  # /dev is the guest's own and bare
        os.mkdir(where)
    _done(_libc.mount(b"guest", where.encode(), kind.encode(), 0, None), f"mount {where}")


def load(module: Path) -> None:
    number = FINIT_MODULE[platform.machine()]
    with module.open("rb") as file:
        _done(_libc.syscall(number, file.fileno(), b"", 0), f"load {module.name}")


def attribute(kind: int, value: bytes) -> bytes:
    """A netlink attribute, padded to four bytes."""
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def add_virtual_can(name: str) -> None:
    """What `ip link add dev NAME type vcan` does: RTM_NEWLINK, made and not there before."""
    name_is, info, kind = 3, 18, 1  # IFLA_IFNAME, IFLA_LINKINFO, IFLA_INFO_KIND
    body = struct.pack("=BxHiII", 0, 0, 0, 0, 0)
    body += attribute(name_is, name.encode() + b"\0")
    body += attribute(info, attribute(kind, b"vcan"))
    asked = 0x0001 | 0x0004 | 0x0200 | 0x0400  # request, acknowledged, exclusive, create
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as line:
        line.send(struct.pack("=IHHII", 16 + len(body), 16, asked, 1, 0) + body)
        (refused,) = struct.unpack_from("=i", line.recv(4096), 16)
    if refused:
        raise OSError(-refused, f"make {name}: {os.strerror(-refused)}")


def set_up(name: str) -> None:
    """What `ip link set NAME up` does."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, 0x8914, struct.pack("=16sh14x", name.encode(), UP_FLAG))


def run(modules: str, tree: str, command: list[str]) -> int:
    for kind, where in MOUNTS:
        mount(kind, where)
    os.mkdir("/run/home")
    for name in MODULES:
        load(Path(modules) / name)
    add_virtual_can("vcan0")
    for name in ("lo", "vcan0"):
        set_up(name)
    environment = {
        "PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin",
        "HOME": "/run/home",
        "TMPDIR": "/run/home",
        "LANG": "C.UTF-8",
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": "/run/home/numba",
        "SOCKETCAN_TESTS": "vcan0",
    }
    print(f"{UP}, Linux", os.uname().release, flush=True)
    with open(os.devnull) as nothing:
        done = subprocess.run(command, cwd=tree, env=environment, stdin=nothing, check=False)
    return done.returncode


if __name__ == "__main__":
    status = 1
    try:
        # The kernel adds words of its own behind ours.
        status = run(**json.loads(base64.urlsafe_b64decode(sys.argv[1])))
    finally:  # whatever it was: a first process that ends is a kernel that panics
        if sys.exc_info()[0] is not None:
            traceback.print_exc(file=sys.stdout)
        print(STATUS, status, flush=True)
        _libc.reboot(POWER_OFF)
