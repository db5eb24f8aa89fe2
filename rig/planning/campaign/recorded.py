"""A campaign again from the configuration in a run's record: what it was told to do."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.campaign_file import CampaignFile
from rig.config.columns import COLUMNS
from rig.config.limits_file import LimitsFile
from rig.config.recorded_limits import wavebot_limits
from rig.config.reference import RecordedReference
from rig.config.rig_file import RigFile
from rig.planning.campaign.input_files import read_file
from rig.planning.campaign.point import Point
from rig.planning.campaign.reference import Record, read_record


class Logged(NamedTuple):
    """The configuration in a run's record, as today's code understands it."""

    file: CampaignFile
    rig: RigFile
    limits: LimitsFile
    points: tuple[Point, ...]  # as the run keeps them; where they stood in a file nobody asks
    record: Record | None  # of a recorded reference


def campaign_as_logged(config: dict[str, Any]) -> Logged:
    """The campaign of a run, with the recorded reference that it names.

    Raises KeyError where the record lacks a part, ValueError where it is none of today's or the
    reference is not what it was.
    """
    file = CampaignFile.model_validate(config["campaign"])
    return Logged(
        file,
        RigFile.model_validate(config["rig"]),
        LimitsFile.model_validate(wavebot_limits(config["limits"])),
        tuple(
            Point({c.name: float(given[c.key]) for c in COLUMNS if c.key in given}, {})
            for given in config["points"]
        ),
        _record(file, config),
    )


def _record(file: CampaignFile, config: dict[str, Any]) -> Record | None:
    """The samples of a recorded reference: a run keeps their file's place and sha256, not them."""
    if not isinstance(file.reference, RecordedReference):
        return None
    (then,) = (each for each in config["files"] if each["role"] == "reference")
    try:
        now = read_file("reference", Path(then["path"]))
    except OSError as error:
        message = f"its recorded reference {then['path']} cannot be read: {error.strerror}"
        raise ValueError(message) from None
    if now.sha256 != then["sha256"]:
        raise ValueError(f"its recorded reference {then['path']} is no longer what it was")
    return read_record(now.path, file.reference)
