"""A device with an object dictionary, without its fieldbus: the same body for CANopen and for CoE.

A transport (`canopen_node.CanopenNode`, `ethercat.slave.Slave`) holds one device. It sets and reads
objects by SDO and PDO, and calls the methods of `ObjectDevice`; the device calls `errors.send`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from sim_plant.emulators.device_errors import DeviceErrors
from sim_plant.emulators.device_objects import ObjectEntry, Objects
from sim_plant.emulators.device_storage import SIGNATURES, Storage
from sim_plant.emulators.fault_list import Fault, FaultList
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.units import Second

DEVICE_FAULTS = (
    Fault("write_ignored", "acknowledges writes to an object and keeps the old value", "index"),
)


class ObjectDevice:
    """Objects, errors, faults and storage. Subclasses are devices: they override `step` etc."""

    def __init__(
        self,
        entries: Iterable[ObjectEntry],
        world: SharedSimulation[Any, Any],
        clock: Callable[[], Second],
    ) -> None:
        """`clock`: that of the transport; `world`: the simulation that the device is part of."""
        self.world = world
        self.clock = clock
        self.objects = Objects(entries)
        self.fault_list = FaultList()
        self.fault_list.add(*DEVICE_FAULTS)
        self.active = self.fault_list.active  # active faults with their values
        self.errors = DeviceErrors(self.objects)
        self.storage = Storage(self.objects)

    # ---- methods that devices override -----------------------------------------------------------

    def step(self, now: Second, elapsed: Second) -> None:
        """Advance the device: read the world, set objects, write the world."""

    def measure_slow(self) -> None:
        """Measure slowly changing values: every 5 ms, and before an SDO request is answered."""

    def apply_outputs(self) -> None:
        """Apply the objects that were just written over the bus."""

    def on_master_lost(self, code: int) -> None:
        """React to a lost master, a stop or a reset; `code` is the EMCY code, 0 if none."""

    def in_fault(self) -> bool:
        """Return whether errors stay until the master resets them."""
        return False

    def on_restart(self, ready_at: Second) -> None:
        """Reset all state except objects, as after power-on; the bus is up at `ready_at`."""

    def on_fault(self, fault: Fault, value: float) -> None:
        """Perform the one-time action of a device's own fault."""

    def ignored_objects(self) -> set[int]:
        """Return the indices of objects whose writes are acknowledged and ignored."""
        return {*SIGNATURES, int(self.active.get("write_ignored", 0.0))}

    def apply_faults(self) -> None:
        """Apply the lasting effects of the active faults to the objects."""
        ignored = self.ignored_objects()
        self.objects.ignored = {key for key in self.objects.types if key[0] in ignored}

    # ---- for transports --------------------------------------------------------------------------

    def reset(self, *, application: bool, ready_at: Second) -> None:
        """Restore the objects of the communication area, or with `application` restart fully."""
        self.storage.restore(all_of_them=application)
        self.errors.active.clear()
        self.apply_faults()
        if application:
            self.on_restart(ready_at)

    def clear_error(self, code: int) -> None:
        """Clear an error of the bus, unless a fault keeps errors until the master resets them."""
        if code in self.errors.active and not self.in_fault():
            self.errors.clear(code)
