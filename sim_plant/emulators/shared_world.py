"""One simulated rig under all emulated devices, moved in real time: WaveBot or bench."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

from sim_plant.bench import signals as bench
from sim_plant.bench.world import BenchWorld
from sim_plant.signals import OFF, Actuation, Readings
from sim_plant.units import Second, Tick
from sim_plant.world import World

BURST = 100  # ticks


class Moving(Protocol):
    """What the worlds have in common."""

    def actuate(self, actuation: Any, /) -> None:
        """Latch a command."""
        ...

    def advance(self, dt: float) -> None:
        """Move one tick on."""
        ...


W = TypeVar("W", bound=Moving)
A = TypeVar("A")  # its Actuation


class Shared(Generic[W, A]):
    """A world that all emulated devices of one process read and actuate.

    Not thread-safe: one asyncio loop owns it. Each device writes only its own fields of the one
    latched Actuation. A command stands until it is changed: the drives of the world never miss
    one, so silence of the rig's side is for the emulated device's own watchdog to act upon.
    """

    def __init__(
        self, world: W, rest: A, dt: Second, clock: Callable[[], Second], burst: Tick = BURST
    ) -> None:
        """`dt` is the world's own, `rest` its command of nothing; `clock` never goes back.

        Raises ValueError for a `burst`, the most ticks of one catch-up, below 1.
        """
        if burst < 1:
            raise ValueError(f"burst must be at least 1 tick, got {burst}")
        self.world = world
        self.dt = dt
        self.ticks: Tick = 0  # done so far
        self.late: Tick = 0  # done more than one tick after they were due
        self.dropped: Tick = 0  # never done, as more than a burst was due: the world lost that time
        self.stopped = False
        self._clock = clock
        self._burst = burst
        self._origin: Second | None = None
        self._rest = rest
        self._actuation = rest

    @property
    def time(self) -> Second:
        """Simulated time done so far."""
        return self.ticks * self.dt

    @property
    def actuation(self) -> A:
        """What is latched now."""
        return self._actuation

    def start(self, at: Second) -> None:
        """Let time begin at a moment of the clock, instead of with the first `catch_up`."""
        self._origin = at

    def catch_up(self) -> Tick:
        """Do the whole ticks that are due by now, and give how many; time starts if it has not."""
        now = self._clock()
        if self._origin is None:
            self._origin = now
        if self.stopped:
            return 0
        due = math.floor((now - self._origin) / self.dt + 1.0e-6) - self.ticks - self.dropped
        if due <= 0:
            return 0
        done = min(due, self._burst)
        world, dt, actuation = self.world, self.dt, self._actuation
        for _ in range(done):
            world.actuate(actuation)
            world.advance(dt)
        self.ticks += done
        self.late += due - 1 if due <= self._burst else done
        self.dropped += due - done
        return done

    def actuate(self, **changes: Any) -> None:
        """Change named fields of the latched Actuation from the next tick on.

        Raises ValueError (TypeError from Python 3.13 on) for a name that Actuation does not have.
        """
        latched: Any = self._actuation
        self._actuation = latched._replace(**changes)

    def renew(self, world: W) -> None:
        """Go on with another world, and with no command; time and counts go on."""
        self.world = world
        self._actuation = self._rest

    def stop(self) -> None:
        """Take every command away and let time stand still, for good."""
        self._actuation = self._rest
        self.stopped = True


class SharedWorld(Shared[World, Actuation]):
    """A WaveBot in its basin."""

    def __init__(
        self, world: World, dt: Second, clock: Callable[[], Second], *, burst: Tick = BURST
    ) -> None:
        """See `Shared`."""
        super().__init__(world, OFF, dt, clock, burst)

    def readings(self) -> Readings:
        """Give what the sensors read after the last tick done; does not catch up by itself."""
        return self.world.readings()


class SharedBench(Shared[BenchWorld, bench.Actuation]):
    """An OSWEC bench."""

    def __init__(
        self, world: BenchWorld, dt: Second, clock: Callable[[], Second], *, burst: Tick = BURST
    ) -> None:
        """See `Shared`."""
        super().__init__(world, bench.OFF, dt, clock, burst)

    def sense(self) -> bench.Reading:
        """Give what the sensors read after the last tick done; does not catch up by itself."""
        return self.world.sense()
