"""The tables of faults: what each device can suffer, and what the rig must then do."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from benchmarks.support.recorded import ROOT
from rig.realtime.safety import CATEGORY, Reason

TABLES = ROOT / "configs" / "faults"
REFUSED, GOES_ON, UNDETECTED = "refused at start", "goes on", "not detected"
LOOP_LOST = "loop lost"
START, MOTION = "start", "motion"  # else it comes while the law acts
_NAMED = {"": "", START: " from the start", MOTION: " in motion"}
NO_STOP = (REFUSED, GOES_ON, UNDETECTED)  # without a category, and without a time
_KEYS = {
    "fault", "must", "category", "within_s", "why", "value", "toward", "from", "short", "and",
    "long",
}  # fmt: skip


class Row(NamedTuple):
    """One fault of one device or link."""

    device: str  # name at the emulated devices
    fault: str
    must: str  # name of rig.realtime.safety.Reason, LOOP_LOST or one of NO_STOP
    category: int | None  # of the stop; None without one
    within: float  # s from the fault until no motor has power; 0 where the run does not stop
    why: str  # what is behind it, for people; never empty where the run goes on
    value: float | None  # the fault's number, None: its own
    toward: str | None  # of a link's fault: host or device alone
    since: str  # START: there before the run; MOTION: come at speed; empty: come in the run
    short: bool  # of the short selection
    long: bool  # in a run that measures for longer: what it shows takes its time
    also: tuple[str, ...]  # other reasons that are as good: which comes first is chance

    @property
    def name(self) -> str:
        """For people."""
        told = f"{self.device}: {self.fault}"
        told += f" {self.value:g}" if self.value is not None else ""
        return told + _NAMED[self.since]

    @property
    def verdicts(self) -> tuple[str, ...]:
        """What may be found: a run that goes on looks the same whether it rightly does or not."""
        return tuple(GOES_ON if one == UNDETECTED else one for one in (self.must, *self.also))


def rows(path: Path) -> list[Row]:
    """All rows of a table; ValueError names one that contradicts itself."""
    tree: dict[str, list[dict[str, Any]]] = YAML(typ="safe").load(path.read_text())
    return [_row(device, one) for device, several in tree.items() for one in several]


def unsound(several: list[Row]) -> list[str]:
    """What of a table cannot be, in words: rows there twice, too many in the short selection."""
    names = [row.name for row in several]
    said = [f"{name}: there twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    short = sum(row.short for row in several)
    return said + (
        [] if 6 <= short <= 10 else [f"{short} rows in the short selection, not 6 to 10"]
    )


def gaps(several: list[Row], there: Mapping[str, Iterable[str]]) -> list[str]:
    """Where a table and the faults that are there (by device) do not cover each other, in words."""
    can = {(device, fault) for device, faults in there.items() for fault in faults}
    have = {(row.device, row.fault) for row in several}
    return [
        *(f"{device}: {fault}: has no row" for device, fault in sorted(can - have)),
        *(f"{device}: {fault}: there is no such fault" for device, fault in sorted(have - can)),
    ]


def _row(device: str, one: dict[str, Any]) -> Row:
    what = f"{device}: {one.get('fault')}"
    if unknown := set(one) - _KEYS:
        raise ValueError(f"{what}: unknown {', '.join(sorted(unknown))}")
    if (since := one.get("from", "")) not in _NAMED:
        raise ValueError(f"{what}: from {since!r}, not {START} or {MOTION}")
    must = one["must"]
    row = Row(
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
        if row.category is not None or row.within or (must != REFUSED and not row.why):
            raise ValueError(f"{what}: {must} has no category and no time, and says why")
    elif must == LOOP_LOST:
        if row.category is not None or row.within <= 0.0:
            raise ValueError(f"{what}: {must} has no category, and is safe within some s")
    elif row.category != CATEGORY[Reason[must]] or row.within <= 0.0:
        raise ValueError(f"{what}: {must} is of category {CATEGORY[Reason[must]]}, within some s")
    return row
