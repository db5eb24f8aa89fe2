"""One simulated rig behind all emulated devices, advanced in real time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

from sim_plant.units import Second, Tick

MAX_CATCH_UP = 100  # ticks


class SteppedWorld(Protocol):
    """Common interface of the worlds."""

    def actuate(self, actuation: Any, /) -> None:
        """Latch a command."""
        ...

    def advance(self, dt: float) -> None:
        """Advance by one tick."""
        ...


W = TypeVar("W", bound=SteppedWorld)
A = TypeVar("A")  # its Actuation


class SharedSimulation(Generic[W, A]):
    """A world that all emulated devices of one process read and actuate.

    Not thread-safe: one asyncio loop owns it. Each device writes only its own fields of the common
    latched Actuation. A command holds until it is changed: the drives of the world receive it in
    every tick, so the watchdogs of the emulated devices must detect silence of the rig.
    """

    def __init__(
        self, world: W, rest: A, dt: Second, clock: Callable[[], Second], burst: Tick = MAX_CATCH_UP
    ) -> None:
        """`dt` is the world's own, `rest` its command at rest; `clock` never decreases.

        Raises ValueError for a `burst`, the most ticks of one catch-up, below 1.
        """
        if burst < 1:
            raise ValueError(f"burst must be at least 1 tick, got {burst}")
        self.world = world
        self.dt = dt
        self.ticks: Tick = 0  # executed so far
        self.late_ticks: Tick = 0  # executed more than one tick late
        self.dropped_ticks: Tick = 0  # skipped because more than a burst was due
        self.stopped = False
        self._clock = clock
        self._burst = burst
        self._origin: Second | None = None
        self._rest = rest
        self._actuation = rest

    @property
    def time(self) -> Second:
        """Simulated time so far."""
        return self.ticks * self.dt

    @property
    def actuation(self) -> A:
        """The latched command."""
        return self._actuation

    def start(self, at: Second) -> None:
        """Set the clock time at which simulated time starts, instead of the first `catch_up`."""
        self._origin = at

    def catch_up(self) -> Tick:
        """Execute the ticks that are due and return their number; the first call starts time."""
        now = self._clock()
        if self._origin is None:
            self._origin = now
        if self.stopped:
            return 0
        due = math.floor((now - self._origin) / self.dt + 1.0e-6) - self.ticks - self.dropped_ticks
        if due <= 0:
            return 0
        done = min(due, self._burst)
        world, dt, actuation = self.world, self.dt, self._actuation
        for _ in range(done):
            world.actuate(actuation)
            world.advance(dt)
        self.ticks += done
        self.late_ticks += due - 1 if due <= self._burst else done
        self.dropped_ticks += due - done
        return done

    def actuate(self, **changes: Any) -> None:
        """Change named fields of the latched Actuation from the next tick on.

        Raises ValueError (TypeError from Python 3.13 on) for a name that Actuation does not have.
        """
        latched: Any = self._actuation
        self._actuation = latched._replace(**changes)

    def replace_world(self, world: W) -> None:
        """Replace the world and reset the command; time and counts continue."""
        self.world = world
        self._actuation = self._rest

    def stop(self) -> None:
        """Reset the command and stop time permanently."""
        self._actuation = self._rest
        self.stopped = True
