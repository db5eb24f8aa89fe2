"""The set points of a WaveBot's rows: defaults for surge and drive, and the loop's table."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from controllers import signal_generator
from rig.campaign.set_points import columns_of
from rig.config.problems import Problem
from rig.config.yaml_source import SourceMap
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.columns import DRIVE_COLUMNS
from rig.kinds.wavebot.config.rig_file import CustomDrive, RigFile
from rig.kinds.wavebot.tick import Setpoints
from rig.planning.point import Point


class RowSetting(NamedTuple):
    """The set point of a row for the impedance law; names as in `config.columns`.

    Those for other laws have the law's columns in the place of Kp, Ki and Km
    (`rig.campaign.set_points.setting_type`).
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


def column_defaults(campaign: CampaignFile, rig: RigFile) -> dict[str, float]:
    """Return the values of surge and drive for a matrix without their columns."""
    surge, station_keeping = campaign.surge, rig.station_keeping
    kp, ki = surge.kp_n_s_per_m, surge.ki_n_per_m
    defaults = {
        "surge_kp": station_keeping.kp_n_s_per_m if kp is None else kp,
        "surge_ki": station_keeping.ki_n_per_m if ki is None else ki,
    }
    drive = drive_settings(campaign, rig)
    if drive is not None:
        defaults |= {column.name: float(getattr(drive, column.key)) for column in DRIVE_COLUMNS}
    return defaults


def setpoint_table(
    campaign: CampaignFile, rig: RigFile, settings: tuple[RowSetting, ...]
) -> Setpoints:
    """Return the set points by columns, as the loop uses them.

    A hoist campaign measures the position at which the stator's force reverses, so its plan has no
    stroke limit; the rig's limits still bound the travel of rotor and heave.
    """
    columns: dict[str, Any] = columns_of(settings)
    law = tuple(columns.pop(name) for name in campaign.heave_law.module.SetPoint._fields)
    for name in ("discharge_level", "realisation"):
        columns[name] = tuple(map(int, columns[name]))
    stroke = tuple(
        rig.spring.stroke(setting.spring_rate) if campaign.hoist is None else math.inf
        for setting in settings
    )
    signal = signal_generator.columns(len(settings))
    return Setpoints(law=law, **columns, stroke=stroke, signal=signal)
