"""The first process of the guest: mount, load CAN, create vcan0, run a command, power off.

The guest's kernel starts it with one argument: JSON in base64. The root folder is that of the host,
read-only; files of the command are in memory and are lost at the end. It needs only the standard
library, and no other tool (kmod and iproute2 need not be installed).
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
STATUS = "guest: the command ended with"  # followed by its exit status, for the launcher
MODULES = (
    "net/can/can.ko",
    "net/can/can-raw.ko",
    "net/can/can-bcm.ko",
    "drivers/net/can/dev/can-dev.ko",
    "drivers/net/can/vcan.ko",
    "drivers/net/can/slcan/slcan.ko",
)
MOUNTS = (  # kind, mount point
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


def _check(result: int, action: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{action}: {os.strerror(number)}")


def mount(kind: str, target: str) -> None:
    if not os.path.isdir(target):  # /dev is the guest's own and bare
        os.mkdir(target)
    _check(_libc.mount(b"guest", target.encode(), kind.encode(), 0, None), f"mount {target}")


def load(module: Path) -> None:
    number = FINIT_MODULE[platform.machine()]
    with module.open("rb") as file:
        _check(_libc.syscall(number, file.fileno(), b"", 0), f"load {module.name}")


def attribute(kind: int, value: bytes) -> bytes:
    """Return a netlink attribute, padded to four bytes."""
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def add_virtual_can(name: str) -> None:
    """Create an interface like `ip link add dev NAME type vcan`: RTM_NEWLINK, exclusive."""
    name_attribute, info, kind = 3, 18, 1  # IFLA_IFNAME, IFLA_LINKINFO, IFLA_INFO_KIND
    body = struct.pack("=BxHiII", 0, 0, 0, 0, 0)
    body += attribute(name_attribute, name.encode() + b"\0")
    body += attribute(info, attribute(kind, b"vcan"))
    flags = 0x0001 | 0x0004 | 0x0200 | 0x0400  # request, acknowledged, exclusive, create
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as line:
        line.send(struct.pack("=IHHII", 16 + len(body), 16, flags, 1, 0) + body)
        (refused,) = struct.unpack_from("=i", line.recv(4096), 16)
    if refused:
        raise OSError(-refused, f"make {name}: {os.strerror(-refused)}")


def set_up(name: str) -> None:
    """Switch an interface on like `ip link set NAME up`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, 0x8914, struct.pack("=16sh14x", name.encode(), UP_FLAG))


def run(modules: str, tree: str, command: list[str]) -> int:
    for kind, target in MOUNTS:
        mount(kind, target)
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
    with open(os.devnull) as null:
        done = subprocess.run(command, cwd=tree, env=environment, stdin=null, check=False)
    return done.returncode


if __name__ == "__main__":
    status = 1
    try:
        # The kernel appends arguments of its own.
        status = run(**json.loads(base64.urlsafe_b64decode(sys.argv[1])))
    finally:  # the kernel panics if its first process ends, so power off in any case
        if sys.exc_info()[0] is not None:
            traceback.print_exc(file=sys.stdout)
        print(STATUS, status, flush=True)
        _libc.reboot(POWER_OFF)
