"""Faults of an emulated node: the list, and the active ones."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One fault by name."""

    name: str
    effect: str  # what the device does
    value: str = ""  # meaning and unit of its value; empty: no value
    default: float = 0.0
    once: bool = False  # an event, not a lasting state


class FaultList:
    """The faults of a node, and the active ones with their values."""

    def __init__(self) -> None:
        self.active: dict[str, float] = {}
        self._known: dict[str, Fault] = {}

    def add(self, *faults: Fault) -> None:
        """Add faults to the list."""
        self._known.update((fault.name, fault) for fault in faults)

    def all(self) -> tuple[Fault, ...]:
        """Return all faults of the list."""
        return tuple(self._known.values())

    def begin(self, name: str, value: float | None) -> Fault:
        """Activate a fault. Raises ValueError for an unknown name."""
        fault = self._known.get(name)
        if fault is None:
            raise ValueError(f"no fault {name!r}; there are {', '.join(sorted(self._known))}")
        if not fault.once:
            self.active[name] = fault.default if value is None else float(value)
        return fault

    def end(self, name: str) -> bool:
        """End a fault; return whether it was active."""
        return self.active.pop(name, None) is not None


NODE_FAULTS = (
    Fault("node_reset", "resets spontaneously, as after a brown-out: boot-up, defaults", once=True),
    Fault("powered_off", "neither sends nor receives, power is off; boots when the fault ends"),
    Fault("silent", "sends neither heartbeat nor PDO nor EMCY; still answers SDO"),
    Fault("heartbeat_lost", "sends no heartbeat"),
    Fault("pdo_lost", "sends no PDO"),
    Fault("sdo_lost", "answers no SDO"),
    Fault(
        "bus_off",
        "its controller is off the bus: neither sends nor receives, and reports it afterwards",
    ),
    Fault("tpdo_length", "its TPDOs are too short", "octets missing", 1.0),
    Fault("tpdo_delay", "its TPDOs are late after SYNC", "delay, s", 0.002),
    Fault("babble", "sends frames that mean nothing with a high priority", "frames/s", 2000.0),
    Fault("write_ignored", "acknowledges writes to an object and keeps the old value", "index"),
)
