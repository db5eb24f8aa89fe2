"""The socket of a run: requests of people in, answers and the ring's descriptor out.

A Unix socket in the run's folder, for this user and root alone. A client sends one JSON object a
line, `{"v": 1, "ask": NAME, ...}`, and gets one line for each:

    hello    run, folder, mode, schema and process; with it the descriptor of the ring, to read only
    state    the state of the orders (`rig.people.orders.Orders.describe`)
    columns  the columns of set points that people may choose
    others   a request of `rig.people.orders`, with `arguments`

A client that sends nonsense, too much at once, or does not read its answers is cut off.
"""

import array
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rig import finite_json
from rig.people.orders import CAMPAIGN, Answer, Asker, Orders
from rig.recording.runs.folder import SOCKET
from rig.user_names import peer, user_name

VERSION = 1
MAX_LINE = 65_536  # bytes
MAX_CLIENTS = 32
MAX_REQUESTS_PER_S = 10  # that may change something, of a client; stop and power off always pass
SEND_TIMEOUT_S = 2.0
_UNLIMITED = ("stop", "abort", "beat", "take_seat", "leave_seat", "state", "hello", "columns")


@contextmanager
def short_path(folder: Path) -> Iterator[str]:
    """Yield a path of the socket that fits into the 108 characters of a socket's address."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{descriptor}/{SOCKET}"
    finally:
        os.close(descriptor)


class RequestServer:
    """Serves the socket in threads of its own."""

    def __init__(self, folder: Path, orders: Orders, facts: Mapping[str, Any], ring: int) -> None:
        """``facts``: for `hello`; ``ring``: descriptor, of which clients get one to read only.

        Raises OSError if the socket cannot be made.
        """
        self._folder, self._orders, self._facts = folder, orders, dict(facts)
        self._ring = os.open(f"/proc/self/fd/{ring}", os.O_RDONLY | os.O_CLOEXEC)
        self._clients: dict[socket.socket, float] = {}  # when each was heard last, s
        self._closed = False
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            with short_path(folder) as path:
                with suppress(FileNotFoundError):
                    os.unlink(path)
                os.fchmod(self._listener.fileno(), 0o600)  # bind gives this mode to the file
                self._listener.bind(path)
            self._listener.listen(128)
        except OSError:
            self._listener.close()
            os.close(self._ring)
            raise
        self._thread("requests", self._accept)

    def close(self) -> None:
        """Close the socket and all connections."""
        self._closed = True
        for each in (self._listener, *self._clients):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        with suppress(OSError):
            (self._folder / SOCKET).unlink()
        os.close(self._ring)

    def _thread(self, name: str, target: Callable[..., None], *arguments: Any) -> None:
        threading.Thread(target=target, args=arguments, name=name, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:  # closed; or no descriptor is left, for a while
                if self._closed:
                    return
                time.sleep(SEND_TIMEOUT_S)
                continue
            if len(self._clients) >= MAX_CLIENTS:  # the one that is silent for longest makes room
                silent = min(self._clients.copy().items(), key=lambda item: item[1])[0]
                self._clients.pop(silent, None)
                with suppress(OSError):
                    silent.shutdown(socket.SHUT_RDWR)
            self._clients[client] = time.monotonic()
            self._thread("client", self._serve, client)

    def _serve(self, client: socket.socket) -> None:
        try:
            client.settimeout(SEND_TIMEOUT_S)
            person = _person(client)
            if person:
                self._converse(client, person)
            else:
                client.recv(MAX_LINE)  # closing on unread data would discard the answer
                client.sendall(_line(_refusal("this run is another user's")))
        except (OSError, ValueError, RecursionError):
            pass  # the client is gone, or sends nonsense
        finally:
            self._clients.pop(client, None)
            client.close()

    def _converse(self, client: socket.socket, person: str) -> None:
        recent: deque[float] = deque(maxlen=MAX_REQUESTS_PER_S)
        for line in _lines(client):
            if client in self._clients:
                self._clients[client] = time.monotonic()
            try:
                answer, ring = self._reply(finite_json.loads(line), person, recent)
            except finite_json.NotFiniteError as error:
                answer, ring = _refusal(str(error)), False
            data = _line(answer)
            if ring:
                descriptors = array.array("i", [self._ring])
                rights = (socket.SOL_SOCKET, socket.SCM_RIGHTS, descriptors)
                sent = client.sendmsg([data], [rights])
                data = data[sent:]
            client.sendall(data)

    def _reply(
        self, message: Any, person: str, recent: deque[float]
    ) -> tuple[dict[str, Any], bool]:
        if not isinstance(message, dict) or message.get("v") != VERSION:
            return _refusal(f"not a message of version {VERSION}"), False
        name = message.get("ask")
        if name == "hello":
            return {"v": VERSION, "accepted": True, **self._facts}, True
        if name == "state":
            return {"v": VERSION, "accepted": True, **self._orders.describe()}, False
        if name == "columns":
            return {"v": VERSION, "accepted": True, "columns": self._orders.columns()}, False
        now = time.monotonic()
        if name not in _UNLIMITED:
            if len(recent) == recent.maxlen and now - recent[0] < 1.0:
                return _refusal(f"at most {MAX_REQUESTS_PER_S} requests a second"), False
            recent.append(now)
        arguments = message.get("arguments", {})
        if not isinstance(name, str) or not isinstance(arguments, dict):
            return _refusal("not a request"), False
        asker = Asker(
            str(message.get("session", ""))[:64],
            _name(message.get("person"), person),
            message["origin"] if message.get("origin") in ("page", CAMPAIGN) else "command",
            message.get("viewer") is True,
        )
        answer: Answer = self._orders.ask(asker, name, arguments)
        return {"v": VERSION, **answer._asdict()}, False


def _refusal(reason: str) -> dict[str, Any]:
    return {"v": VERSION, "accepted": False, "reason": reason}


def _line(answer: dict[str, Any]) -> bytes:
    return (finite_json.dumps(answer) + "\n").encode()


def _name(given: Any, person: str) -> str:
    """Return the name of a person: that of the user, with the name that a page gives."""
    text = given.strip()[:40] if isinstance(given, str) else ""
    return f"{text} ({person})" if text and text != person else person


def _person(client: socket.socket) -> str:
    """Return the user of a client; empty for one who is neither this user nor root."""
    _, user = peer(client)
    if user not in (0, os.getuid()):
        return ""
    name = user_name(user)
    return f"user {name}" if name == str(user) else name


def _lines(client: socket.socket) -> Iterator[bytes]:
    """Yield the lines of a client; ValueError for one that is too long."""
    waiting = b""
    while True:
        try:
            data = client.recv(MAX_LINE)
        except TimeoutError:
            continue  # it has nothing to say
        if not data:
            return
        *lines, waiting = (waiting + data).split(b"\n")
        yield from lines
        if len(waiting) > MAX_LINE:
            raise ValueError("the line is too long")
