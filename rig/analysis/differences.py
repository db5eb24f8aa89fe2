"""Differences between the configurations of two runs, in order of importance."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from rig.analysis.rows import wave_period
from rig.config.differences import ABSENT, value_text
from rig.recording.runs.folder import RunInfo

GROUPS = (
    "mode", "sea", "drive", "control", "plant", "calibration", "code", "timing", "limits", "rig",
    "campaign", "host",
)  # fmt: skip
_CALIBRATION = (  # constants that convert device values to forces, positions and rates
    "torque_constant", "gear_ratio", "counts_per_revolution", "metres_per_radian", "spring.map",
    "calibration",
)  # fmt: skip
_CONTROL = ("law", "reference")  # sections of the control of every rig
_EXCLUDED = ("campaign.name", "campaign.matrix", "campaign.rig", "campaign.plant", "campaign.sea")
_ELEVATION = (
    "elevation"  # role of a recorded sea's file; the configuration does not contain its data
)
_LAW = "law"  # role of the file of a law
_MAX_LENGTH = 60  # characters of a displayed value


class Difference(NamedTuple):
    """One setting that differs between two runs."""

    group: str  # one of GROUPS
    key: str
    a: str
    b: str


def differences(a: RunInfo, b: RunInfo) -> list[Difference]:
    """Return every difference between the resolved configurations, the code and the host.

    The gain matrix is excluded; `rig.analysis.comparison` matches its points one by one.
    """
    settings_a, settings_b = dict(_flat_settings(a)), dict(_flat_settings(b))
    control = {*_CONTROL, *a.row_contents.control, *b.row_contents.control}
    found = [
        Difference(
            _group(key, control), key, settings_a.get(key, ABSENT), settings_b.get(key, ABSENT)
        )
        for key in [*settings_a, *(key for key in settings_b if key not in settings_a)]
        if settings_a.get(key) != settings_b.get(key)
    ]
    return sorted(found, key=lambda each: GROUPS.index(each.group))


def _flat_settings(run_facts: RunInfo) -> Iterator[tuple[str, str]]:
    yield "mode", run_facts.mode or ABSENT
    yield from _flatten("sea", normalised_sea(run_facts))
    config = run_facts.config
    for name in ("campaign", "rig", "limits", "plant"):
        for key, value in _flatten(name, config.get(name)):
            if not key.startswith(_EXCLUDED):
                yield key, value
    for file in config.get("files") or ():
        if isinstance(file, dict) and file.get("role") == _ELEVATION:
            yield f"{_ELEVATION} file", f"sha256 {str(file.get('sha256', ''))[:12]}"
        if isinstance(file, dict) and file.get("role") == _LAW:
            name = str(file.get("path", "")).rpartition("/")[2]
            yield f"{_LAW} file {name}", f"sha256 {str(file.get('sha256', ''))[:12]}"
    for key in ("version", "git", "dirty", "python"):
        if run_facts.code.get(key) is not None:
            yield f"code.{key}", value_text(run_facts.code[key])
    yield from _flatten("code.packages", run_facts.code.get("packages"))
    yield "host", str(run_facts.host.get("name") or run_facts.host.get("hostname") or ABSENT)


def normalised_sea(run_facts: RunInfo) -> dict[str, Any]:
    """Return the parameters of a run's sea in a form that is equal for equal seas."""
    planned = run_facts.plan.get("sea") or {}
    sea = {k: v for k, v in planned.items() if k != "words" and v is not None}
    if "frequency_hz" in sea or "period_s" in sea:
        period = wave_period(run_facts.plan)
        sea.pop("frequency_hz", None)
        sea["period_s"] = float(f"{period:.9g}") if period else None
    if "file" in sea:
        sea["file"] = str(sea["file"]).rpartition("/")[2]  # the contents are compared by checksum
    random = sea.get("kind") not in (None, "calm", "regular", "recorded")
    campaign = run_facts.config.get("campaign")
    if random and "seed" not in sea and isinstance(campaign, dict):
        sea["seed"] = campaign.get("seed")
    return sea


def _flatten(key: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield settings by dotted path; a quantity with unit and source, or a list of values, is one.

    Entries of a list of mappings are settings by their number.
    """
    if isinstance(value, dict) and "value" in value:
        unit = str(value.get("unit") or "").removeprefix("1")  # 1 is no unit
        yield key, f"{value_text(value['value'])} {unit}".rstrip()
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _flatten(f"{key}.{name}", inner)
    elif isinstance(value, list) and any(isinstance(each, dict) for each in value):
        for number, inner in enumerate(value):
            yield from _flatten(f"{key}[{number}]", inner)
    elif value is not None:
        yield key, value_text(value)


def sea_text(run_facts: RunInfo) -> str:
    """Return the sea of a run in one line, with the seed of its phases."""
    sea = run_facts.plan.get("sea") or {}
    text = str(sea.get("words") or sea.get("kind") or "not recorded")
    seed = normalised_sea(run_facts).get("seed")
    return text if seed is None or "seed" in text else f"{text}, {_seeds_text(seed)}"


def _seeds_text(seed: Any) -> str:
    return f"seeds {value_text(seed)}" if isinstance(seed, list) else f"seed {value_text(seed)}"


def unlike_sea_texts(a: RunInfo, b: RunInfo) -> tuple[str, str]:
    """Return the seas of two runs in one line each, with what differs where the lines are equal."""
    texts = sea_text(a), sea_text(b)
    if texts[0] != texts[1]:
        return texts
    seas = normalised_sea(a), normalised_sea(b)
    keys = [key for key in {**seas[0], **seas[1]} if seas[0].get(key) != seas[1].get(key)]
    if not keys:
        return texts[0], f"{texts[1]}, with another elevation file"
    first, second = (
        ", ".join([text, *(f"{key} {value_text(sea.get(key))}" for key in keys)])
        for text, sea in zip(texts, seas, strict=True)
    )
    return first, second


def shorten(text: str) -> str:
    """Return a value truncated to `_MAX_LENGTH` characters."""
    return text if len(text) <= _MAX_LENGTH else f"{text[: _MAX_LENGTH - 4]} ..."


def _group(key: str, control: set[str]) -> str:
    if key.startswith(f"{_LAW} file "):
        return "control"
    first, _, rest = key.partition(".")
    if first == f"{_ELEVATION} file":
        return "sea"
    if first in ("campaign", "rig") and rest.partition(".")[0] in control:
        return "control"
    if rest == "drive" or rest.startswith("drive."):
        return "drive"
    if first == "rig" and any(each in rest for each in _CALIBRATION):
        return "calibration"
    if first == "campaign" and rest.startswith(("timing", "start", "tare")):
        return "timing"
    return first if first in GROUPS else "campaign"
