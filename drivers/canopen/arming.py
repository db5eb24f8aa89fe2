"""What must stand in a drive before it is armed: steps to write, what to read back, what differs.

The conversation writes the steps in their order while the node is PRE-OPERATIONAL, reads back every
object of `read_back`, and arms only if `compare` finds nothing. Pure: no bus here.
"""

from collections.abc import Mapping
from typing import NamedTuple

from drivers.canopen.drive_objects import ALWAYS, BY_NAME, Access
from drivers.canopen.pdo import BYTES, Layout, mapping_words

_OFF = 1 << 31  # of a PDO's COB-ID: it does not exist
_PDO_ID = 0xA000_07FF  # that bit, 29-bit frame, identifier; bit 30 (remote requests) is the drive's


class Step(NamedTuple):
    """One object to write or to read."""

    object: int  # index
    sub: int
    type: str  # as in pdo.TYPES
    name: str
    value: int
    access: int  # `Access`
    mask: int  # bits that count when read back; -1: all


class Mismatch(NamedTuple):
    """One object that is not as it must be."""

    object: int
    sub: int
    name: str
    wanted: int
    got: int | None  # None: the drive did not give it


class SetupError(ValueError):
    """A configuration that must not reach a drive; names the object."""


def heartbeat_consumer(node: int, milliseconds: int) -> int:
    """The value of 0x1016:1 that makes a drive watch the heartbeat of ``node`` for so long."""
    if not (1 <= node <= 127 and 1 <= milliseconds <= 0xFFFF):
        raise SetupError(f"heartbeat_consumer: node {node}, {milliseconds} ms")
    return node << 16 | milliseconds


def _in_range(where: str, kind: str, value: int) -> int:
    bits = 8 * BYTES[kind]
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind[0] == "i" else (0, (1 << bits) - 1)
    if not low <= value <= high:
        raise SetupError(f"{where}: {value} does not fit {kind}, {low} to {high}")
    return value


def parameter_steps(
    values: Mapping[str, int | None],
    required: frozenset[str] = ALWAYS,
    read_only: frozenset[str] = frozenset(),
) -> tuple[Step, ...]:
    """Steps for the named objects; None says that the drive lacks one, and leaves it out.

    ``read_only``: names of objects that this drive does not let itself be told; they are verified.
    Raises SetupError for an unknown name, a required one that is not spoken of, a value out of its
    type's range, a protection that 0 would switch off, soft limits that are crossed or both 0.
    """
    for name in (*values, *read_only):
        if name not in BY_NAME:
            raise SetupError(f"{name}: no such object")
    for name in sorted(required - set(values)):
        raise SetupError(f"{name}: neither a value nor null (the drive has it not)")
    low, high = values.get("position_low"), values.get("position_high")
    if (low is None) != (high is None):
        raise SetupError("position_low, position_high: one without the other")
    if low is not None and high is not None and low >= high:
        raise SetupError(f"position_low {low} is not below position_high {high} (0 and 0: off)")
    steps = []
    for name, item in BY_NAME.items():
        value = values.get(name)
        if value is None:
            continue
        if item.guard == 1 and value == 0:
            raise SetupError(f"{name}: 0 would switch it off")
        _in_range(name, item.type, value)
        access = Access.VERIFY if name in read_only else item.access
        steps.append(Step(item.object, item.sub, item.type, name, value, access, item.mask))
    return tuple(steps)


def rpdo_steps(number: int, pdo: Layout, transmission: int, deadline: int) -> tuple[Step, ...]:
    """Remap RPDO ``number`` (1 to 512); the drive reacts if none comes for ``deadline`` (ms, > 0).

    What it does then is its 0x6007, or the maker's: whether a drive minds its RPDO's event timer
    differs between makers, so a test has to show it.
    """
    if not 1 <= deadline <= 0xFFFF:
        raise SetupError(f"RPDO{number} deadline: {deadline} ms is not 1 to 65535")
    return _remap("RPDO", 0x1400, 0x1600, number, pdo, transmission, deadline)


def tpdo_steps(number: int, pdo: Layout, transmission: int) -> tuple[Step, ...]:
    """Remap TPDO ``number`` (1 to 512), sent on every ``transmission``-th SYNC (1 to 240)."""
    if not 1 <= transmission <= 240:
        raise SetupError(f"TPDO{number} transmission type: {transmission} is not 1 to 240")
    return _remap("TPDO", 0x1800, 0x1A00, number, pdo, transmission, None)


def silent_tpdo_step(number: int, cob_id: int) -> Step:
    """Switch off a TPDO that a drive has on by default and the bus budget does not know."""
    return Step(
        *_item("TPDO", 0x1800, number), 1, "u32", f"TPDO{number} COB-ID", cob_id | _OFF,
        Access.SET, _OFF,
    )  # fmt: skip


def _item(kind: str, base: int, number: int) -> tuple[int]:
    if not 1 <= number <= 512:
        raise SetupError(f"{kind}{number}: not 1 to 512")
    return (base + number - 1,)


def _remap(
    kind: str,
    comm_base: int,
    map_base: int,
    number: int,
    pdo: Layout,
    transmission: int,
    deadline: int | None,
) -> tuple[Step, ...]:
    """In the order of CiA 301: off, no entries, entries, their count, type and times, on."""
    (comm,), (mapping,) = _item(kind, comm_base, number), _item(kind, map_base, number)
    name = f"{kind}{number}"
    words = mapping_words(pdo.entries)

    def step(index: int, sub: int, of: str, what: str, value: int, access: Access) -> Step:
        what = f"{name} {what}"
        mask = _PDO_ID if (index, sub) == (comm, 1) else -1
        return Step(index, sub, of, what, _in_range(what, of, value), access, mask)

    steps = [
        step(comm, 1, "u32", "COB-ID", pdo.cob_id | _OFF, Access.PASSING),
        step(mapping, 0, "u8", "map count", 0, Access.PASSING),
        *(
            step(mapping, sub, "u32", f"map {sub}", word, Access.SET)
            for sub, word in enumerate(words, start=1)
        ),
        step(mapping, 0, "u8", "map count", len(words), Access.SET),
        step(comm, 2, "u8", "transmission type", transmission, Access.SET),
    ]
    if deadline is not None:
        steps.append(step(comm, 5, "u16", "deadline", deadline, Access.SET))
    steps.append(step(comm, 1, "u32", "COB-ID", pdo.cob_id, Access.SET))
    return tuple(steps)


def read_back(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """The steps whose objects are to be read after all writing, each object once."""
    last = {(s.object, s.sub): s for s in steps if s.access != Access.PASSING}
    return tuple(last.values())


def compare(
    steps: tuple[Step, ...], answers: Mapping[tuple[int, int], int | None]
) -> tuple[Mismatch, ...]:
    """What in ``answers`` (by index and sub-index) is not as wanted; empty: the drive may be armed.

    An object that is missing from the answers, or None, was not read and counts as a mismatch.
    """
    found = []
    for step in read_back(steps):
        got = answers.get((step.object, step.sub))
        if got is None or got & step.mask != step.value & step.mask:
            found.append(Mismatch(step.object, step.sub, step.name, step.value, got))
    return tuple(found)


def refusal(mismatches: tuple[Mismatch, ...]) -> str:
    """Why the drive is not armed, one object a line; empty if nothing is wrong."""
    return "\n".join(
        f"{m.object:#06x}:{m.sub:02x} {m.name}: wanted {_number(m.wanted)}, "
        + ("got no answer" if m.got is None else f"got {_number(m.got)}")
        for m in mismatches
    )


def _number(value: int) -> str:
    return f"{value}" if -1000 < value < 1000 else f"{value} ({value:#x})"
