"""The complete set point of a row: values of the matrix, and defaults of the campaign or rig."""

from collections import namedtuple
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple, cast

from rig.config.problems import Problem
from rig.config.yaml_source import SourceMap
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import COLUMNS, DRIVE_COLUMNS
from rig.kinds.wavebot.config.rig_file import CustomDrive, RigFile
from rig.laws import Law
from rig.planning.point import Point


class RowSetting(NamedTuple):
    """The set point of a row for the impedance law; names as in `config.columns`.

    Those for other laws have the law's columns in the place of Kp, Ki and Km (`setting_type`).
    """

    spring_rate: float  # N/m
    kp: float  # N*s/m
    ki: float  # N/m
    km: float  # kg
    reference_scale: float
    realisation: float  # of the multisine reference, from 1; 0 without a reference
    surge_kp: float  # N*s/m
    surge_ki: float  # N/m
    bus_voltage: float  # V; this and all following fields are 0 for a drive without settings
    switching_period: float  # s
    hysteresis_tolerance: float  # A
    velocity_threshold: float  # m/s
    discharge_level: float  # set of dump resistors


@cache
def setting_type(law: Law) -> type[RowSetting]:
    """Return the type of a row's set point for a law."""
    names = tuple(column.name for column in COLUMNS.with_law(law.columns))
    if names == RowSetting._fields:
        return RowSetting
    kind: Any = namedtuple("RowSetting", names)  # type: ignore[misc]
    return cast(type[RowSetting], kind)


def zero_setting(law: Law) -> RowSetting:
    """Return the set point with all values 0."""
    return setting_type(law)(*(0.0 for _ in setting_type(law)._fields))


def row_setting(campaign: CampaignFile, rig: RigFile, point: Point) -> RowSetting:
    """Return the set point of a point of the matrix."""
    return setting_type(campaign.heave_law)(**{**_defaults(campaign, rig), **point.values})


def drive_settings(campaign: CampaignFile, rig: RigFile) -> CustomDrive | None:
    """Return the settings of the custom drive for this campaign; None for a drive without any."""
    if not isinstance(rig.drive, CustomDrive):
        return None
    changes = campaign.drive.model_dump(exclude_none=True, exclude={"supply"})
    return rig.drive.model_copy(update=changes)


def drive_setting_problems(
    campaign: CampaignFile | None, points: tuple[Point, ...], rig: RigFile, locate: SourceMap
) -> Iterator[Problem]:
    """Yield a problem for each key and column that this rig's drive does not have."""
    if isinstance(rig.drive, CustomDrive):
        return
    message = "the rig's drive has no such setting; only a drive of kind custom has it"
    for key in sorted(campaign.drive.model_fields_set) if campaign is not None else ():
        yield locate.problem(("drive", key), None, message)
    for column in DRIVE_COLUMNS:
        location = next(
            (p.locations[column.name] for p in points if column.name in p.locations), None
        )
        if location is not None:
            yield location.problem(None, message)


def _defaults(campaign: CampaignFile, rig: RigFile) -> dict[str, float]:
    defaults = dict.fromkeys(setting_type(campaign.heave_law)._fields, 0.0)
    defaults |= {column.name: column.default or 0.0 for column in campaign.heave_law.columns}
    defaults["reference_scale"] = 1.0
    if campaign.reference is not None:
        defaults["realisation"] = float(getattr(campaign.reference, "realisation", 1))
    surge, station_keeping = campaign.surge, rig.station_keeping
    kp, ki = surge.kp_n_s_per_m, surge.ki_n_per_m
    defaults["surge_kp"] = station_keeping.kp_n_s_per_m if kp is None else kp
    defaults["surge_ki"] = station_keeping.ki_n_per_m if ki is None else ki
    drive = drive_settings(campaign, rig)
    if drive is not None:
        defaults |= {column.name: float(getattr(drive, column.key)) for column in DRIVE_COLUMNS}
    return defaults
