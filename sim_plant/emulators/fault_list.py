"""Faults of an emulated device with objects: the list, and the active ones."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """Allowed values of a fault, in its unit."""

    low: float = 0.0
    high: float = 1e9

    def checked(self, name: str, value: float) -> float:
        """Return a value as a number; raises ValueError outside the limits, or for NaN."""
        number = float(value)
        if not self.low <= number <= self.high:
            allowed = f"allowed {self.low:g} .. {self.high:g}"
            raise ValueError(f"{name}: {value} is out of range; {allowed}")
        return number


SIGNED = Limits(-1e9, 1e9)
UP_TO_A_MINUTE = Limits(0.0, 60.0)  # s
EITHER = Limits(0.0, 1.0)


class Fault(NamedTuple):
    """One fault by name."""

    name: str
    effect: str  # what the device does
    value: str = ""  # meaning and unit of its value; empty: no value
    default: float = 0.0
    once: bool = False  # an event, not a lasting state
    limits: Limits = Limits()  # of its value


class FaultList:
    """The faults of a device and of its transport, and the active ones with their values."""

    def __init__(self) -> None:
        self.active: dict[str, float] = {}
        self._known: dict[str, Fault] = {}

    def add(self, *faults: Fault) -> None:
        """Add faults to the list."""
        self._known.update((fault.name, fault) for fault in faults)

    def all(self) -> tuple[Fault, ...]:
        """Return all faults of the list."""
        return tuple(self._known.values())

    def begin(self, name: str, value: float | None) -> tuple[Fault, float]:
        """Activate a fault; return it and its value.

        Raises ValueError for an unknown name, or a value outside its limits.
        """
        fault = self._known.get(name)
        if fault is None:
            raise ValueError(f"no fault {name!r}; there are {', '.join(sorted(self._known))}")
        given = fault.default if value is None else fault.limits.checked(name, value)
        if not fault.once:
            self.active[name] = given
        return fault, given

    def end(self, name: str) -> bool:
        """End a fault; return whether it was active."""
        return self.active.pop(name, None) is not None
