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
from rig.wires.can_axes import CanAxes

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

    def mark(self) -> None:
        """Store the present time."""
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

    def to_bytes(self) -> bytes:
        """Return the times of all complete ticks."""
        return self._times[: self._count - self._count % STAMPS].tobytes()


class TimedDevices:
    """The devices of a WaveBot; from the warm-up to the first stop each tick is stamped."""

    def __init__(self, wired: Any, can: CanAxes) -> None:
        self._devices, self._can, self._stamps = wired, can, Stamps()
        self._times: bytes | None = None  # of all ticks, once the loop has ended

    def warm_up(self, dt: float) -> None:
        self._devices.warm_up(dt)
        bus, receive = self._can._bus, self._can.receive
        link: Any = bus._link

        def timed_receive() -> float:
            time = receive()
            mark()
            return time

        mark = self._stamps.mark
        self._can.receive = timed_receive  # type: ignore[method-assign]
        link.drain = self._stamps.around(link.drain)
        bus.send = self._stamps.around(bus.send)  # type: ignore[method-assign]

    def read(self, now: float) -> Any:
        self._stamps.mark()
        sense = self._devices.read(now)
        self._stamps.mark()
        return sense

    def write(self, command: Any) -> None:
        self._stamps.mark()
        self._devices.write(command)
        self._stamps.mark()

    def stop(self, reason: int) -> None:
        if self._times is None:
            self._times = self._stamps.to_bytes()
        self._devices.stop(reason)

    def close(self) -> None:
        self._devices.close()
        Path(os.environ[STAMPS_FILE]).write_bytes(self._times or b"")


def connect(config: dict[str, Any], dt: float) -> TimedDevices:
    """Return the stamped devices for a configuration of `rig.kinds.wavebot.hardware.job`."""
    wired = devices.connect(config, dt)
    return TimedDevices(wired, wired._can)
