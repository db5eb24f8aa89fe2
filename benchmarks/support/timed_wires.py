"""A wired WaveBot's devices with time stamps between the parts of a tick, for the loop process.

`benchmarks.hil_tick` names this module in place of `rig.kinds.wavebot.hardware.devices`. The
devices are those of a run; only the calls between their parts are stamped. `close` writes the
stamps to the file that the environment variable `STAMPS_FILE` names.
"""

import os
from array import array
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns
from typing import Any

from rig.kinds.wavebot.hardware import devices
from rig.kinds.wavebot.hardware.devices import WaveBotDevices

STAMPS_FILE = "WEC_RIG_TICK_STAMPS"
MAX_TICKS = 200_000
# Each part lasts from one stamp to the next. Between `read` and `write` the loop runs the step.
PARTS = (
    "mailboxes",
    "read CAN frames",
    "decode frames",
    "sense",
    "compiled step",
    "encode commands",
    "send CAN frames",
    "outputs mailbox",
)
STAMPS = len(PARTS) + 1


class Stamps:
    """The times (ns) of all ticks, in memory that is reserved before the first one."""

    def __init__(self) -> None:
        self._times = array("q", bytes(8 * STAMPS * MAX_TICKS))
        self._count = 0
        self._paused = False

    def mark(self) -> None:
        """Store the present time."""
        if self._paused:
            return
        self._times[self._count] = perf_counter_ns()
        self._count += 1

    def around(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same, with a stamp before and after it."""

        def timed(*arguments: Any) -> Any:
            self.mark()
            result = call(*arguments)
            self.mark()
            return result

        return timed

    def without(self, call: Callable[[float], None]) -> Callable[[float], None]:
        """Return a function that does the same without stamps."""

        def unstamped(now: float) -> None:
            self._paused = True
            call(now)
            self._paused = False

        return unstamped

    def to_bytes(self) -> bytes:
        """Return the times of all complete ticks."""
        return self._times[: self._count - self._count % STAMPS].tobytes()


def connect(config: dict[str, Any], dt: float) -> WaveBotDevices:
    """Return the stamped devices for a configuration of `rig.kinds.wavebot.hardware.job`.

    From the warm-up to the first stop each tick is stamped.
    """
    wired, stamps = devices.connect(config, dt), Stamps()
    changed: Any = wired
    warm_up, stop, close = wired.warm_up, wired.stop, wired.close
    times: bytes | None = None  # of all ticks, once the loop has ended

    def stamp_from_here(dt: float) -> None:
        warm_up(dt)
        bus, receive = changed._drives._bus, changed._drives.receive

        def timed_receive() -> float:
            time: float = receive()
            stamps.mark()
            return time

        changed._drives.receive = timed_receive
        bus._link.drain = stamps.around(bus._link.drain)
        bus.send = stamps.around(bus.send)
        changed.read_in_place = stamps.around(wired.read_in_place)
        changed.prepare = stamps.without(wired.prepare)
        changed.write_in_place = stamps.around(wired.write_in_place)

    def first_stop(reason: int) -> None:
        nonlocal times
        if times is None:
            times = stamps.to_bytes()
        stop(reason)

    def write_and_close() -> None:
        close()
        Path(os.environ[STAMPS_FILE]).write_bytes(times or b"")

    changed.warm_up, changed.stop, changed.close = stamp_from_here, first_stop, write_and_close
    return wired
