"""The record of a campaign in its run, and the campaign of a recorded run."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from rig import laws
from rig.campaign.kind import AnyCampaign, AnyPlan, CampaignKind
from rig.config.campaign_file import BaseCampaignFile
from rig.config.law_settings import DEFAULT_LAW, IMPEDANCE
from rig.config.problems import display_path
from rig.config.reference import AnyReference, RecordedReference
from rig.identification.channels import AxisChannels
from rig.laws import Law, LawError, choice, find, load_source
from rig.planning.input_files import hash_input_file
from rig.planning.point import Point
from rig.planning.reference import ReferenceRecord, read_reference_record
from rig.planning.windows import repeat_period
from rig.recording.runs import RunError, RunInfo
from rig.recording.runs.windows import LEAST_MEASURE
from rig.row_contents import RowContents

SEED = "seed"  # key of a recorded plan and of its rows, with several seeds


def resolved_config(campaign: AnyCampaign) -> str:
    """Return JSON text with every key of every file, with defaults, points, and files with sha256.

    Equal campaigns give equal text.
    """
    records = {axis: _law_record(each.law) for axis, each in campaign.axis_laws.items()}
    config: dict[str, Any] = {
        "campaign": campaign.file.model_dump(mode="json", by_alias=True),
        "points": [
            {c.key: p.values[c.name] for c in campaign.file.columns() if c.name in p.values}
            for p in campaign.points
        ],
        "rig": campaign.rig.model_dump(mode="json", by_alias=True),
        "limits": campaign.limits.model_dump(mode="json", by_alias=True),
        "plant": campaign.plant,
        "law": records if len(records) > 1 else next(iter(records.values())),
        "files": [file.as_dict() for file in campaign.files],
    }
    return json.dumps(config, ensure_ascii=False, indent=2)


def _law_record(law: Law) -> dict[str, Any]:
    choices = {"choices": [_law_record(each) for each in law.parts]} if law.parts else {}
    path = display_path(Path(law.path)) if law.path else ""
    return law.record() | {"path": path} | choices


def law_source(campaign: AnyCampaign) -> str:
    """Return the source of the law that is given by its file; empty for a registered law.

    Of several axes, the result is JSON text with the sources of such laws by axis.
    """
    sources = {
        axis: laws.source_text(each.law)
        for axis, each in campaign.axis_laws.items()
        if each.law.is_file
    }
    if len(campaign.axis_laws) == 1:
        return next(iter(sources.values()), "")
    return json.dumps(sources) if sources else ""


def plan_record(campaign: AnyCampaign, plan: AnyPlan, contents: RowContents) -> dict[str, Any]:
    """Return the plan as a run records it, as JSON values; a kind adds the reference's scale."""
    sea, actuator = campaign.file.sea, campaign.file.kind_columns.actuator
    several = len(campaign.file.seeds) > 1
    description = sea.description() + (f", {seeds_text(campaign.file)}" if several else "")
    return {
        "dt": plan.dt,
        **({SEED: plan.seed} if several else {}),
        "rows": [
            {
                "row": r.row,
                "point": r.point,
                "repetition": r.repetition,
                **({SEED: r.seed} if several else {}),
                **({} if actuator is None else {actuator.name: r.place}),
                **r.setting._asdict(),
                "periods": r.periods,
                "measure_s": r.measure,
                **({} if r.least_measure == r.measure else {LEAST_MEASURE: r.least_measure}),
            }
            for r in plan.rows
        ],
        "device": "present" if plan.rows else "absent",
        "repeat_s": repeat_period(sea),
        "sea": sea.model_dump(mode="json") | {"words": description},
        **contents.as_records(),
        **moves_entry(campaign, plan),
        "duration_s": plan.duration,
    }


def seeds_text(file: BaseCampaignFile) -> str:
    """Return the seeds of the phases of a campaign's seas as text."""
    seeds = [str(file.sea_seed(seed)) for seed in file.seeds]
    return f"seed{'s' if len(seeds) > 1 else ''} {', '.join(seeds)}"


def moves_entry(campaign: AnyCampaign, plan: AnyPlan) -> dict[str, int]:
    """Return the number of moves between rows by its key; empty if no part of the rig moves."""
    first = campaign.file.kind_columns.first
    if first is None or first.actuator is None:
        return {}
    return {f"{first.heading}_moves": plan.moves}


def reference_record(
    reference: AnyReference,
    newtons_per_ampere: float,
    channels: Callable[[str], AxisChannels],
) -> dict[str, Any] | None:
    """Return the open-loop reference as identification needs it; None without one.

    ``newtons_per_ampere`` is the force (N, or N*m) per current of the drive of its axis,
    ``channels`` returns the channels of an axis.
    """
    if reference is None:
        return None
    return {
        "axis": reference.axis,
        "kind": reference.kind,
        "period_s": reference.period,
        "newtons_per_ampere": newtons_per_ampere,
        "channels": channels(reference.axis).as_record(),
        "words": reference.description(),
    }


class RecordedCampaign(NamedTuple):
    """The configuration in a run's record, validated by the current models."""

    kind: CampaignKind
    file: Any
    rig: Any
    limits: Any
    points: tuple[Point, ...]  # as recorded, without their locations in a file
    record: ReferenceRecord | None  # of a recorded reference
    seed: int  # one of those of the file
    plant: Mapping[str, Any] = MappingProxyType({})  # the file of the simulated one

    @property
    def sea_seed(self) -> int:
        """Seed of the sea's phases."""
        seed: int = self.file.sea_seed(self.seed)
        return seed


def campaign_from_record(
    kind: CampaignKind, config: dict[str, Any], law_text: bytes = b"", seed: int | None = None
) -> RecordedCampaign:
    """Return the campaign of a run, with the recorded reference that it names.

    ``law_text`` is that of `law_source`, ``seed`` one of its seeds (None: the first). Raises
    KeyError if the record lacks a part, and ValueError if the current models refuse it, the file of
    the reference has changed, or a law cannot be used here.
    """
    laws_of_axes = laws_from_record(config, law_text, kind.axes(config["rig"]))
    file = kind.model(laws_of_axes, config["rig"]).model_validate(config["campaign"])
    return RecordedCampaign(
        kind,
        file,
        kind.rig_file.model_validate(config["rig"]),
        kind.limits_file.model_validate(kind.earlier_limits(config["limits"])),
        tuple(
            Point({c.name: float(values[c.key]) for c in file.columns() if c.key in values}, {})
            for values in config["points"]
        ),
        _read_record(file, config),
        file.seeds[0] if seed is None else seed,
        config.get("plant") or {},
    )


def recorded_campaign(kind: CampaignKind, run: RunInfo) -> RecordedCampaign:
    """Return the campaign of a run in the sea of its last rows; raises `campaign_from_record`'s."""
    seed = run.plan.get(SEED)
    return campaign_from_record(kind, run.config, run.law_source, seed)


def logged_campaign(kind: CampaignKind, run: RunInfo) -> RecordedCampaign:
    """Return the campaign of a run; RunError if its record has none that is valid today."""
    try:
        return recorded_campaign(kind, run)
    except KeyError as error:
        raise RunError(f"{run.run}: its record holds no configuration ({error})") from None
    except ValueError as error:
        raise RunError(f"{run.run}: its configuration is not valid today: {error}") from None


def laws_from_record(
    config: dict[str, Any], law_text: bytes, axes: Sequence[str]
) -> dict[str, Law]:
    """Return the laws of a run: the recorded source of a file, or the law of that name here."""
    recorded = _recorded_laws(config, axes)
    sources = {axes[0]: law_text}
    if len(axes) > 1:
        sources = {axis: text.encode() for axis, text in json.loads(law_text or b"{}").items()}
    return {axis: _law(recorded.get(axis), sources.get(axis, b"")) for axis in axes}


def _recorded_laws(config: dict[str, Any], axes: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the record of each law by axis; empty for runs older than the choice of a law."""
    recorded = config.get("law")
    if not isinstance(recorded, dict):
        return {}
    return {axes[0]: recorded} if len(axes) == 1 else recorded


def _law(recorded: dict[str, Any] | None, source: bytes) -> Law:
    if recorded is None:
        return IMPEDANCE
    if "choices" in recorded:
        sources = json.loads(source or b"{}")
        return choice(
            [_law(each, sources.get(each["sha256"], "").encode()) for each in recorded["choices"]]
        )
    if not recorded["file"]:
        return IMPEDANCE if recorded["name"] == DEFAULT_LAW else find(recorded["name"])
    if hashlib.sha256(source).hexdigest() != recorded["sha256"]:
        raise LawError(f"the record lacks the source of its law {recorded['path']}")
    return load_source(source, Path(recorded["path"]))


def law_notice(kind: CampaignKind, config: dict[str, Any]) -> str:
    """Return how the laws on this host differ from those of a run; empty if they do not."""
    recorded = _recorded_laws(config, kind.axes(config["rig"]))
    each_law = chain.from_iterable(law.get("choices", [law]) for law in recorded.values())
    return "; ".join(filter(None, dict.fromkeys(map(_law_notice, each_law))))


def _law_notice(recorded: dict[str, Any]) -> str:
    path = recorded["path"]
    if recorded["file"]:
        try:
            now = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except OSError:
            return ""  # the record has the source
        if now == recorded["sha256"]:
            return ""
        return f"the law {path} has changed since the run (sha256); replayed is the recorded one"
    try:
        law = IMPEDANCE if recorded["name"] == DEFAULT_LAW else find(recorded["name"])
    except LawError as error:
        return str(error)
    if law.sha256 == recorded["sha256"]:
        return ""
    return f"the law {law.name} has changed since the run (sha256); replayed is that of today"


def _read_record(file: BaseCampaignFile, config: dict[str, Any]) -> ReferenceRecord | None:
    """Return the samples of a recorded reference, whose file a run stores by path and sha256."""
    if not isinstance(file.reference, RecordedReference):
        return None
    (recorded,) = (entry for entry in config["files"] if entry["role"] == "reference")
    try:
        current = hash_input_file("reference", Path(recorded["path"]))
    except OSError as error:
        message = f"its recorded reference {recorded['path']} cannot be read: {error.strerror}"
        raise ValueError(message) from None
    if current.sha256 != recorded["sha256"]:
        message = f"its recorded reference {recorded['path']} has changed since the run (sha256)"
        raise ValueError(message)
    return read_reference_record(current.path, file.reference)
