"""The interface between the loop and the devices of a rig."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

from rig.realtime.tick_memory import FlatMemory, example


class Devices(Protocol):
    """All devices of a rig; the rig kind defines the types of its Sense and Command."""

    def warm_up(self, dt: float) -> None:
        """Synchronise the wires with ticks of ``dt`` (s); raise OSError naming a silent device.

        The loop calls it last before the first tick, which comes ``dt`` after it.
        """

    def read(self, now: float) -> Any:
        """Return the values that arrived since the last tick, each with its age; never block.

        ``now``: planned time of the tick, s since run start.
        """

    def write(self, command: Any) -> None:
        """Send a command; it expires in the devices unless the next one follows."""

    def stop(self, reason: int) -> None:
        """Remove force and power; never raise; the loop may call it repeatedly."""

    def close(self) -> None:
        """Release the wires."""


class FlatDevices(ABC):
    """Devices that store readings in flat memory and take the command from it: `Devices` on wires.

    A compiled tick works on the same memory, so nothing is packed or unpacked between the two. For
    an interpreted tick, `read` and `write` do the same exchange in memory of the devices' own.
    """

    def __init__(self, sense_type: type, command_type: type) -> None:
        """Both types are NamedTuples of NamedTuples and numbers, with annotations."""
        self.use(FlatMemory(sense=example(sense_type), command=example(command_type)))

    def use(self, memory: FlatMemory) -> None:
        """Exchange the sections `sense` and `command` of a memory from now on."""
        self._get_sense, self._set_command = memory.getter("sense"), memory.setter("command")
        self.attach(memory.writers("sense"), memory.readers("command"))

    @abstractmethod
    def attach(self, sense: Any, command: Any) -> None:
        """Take the places of readings and command, and store the readings that never change.

        ``sense`` and ``command`` are records like the kind's own: a member of ``sense`` is the
        function that stores the numbers of this part, one of ``command`` returns them as a tuple.
        """

    @abstractmethod
    def read_in_place(self, now: float) -> None:
        """Store the values that arrived since the last tick, as of `Devices.read`.

        It may be called twice before a tick: the second call stores all again.
        """

    @abstractmethod
    def write_in_place(self) -> None:
        """Send the stored command, as of `Devices.write`."""

    clock_correction: Callable[[], int] | None = None
    """Correction (ns) of the next deadline, if a clock on the wires leads that of the loop."""

    def wire_report(self) -> dict[str, Any]:
        """Return what the record keeps of the wires, as JSON values; empty: nothing."""
        return {}

    def prepare(self, now: float) -> None:
        """Take what has arrived shortly before the tick of a time (s); reading completes it."""
        self.read_in_place(now)

    def read(self, now: float) -> Any:
        """Return the readings, as of `Devices.read`."""
        self.read_in_place(now)
        return self._get_sense()

    def write(self, command: Any) -> None:
        """Send a command, as of `Devices.write`."""
        self._set_command(command)
        self.write_in_place()


class PackedDevices:
    """Devices of NamedTuples, such as a simulated plant, behind the interface of flat memory."""

    def __init__(self, devices: Devices, memory: FlatMemory) -> None:
        self._read, self._write = devices.read, devices.write
        self._set_sense, self._get_command = memory.setter("sense"), memory.getter("command")

    def read_in_place(self, now: float) -> None:
        """Store the readings."""
        self._set_sense(self._read(now))

    def prepare(self, now: float) -> None:
        """Do nothing: devices of NamedTuples are read once a tick."""

    def write_in_place(self) -> None:
        """Send the stored command."""
        self._write(self._get_command())
