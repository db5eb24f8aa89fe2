"""The asking end of the emulated devices' control port."""

import json
import socket
from types import TracebackType
from typing import Any

_PATIENCE = 5.0  # s for an answer


class ControlError(RuntimeError):
    """A request that the emulated devices cannot heed; says why."""


class ControlClient:
    """One conversation with the emulated devices."""

    def __init__(self, address: str) -> None:
        """``address``: HOST:PORT, as the devices told it. OSError if nobody is there."""
        host, _, port = address.rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=_PATIENCE)
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> "ControlClient":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def ask(self, what: str, **words: Any) -> dict[str, Any]:
        """One request and its answer; ControlError if it is refused, OSError if nobody is there."""
        self._socket.sendall(json.dumps({"ask": what, **words}).encode() + b"\n")
        line = self._lines.readline()
        if not line:
            raise OSError("the emulated devices hung up")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ControlError(str(answer["error"]))
        return answer

    def switch(
        self,
        device: str,
        fault: str,
        on: bool = True,
        value: float | None = None,
        toward: str | None = None,
    ) -> float:
        """Switch a fault; gives when (s on the monotonic clock)."""
        words = {"device": device, "fault": fault, "on": on, "value": value, "toward": toward}
        return float(self.ask("switch", **words)["at"])

    def close(self) -> None:
        """Hang up."""
        self._lines.close()
        self._socket.close()
