"""Quick checks why a wire cannot be opened, with messages on which a person can act."""

import grp
import os
import pwd
import socket
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path

from drivers.canopen.bus_settings import BusSettings

_TCP_TIMEOUT_S = 1.0  # s for a TCP connection


def bus_problem(bus: BusSettings) -> str:
    """Return why a CAN bus is out of reach, without opening it; empty if no reason is found.

    python-can itself would try to reach an absent socketcand for 10 s.
    """
    if bus.interface == "socketcand":
        host, port = bus.endpoint
        why = tcp_problem(host, port)
        return f"no socketcand at {host}:{port}: {why}" if why else ""
    if bus.interface == "socketcan":
        return network_problem(bus.channel)
    return ""


def listening_problem(bus: BusSettings) -> str:
    """Return why a program cannot listen to a bus without sending on it; empty if it can."""
    if bus.interface in ("socketcan", "socketcand"):
        return ""
    return (
        f"{bus.interface} gives an adapter to one program only: no other program can listen to it"
    )


def network_problem(name: str, root: Path = Path("/")) -> str:
    """Return why a CAN interface of the kernel cannot be used; empty if it can."""
    folder = root / "sys/class/net" / name
    if not folder.is_dir():
        return f"the kernel has no interface {name}"
    try:
        flags = int((folder / "flags").read_text(), 16)
    except (OSError, ValueError):
        return ""
    return "" if flags & 1 else f"{name} is down"


def tcp_problem(host: str, port: int) -> str:
    """Return why no server answers at a TCP address; empty if one does."""
    try:
        socket.create_connection((host, port), _TCP_TIMEOUT_S).close()
    except TimeoutError:
        return f"no answer in {_TCP_TIMEOUT_S:g} s"
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return ""


def is_loopback(host: str) -> bool:
    """Return whether an address or `localhost` leads to this host itself."""
    if host == "localhost":
        return True
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return False


def port_problem(path: str) -> str:
    """Return why this user cannot open a serial port; empty if this user can."""
    port = Path(path)
    if not port.exists():
        return "is not there" if not port.is_symlink() else "leads nowhere: unplugged"
    if not port.is_char_device():
        return "is no serial port"
    if os.access(port, os.R_OK | os.W_OK):
        return ""
    return f"may not be opened by {current_user()}: it belongs to {file_owner(port)}"


def current_user() -> str:
    """Return the name of this process's user."""
    return user_name(os.geteuid())


def file_owner(port: Path) -> str:
    """Return user, group and rights of a file, as `root:dialout rw-rw----`."""
    status = port.stat()
    rights = "".join(
        letter if status.st_mode >> shift & 1 else "-"
        for shift, letter in zip(range(8, -1, -1), "rwxrwxrwx", strict=True)
    )
    return f"{user_name(status.st_uid)}:{group_name(status.st_gid)} {rights}"


def group_name(number: int) -> str:
    """Return the name of a group, or its number."""
    with suppress(KeyError):
        return grp.getgrgid(number).gr_name
    return str(number)


def user_name(number: int) -> str:
    """Return the name of a user, or its number."""
    with suppress(KeyError):
        return pwd.getpwuid(number).pw_name
    return str(number)
