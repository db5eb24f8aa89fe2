"""A terminal as a description has it: PDOs with values, which the world gives or takes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from sim_plant.emulators.device_objects import (
    BOOLEAN,
    SIGNED,
    UINT32,
    UNSIGNED,
    Key,
    ObjectEntry,
)
from sim_plant.emulators.ethercat.process_data import (
    RX_ASSIGNMENT,
    TX_ASSIGNMENT,
    assignment_objects,
    mapping_entry,
    mapping_objects,
)
from sim_plant.emulators.ethercat.terminals import INPUT, OUTPUT, Clock, Shared
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.units import Second

_FLOATS = {"f32": ("<f", "<I"), "f64": ("<d", "<Q")}
_FIRST_MAPPING = {RX_ASSIGNMENT: 0x1600, TX_ASSIGNMENT: 0x1A00}
_FIRST_OBJECT = {RX_ASSIGNMENT: OUTPUT, TX_ASSIGNMENT: INPUT}


class DescribedValue(NamedTuple):
    """A value of a PDO, or several of one type at the sub-indices that follow."""

    name: str  # empty: a gap
    object: int  # 0: any
    sub: int
    type: str  # bit, u8, i8, ..., f64
    number: int = 1

    @property
    def bits(self) -> int:
        """The bits of one value."""
        return 1 if self.type == "bit" else int(self.type[1:])


class DescribedPdo(NamedTuple):
    """A PDO; index 0: any."""

    pdo: int
    values: tuple[DescribedValue, ...]


class ObjectSetting(NamedTuple):
    """An object that the master may write."""

    object: int
    sub: int
    type: str


class TerminalDescription(NamedTuple):
    """Process data and settings of a terminal."""

    outputs: tuple[DescribedPdo, ...] = ()
    inputs: tuple[DescribedPdo, ...] = ()
    settings: tuple[ObjectSetting, ...] = ()


class DescribedTerminal(ObjectDevice):
    """Inputs that read the world, outputs that act on it."""

    def __init__(
        self,
        entries: Sequence[ObjectEntry],
        description: TerminalDescription,
        reads: Mapping[str, Callable[[], float]],
        writes: Mapping[str, Callable[[float], None]],
        world: Shared,
        clock: Clock,
    ) -> None:
        """`entries`: those of a CoE slave; `reads` and `writes` by the name of the value, in the
        numbers of the process data. Inputs without a function are 0.
        """
        places: dict[str, tuple[DescribedValue, list[Key]]] = {}
        objects = [
            *_direction(description.outputs, RX_ASSIGNMENT, places),
            *_direction(description.inputs, TX_ASSIGNMENT, places),
        ]
        known = [*entries, *objects]
        super().__init__([*known, *setting_objects(description.settings, known)], world, clock)
        self._inputs = [(*places[name], read) for name, read in reads.items()]
        self._outputs = [(*places[name], write) for name, write in writes.items()]

    def step(self, now: Second, elapsed: Second) -> None:
        """Read the inputs."""
        for value, keys, read in self._inputs:
            raw = _encode(value, read())
            for index, sub in keys:
                self.objects.put(index, raw, sub)

    def apply_outputs(self) -> None:
        """Set the outputs."""
        for value, keys, write in self._outputs:
            write(_decode(value, self.objects.get(*keys[0])))

    def on_master_lost(self, code: int) -> None:
        """Switch all outputs off."""
        for _, keys, write in self._outputs:
            for index, sub in keys:
                self.objects.put(index, 0, sub)
            write(0.0)

    def on_restart(self, ready_at: Second) -> None:
        """Switch all outputs off."""
        self.on_master_lost(0)


def _direction(
    pdos: Sequence[DescribedPdo],
    assignment: int,
    places: dict[str, tuple[DescribedValue, list[Key]]],
) -> Iterator[ObjectEntry]:
    """Yield the objects of one direction, and note the place of each value."""
    mappings: dict[int, tuple[int, ...]] = {}
    taken: set[Key] = set()
    for number, pdo in enumerate(pdos):
        mapped: list[int] = []
        for at, value in enumerate(pdo.values):
            if not value.name:
                mapped += [mapping_entry(0, 0, value.bits)] * value.number
                continue
            index = value.object or _FIRST_OBJECT[assignment] + 0x10 * number
            first = value.sub if value.object else 1 + sum(v.number for v in pdo.values[:at])
            keys = [(index, first + each) for each in range(value.number)]
            for key in keys:
                mapped.append(mapping_entry(*key, value.bits))
                if key not in taken:
                    is_output = assignment == RX_ASSIGNMENT
                    kind = _data_type(value.type)
                    yield ObjectEntry(key, value.name, value.name, kind, 0, is_output, True)
            taken |= set(keys)
            places[value.name] = (value, keys)
        mappings[pdo.pdo or _FIRST_MAPPING[assignment] + number] = tuple(mapped)
    yield from mapping_objects(mappings)
    yield from assignment_objects(assignment, tuple(mappings), slots=max(1, len(mappings)))


def setting_objects(
    settings: Sequence[ObjectSetting], known: Iterable[ObjectEntry]
) -> Iterator[ObjectEntry]:
    """Yield the objects of settings that a slave lacks; they have no effect."""
    keys = {entry.key for entry in known}
    for index, sub, kind in settings:
        if (index, sub) not in keys:
            keys.add((index, sub))
            yield ObjectEntry((index, sub), "settings", f"setting {sub}", _data_type(kind), 0, True)


def _data_type(kind: str) -> int:
    if kind == "bit":
        return BOOLEAN
    if kind in _FLOATS:
        return UINT32 if kind == "f32" else UNSIGNED_64
    codes = SIGNED if kind[0] == "i" else UNSIGNED
    return next(code for code, bits in codes.items() if bits == int(kind[1:]))


UNSIGNED_64 = next(code for code, bits in UNSIGNED.items() if bits == 64)


def _encode(value: DescribedValue, number: float) -> int:
    if value.type == "bit":
        return 1 if number else 0
    if value.type in _FLOATS:
        real, whole = _FLOATS[value.type]
        raw: int = struct.unpack(whole, struct.pack(real, number))[0]
        return raw
    high = (1 << value.bits - (value.type[0] == "i")) - 1
    low = -high - 1 if value.type[0] == "i" else 0
    return max(low, min(high, round(number)))


def _decode(value: DescribedValue, raw: int) -> float:
    if value.type in _FLOATS:
        real, whole = _FLOATS[value.type]
        number: float = struct.unpack(real, struct.pack(whole, raw))[0]
        return number
    return raw
