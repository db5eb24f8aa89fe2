"""Reconstruction of a campaign from the configuration in a run's record."""

import hashlib
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.law_settings import DEFAULT_LAW, IMPEDANCE
from rig.config.limits_file import complete_limits
from rig.config.reference import RecordedReference
from rig.kinds.wavebot.config.campaign_file import CampaignFile, campaign_model
from rig.kinds.wavebot.config.columns import COLUMNS
from rig.kinds.wavebot.config.limits_file import LATER_LIMITS, LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.laws import Law, LawError, find, load_source
from rig.planning.input_files import hash_input_file
from rig.planning.point import Point
from rig.planning.reference import ReferenceRecord, read_reference_record
from rig.recording.runs import RunError, RunInfo


class RecordedCampaign(NamedTuple):
    """The configuration in a run's record, validated by the current models."""

    file: CampaignFile
    rig: RigFile
    limits: LimitsFile
    points: tuple[Point, ...]  # as recorded, without their locations in a file
    record: ReferenceRecord | None  # of a recorded reference


def campaign_from_record(config: dict[str, Any], law_source: bytes = b"") -> RecordedCampaign:
    """Return the campaign of a run, with the recorded reference that it names.

    ``law_source`` is the text of a law that was given by its file. Raises KeyError if the record
    lacks a part, and ValueError if the current models refuse it, the file of the reference has
    changed, or the law cannot be used here.
    """
    law = law_from_record(config, law_source)
    file = campaign_model(law).model_validate(config["campaign"])
    columns = COLUMNS.with_law(law.columns)
    return RecordedCampaign(
        file,
        RigFile.model_validate(config["rig"]),
        LimitsFile.model_validate(complete_limits(config["limits"], LATER_LIMITS)),
        tuple(
            Point({c.name: float(values[c.key]) for c in columns if c.key in values}, {})
            for values in config["points"]
        ),
        _read_record(file, config),
    )


def logged_campaign(run: RunInfo) -> RecordedCampaign:
    """Return the campaign of a run; RunError if its record has none that is valid today."""
    try:
        return campaign_from_record(run.config, run.law_source)
    except KeyError as error:
        raise RunError(f"{run.run}: its record holds no configuration ({error})") from None
    except ValueError as error:
        raise RunError(f"{run.run}: its configuration is not valid today: {error}") from None


def law_from_record(config: dict[str, Any], law_source: bytes) -> Law:
    """Return the law of a run: the recorded source of a file, or the law of that name here."""
    recorded = config.get("law")
    if not isinstance(recorded, dict):
        return IMPEDANCE  # runs recorded before there was a choice
    if not recorded["file"]:
        return IMPEDANCE if recorded["name"] == DEFAULT_LAW else find(recorded["name"])
    if hashlib.sha256(law_source).hexdigest() != recorded["sha256"]:
        raise LawError(f"the record lacks the source of its law {recorded['path']}")
    return load_source(law_source, Path(recorded["path"]))


def law_notice(config: dict[str, Any]) -> str:
    """Return how the law on this host differs from that of a run; empty if it does not."""
    recorded = config.get("law")
    if not isinstance(recorded, dict):
        return ""
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


def _read_record(file: CampaignFile, config: dict[str, Any]) -> ReferenceRecord | None:
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
