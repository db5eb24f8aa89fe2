"""Time stamps at the loop's calls of devices and ring, which split a tick into parts.

The parts add up to the whole tick, and the loop itself is not changed. They include the cost of the
stamps, which is the difference between a loop with stamps and one without.
"""

from array import array
from collections.abc import Callable
from time import perf_counter_ns
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.realtime.devices import Devices, FlatDevices, PackedDevices
from rig.realtime.tick_memory import FlatMemory
from rig.recording.ring import RingWriter

# The loop reads the devices, runs the cycle, writes, puts the row; the rest is clock and mailbox.
PARTS = ("plant", "cycle", "ring", "rest")


class Stamps:
    """Six times of every tick, in nanoseconds."""

    def __init__(self) -> None:
        self.times = array("q")

    def tick_times(self, first: int) -> "TickTimes":
        """Return the microseconds of each part by tick, from tick ``first`` >= 1 on."""
        ticks = len(self.times) // 6
        at = np.frombuffer(self.times, dtype=np.int64)[: 6 * ticks].reshape(-1, 6) / 1e3
        reading, stepping, writing = at[:, 1] - at[:, 0], at[:, 2] - at[:, 1], at[:, 3] - at[:, 2]
        putting = at[:, 5] - at[:, 4]
        rest = (at[1:, 0] - at[:-1, 5]) + (at[1:, 4] - at[1:, 3])
        return TickTimes(
            (reading + writing)[first:], stepping[first:], putting[first:], rest[first - 1 :]
        )


class TickTimes(NamedTuple):
    """Microseconds of each part of a tick, one entry a tick."""

    plant: npt.NDArray[np.float64]
    cycle: npt.NDArray[np.float64]
    ring: npt.NDArray[np.float64]
    rest: npt.NDArray[np.float64]  # waiting for the clock included


class TimedDevices(FlatDevices):
    """A simulated plant's devices with a time stamp before and after reading and writing.

    As with devices on wires, a compiled tick finds its readings in memory and leaves its command
    there: what the plant takes for this is part of its own time.
    """

    def __init__(self, devices: Devices, stamps: Stamps) -> None:
        self._devices, self._stamps = devices, stamps
        self.warm_up, self.stop, self.close = devices.warm_up, devices.stop, devices.close
        self.read = _timed(devices.read, stamps)  # type: ignore[method-assign]
        self.write = _timed(devices.write, stamps)  # type: ignore[method-assign]

    def use(self, memory: FlatMemory) -> None:
        packed = PackedDevices(self._devices, memory)
        self._read_in_place = _timed(packed.read_in_place, self._stamps)
        self._write_in_place = _timed(packed.write_in_place, self._stamps)

    def attach(self, sense: Any, command: Any) -> None:
        """The plant has readings and command of its own."""

    def read_in_place(self, now: float) -> None:
        self._read_in_place(now)

    def write_in_place(self) -> None:
        self._write_in_place()

    def prepare(self, now: float) -> None:
        """The plant has nothing to prepare."""


class TimedWriter(RingWriter):
    """Ring writer with a time stamp before and after a row is put or published."""

    def __init__(self, fd: int, row_type: type, stamps: Stamps) -> None:
        super().__init__(fd, row_type, wait=False)
        self._put = _timed(super().put, stamps)
        self._publish = _timed(super().publish, stamps)
        self._putting = False

    def put(self, row: Any) -> None:
        self._putting = True  # it publishes the row itself
        self._put(row)
        self._putting = False

    def publish(self, count: int = 1) -> None:
        if self._putting or not count:  # no row: the tick is being prepared
            super().publish(count)
        else:
            self._publish(count)


def _timed(call: Callable[..., Any], stamps: Stamps) -> Callable[..., Any]:
    stamp = stamps.times.append

    def timed(*arguments: Any) -> Any:
        began = perf_counter_ns()
        result = call(*arguments)
        ended = perf_counter_ns()
        stamp(began)
        stamp(ended)
        return result

    return timed
