"""What a changed calibration changes: which runs and rows, by how much, and what goes stale."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from rig.config.calibration_file import (
    CalibrationFile,
    OffsetCorrection,
    ScaleCorrection,
    TableCorrection,
)
from rig.recording.calibration.correction import At, OutsideError, corrected, holds
from rig.recording.calibration.sources import Stood


class Changed(NamedTuple):
    """A value that is read differently with the new version."""

    where: str
    field: str
    recorded: float | None  # None where the record does not hold the value itself
    old: float | None  # None where the old version refuses it
    new: float | None
    note: str
    stale: tuple[str, ...]  # what was worked out from the old value


class Difference(NamedTuple):
    """What a new version of a calibration changes."""

    old: str  # name and version
    new: str
    keys: tuple[tuple[str, object, object], ...]  # of the file: key, old, new
    changed: tuple[Changed, ...]
    unchanged: int  # values that are read as before
    untold: tuple[tuple[str, str], ...]  # where it cannot be told, and why; one each

    @property
    def stale(self) -> dict[str, tuple[str, ...]]:
        """What is to be made anew: run -> products."""
        found: dict[str, dict[str, None]] = {}
        for change in self.changed:
            found.setdefault(change.where, {}).update(dict.fromkeys(change.stale))
        return {where: tuple(names) for where, names in found.items() if names}


class NoComparisonError(ValueError):
    """Two calibrations that do not correct the same thing."""


def difference(old: CalibrationFile, new: CalibrationFile, stood: Iterable[Stood]) -> Difference:
    """What reading recorded values with ``new`` in place of ``old`` changes.

    Raises `NoComparisonError` unless both are of one name and quantity.
    """
    if (old.name, old.quantity) != (new.name, new.quantity):
        message = f"{old.title} ({old.quantity}) and {new.title} ({new.quantity})"
        raise NoComparisonError(f"{message} do not correct the same thing")
    changed = []
    unchanged = 0
    untold: dict[str, str] = {}
    for one in stood:
        try:
            rules = _rule(old, one.at), _rule(new, one.at)
        except OutsideError as error:
            untold.setdefault(one.where, one.note or str(error))
            continue
        if one.value is None:
            if rules[0] == rules[1]:
                unchanged += 1
            else:
                changed.append(_change(one, None, None))
            continue
        if one.mean and rules[0] != rules[1] and any(isinstance(r, TableCorrection) for r in rules):
            untold.setdefault(one.where, "a mean cannot be corrected by a table; read the record")
            continue
        before, after = _read(old, one), _read(new, one)
        if before == after:
            unchanged += 1
        else:
            changed.append(_change(one, before, after))
    return Difference(
        old.title, new.title, _keys(old, new), tuple(changed), unchanged, tuple(untold.items())
    )


def _change(one: Stood, before: float | None, after: float | None) -> Changed:
    return Changed(one.where, one.field, one.value, before, after, one.note, one.products)


def _rule(calibration: CalibrationFile, at: At) -> object:
    """What is done to values recorded there; equal rules do the same."""
    if not holds(calibration.valid, at):
        return calibration.outside
    correction = calibration.correction
    nothing = (isinstance(correction, ScaleCorrection) and correction.factor == 1.0) or (
        isinstance(correction, OffsetCorrection) and correction.offset == 0.0
    )
    return "unchanged" if nothing else correction


def _read(calibration: CalibrationFile, one: Stood) -> float | None:
    assert one.value is not None
    try:
        return corrected(calibration, one.value, one.at).value
    except OutsideError:
        return None


def _keys(old: CalibrationFile, new: CalibrationFile) -> tuple[tuple[str, object, object], ...]:
    """Keys of the two files that differ, leaf by leaf."""
    before, after = _leaves(_plain(old)), _leaves(_plain(new))
    names = dict.fromkeys((*before, *after))
    return tuple(
        (name, before.get(name), after.get(name))
        for name in names
        if before.get(name) != after.get(name)
    )


def _plain(calibration: CalibrationFile) -> dict[str, Any]:
    return calibration.model_dump(mode="json", by_alias=True, exclude_none=True)


def _leaves(mapping: dict[str, Any], above: str = "") -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in mapping.items():
        name = f"{above}.{key}" if above else key
        if isinstance(value, dict):
            found |= _leaves(value, name)
        else:
            found[name] = value
    return found
