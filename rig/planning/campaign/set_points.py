"""The complete set point of a row: what the matrix gives, and the campaign or rig for the rest."""

from collections.abc import Iterator
from typing import NamedTuple

from rig.config.campaign_file import CampaignFile
from rig.config.columns import COLUMNS, DRIVE_COLUMNS
from rig.config.problems import Problem
from rig.config.rig_file import CustomDrive, RigFile
from rig.config.yaml_source import Locate
from rig.planning.campaign.point import Point


class Setting(NamedTuple):
    """One set point; the names are those of `rig.config.columns`."""

    spring_rate: float  # N/m
    kp: float  # N*s/m
    ki: float  # N/m
    km: float  # kg
    reference_scale: float
    realisation: float  # of the multisine reference, from 1; 0 where there is none
    surge_kp: float  # N*s/m
    surge_ki: float  # N/m
    bus_voltage: float  # V; 0 like all that follows where the drive has no such setting
    switching_period: float  # s
    hysteresis_tolerance: float  # A
    velocity_threshold: float  # m/s
    discharge_level: float  # set of dump resistors


NOTHING = Setting(*(0.0 for _ in COLUMNS))
"""Nothing is asked of the rig."""


def setting(campaign: CampaignFile, rig: RigFile, point: Point) -> Setting:
    """The set point of a point of the matrix."""
    return Setting(**{**_defaults(campaign, rig), **point.given})


def drive_settings(campaign: CampaignFile, rig: RigFile) -> CustomDrive | None:
    """Settings of the custom drive for this campaign; None for a drive that has none."""
    if not isinstance(rig.drive, CustomDrive):
        return None
    ours = campaign.drive.model_dump(exclude_none=True, exclude={"supply"})
    return rig.drive.model_copy(update=ours)


def foreign_to_drive(
    campaign: CampaignFile | None, points: tuple[Point, ...], rig: RigFile, locate: Locate
) -> Iterator[Problem]:
    """A problem for each key and column that this rig's drive cannot take, told where it stands."""
    if isinstance(rig.drive, CustomDrive):
        return
    message = "the rig's drive has no such setting; only one of kind custom has"
    for key in sorted(campaign.drive.model_fields_set) if campaign is not None else ():
        yield locate.problem(("drive", key), None, message)
    for column in DRIVE_COLUMNS:
        where = next((p.at[column.name] for p in points if column.name in p.at), None)
        if where is not None:
            yield where.problem(None, message)


def _defaults(campaign: CampaignFile, rig: RigFile) -> dict[str, float]:
    found = dict.fromkeys((column.name for column in COLUMNS), 0.0)
    found["reference_scale"] = 1.0
    if campaign.reference is not None:
        found["realisation"] = float(getattr(campaign.reference, "realisation", 1))
    surge, keeping = campaign.surge, rig.station_keeping
    kp, ki = surge.kp_n_s_per_m, surge.ki_n_per_m
    found["surge_kp"] = keeping.kp_n_s_per_m if kp is None else kp
    found["surge_ki"] = keeping.ki_n_per_m if ki is None else ki
    drive = drive_settings(campaign, rig)
    if drive is not None:
        found |= {column.name: float(getattr(drive, column.key)) for column in DRIVE_COLUMNS}
    return found
