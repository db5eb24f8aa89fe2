"""Tables of faults: the faults of each device, and the required reaction of the rig."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from benchmarks.support.recorded import ROOT
from rig.kinds import registry

TABLES = ROOT / "configs" / "faults"
REFUSED, GOES_ON, UNDETECTED = "refused at start", "goes on", "not detected"
LOOP_LOST = "loop lost"
START, MOTION = "start", "motion"  # otherwise the fault is injected while the law acts
_ONSET_LABELS = {"": "", START: " from the start", MOTION: " in motion"}
NO_STOP = (REFUSED, GOES_ON, UNDETECTED)  # without a category, and without a time
_KEYS = {
    "fault", "must", "category", "within_s", "why", "value", "toward", "from", "short", "and",
    "long",
}  # fmt: skip

CATEGORY = {
    reason.name: reason.category
    for kind in registry.OWN_PACKAGES
    for reason in registry.find(kind).room("tick").find_kind("").reason_table.reasons
}
"""The stop category of every reason, by name; both kinds of rig agree in those they share."""


class FaultRow(NamedTuple):
    """One fault of one device or link."""

    device: str  # name at the emulated devices
    fault: str
    expected: str  # name of rig.realtime.safety.Reason, LOOP_LOST or one of NO_STOP
    category: int | None  # of the stop; None without one
    max_seconds: float  # s from the fault until no motor has power; 0 where the run does not stop
    explanation: str  # never empty if the run goes on
    value: float | None  # magnitude of the fault; None: its default
    toward: str | None  # of a link's fault: host or device alone
    onset: str  # START: before the run; MOTION: at speed; empty: during the run
    short: bool  # part of the short selection
    long_run: bool  # needs a longer run, because detection is slow
    alternatives: tuple[str, ...]  # other correct reasons, if their order varies between runs

    @property
    def name(self) -> str:
        """Return the name of the row: device, fault, value, onset."""
        name = f"{self.device}: {self.fault}"
        name += f" {self.value:g}" if self.value is not None else ""
        return name + _ONSET_LABELS[self.onset]

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Return the correct verdicts; GOES_ON and UNDETECTED look the same in a run."""
        expected = (self.expected, *self.alternatives)
        return tuple(GOES_ON if verdict == UNDETECTED else verdict for verdict in expected)


def read_rows(path: Path) -> list[FaultRow]:
    """Return all rows of a table; ValueError names a contradictory row."""
    tree: dict[str, list[dict[str, Any]]] = YAML(typ="safe").load(path.read_text())
    return [_row(device, keys) for device, rows in tree.items() for keys in rows]


def table_errors(table: list[FaultRow]) -> list[str]:
    """Return errors of a table: duplicate rows, or a short selection of the wrong size."""
    names = [row.name for row in table]
    errors = [f"{name}: occurs twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    short = sum(row.short for row in table)
    return errors + (
        [] if 6 <= short <= 10 else [f"{short} rows in the short selection, not 6 to 10"]
    )


def missing_rows(table: list[FaultRow], available: Mapping[str, Iterable[str]]) -> list[str]:
    """Return faults without a row, and rows without such a fault; ``available``: by device."""
    existing = {(device, fault) for device, faults in available.items() for fault in faults}
    listed = {(row.device, row.fault) for row in table}
    return [
        *(f"{device}: {fault}: has no row" for device, fault in sorted(existing - listed)),
        *(
            f"{device}: {fault}: there is no such fault"
            for device, fault in sorted(listed - existing)
        ),
    ]


def _row(device: str, keys: dict[str, Any]) -> FaultRow:
    label = f"{device}: {keys.get('fault')}"
    if unknown := set(keys) - _KEYS:
        raise ValueError(f"{label}: unknown {', '.join(sorted(unknown))}")
    if (onset := keys.get("from", "")) not in _ONSET_LABELS:
        raise ValueError(f"{label}: from {onset!r}, not {START} or {MOTION}")
    expected = keys["must"]
    row = FaultRow(
        device,
        keys["fault"],
        expected,
        keys.get("category"),
        float(keys.get("within_s", 0.0)),
        keys.get("why", ""),
        keys.get("value"),
        keys.get("toward"),
        onset,
        bool(keys.get("short", False)),
        bool(keys.get("long", False)),
        tuple(keys.get("and", ())),
    )
    if expected in NO_STOP:
        if (
            row.category is not None
            or row.max_seconds
            or (expected != REFUSED and not row.explanation)
        ):
            raise ValueError(
                f"{label}: {expected} needs an explanation (why), and no category and no time"
            )
    elif expected == LOOP_LOST:
        if row.category is not None or row.max_seconds <= 0.0:
            raise ValueError(f"{label}: {expected} needs a time within_s, and no category")
    elif row.category != CATEGORY[expected] or row.max_seconds <= 0.0:
        raise ValueError(
            f"{label}: {expected} needs category {CATEGORY[expected]} and a time within_s"
        )
    return row
