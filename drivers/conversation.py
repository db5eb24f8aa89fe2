"""How a conversation and its link meet: bytes in, what they mean, bytes out, turn by turn.

A conversation owns no port and reads no clock, so a test can hold it against any peer and any
time. A link knows nothing of what it carries. `Exchange` is all there is between them.
"""

from typing import Protocol


class Port(Protocol):
    """What moves bytes: `SerialLink`, `UdpLink`, or one that spoils them on the way."""

    @property
    def opens(self) -> int:
        """How often it was opened."""
        ...

    @property
    def is_open(self) -> bool:
        """Whether bytes can go out."""
        ...

    def now(self) -> float:
        """Seconds on the monotonic clock."""
        ...

    def take(self) -> list[bytes]:
        """What has come: at most one piece of a stream, or datagrams; never waits."""
        ...

    def send(self, data: bytes) -> bool:
        """Send one message; False if it did not go out whole."""
        ...


class Conversation(Protocol):
    """What a device is told and what it said. Nothing here raises; trouble is named."""

    def opened(self, now: float) -> None:
        """The line was opened, perhaps again: what was under way is void; permission falls."""
        ...

    def take(self, data: bytes, now: float) -> None:
        """Bytes that came, split anyhow; a datagram comes whole. Empty: nothing came."""
        ...

    def speak(self, now: float) -> bytes:
        """The one message to send now; mostly empty. Called once a turn while the line is open."""
        ...

    def explain(self, now: float) -> str:
        """What is wrong, with the device's name, for people; empty if nothing is."""
        ...


class Exchange:
    """One conversation over one port."""

    def __init__(self, port: Port, conversation: Conversation) -> None:
        """Nothing is taken or sent yet."""
        self._port, self._conversation = port, conversation
        self._opens = -1  # of the port, when the conversation was last told

    def turn(self) -> float:
        """Take in what has come, then say what is to be said; gives the time of it (s)."""
        port, conversation = self._port, self._conversation
        pieces = port.take()
        now = port.now()
        if port.is_open and port.opens != self._opens:
            self._opens = port.opens
            conversation.opened(now)
        for piece in pieces:
            conversation.take(piece, now)
        if not pieces:
            conversation.take(b"", now)
        if port.is_open:
            message = conversation.speak(now)
            if message:
                port.send(message)
        return now
