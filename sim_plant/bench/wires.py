"""What stands between a rig and a plant on the bench's wires: latch, stop chain, delay line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque

from sim_plant.bench.signals import OFF, Actuation, Reading
from sim_plant.units import Flag, Second, Tick


class Wires(ABC):
    """A plant that speaks the bench's words, moved only by advance(dt).

    Time order of tick k: sense() gives what was sampled at tick k - delay_ticks, actuate() latches
    a command, advance(dt) moves to tick k + 1 under it. The drive drops out when commands cease.
    """

    def __init__(self, dt: Second, delay: Tick, still: Reading) -> None:
        """`still` is what is read before the first tick."""
        self._dt = dt
        self._actuation = OFF
        self._fresh: Flag = 0
        self._pressed: Flag = 0
        self._tick: Tick = 0
        self.delay: Second = delay * dt  # age of a reading
        self._line: deque[Reading] = deque([still] * (delay + 1), maxlen=delay + 1)

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age."""
        self._actuation = actuation
        self._fresh = 1

    def press_e_stop(self, pressed: bool = True) -> None:
        """Open the hard-wired stop chain, or close it: the drive's power stage follows."""
        self._pressed = 1 if pressed else 0

    def advance(self, dt: float) -> None:
        """Move one tick on. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world ticks in {self._dt} s, not {dt} s")
        self._tick += 1
        self._line.append(self._move())
        self._fresh = 0

    def sense(self) -> Reading:
        """Give what came over the wires last."""
        return self._line[0]

    @abstractmethod
    def _move(self) -> Reading:
        """Move the plant to the present tick and sample it."""


def checked(dt: Second) -> Second:
    """Give the tick back. Raises ValueError for one outside (0, 2 ms]."""
    if not 0.0 < dt <= 0.002:
        raise ValueError(f"dt must be in (0, 0.002] s, got {dt}")
    return dt
