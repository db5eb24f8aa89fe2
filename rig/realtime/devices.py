"""The interface between the loop and the devices of a rig."""

from typing import Any, Protocol


class Devices(Protocol):
    """All devices of a rig; the rig kind defines the types of its Sense and Command."""

    def warm_up(self, dt: float) -> None:
        """Synchronise the wires with ticks of ``dt`` (s); raise OSError naming a silent device.

        The loop calls it last before the first tick, which comes ``dt`` after it.
        """
        ...

    def read(self, now: float) -> Any:
        """Return the values that arrived since the last tick, each with its age; never block.

        ``now``: planned time of the tick, s since run start.
        """
        ...

    def write(self, command: Any) -> None:
        """Send a command; it expires in the devices unless the next one follows."""
        ...

    def stop(self, reason: int) -> None:
        """Remove force and power; never raise; the loop may call it repeatedly."""
        ...

    def close(self) -> None:
        """Release the wires."""
        ...
