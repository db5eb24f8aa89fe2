"""A client of a run's socket: asks, and reads the answers; it also gets the ring to read."""

import array
import json
import os
import socket
import threading
from pathlib import Path
from typing import Any

from rig.people.request_socket import MAX_CLIENTS, MAX_LINE, VERSION, short_path

TIMEOUT_S = 10.0


class RequestError(OSError):
    """The run does not answer; the message says why."""


class RequestClient:
    """A connection to the socket in a run's folder; its methods may be called from threads."""

    def __init__(self, folder: Path, session: str = "", person: str = "", origin: str = "command"):
        """``session``: names one page or command; ``person``: a name beside that of the user.

        Raises RequestError if the run does not listen.
        """
        self._folder = folder
        self._own = {"session": session, "person": person, "origin": origin}
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(TIMEOUT_S)
        self._lock = threading.Lock()
        self._waiting = b""
        try:
            with short_path(folder) as path:
                self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            raise RequestError(f"{folder}: the run does not listen: {error.strerror}") from None

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def ask(self, name: str, *, viewer: bool = False, **arguments: Any) -> dict[str, Any]:
        """Send a request and return the answer; RequestError if none comes."""
        return self._exchange(name, viewer, arguments)[0]

    def hello(self) -> tuple[dict[str, Any], int]:
        """Return the facts of the run, and a descriptor of its ring that can only be read."""
        answer, descriptors = self._exchange("hello", False, {})
        if not descriptors:
            raise RequestError("the run sent no descriptor of its rows")
        return answer, descriptors[0]

    def _exchange(
        self, name: str, viewer: bool, arguments: dict[str, Any]
    ) -> tuple[dict[str, Any], list[int]]:
        message = {"v": VERSION, "ask": name, "viewer": viewer, "arguments": arguments} | self._own
        with self._lock:
            try:
                self._socket.sendall((json.dumps(message) + "\n").encode())
                line, descriptors = self._receive()
                answer = json.loads(line)
            except TimeoutError:
                raise RequestError(f"no answer of the run within {TIMEOUT_S:g} s") from None
            except (OSError, EOFError):  # a broken pipe, a reset, a closed socket
                raise RequestError(self._why_closed()) from None
            except ValueError:
                answer = None
        if not isinstance(answer, dict):
            raise RequestError("the answer of the run cannot be read")
        return answer, descriptors

    def _why_closed(self) -> str:
        """Return why the run has closed the connection: one that still listens has not ended."""
        try:
            RequestClient(self._folder).close()
        except RequestError:
            return "the run has ended"
        return (
            f"the run closed this connection: it has more than {MAX_CLIENTS} clients, or could not "
            f"read the last message (JSON, at most {MAX_LINE} bytes); connect anew"
        )

    def _receive(self) -> tuple[bytes, list[int]]:
        received: list[int] = []
        size = array.array("i").itemsize
        while b"\n" not in self._waiting:
            data, extra, _, _ = self._socket.recvmsg(MAX_LINE, socket.CMSG_SPACE(size))
            if not data:
                raise EOFError
            for level, kind, rights in extra:
                if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
                    received += array.array("i", rights[: len(rights) // size * size])
            self._waiting += data
        line, _, self._waiting = self._waiting.partition(b"\n")
        for each in received:
            os.set_inheritable(each, False)
        return line, received
