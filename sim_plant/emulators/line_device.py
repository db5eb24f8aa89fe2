"""What every emulated device on a serial line has in common: it is there as long as its line."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sim_plant.emulators.background import Background
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.serial_line import SerialLine


class LineDevice(ABC):
    """A line and what the device does on it by itself."""

    def __init__(self, line: SerialLine) -> None:
        """`line` is offered with `start`."""
        self.line = line
        self._work = Background()

    @property
    def address(self) -> str:
        """The path a host opens."""
        return self.line.address

    @property
    def link(self) -> LinkFaults:
        """The faults of the line."""
        return self.line.link

    async def start(self) -> None:
        """Offer the line and begin to work."""
        await self.line.start()
        self._work.start(self._tend())

    async def close(self) -> None:
        """Take the line away."""
        await self._work.stop()
        await self.line.close()

    @abstractmethod
    async def _tend(self) -> None:
        """Do what needs no request, until it is cancelled."""
