"""Names of users and groups of this host, for messages."""

import grp
import os
import pwd
import socket
import struct
from contextlib import suppress
from pathlib import Path

_CREDENTIALS = struct.Struct("3i")  # process, user, group


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


def peer(connection: socket.socket) -> tuple[int, int]:
    """Return the process and the user at the other end of a Unix connection."""
    size = _CREDENTIALS.size
    found = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    process, user, _ = _CREDENTIALS.unpack(found)
    return process, user


def user_name(number: int) -> str:
    """Return the name of a user, or its number."""
    with suppress(KeyError):
        return pwd.getpwuid(number).pw_name
    return str(number)
