"""From a campaign to the table the loop walks: rows, segments, set points.

The plan: tare (calm water, drive off), stator and drive made ready, lead-in while the sea builds
up, then row after row settle, measure, tail. The wave maker runs from the first segment of the
lead-in on; its seconds are the wave clock. Before a row with another spring rate its combination
is held for an extra interval while the stator moves (MASK4 report (Sandia), section 3.2.3).

Without the device (a wave calibration) there is only a lead-in and one window of whole repeat
periods; the drive is never asked for.
"""

import math
from typing import NamedTuple

from rig.config.campaign_file import CampaignFile
from rig.config.rig_file import RigFile
from rig.kinds.wavebot import Setpoints
from rig.planning.campaign.order import turns
from rig.planning.campaign.point import Point
from rig.planning.campaign.points import stator_positions
from rig.planning.campaign.segments import Piece, cut_into_ticks
from rig.planning.campaign.set_points import NOTHING, Setting, setting
from rig.planning.campaign.stability import max_stable_ki
from rig.planning.campaign.windows import Windows, calibration, windows
from rig.realtime.sequence import NO_ROW, WAIT_DRIVE, WAIT_STATOR, Phase, Segments


class CampaignRow(NamedTuple):
    """One row of the plan: a point of the matrix, run once."""

    row: int  # from 0, in the order of the plan
    point: int  # from 0, in the order of the file
    repetition: int  # from 0
    stator_position: float  # %
    setting: Setting
    periods: int  # whole wave or repeat periods measured; 0: not a whole number of them
    measure: float  # s

    @property
    def spring_rate(self) -> float:
        """N/m."""
        return self.setting.spring_rate


class PhaseSeconds(NamedTuple):
    """Planned seconds of each phase."""

    tare: float
    lead_in: float
    moving: float
    settle: float
    measure: float
    tail: float


class Plan(NamedTuple):
    """A campaign ready to be walked by `rig.realtime.sequence.step`."""

    rows: tuple[CampaignRow, ...]
    segments: Segments
    setpoints: Setpoints
    dt: float  # s, length of a tick
    duration: float  # s, planned; waiting for stator and drive may add to it
    wave_seconds: float  # s of the wave clock, planned
    spring_moves: int  # changes of the spring rate between rows
    phases: PhaseSeconds


def plan(campaign: CampaignFile, rig: RigFile, points: tuple[Point, ...]) -> Plan:
    """The plan of a campaign that passed all checks (`rig.planning.campaign.open_campaign`).

    ``points`` are those of its matrix, none without the device. Raises `WindowError` when no
    window can be cut.
    """
    if campaign.device == "absent":
        return _table((), _waves_alone(campaign), rig)
    cut = windows(campaign.sea, campaign.timing, campaign.reference, campaign.hoist)
    positions = stator_positions(points, rig.spring)
    rows = tuple(
        CampaignRow(
            row,
            turn.point,
            turn.repetition,
            positions[points[turn.point].spring_rate],
            setting(campaign, rig, points[turn.point]),
            cut.periods,
            cut.measure,
        )
        for row, turn in enumerate(
            turns(points, campaign.order, campaign.repeat, campaign.seed, positions)
        )
    )
    pieces = [*_opening(campaign, rig, rows[0]), *_rows(rows, cut, rig)]
    made = _table(rows, pieces, rig)
    if campaign.hoist is None:
        return made
    # Where the stator's force reverses is what the hoist is there to find; rotor and heave travel
    # end where the rig's limits say.
    anywhere = (math.inf,) * len(made.setpoints.stroke)
    return made._replace(setpoints=made.setpoints._replace(stroke=anywhere))


def _waves_alone(campaign: CampaignFile) -> list[Piece[Setting]]:
    """Lead-in and one window: the wave maker runs, the probes are read, all power is off."""
    cut = calibration(campaign.sea, campaign.timing)
    return [
        Piece(NO_ROW, Phase.LEAD_IN, campaign.start.lead_in_s, NOTHING, drive=0),
        Piece(NO_ROW, Phase.MEASURE, cut.measure, NOTHING, drive=0),
        Piece(NO_ROW, Phase.DONE, 0.0, NOTHING, waves=0, drive=0),
    ]


def _opening(campaign: CampaignFile, rig: RigFile, first: CampaignRow) -> list[Piece[Setting]]:
    """Tare, readiness and lead-in: everything before the first row."""
    start = campaign.start
    given, gains = start.set_point, first.setting
    kp, ki = (given.kp_n_s_per_m, given.ki_n_per_m) if given is not None else (gains.kp, 0.0)
    set_point = gains._replace(kp=kp, ki=ki)
    # Where the stator stands before its first move is not known: bearable anywhere.
    anywhere = max_stable_ki(rig.stability, rig.spring.by_rate()[0], ki)
    ready = Piece(
        NO_ROW,
        Phase.MOVING,
        max(rig.heave.gain_ramp_s, 1.0 / rig.rate_hz),
        set_point._replace(ki=anywhere),
        wait=WAIT_STATOR | WAIT_DRIVE,
        timeout=max(rig.spring.move_timeout_s, rig.drive_enable_timeout_s),
        waves=0,
    )
    return [
        Piece(NO_ROW, Phase.TARE, campaign.tare_duration, set_point, waves=0, drive=0),
        ready,
        Piece(NO_ROW, Phase.LEAD_IN, start.set_point_s, set_point),
        Piece(NO_ROW, Phase.LEAD_IN, start.lead_in_s - start.set_point_s, gains),
    ]


def _rows(rows: tuple[CampaignRow, ...], cut: Windows, rig: RigFile) -> list[Piece[Setting]]:
    pieces = []
    rate = rows[0].spring_rate
    for row in rows:
        gains = row.setting
        if row.spring_rate != rate:
            # Gains change at once, the stator takes seconds: until then the old spring bears them.
            ki = max_stable_ki(rig.stability, (rate, row.spring_rate), gains.ki)
            rate = row.spring_rate
            pieces.append(
                Piece(
                    row.row,
                    Phase.MOVING,
                    max(cut.move, 1.0 / rig.rate_hz),
                    gains._replace(ki=ki),
                    wait=WAIT_STATOR,
                    timeout=rig.spring.move_timeout_s,
                )
            )
        pieces += [
            Piece(row.row, Phase.SETTLE, cut.settle, gains),
            Piece(row.row, Phase.MEASURE, cut.measure, gains),
            Piece(row.row, Phase.TAIL, cut.tail, gains),
        ]
    last = rows[-1].setting._replace(ki=0.0)
    return [*pieces, Piece(NO_ROW, Phase.DONE, 0.0, last, waves=0, drive=0)]


def _table(rows: tuple[CampaignRow, ...], pieces: list[Piece[Setting]], rig: RigFile) -> Plan:
    """Segments in ticks: ends are rounded on the plan's own clock, so nothing drifts."""
    rate = float(rig.rate_hz)
    segments, kept, table = cut_into_ticks(pieces, rate)
    ticks = segments.ticks

    def seconds(phase: Phase) -> float:
        return sum(n for n, p in zip(ticks, kept, strict=True) if p.phase is phase) / rate

    phases = PhaseSeconds(
        tare=seconds(Phase.TARE),
        lead_in=seconds(Phase.LEAD_IN),
        moving=seconds(Phase.MOVING),
        settle=seconds(Phase.SETTLE),
        measure=seconds(Phase.MEASURE),
        tail=seconds(Phase.TAIL),
    )
    waves = sum(n for n, p in zip(ticks, kept, strict=True) if p.waves) / rate
    moves = sum(1 for i in range(1, len(rows)) if rows[i].spring_rate != rows[i - 1].spring_rate)
    return Plan(
        rows,
        segments,
        _setpoints(table, rig),
        1.0 / rate,
        sum(ticks) / rate,
        waves,
        moves,
        phases,
    )


def _setpoints(table: tuple[Setting, ...], rig: RigFile) -> Setpoints:
    """The set points by columns, as the loop takes them."""
    columns = {name: tuple(getattr(one, name) for one in table) for name in Setting._fields}
    masks = tuple(int(one.discharge_level) for one in table)
    stroke = tuple(rig.spring.stroke(one.spring_rate) for one in table)
    played = tuple(int(one.realisation) for one in table)
    whole = {"discharge_level": masks, "realisation": played}
    return Setpoints(**{**columns, **whole}, stroke=stroke)
