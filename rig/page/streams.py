"""Live streams of a run for other tools, from the rows that the page reads.

PlotJuggler takes UDP datagrams with one JSON object each; Foxglove connects to a WebSocket and gets
each row in the encoding of the run's MCAP file. Neither is ever waited for: a datagram that the
kernel does not take is lost, and the Foxglove server leaves out messages of a slow client.
"""

import json
import socket
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

import numpy as np

from rig.page.tap import Rows
from rig.recording.row_layout import Leaf, RowSchema

TOPIC = "/rows"
BACKLOG = 2048  # messages of a client that wait: two seconds of a loop of 1 kHz
_CDR_HEADER = b"\x00\x01\x00\x00"  # little-endian
_NS = 10**9


class StreamError(ValueError):
    """A stream cannot be opened; the message says why."""


class Stream(Protocol):
    """A receiver of rows that is never waited for."""

    def send(self, rows: Rows) -> None:
        """Send rows, oldest first."""

    def close(self) -> None:
        """End the stream."""


class PlotJuggler:
    """UDP datagrams of JSON for PlotJuggler's streaming plug-in "UDP Server".

    Each has the fields of a row as nested objects, and its time as `timestamp` (s of the run).
    Numbers that JSON does not have (NaN, infinity) are left out.
    """

    def __init__(self, address: str, leaves: Sequence[Leaf], rate_hz: float, dt: float) -> None:
        """``address``: HOST:PORT; ``rate_hz``: of the rows to send, of those every ``dt`` (s).

        StreamError for an address that is none.
        """
        host, _, port = address.rpartition(":")
        try:
            found = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_DGRAM)
        except (OSError, ValueError) as error:
            raise StreamError(f"{address}: not HOST:PORT of a receiver: {error}") from None
        family, self._target = found[0][0], found[0][4]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._every = max(1, round(1.0 / (rate_hz * dt)))
        self._paths = [leaf.name.split(".") for leaf in leaves]
        self._time = [leaf.name for leaf in leaves].index("time")
        self.lost = 0  # datagrams that the kernel did not take

    def send(self, rows: Rows) -> None:
        """Send the rows whose tick is a multiple of the interval."""
        for row in rows[rows[:, 0] % self._every == 0].tolist():
            data = json.dumps({"timestamp": row[self._time]} | self._nested(row)).encode()
            try:
                self._socket.sendto(data, self._target)
            except OSError:  # full, nobody there, or too long: the next one may arrive
                self.lost += 1

    def close(self) -> None:
        """End the stream."""
        self._socket.close()

    def _nested(self, row: Sequence[float]) -> dict[str, Any]:
        tree: dict[str, Any] = {}
        for path, value in zip(self._paths, row, strict=True):
            if value - value != 0.0:
                continue
            branch = tree
            for name in path[:-1]:
                branch = branch.setdefault(name, {})
            branch[path[-1]] = value
        return tree


class Foxglove:
    """A WebSocket server for Foxglove, on this computer alone, that can only be listened to."""

    def __init__(self, port: int, schema: RowSchema, start_utc_ns: Callable[[], int]) -> None:
        """``start_utc_ns`` returns the UTC of run time zero, once there are rows.

        StreamError if foxglove-sdk is not installed, or the port is taken.
        """
        try:
            import foxglove  # noqa: PLC0415  (an extra)
        except ImportError:
            raise StreamError(
                "foxglove-sdk is not installed; `pip install wec-rig[foxglove]` adds it"
            ) from None
        leaves = schema.leaves
        self._time = [leaf.name for leaf in leaves].index("time")
        self._counts = [at for at, leaf in enumerate(leaves) if leaf.code == "q"]
        self._start = start_utc_ns
        context = self._context = foxglove.Context()  # its end would close the channel
        form = foxglove.Schema(name=schema.name, encoding="ros2msg", data=schema.text.encode())
        self._channel = foxglove.Channel(
            TOPIC, schema=form, message_encoding="cdr", context=context
        )
        try:
            self._server = foxglove.start_server(
                name="wec-rig",
                host="127.0.0.1",
                port=port,
                context=context,
                message_backlog_size=BACKLOG,
            )
        except (OSError, RuntimeError) as error:
            raise StreamError(f"port {port} for Foxglove: {error}") from None
        self.port = int(self._server.port)

    def send(self, rows: Rows) -> None:
        """Send all rows."""
        packed = np.ascontiguousarray(rows, "<f8").copy()
        packed.view("<i8")[:, self._counts] = rows[:, self._counts].astype("<i8")
        start = self._start()
        for row, time in zip(packed, rows[:, self._time].tolist(), strict=True):
            self._channel.log(_CDR_HEADER + row.tobytes(), log_time=start + round(time * _NS))

    def close(self) -> None:
        """End the stream."""
        with suppress(Exception):
            self._server.stop()
