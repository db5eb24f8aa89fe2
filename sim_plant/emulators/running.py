"""All emulators of a rig in one asyncio process."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Protocol

from sim_plant.emulators.link_faults import LinkFaults


class Emulator(Protocol):
    """Interface of every emulator, whatever its protocol; its `faults` are those of its devices."""

    @property
    def address(self) -> str:
        """Address for a host: a path, or host and port."""
        ...

    @property
    def link(self) -> LinkFaults:
        """The faults of its link."""
        ...

    async def start(self) -> None:
        """Start the emulator and open its address."""
        ...

    async def close(self) -> None:
        """Stop the emulator and close its address."""
        ...


@asynccontextmanager
async def running(emulators: Mapping[str, Emulator]) -> AsyncIterator[dict[str, str]]:
    """Start all emulators, yield their addresses by name, and close all at the end in any case."""
    async with AsyncExitStack() as stack:
        for emulator in emulators.values():
            stack.push_async_callback(emulator.close)  # also if its start fails
            await emulator.start()
        yield {name: emulator.address for name, emulator in emulators.items()}
