"""Tables of faults: the faults of each device, and the required reaction of the rig."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from benchmarks.support.recorded import ROOT
from rig import kinds

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
    for kind in kinds.OWN_PACKAGES
    for reason in kinds.find(kind).room("tick").find_kind("").reason_table.reasons
}
"""The stop category of every reason, by name; both kinds of rig agree in those they share."""


class FaultRow(NamedTuple):
    """One fault of one device or link."""

    device: str  # name at the emulated devices
    fault: str
    expected: str  # name of rig.realtime.safety.Reason, LOOP_LOST or one of NO_STOP
    category: int | None  # of the stop; None without one
    max_seconds: float  # s from the fault until no motor has power; 0 where the run does not stop
    explanation: str  # explanation for people; never empty if the run goes on
    value: float | None  # magnitude of the fault; None: its default
    toward: str | None  # of a link's fault: host or device alone
    onset: str  # START: before the run; MOTION: at speed; empty: during the run
    short: bool  # part of the short selection
    long_run: bool  # needs a longer run, because detection is slow
    alternatives: tuple[str, ...]  # other correct reasons: which comes first is chance

    @property
    def name(self) -> str:
        """Return the name of the row for people."""
        name = f"{self.device}: {self.fault}"
        name += f" {self.value:g}" if self.value is not None else ""
        return name + _ONSET_LABELS[self.onset]

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Return the correct verdicts; GOES_ON and UNDETECTED look the same in a run."""
        return tuple(
            GOES_ON if one == UNDETECTED else one for one in (self.expected, *self.alternatives)
        )


def read_rows(path: Path) -> list[FaultRow]:
    """Return all rows of a table; ValueError names a contradictory row."""
    tree: dict[str, list[dict[str, Any]]] = YAML(typ="safe").load(path.read_text())
    return [_row(device, one) for device, several in tree.items() for one in several]


def table_errors(table: list[FaultRow]) -> list[str]:
    """Return errors of a table: duplicate rows, or a short selection of the wrong size."""
    names = [row.name for row in table]
    errors = [f"{name}: occurs twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    short = sum(row.short for row in table)
    return errors + (
        [] if 6 <= short <= 10 else [f"{short} rows in the short selection, not 6 to 10"]
    )


def missing_rows(table: list[FaultRow], available: Mapping[str, Iterable[str]]) -> list[str]:
    """Return faults without a row, and rows without such a fault (``there``: faults by device)."""
    existing = {(device, fault) for device, faults in available.items() for fault in faults}
    listed = {(row.device, row.fault) for row in table}
    return [
        *(f"{device}: {fault}: has no row" for device, fault in sorted(existing - listed)),
        *(
            f"{device}: {fault}: there is no such fault"
            for device, fault in sorted(listed - existing)
        ),
    ]


def _row(device: str, one: dict[str, Any]) -> FaultRow:
    label = f"{device}: {one.get('fault')}"
    if unknown := set(one) - _KEYS:
        raise ValueError(f"{label}: unknown {', '.join(sorted(unknown))}")
    if (since := one.get("from", "")) not in _ONSET_LABELS:
        raise ValueError(f"{label}: from {since!r}, not {START} or {MOTION}")
    must = one["must"]
    row = FaultRow(
        device,
        one["fault"],
        must,
        one.get("category"),
        float(one.get("within_s", 0.0)),
        one.get("why", ""),
        one.get("value"),
        one.get("toward"),
        since,
        bool(one.get("short", False)),
        bool(one.get("long", False)),
        tuple(one.get("and", ())),
    )
    if must in NO_STOP:
        if row.category is not None or row.max_seconds or (must != REFUSED and not row.explanation):
            raise ValueError(
                f"{label}: {must} needs an explanation (why), and no category and no time"
            )
    elif must == LOOP_LOST:
        if row.category is not None or row.max_seconds <= 0.0:
            raise ValueError(f"{label}: {must} needs a time within_s, and no category")
    elif row.category != CATEGORY[must] or row.max_seconds <= 0.0:
        raise ValueError(f"{label}: {must} needs category {CATEGORY[must]} and a time within_s")
    return row
