"""The seam between the loop and whatever is on the other side of its wires."""

from typing import Any, Protocol


class Devices(Protocol):
    """All devices of a rig as the loop sees them; words are the rig kind's Sense and Command."""

    def warm_up(self, dt: float) -> None:
        """Get the wires into the step of ticks of ``dt`` (s); OSError names what does not answer.

        It is the last thing before the first tick, which comes ``dt`` after it.
        """
        ...

    def read(self, now: float) -> Any:
        """What has come since the last tick, every value with its age; never blocks.

        ``now``: planned time of the tick, s since run start.
        """
        ...

    def write(self, command: Any) -> None:
        """Send a command; it expires in the devices if the next one does not come."""
        ...

    def stop(self, reason: int) -> None:
        """Remove force and power; cannot raise, may be called again and again."""
        ...

    def close(self) -> None:
        """Release the wires."""
        ...
