"""The cable of an emulated segment: a veth pair of Linux, one end for the rig, one for its slaves.

Both ends are in the network namespace of this process. It needs CAP_NET_ADMIN: root, or a namespace
of one's own (`unshare -Urn`).
"""

import os
import socket
import subprocess
from contextlib import suppress
from pathlib import Path

_INTERFACES = Path("/sys/class/net")
_MAX_NAME = 15  # characters of an interface
_FAR_SUFFIX = "-sim"
_NET_ADMIN = 12  # bit of CAP_NET_ADMIN
_NAMESPACE = "as root, or in a namespace: `unshare -Urn sh`, then `ip link set lo up`"


def far_end(interface: str) -> str:
    """Return the name of the slaves' end of an interface's cable."""
    return interface[: _MAX_NAME - len(_FAR_SUFFIX)] + _FAR_SUFFIX


def cable_problem(interface: str) -> str:
    """Return why emulated slaves cannot be on an interface; empty if they can."""
    exists = (_INTERFACES / interface).exists()
    if exists and not (_INTERFACES / far_end(interface)).exists():
        return (
            f"{interface} is an interface of this host, and no cable to emulated slaves; use "
            "another name in a copy of the rig file"
        )
    if not _may_administer():
        what = "use the cable" if exists else "create it: it does not exist yet"
        return (
            f"{interface}: this user may not {what} (CAP_NET_ADMIN is missing); start this "
            f"{_NAMESPACE}"
        )
    return ""


def _may_administer() -> bool:
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (effective,) = (line.split()[1] for line in status if line.startswith("CapEff:"))
    return bool(int(effective, 16) >> _NET_ADMIN & 1)


def cable_holder(interface: str) -> str:
    """Return why an interface cannot take emulated slaves now; empty if it can."""
    lock = _lock(interface)
    if lock is None:
        return "has emulated slaves of another program (`rig sim`, or a run with --sim)"
    lock.close()
    return ""


def _lock(interface: str) -> socket.socket | None:
    """Return the lock of a cable, which one program of a namespace has; None if another has it."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        lock.bind(f"\0wec-rig/cable/{interface}")
    except OSError:
        lock.close()
        return None
    return lock


class Cable:
    """A veth pair that exists from `plug` to `unplug`; one that exists already is used and kept."""

    def __init__(self, interface: str) -> None:
        self.interface = interface
        self.far = far_end(interface)
        self._is_own = False
        self._lock: socket.socket | None = None

    def plug(self) -> None:
        """Create the pair and bring both ends up; OSError gives the reason against it."""
        if problem := cable_problem(self.interface):
            raise OSError(problem)
        self._lock = _lock(self.interface)
        if self._lock is None:
            raise OSError(f"{self.interface} {cable_holder(self.interface)}")
        if not (_INTERFACES / self.interface).exists():
            _ip("link", "add", self.interface, "type", "veth", "peer", "name", self.far)
            self._is_own = True
        for end in (self.interface, self.far):
            _silence(end)
            _ip("link", "set", end, "up")

    def unplug(self) -> None:
        """Delete the pair, if `plug` has created it; cannot raise."""
        if self._is_own:
            self._is_own = False
            with suppress(OSError):  # someone has deleted it
                _ip("link", "delete", self.interface)
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def _ip(*arguments: str) -> None:
    try:
        subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise OSError(
            "the program ip is not installed (Debian: apt-get install iproute2)"
        ) from None
    except subprocess.CalledProcessError as error:
        raise OSError(f"ip {' '.join(arguments)}: {error.stderr.strip()}") from error


def _silence(interface: str) -> None:
    """Switch IPv6 off: the kernel would send frames of its own on the cable."""
    setting = Path(f"/proc/sys/net/ipv6/conf/{interface}/disable_ipv6")
    if socket.has_ipv6 and os.access(setting, os.W_OK):
        setting.write_text("1", encoding="ascii")
