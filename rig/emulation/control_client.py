"""The client of the emulated devices' control port."""

import json
import socket
from typing import Any

_ANSWER_TIMEOUT_S = 5.0  # s for an answer


class ControlError(RuntimeError):
    """A request that the emulated devices refuse; the message has the reason."""


class ControlClient:
    """One connection to the emulated devices."""

    def __init__(self, address: str) -> None:
        """``address``: HOST:PORT, as the devices report it. OSError if no device answers."""
        host, _, port = address.rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=_ANSWER_TIMEOUT_S)
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> "ControlClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def request(self, kind: str, **arguments: Any) -> dict[str, Any]:
        """Send a request and return its answer; ControlError if it is refused, OSError if lost."""
        self._socket.sendall(json.dumps({"request": kind, **arguments}).encode() + b"\n")
        line = self._lines.readline()
        if not line:
            raise OSError("the emulated devices closed the connection")
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
        """Switch a fault and return the time (s on the monotonic clock)."""
        arguments = {"device": device, "fault": fault, "on": on, "value": value, "toward": toward}
        return float(self.request("switch", **arguments)["at"])

    def close(self) -> None:
        """Close the connection."""
        self._lines.close()
        self._socket.close()
