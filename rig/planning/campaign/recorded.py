"""Reconstruction of a campaign from the configuration in a run's record."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.campaign_file import CampaignFile
from rig.config.columns import COLUMNS
from rig.config.limits_file import LimitsFile
from rig.config.recorded_limits import complete_wavebot_limits
from rig.config.reference import RecordedReference
from rig.config.rig_file import RigFile
from rig.planning.campaign.input_files import hash_input_file
from rig.planning.campaign.point import Point
from rig.planning.campaign.reference import ReferenceRecord, read_reference_record


class RecordedCampaign(NamedTuple):
    """The configuration in a run's record, validated by the current models."""

    file: CampaignFile
    rig: RigFile
    limits: LimitsFile
    points: tuple[Point, ...]  # as recorded, without their locations in a file
    record: ReferenceRecord | None  # of a recorded reference


def campaign_from_record(config: dict[str, Any]) -> RecordedCampaign:
    """Return the campaign of a run, with the recorded reference that it names.

    Raises KeyError if the record lacks a part, and ValueError if the current models refuse it or
    the file of the reference has changed.
    """
    file = CampaignFile.model_validate(config["campaign"])
    return RecordedCampaign(
        file,
        RigFile.model_validate(config["rig"]),
        LimitsFile.model_validate(complete_wavebot_limits(config["limits"])),
        tuple(
            Point({c.name: float(values[c.key]) for c in COLUMNS if c.key in values}, {})
            for values in config["points"]
        ),
        _read_record(file, config),
    )


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
