"""Emulators in an event loop in a thread of its own, for tests with blocking clients."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from sim_plant.emulators.running import Emulator
from sim_plant.emulators.schedule import precise_loop
from sim_plant.emulators.serial_line import SerialLine, SerialLineSettings

Result = TypeVar("Result")
Kind = TypeVar("Kind", bound=Emulator)


class Stage:
    """One thread with one loop."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.loop = precise_loop()
        self._thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self._thread.start()
        self._shown: list[Emulator] = []

    def show(self, emulator: Kind) -> Kind:
        self._wait(emulator.start())
        self._shown.append(emulator)
        return emulator

    def line(self, name: str = "port", **settings: Any) -> SerialLine:
        return SerialLine(SerialLineSettings(self.folder / name, **{"baud": 115_200, **settings}))

    def do(self, call: Callable[[], Result]) -> Result:
        """Call in the loop's thread."""

        async def called() -> Result:
            return call()

        return self._wait(called())

    def end(self) -> None:
        for emulator in reversed(self._shown):
            self._wait(emulator.close())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(5.0)
        self.loop.close()

    def _wait(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(10.0)


def until(true: Callable[[], object], within: float = 5.0) -> bool:
    """Wait until a condition holds; the time limit allows for busy machines."""
    end = time.monotonic() + within
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True
