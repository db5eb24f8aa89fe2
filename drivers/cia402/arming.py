"""Set-up of a drive before arming: steps to write, objects to read back, and their comparison.

The caller writes the steps in order while the drive is without power, reads back every object of
`read_back`, and arms only if `compare` returns no mismatch. The functions are pure: no bus here.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from drivers.cia402.drive_objects import BY_NAME, REQUIRED, Access
from drivers.cia402.process_data import BYTES, Entry, mapping_entries


class SetupStep(NamedTuple):
    """One object to write or to read."""

    object: int  # index
    sub: int
    type: str  # as in process_data.TYPES
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


def in_range(where: str, kind: str, value: int) -> int:
    """Return a value; SetupError if it does not fit its type."""
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
        in_range(name, item.type, value)
        access = Access.VERIFY if name in read_only else item.access
        steps.append(SetupStep(item.object, item.sub, item.type, name, value, access, item.mask))
    return tuple(steps)


def mapping_steps(name: str, index: int, entries: tuple[Entry, ...]) -> tuple[SetupStep, ...]:
    """Return the steps that map entries in the object ``index`` of the PDO ``name``.

    The order is that of CiA 301: no entries, entries, their count.
    """

    def step(sub: int, kind: str, what: str, value: int, access: Access) -> SetupStep:
        what = f"{name} {what}"
        return SetupStep(index, sub, kind, what, in_range(what, kind, value), access, -1)

    return (
        step(0, "u8", "map count", 0, Access.TRANSIENT),
        *(
            step(sub, "u32", f"map {sub}", word, Access.SET)
            for sub, word in enumerate(mapping_entries(entries), start=1)
        ),
        step(0, "u8", "map count", len(entries), Access.SET),
    )


def set_up(
    steps: tuple[SetupStep, ...],
    write: Callable[[SetupStep], object],
    read: Callable[[SetupStep], int | None],
) -> tuple[Mismatch, ...]:
    """Write the steps, read all back, and return the mismatches.

    ``write`` may fail in silence: reading back shows it. ``read`` returns None for no answer.
    """
    for step in steps:
        if step.access != Access.VERIFY:
            write(step)
    return compare(steps, {(each.object, each.sub): read(each) for each in read_back(steps)})


class Comparison(NamedTuple):
    """The present objects of a drive beside those of its set-up."""

    checked: int  # number of compared objects
    wrong: tuple[Mismatch, ...]  # objects that no run writes: a run would be refused
    unset: tuple[Mismatch, ...]  # objects that every run writes before it arms


def compare_present(
    steps: tuple[SetupStep, ...], read: Callable[[SetupStep], int | None]
) -> Comparison:
    """Compare what a device has now with its set-up, without writing."""
    objects = read_back(steps)
    mismatches = compare(steps, {(each.object, each.sub): read(each) for each in objects})
    verified = {(each.object, each.sub) for each in objects if each.access == Access.VERIFY}
    wrong = tuple(each for each in mismatches if (each.object, each.sub) in verified)
    unset = tuple(each for each in mismatches if (each.object, each.sub) not in verified)
    return Comparison(len(objects), wrong, unset)


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
