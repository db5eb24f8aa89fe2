"""The simulated plant in the loop's own process: what the devices of all kinds of rig share."""

import sys
from abc import ABC, abstractmethod
from typing import Any, Protocol

from rig.compilation.tick_source import PlantCode, TickSource, coupled_source
from rig.realtime import cycle
from rig.realtime.coupled_ticks import Coupling
from rig.realtime.tick_memory import FlatMemory


class World(Protocol):
    """A simulated rig with its delay line."""

    delay: float  # s, age of a reading

    def advance(self, dt: float) -> None:
        """Advance by one tick."""

    def actuate(self, actuation: Any, /) -> None:
        """Latch a command."""


class WholePlant:
    """A plant that is compiled as a whole: nothing of it acts between chunks of ticks."""

    def __init__(self, plant: Any, device: Any) -> None:
        self.plant, self.device = plant, device

    def attach(self, memory: FlatMemory) -> None:
        """Nothing of the plant is outside of the memory."""

    def ticks_until_due(self, tick: int) -> int:
        """Return a number of ticks that no run has."""
        return sys.maxsize

    def act(self, tick: int) -> None:
        """Nothing is due."""


class PlantDevices:
    """Base of the devices of a simulated rig; a kind adds `read` and `write`.

    `read` advances the world to the planned time of the tick: by one step on the virtual clock, by
    more when ticks of the real clock were lost (a plant does not wait for a late loop).
    """

    def __init__(self, world: World, rest: Any, dt: float) -> None:
        """``rest``: the world's command at rest."""
        self._plant = world
        self._rest = rest
        self._dt = dt
        self._ticks = 0

    def warm_up(self, dt: float) -> None:
        """Do nothing: a plant in the same process needs no warm-up."""

    def _advance_to(self, now: float) -> None:
        """Advance the world to the tick at a time (s)."""
        tick = round(now / self._dt)
        while self._ticks < tick:
            self._plant.advance(self._dt)
            self._ticks += 1

    def stop(self, reason: int) -> None:
        """Command rest."""
        self._plant.actuate(self._rest)

    def close(self) -> None:
        """Nothing to release."""


class CoupledDevices(PlantDevices, ABC):
    """Devices whose plant can be compiled together with the loop's ticks."""

    @abstractmethod
    def coupling(self) -> Coupling:
        """Return the plant as it is between two ticks."""

    @abstractmethod
    def plant_code(self) -> PlantCode:
        """Return the plant's part of the compiled ticks."""

    def coupled_source(self, tick: str, law: str, params: cycle.Params) -> TickSource:
        """Return the source of ticks together with the plant, as of `tick_source`."""
        return coupled_source(tick, law, params, self.coupling(), self.plant_code())
