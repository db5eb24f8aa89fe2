"""Survey of the servo drive: read its name, status and current without writing anything."""

from typing import Any, NamedTuple

from drivers.compax3 import objects
from drivers.compax3.codec import error_number
from drivers.compax3.requests import Requests
from drivers.errors import CodecError
from rig.wires.streams import servo_settings


class ServoIdentity(NamedTuple):
    """Identity and state as the drive reports them."""

    name: str
    status: objects.Status
    current: float  # A
    error: int  # its number; `objects.NO_ERROR` for none


class ServoIdentification:
    """The conversation of one survey; finished when `identity` is set."""

    def __init__(self, config: dict[str, Any]) -> None:
        """``config``: as for `rig.wires.streams.servo_stream`.

        CodecError for impossible values.
        """
        settings = servo_settings(config)
        channels = (settings.status, *settings.actual)
        self.identity: ServoIdentity | None = None
        self.requests = Requests(
            settings.name, settings.address, settings.identity, settings.timing
        )
        self._name = settings.name
        self._channels = (channels, (settings.error,))
        self._requests = tuple(objects.encode_read(one, settings.address) for one in self._channels)
        self._values: list[float] = []
        self._refused = ""

    def on_open(self, now: float) -> None:
        """Begin with the request for the drive's name."""
        self.requests.on_open(now)
        self._values = []

    def receive(self, data: bytes, now: float) -> None:
        """Process an answer or a part of one."""
        answer = self.requests.receive(data, now)
        if answer is None:
            return
        if code := error_number(answer):
            self._refused = f"actual values refused: {objects.error_name(code)}"
            return
        try:
            self._values += objects.decode_actual_values(
                self._channels[1 if self._values else 0], answer
            )
            if len(self._values) == 3:
                status_word, current, error = self._values
                status = objects.decode_status(status_word)
                self.identity = ServoIdentity(self.requests.name, status, current, int(error))
        except CodecError as error:
            self._values = []
            self.requests.distrust(now, str(error))

    def next_message(self, now: float) -> bytes:
        """Return the next request."""
        data = self.requests.recovery_message(now, b"")
        if data or not self.requests.is_ready or self.identity is not None or self._refused:
            return data
        return self.requests.begin_request(self._requests[1 if self._values else 0], now)

    def explain(self, now: float) -> str:
        """Return why there is no identity; empty if nothing is wrong."""
        trouble = self.requests.problem or self._refused
        return f"{self._name}: {trouble}" if trouble else ""
