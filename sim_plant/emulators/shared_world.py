"""The simulated WaveBot and the bench behind emulated devices."""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.bench import signals as bench
from sim_plant.bench.world import BenchWorld
from sim_plant.emulators.shared_simulation import MAX_CATCH_UP, SharedSimulation
from sim_plant.signals import OFF, Actuation, Readings
from sim_plant.units import Second, Tick
from sim_plant.world import World


class SharedWorld(SharedSimulation[World, Actuation]):
    """A WaveBot in its basin."""

    def __init__(
        self, world: World, dt: Second, clock: Callable[[], Second], *, burst: Tick = MAX_CATCH_UP
    ) -> None:
        """See `Shared`."""
        super().__init__(world, OFF, dt, clock, burst)

    def readings(self) -> Readings:
        """Return the sensor readings after the last executed tick, without catching up."""
        return self.world.readings()


class SharedBench(SharedSimulation[BenchWorld, bench.Actuation]):
    """An OSWEC bench."""

    def __init__(
        self,
        world: BenchWorld,
        dt: Second,
        clock: Callable[[], Second],
        *,
        burst: Tick = MAX_CATCH_UP,
    ) -> None:
        """See `Shared`."""
        super().__init__(world, bench.OFF, dt, clock, burst)

    def sense(self) -> bench.BenchReading:
        """Return the sensor readings after the last executed tick, without catching up."""
        return self.world.sense()
