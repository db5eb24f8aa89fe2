"""All emulators of a rig in one asyncio process."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Protocol

from sim_plant.emulators.link_faults import LinkFaults


class Emulator(Protocol):
    """What every emulator offers, whatever it speaks; its `faults` are those of its devices."""

    @property
    def address(self) -> str:
        """What a host opens: a path, or host and port."""
        ...

    @property
    def link(self) -> LinkFaults:
        """The faults of its link."""
        ...

    async def start(self) -> None:
        """Be there."""
        ...

    async def close(self) -> None:
        """Be gone."""
        ...


@asynccontextmanager
async def running(emulators: Mapping[str, Emulator]) -> AsyncIterator[dict[str, str]]:
    """Start all, give the address of each by name, and close all in the end, whatever happens."""
    async with AsyncExitStack() as stack:
        for emulator in emulators.values():
            stack.push_async_callback(emulator.close)  # also of one that starts by half
            await emulator.start()
        yield {name: emulator.address for name, emulator in emulators.items()}
