"""The plan of a campaign: rows, segments and set points that the loop executes.

A plan consists of the tare (calm water, drive off), the preparation of stator and drive, the
lead-in while the sea builds up, and then settle, measure and tail for each row. The wave maker
runs from the first segment of the lead-in; the wave clock counts its seconds. Before a row with
another spring rate, its combination is held for an extra interval while the stator moves (MASK4
report (Sandia), section 3.2.3).

Without the device (a wave calibration) there is only a lead-in and one window of whole repeat
periods; the drive stays off.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from rig.config.law_settings import IMPEDANCE
from rig.kinds.wavebot.campaign.set_points import (
    RowSetting,
    row_setting,
    setting_type,
    zero_setting,
)
from rig.kinds.wavebot.campaign.stability import max_stable_ki
from rig.kinds.wavebot.campaign.stator import order_rows, stator_positions
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.tick import Setpoints
from rig.laws import Law
from rig.planning.point import Point
from rig.planning.segments import PlanSegment, cut_into_ticks, phase_seconds
from rig.planning.windows import RowWindows, calibration_window, row_windows
from rig.realtime.sequence import NO_ROW, WAIT_ARRIVAL, WAIT_DRIVE, Phase, Segments


class CampaignRow(NamedTuple):
    """One row of the plan: a point of the matrix, run once."""

    row: int  # from 0, in the order of the plan
    point: int  # from 0, in the order of the file
    repetition: int  # from 0
    stator_position: float  # %
    setting: RowSetting
    periods: int  # wave or repeat periods measured; 0: not a whole number
    measure: float  # s

    @property
    def spring_rate(self) -> float:
        """Spring rate, N/m."""
        return self.setting.spring_rate


class PhaseSeconds(NamedTuple):
    """Planned duration of each phase, s."""

    tare: float
    lead_in: float
    moving: float
    settle: float
    measure: float
    tail: float


class Plan(NamedTuple):
    """A campaign that `rig.realtime.sequence.step` can execute."""

    rows: tuple[CampaignRow, ...]
    segments: Segments
    setpoints: Setpoints
    dt: float  # s, length of a tick
    duration: float  # s, planned; waiting for stator and drive may add to it
    wave_seconds: float  # s of the wave clock, planned
    spring_moves: int  # changes of the spring rate between rows
    phases: PhaseSeconds
    law: Law = IMPEDANCE  # of heave


def build_plan(campaign: CampaignFile, rig: RigFile, points: tuple[Point, ...]) -> Plan:
    """Return the plan of a campaign that passed all checks of `open_campaign`.

    ``points`` are those of its matrix, and empty without the device. Raises `WindowError` if the
    window of a row does not fit.
    """
    if campaign.device == "absent":
        return _assemble((), _calibration_segments(campaign), campaign, rig)
    windows = row_windows(campaign.sea, campaign.timing, campaign.reference, campaign.hoist)
    positions = stator_positions(points, rig.spring)
    rows = tuple(
        CampaignRow(
            row,
            repetition.point,
            repetition.repetition,
            positions[repetition.point],
            row_setting(campaign, rig, points[repetition.point]),
            windows.periods,
            windows.measure,
        )
        for row, repetition in enumerate(order_rows(campaign, positions))
    )
    plan_segments = [
        *_opening_segments(campaign, rig, rows[0]),
        *_row_segments(rows, windows, campaign, rig),
    ]
    plan = _assemble(rows, plan_segments, campaign, rig)
    if campaign.hoist is None:
        return plan
    # A hoist campaign measures the position at which the stator's force reverses, so the plan has
    # no stroke limit; the rig's limits still bound the travel of rotor and heave.
    unlimited = (math.inf,) * len(plan.setpoints.stroke)
    return plan._replace(setpoints=plan.setpoints._replace(stroke=unlimited))


def _calibration_segments(campaign: CampaignFile) -> list[PlanSegment[RowSetting]]:
    """Return lead-in and one window: the wave maker runs, the probes are read, power is off."""
    windows = calibration_window(campaign.sea, campaign.timing)
    zero = zero_setting(campaign.heave_law)
    return [
        PlanSegment(NO_ROW, Phase.LEAD_IN, campaign.start.lead_in_s, zero, drive=0),
        PlanSegment(NO_ROW, Phase.MEASURE, windows.measure, zero, drive=0),
        PlanSegment(NO_ROW, Phase.DONE, 0.0, zero, waves=0, drive=0),
    ]


def _opening_segments(
    campaign: CampaignFile, rig: RigFile, first: CampaignRow
) -> list[PlanSegment[RowSetting]]:
    """Return the segments before the first row: tare, preparation and lead-in."""
    start, gains = campaign.start, first.setting
    set_point = _lead_in_setting(campaign, gains)
    # The stator's position before its first move is unknown: Ki must be stable at all positions.
    ready = PlanSegment(
        NO_ROW,
        Phase.MOVING,
        max(rig.heave.gain_ramp_s, 1.0 / rig.rate_hz),
        _with_stable_ki(campaign, rig, set_point, rig.spring.by_rate()[0]),
        wait=WAIT_ARRIVAL | WAIT_DRIVE,
        timeout=max(rig.spring.move_timeout_s, rig.drive_enable_timeout_s),
        waves=0,
    )
    return [
        PlanSegment(NO_ROW, Phase.TARE, campaign.tare_duration, set_point, waves=0, drive=0),
        ready,
        PlanSegment(NO_ROW, Phase.LEAD_IN, start.set_point_s, set_point),
        PlanSegment(NO_ROW, Phase.LEAD_IN, start.lead_in_s - start.set_point_s, gains),
    ]


def _lead_in_setting(campaign: CampaignFile, first: RowSetting) -> RowSetting:
    """Return the set point of the lead-in: the file's, else the first row's with Ki 0.

    A law other than the impedance law has the first row's set point.
    """
    if campaign.zc_law is None:
        return first
    configured = campaign.start.set_point
    if configured is None:
        return first._replace(ki=0.0)
    return first._replace(kp=configured.kp_n_s_per_m, ki=configured.ki_n_per_m)


def _with_stable_ki(
    campaign: CampaignFile, rig: RigFile, setting: RowSetting, spring_rates: Iterable[float]
) -> RowSetting:
    """Return a set point whose Ki is stable at all given spring rates (N/m).

    Only the impedance law has a Ki of which this is known.
    """
    if campaign.zc_law is None:
        return setting
    return setting._replace(ki=max_stable_ki(rig.stability, spring_rates, setting.ki))


def _row_segments(
    rows: tuple[CampaignRow, ...], windows: RowWindows, campaign: CampaignFile, rig: RigFile
) -> list[PlanSegment[RowSetting]]:
    plan_segments = []
    rate = rows[0].spring_rate
    for row in rows:
        gains = row.setting
        if row.spring_rate != rate:
            # The gains change at once, but the stator moves for seconds: until then, Ki must be
            # stable with the old spring rate, too.
            moving = _with_stable_ki(campaign, rig, gains, (rate, row.spring_rate))
            rate = row.spring_rate
            plan_segments.append(
                PlanSegment(
                    row.row,
                    Phase.MOVING,
                    max(windows.move, 1.0 / rig.rate_hz),
                    moving,
                    wait=WAIT_ARRIVAL,
                    timeout=rig.spring.move_timeout_s,
                )
            )
        plan_segments += [
            PlanSegment(row.row, Phase.SETTLE, windows.settle, gains),
            PlanSegment(row.row, Phase.MEASURE, windows.measure, gains),
            PlanSegment(row.row, Phase.TAIL, windows.tail, gains),
        ]
    last = rows[-1].setting
    if campaign.zc_law is not None:
        last = last._replace(ki=0.0)
    return [*plan_segments, PlanSegment(NO_ROW, Phase.DONE, 0.0, last, waves=0, drive=0)]


def _assemble(
    rows: tuple[CampaignRow, ...],
    plan_segments: list[PlanSegment[RowSetting]],
    campaign: CampaignFile,
    rig: RigFile,
) -> Plan:
    """Return the plan with its segments in ticks."""
    rate = float(rig.rate_hz)
    table = cut_into_ticks(plan_segments, rate)
    segments, kept, settings = table
    ticks, seconds = segments.ticks, phase_seconds(table, rate)
    phases = PhaseSeconds(
        tare=seconds[Phase.TARE],
        lead_in=seconds[Phase.LEAD_IN],
        moving=seconds[Phase.MOVING],
        settle=seconds[Phase.SETTLE],
        measure=seconds[Phase.MEASURE],
        tail=seconds[Phase.TAIL],
    )
    waves = sum(n for n, p in zip(ticks, kept, strict=True) if p.waves) / rate
    moves = sum(1 for i in range(1, len(rows)) if rows[i].spring_rate != rows[i - 1].spring_rate)
    return Plan(
        rows,
        segments,
        _setpoints(settings, campaign, rig),
        1.0 / rate,
        sum(ticks) / rate,
        waves,
        moves,
        phases,
        campaign.heave_law,
    )


def _setpoints(settings: tuple[RowSetting, ...], campaign: CampaignFile, rig: RigFile) -> Setpoints:
    """Return the set points by columns, as the loop uses them."""
    columns: dict[str, Any] = {
        name: tuple(getattr(setting, name) for setting in settings)
        for name in setting_type(campaign.heave_law)._fields
    }
    law_fields = campaign.heave_law.module.SetPoint._fields
    law = tuple(columns.pop(name) for name in law_fields)
    integer_columns = {
        "discharge_level": tuple(int(setting.discharge_level) for setting in settings),
        "realisation": tuple(int(setting.realisation) for setting in settings),
    }
    stroke = tuple(rig.spring.stroke(setting.spring_rate) for setting in settings)
    return Setpoints(law=law, **{**columns, **integer_columns}, stroke=stroke)
