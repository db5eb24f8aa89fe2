"""Base class of the emulated devices on a serial line; a device exists as long as its line."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_plant.emulators.background import BackgroundTask
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.serial_line import SerialLine


class LineDevice(ABC):
    """A serial line and the device's own activity on it."""

    def __init__(self, line: SerialLine) -> None:
        """`line` is opened by `start`."""
        self.line = line
        self._task = BackgroundTask()

    @property
    def address(self) -> str:
        """The path a host opens."""
        return self.line.address

    @property
    def link(self) -> LinkFaults:
        """The faults of the line."""
        return self.line.link

    async def start(self) -> None:
        """Open the line and start the device's task."""
        await self.line.start()
        self._task.start(self._poll_loop())

    async def close(self) -> None:
        """Stop the task and close the line."""
        await self._task.stop()
        await self.line.close()

    @abstractmethod
    async def _poll_loop(self) -> None:
        """Perform the device's periodic work until cancelled."""
