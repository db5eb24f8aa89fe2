"""Why a wire cannot even be opened, said at once and in words a person can act upon."""

import grp
import os
import pwd
import socket
from contextlib import suppress
from pathlib import Path

from drivers.canopen.bus_settings import SOCKETCAND_PORT, Bus

_PATIENCE = 1.0  # s for a TCP connection


def bus_trouble(bus: Bus) -> str:
    """Why a CAN bus is out of reach, as far as that can be seen without opening it; else empty.

    python-can itself tries a socketcand that is not there for 10 s.
    """
    options = dict(bus.options)
    if bus.interface == "socketcand":
        host, port = (
            str(options.get("host", "127.0.0.1")),
            int(options.get("port", SOCKETCAND_PORT)),
        )
        why = tcp_trouble(host, port)
        return f"no socketcand at {host}:{port}: {why}" if why else ""
    if bus.interface == "socketcan":
        return network_trouble(bus.channel)
    return ""


def unheard(bus: Bus) -> str:
    """Why a bus cannot be listened to without sending anything on it; empty if it can."""
    if bus.interface in ("socketcan", "socketcand"):
        return ""
    return (
        f"{bus.interface} gives an adapter to one program only: it cannot be listened to beside it"
    )


def network_trouble(name: str, root: Path = Path("/")) -> str:
    """Why a CAN interface of the kernel cannot be used; empty if it can."""
    folder = root / "sys/class/net" / name
    if not folder.is_dir():
        return f"the kernel has no interface {name}"
    try:
        flags = int((folder / "flags").read_text(), 16)
    except (OSError, ValueError):
        return ""
    return "" if flags & 1 else f"{name} is down"


def tcp_trouble(host: str, port: int) -> str:
    """Why nobody answers at a TCP address; empty if somebody does."""
    try:
        socket.create_connection((host, port), _PATIENCE).close()
    except TimeoutError:
        return f"no answer in {_PATIENCE:g} s"
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return ""


def port_trouble(path: str) -> str:
    """Why this user cannot open a serial port; empty if that is possible."""
    place = Path(path)
    if not place.exists():
        return "is not there" if not place.is_symlink() else "leads nowhere: unplugged"
    if not place.is_char_device():
        return "is no serial port"
    if os.access(place, os.R_OK | os.W_OK):
        return ""
    return f"may not be opened by {user()}: it belongs to {owner(place)}"


def user() -> str:
    """Who this process is."""
    return _user(os.geteuid())


def owner(place: Path) -> str:
    """User, group and rights of a file, as `root:dialout rw-rw----`."""
    seen = place.stat()
    rights = "".join(
        letter if seen.st_mode >> shift & 1 else "-"
        for shift, letter in zip(range(8, -1, -1), "rwxrwxrwx", strict=True)
    )
    return f"{_user(seen.st_uid)}:{group(seen.st_gid)} {rights}"


def group(number: int) -> str:
    """The name of a group, or its number."""
    with suppress(KeyError):
        return grp.getgrgid(number).gr_name
    return str(number)


def _user(number: int) -> str:
    with suppress(KeyError):
        return pwd.getpwuid(number).pw_name
    return str(number)
