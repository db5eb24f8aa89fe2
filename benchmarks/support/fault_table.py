"""The table of faults: what each device can suffer, and what the rig must then do."""

from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

from benchmarks.support.recorded import ROOT
from rig.safety import CATEGORY, Reason

TABLE = ROOT / "configs" / "faults" / "wavebot.yaml"
REFUSED, UNDETECTED = "refused at start", "not detected"
_KEYS = {
    "fault", "must", "category", "within_s", "why", "value", "toward", "from", "short", "and",
}  # fmt: skip


class Row(NamedTuple):
    """One fault of one device or link."""

    device: str  # name at the emulated devices
    fault: str
    must: str  # name of rig.safety.Reason, REFUSED or UNDETECTED
    category: int | None  # of the stop; None without one
    within: float  # s from the fault until both motors are without power; 0 without a stop
    why: str  # what is behind it, for people; never empty where nothing is detected
    value: float | None  # the fault's number, None: its own
    toward: str | None  # of a link's fault: host or device alone
    at_start: bool  # there before the run, not come in it
    short: bool  # of the short selection
    also: tuple[str, ...]  # other reasons that are as good: which comes first is chance

    @property
    def name(self) -> str:
        """For people."""
        told = f"{self.device}: {self.fault}"
        told += f" {self.value:g}" if self.value is not None else ""
        return told + (" from the start" if self.at_start else "")


def rows(path: Path = TABLE) -> list[Row]:
    """All rows of the table; ValueError names one that contradicts itself."""
    tree: dict[str, list[dict[str, Any]]] = YAML(typ="safe").load(path.read_text())
    return [_row(device, one) for device, several in tree.items() for one in several]


def _row(device: str, one: dict[str, Any]) -> Row:
    what = f"{device}: {one.get('fault')}"
    if unknown := set(one) - _KEYS:
        raise ValueError(f"{what}: unknown {', '.join(sorted(unknown))}")
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
        one.get("from") == "start",
        bool(one.get("short", False)),
        tuple(one.get("and", ())),
    )
    if must in (REFUSED, UNDETECTED):
        if row.category is not None or (must == UNDETECTED and not row.why):
            raise ValueError(f"{what}: {must} has no category, and says why")
    elif row.category != CATEGORY[Reason[must]] or row.within <= 0.0:
        raise ValueError(f"{what}: {must} is of category {CATEGORY[Reason[must]]}, within some s")
    return row
