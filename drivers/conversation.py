"""Interfaces of a conversation (device protocol) and its port, and the loop that joins them.

A conversation owns no port and reads no clock, so a test can run it against any peer at any time.
A link knows nothing about the meaning of its bytes. `Exchange` connects the two.
"""

from typing import Protocol


class Port(Protocol):
    """A transport of bytes: `SerialLink`, `UdpLink`, or a test port that injects faults."""

    @property
    def open_count(self) -> int:
        """Return how often the port was opened."""
        ...

    @property
    def is_open(self) -> bool:
        """Return True while bytes can be sent."""
        ...

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        ...

    def receive(self) -> list[bytes]:
        """Return the received bytes: at most one piece of a stream, or datagrams; never wait."""
        ...

    def send(self, data: bytes) -> bool:
        """Send one message; return False if it was not sent completely."""
        ...


class Conversation(Protocol):
    """The protocol with one device. No method raises; `explain` reports problems."""

    def on_open(self, now: float) -> None:
        """Reset after the port was opened: discard partial messages, withdraw permission to act."""
        ...

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes, split anywhere (a datagram is whole); empty if none came."""
        ...

    def next_message(self, now: float) -> bytes:
        """Return the message to send now, often empty; called each step while the port is open."""
        ...

    def explain(self, now: float) -> str:
        """Return the current problem with the device's name, for people; empty if there is none."""
        ...


class Exchange:
    """Runs one conversation over one port."""

    def __init__(self, port: Port, conversation: Conversation) -> None:
        """Store the two; `step` starts the transfer."""
        self._port, self._conversation = port, conversation
        self._seen_open_count = -1  # of the port, at the last call of on_open

    def step(self) -> float:
        """Process received bytes, send the next message, and return the time of this step (s)."""
        port, conversation = self._port, self._conversation
        pieces = port.receive()
        now = port.now()
        if port.is_open and port.open_count != self._seen_open_count:
            self._seen_open_count = port.open_count
            conversation.on_open(now)
        for piece in pieces:
            conversation.receive(piece, now)
        if not pieces:
            conversation.receive(b"", now)
        if port.is_open:
            message = conversation.next_message(now)
            if message:
                port.send(message)
        return now
