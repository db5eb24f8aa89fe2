"""Interface of a plant on the bench's wires: command latch, stop chain, delay line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from sim_plant.bench.signals import OFF, Actuation, BenchReading
from sim_plant.bench.stepper import Stepper, StepperInputs
from sim_plant.sensors import NOISE_LENGTH
from sim_plant.units import Flag, Second, Tick


class Conditions(NamedTuple):
    """A world between two ticks, for callers that execute the step themselves from then on."""

    params: Any  # of the stepper's plant
    state: Any
    normals: list[float]  # noise table
    delay_line: tuple[BenchReading, ...]  # readings not yet delivered, oldest first
    delay: Second  # of a reading
    actuation: Actuation  # last command
    fresh: Flag  # 1: it arrived after the last step


class PlantInterface(ABC):
    """Base of the plants with the bench's signals, advanced only by advance(dt).

    Order of calls in tick k: sense() returns the sample of tick k - delay_ticks, actuate() latches
    a command, advance(dt) steps to tick k + 1 under it. Without commands the drive goes into fault.
    """

    def __init__(
        self,
        params: Any,
        state: Any,
        delay: Tick,
        *,
        dt: Second,
        seed: int,
        stepper: type[Stepper],
        steps: int = 1,
    ) -> None:
        """`params` and `state` are those of the stepper's plant, `delay` is that of a reading.

        The stepper takes ``steps`` steps in a tick of ``dt``; it may be any execution of the step
        with bitwise equal results. Raises ValueError for a dt outside (0, 2 ms].
        """
        normals = np.random.default_rng(seed).standard_normal(NOISE_LENGTH).tolist()
        self._normals = normals
        self._constants = params
        self._stepper = stepper(StepperInputs(params, state, normals, check_tick(dt) / steps))
        self._dt = dt
        self._actuation = OFF
        self._fresh: Flag = 0
        self._stop_pressed: Flag = 0
        self._tick: Tick = 0
        self.delay: Second = delay * dt  # age of a reading
        self._delay_line: deque[BenchReading] = deque(
            [self._stepper.reading(0, 0)] * (delay + 1), maxlen=delay + 1
        )

    def conditions(self) -> Conditions:
        """Return the present conditions; nobody presses the emergency stop."""
        return Conditions(
            self._constants,
            self._stepper.state,
            self._normals,
            tuple(self._delay_line),
            self.delay,
            self._actuation,
            self._fresh,
        )

    def actuate(self, actuation: Actuation) -> None:
        """Latch a command and reset its age."""
        self._actuation = actuation
        self._fresh = 1

    def press_e_stop(self, pressed: bool = True) -> None:
        """Open the hard-wired stop chain, or close it; it controls the drive's power stage."""
        self._stop_pressed = 1 if pressed else 0

    def advance(self, dt: float) -> None:
        """Advance by one tick. Raises ValueError for another dt than that of construction."""
        if dt != self._dt:
            raise ValueError(f"this world advances by {self._dt} s, got {dt} s")
        self._tick += 1
        self._delay_line.append(self._step_plant())
        self._fresh = 0

    def sense(self) -> BenchReading:
        """Return the last reading that has arrived."""
        return self._delay_line[0]

    @abstractmethod
    def _step_plant(self) -> BenchReading:
        """Advance the plant to the present tick and return its readings."""


def check_tick(dt: Second) -> Second:
    """Return the tick. Raises ValueError if it is outside (0, 2 ms]."""
    if not 0.0 < dt <= 0.002:
        raise ValueError(f"dt must be in (0, 0.002] s, got {dt}")
    return dt
