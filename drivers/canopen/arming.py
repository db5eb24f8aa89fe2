"""Set-up of a drive before arming: steps to write, objects to read back, and their comparison.

The caller writes the steps in order while the node is PRE-OPERATIONAL, reads back every object of
`read_back`, and arms only if `compare` returns no mismatch. The functions are pure: no bus here.
"""

from collections.abc import Mapping
from typing import NamedTuple

from drivers.canopen.drive_objects import BY_NAME, REQUIRED, Access
from drivers.canopen.pdo import BYTES, Layout, mapping_entries

_OFF = 1 << 31  # of a PDO's COB-ID: the PDO does not exist
_PDO_ID = 0xA000_07FF  # that bit, 29-bit frame, identifier; the drive owns bit 30 (remote requests)


class SetupStep(NamedTuple):
    """One object to write or to read."""

    object: int  # index
    sub: int
    type: str  # as in pdo.TYPES
    name: str
    value: int
    access: int  # `Access`
    mask: int  # bits compared when read back; -1: all


class Mismatch(NamedTuple):
    """One object whose value differs from the expected one."""

    object: int
    sub: int
    name: str
    expected: int
    actual: int | None  # None: the drive did not return a value


class SetupError(ValueError):
    """An unsafe or invalid drive configuration; names the object."""


def heartbeat_consumer(node: int, milliseconds: int) -> int:
    """Return the value of 0x1016:1 with which a drive monitors the heartbeat of ``node``."""
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
    required: frozenset[str] = REQUIRED,
    read_only: frozenset[str] = frozenset(),
) -> tuple[SetupStep, ...]:
    """Return the steps for the named objects; None means that the drive lacks the object.

    ``read_only``: names of objects that this drive does not let the host write; they are verified.
    SetupError for an unknown name, a required name that is missing, a value outside its type's
    range, a protection disabled by 0, soft limits that are crossed or both 0.
    """
    for name in (*values, *read_only):
        if name not in BY_NAME:
            raise SetupError(f"{name}: no such object")
    for name in sorted(required - set(values)):
        raise SetupError(f"{name}: missing; give a value, or null if the drive lacks this object")
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
        steps.append(SetupStep(item.object, item.sub, item.type, name, value, access, item.mask))
    return tuple(steps)


def rpdo_steps(number: int, pdo: Layout, transmission: int, deadline: int) -> tuple[SetupStep, ...]:
    """Return the steps that remap RPDO ``number`` (1 to 512) with a ``deadline`` (ms, > 0).

    The drive's reaction to a missed deadline is its 0x6007 or specific to the manufacturer. Whether
    a drive monitors the event timer of an RPDO differs between manufacturers, so test it.
    """
    if not 1 <= deadline <= 0xFFFF:
        raise SetupError(f"RPDO{number} deadline: {deadline} ms is not 1 to 65535")
    return _remap("RPDO", 0x1400, 0x1600, number, pdo, transmission, deadline)


def tpdo_steps(number: int, pdo: Layout, transmission: int) -> tuple[SetupStep, ...]:
    """Return the steps that remap TPDO ``number`` (1 to 512).

    The drive sends it on every ``transmission``-th SYNC (1 to 240).
    """
    if not 1 <= transmission <= 240:
        raise SetupError(f"TPDO{number} transmission type: {transmission} is not 1 to 240")
    return _remap("TPDO", 0x1800, 0x1A00, number, pdo, transmission, None)


def silent_tpdo_step(number: int, cob_id: int) -> SetupStep:
    """Return the step that disables a TPDO which is on by default but not in the bus budget."""
    return SetupStep(
        *_communication_index("TPDO", 0x1800, number), 1, "u32", f"TPDO{number} COB-ID",
        cob_id | _OFF, Access.SET, _OFF,
    )  # fmt: skip


def _communication_index(kind: str, base: int, number: int) -> tuple[int]:
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
) -> tuple[SetupStep, ...]:
    """Return the steps in the order of CiA 301.

    The order is: off, no entries, entries, their count, type and times, on.
    """
    (comm,), (mapping,) = (
        _communication_index(kind, comm_base, number),
        _communication_index(kind, map_base, number),
    )
    name = f"{kind}{number}"
    mapped = mapping_entries(pdo.entries)

    def step(index: int, sub: int, of: str, what: str, value: int, access: Access) -> SetupStep:
        what = f"{name} {what}"
        mask = _PDO_ID if (index, sub) == (comm, 1) else -1
        return SetupStep(index, sub, of, what, _in_range(what, of, value), access, mask)

    steps = [
        step(comm, 1, "u32", "COB-ID", pdo.cob_id | _OFF, Access.TRANSIENT),
        step(mapping, 0, "u8", "map count", 0, Access.TRANSIENT),
        *(
            step(mapping, sub, "u32", f"map {sub}", word, Access.SET)
            for sub, word in enumerate(mapped, start=1)
        ),
        step(mapping, 0, "u8", "map count", len(mapped), Access.SET),
        step(comm, 2, "u8", "transmission type", transmission, Access.SET),
    ]
    if deadline is not None:
        steps.append(step(comm, 5, "u16", "deadline", deadline, Access.SET))
    steps.append(step(comm, 1, "u32", "COB-ID", pdo.cob_id, Access.SET))
    return tuple(steps)


def read_back(steps: tuple[SetupStep, ...]) -> tuple[SetupStep, ...]:
    """Return the steps whose objects must be read after all writing, each object once."""
    last = {(s.object, s.sub): s for s in steps if s.access != Access.TRANSIENT}
    return tuple(last.values())


def compare(
    steps: tuple[SetupStep, ...], answers: Mapping[tuple[int, int], int | None]
) -> tuple[Mismatch, ...]:
    """Return the mismatches in ``answers`` (by index and sub-index); empty: the drive may be armed.

    An object that is missing from the answers, or None, was not read and counts as a mismatch.
    """
    mismatches = []
    for step in read_back(steps):
        actual = answers.get((step.object, step.sub))
        if actual is None or actual & step.mask != step.value & step.mask:
            mismatches.append(Mismatch(step.object, step.sub, step.name, step.value, actual))
    return tuple(mismatches)


def format_mismatches(mismatches: tuple[Mismatch, ...]) -> str:
    """Return why the drive is not armed, one line per object; empty if nothing is wrong."""
    return "\n".join(
        f"{m.object:#06x}:{m.sub:02x} {m.name}: expected {_number(m.expected)}, "
        + ("no answer" if m.actual is None else f"got {_number(m.actual)}")
        for m in mismatches
    )


def _number(value: int) -> str:
    return f"{value}" if -1000 < value < 1000 else f"{value} ({value:#x})"
