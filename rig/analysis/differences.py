"""What differs between the configurations of two runs, in the order in which it matters."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.analysis.rows import wave_period
from rig.recording.runs.folder import Facts

GROUPS = (
    "mode", "sea", "drive", "control", "plant", "calibration", "code", "timing", "limits", "rig",
    "campaign", "host",
)  # fmt: skip
ABSENT = "not there"

_CALIBRATION = (  # how numbers of the rig become forces, positions and rates
    "torque_constant", "gear_ratio", "counts_per_revolution", "metres_per_radian", "spring.map",
    "calibration",
)  # fmt: skip
_CONTROL = ("surge.", "law.", "reference", "station_keeping.", "surge_hold.")
_LEFT_OUT = ("campaign.name", "campaign.matrix", "campaign.rig", "campaign.plant", "campaign.sea")
_ELEVATION = "elevation"  # role of a recorded sea's file, whose data the configuration lacks
_LONGEST = 60  # letters of a value


class Difference(NamedTuple):
    """One setting that is not the same."""

    group: str  # one of GROUPS
    key: str
    a: str
    b: str


def differences(a: Facts, b: Facts) -> list[Difference]:
    """Every setting of the resolved configurations, the code and the host that differs.

    Not the matrix itself: its points are matched one by one.
    """
    one, other = dict(_all(a)), dict(_all(b))
    found = [
        Difference(_group(key), key, one.get(key, ABSENT), other.get(key, ABSENT))
        for key in [*one, *(key for key in other if key not in one)]
        if one.get(key) != other.get(key)
    ]
    return sorted(found, key=lambda each: GROUPS.index(each.group))


def _all(known: Facts) -> Iterator[tuple[str, str]]:
    yield "mode", known.mode or ABSENT
    yield from _flat("sea", sea(known))
    config = known.config
    for name in ("campaign", "rig", "limits", "plant"):
        for key, value in _flat(name, config.get(name)):
            if not key.startswith(_LEFT_OUT):
                yield key, value
    for file in config.get("files") or ():
        if isinstance(file, dict) and file.get("role") == _ELEVATION:
            yield f"{_ELEVATION} file", f"sha256 {str(file.get('sha256', ''))[:12]}"
    for key in ("version", "git", "dirty", "python"):
        if known.code.get(key) is not None:
            yield f"code.{key}", _text(known.code[key])
    yield from _flat("code.packages", known.code.get("packages"))
    yield "host", str(known.host.get("name") or known.host.get("hostname") or ABSENT)


def sea(known: Facts) -> dict[str, Any]:
    """What makes a run's sea: two ways of writing one sea are one sea."""
    told = known.plan.get("sea") or {}
    found = {k: v for k, v in told.items() if k != "words" and v is not None}
    if "frequency_hz" in found or "period_s" in found:
        period = wave_period(known.plan)
        found.pop("frequency_hz", None)
        found["period_s"] = float(f"{period:.9g}") if period else None
    if "file" in found:
        found["file"] = str(found["file"]).rpartition("/")[2]  # its contents have a checksum
    random = found.get("kind") not in (None, "calm", "regular", "recorded")
    campaign = known.config.get("campaign")
    if random and "seed" not in found and isinstance(campaign, dict):
        found["seed"] = campaign.get("seed")
    return found


def _flat(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Settings by dotted path; a quantity with unit and source is one, and so is a list."""
    if isinstance(value, dict) and "value" in value:
        unit = str(value.get("unit") or "").removeprefix("1")  # 1 is no unit
        yield key, f"{_text(value['value'])} {unit}".rstrip()
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(f"{key}.{name}", inner)
    elif value is not None:
        yield key, _text(value)


def _text(value: Any) -> str:
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, int | float):
        return f"{value:.10g}"
    return json.dumps(value, ensure_ascii=False)


def shortened(text: str) -> str:
    """A value short enough for a line; a longer one shows its beginning."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."


def _group(key: str) -> str:
    first, _, rest = key.partition(".")
    if first == f"{_ELEVATION} file":
        return "sea"
    if first in ("campaign", "rig") and rest.startswith(_CONTROL):
        return "control"
    if rest == "drive" or rest.startswith("drive."):
        return "drive"
    if first == "rig" and any(word in rest for word in _CALIBRATION):
        return "calibration"
    if first == "campaign" and rest.startswith(("timing", "start", "tare")):
        return "timing"
    return first if first in GROUPS else "campaign"
