"""A look at the servo drive that writes nothing: its name, its status, its current."""

from typing import Any, NamedTuple

from drivers.compax3 import objects
from drivers.compax3.codec import refusal
from drivers.compax3.requests import Requests
from drivers.errors import CodecError
from rig.execution.hardware.streams import servo_settings


class ServoIdentity(NamedTuple):
    """What the drive said."""

    name: str
    status: objects.Status
    current: float  # A
    error: int  # its number; `objects.NO_ERROR` for none


class ServoLook:
    """The conversation of one look; over when `told` is there."""

    def __init__(self, told: dict[str, Any]) -> None:
        """``told``: as `rig.execution.hardware.streams.servo` takes it.

        CodecError for what cannot be.
        """
        settings = servo_settings(told)
        channels = (settings.status, *settings.actual)
        self.told: ServoIdentity | None = None
        self.requests = Requests(
            settings.name, settings.address, settings.identity, settings.timing
        )
        self._name = settings.name
        self._parts = (channels, (settings.error,))
        self._questions = tuple(objects.ask(one, settings.address) for one in self._parts)
        self._values: list[float] = []
        self._refused = ""

    def opened(self, now: float) -> None:
        """Begin with its name."""
        self.requests.opened(now)
        self._values = []

    def take(self, data: bytes, now: float) -> None:
        """An answer, or a part of one."""
        answer = self.requests.take(data, now)
        if answer is None:
            return
        if code := refusal(answer):
            self._refused = f"actual values refused: {objects.error_name(code)}"
            return
        try:
            self._values += objects.actual_values(self._parts[1 if self._values else 0], answer)
            if len(self._values) == 3:
                word, current, error = self._values
                status = objects.status(word)
                self.told = ServoIdentity(self.requests.name, status, current, int(error))
        except CodecError as error:
            self._values = []
            self.requests.doubt(now, str(error))

    def speak(self, now: float) -> bytes:
        """The next question."""
        said = self.requests.upkeep(now, b"")
        if said or not self.requests.free or self.told is not None or self._refused:
            return said
        return self.requests.ask(self._questions[1 if self._values else 0], now)

    def explain(self, now: float) -> str:
        """Why there is nothing, or what it says of itself."""
        trouble = self.requests.trouble or self._refused
        return f"{self._name}: {trouble}" if trouble else ""
