"""Every row of a campaign in the sea it will meet, in the order of its plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.design.predictions import bus, electrics, plant
from rig.design.predictions.grid import Floats
from rig.design.predictions.heave import Heave, heave_of, heave_poles
from rig.design.predictions.margins import Margin, margins
from rig.design.predictions.model import Subject, subject_of, switching
from rig.design.predictions.prediction import Prediction, RowPrediction
from rig.design.predictions.row_prediction import RowPredictions
from rig.design.predictions.sampled import Poles
from rig.design.predictions.surge import Surge, surge_of
from rig.design.predictions.travel import orders, to_the_first
from rig.design.predictions.verdict import refused, warnings
from rig.planning.campaign import Campaign
from rig.planning.campaign.plan import CampaignRow, Plan
from rig.planning.campaign.set_points import RowSetting
from rig.planning.campaign.stability import total_stiffness
from rig.realtime.sequence import NO_ROW, Phase

MOST_SAMPLES = 500_000  # in one go: a processor's cache, not gigabytes
PASSES = 2  # of motion and bus, which depend on each other

Row = tuple[RowSetting, float]
"""A setting and the stator's position (%)."""

Margins = tuple[Margin, ...]


def foreseen(subject: Subject, plan: Plan, rows: Sequence[CampaignRow]) -> list[RowPredictions]:
    """What is predicted of each of ``rows``, which stand in the order of the plan.

    Equal settings are worked out once.
    """
    pairs: list[Row] = [(row.setting, row.stator_position) for row in rows]
    unique = list(dict.fromkeys(pairs))
    most = max(1, MOST_SAMPLES // subject.grid.samples)
    parts = [unique[i : i + most] for i in range(0, len(unique), most)]
    if not subject.plant.custom:
        found = [
            one
            for part in parts
            for one in _part(subject, part, np.zeros(len(part)), _still(subject, part))[0]
        ]
        by_pair = dict(zip(unique, found, strict=True))
        return [RowPredictions(**by_pair[pair]) for pair in pairs]
    buses = {pair: bus_of(subject, pair[0]) for pair in unique}
    volts = {pair: one.supply_voltage if one.connected else one.set_voltage
             for pair, one in buses.items()}  # fmt: skip
    told: list[bus.Voltage] = []
    by_pair = {}
    resting = [_still(subject, part) for part in parts]
    for _ in range(PASSES):
        powers: dict[Row, tuple[tuple[float, ...], float]] = {}
        for part, still in zip(parts, resting, strict=True):
            columns, heave = _part(subject, part, np.array([volts[pair] for pair in part]), still)
            by_pair |= dict(zip(part, columns, strict=True))
            for pair, power in zip(part, heave.dc, strict=True):
                powers[pair] = bus.stepped(subject.grid, power)
        told = _walked(subject, plan, rows, buses, powers)
        for pair in unique:
            at = [one.mean for one, other in zip(told, pairs, strict=True) if other == pair]
            volts[pair] = sum(at) / len(at)
    return [
        RowPredictions(**{**by_pair[pair], **_voltage(one)})
        for pair, one in zip(pairs, told, strict=True)
    ]


def tried(
    subject: Subject, rows: Sequence[Row], seconds: float
) -> list[tuple[RowPredictions, Margins]]:
    """What is predicted of set points that stand alone, each held for so many seconds.

    The custom drive's bus starts at its supply, or at its set voltage where that is off. Only its
    first pass is walked: the second, at the mean voltage found, moves power by little.
    """
    most = max(1, MOST_SAMPLES // subject.grid.samples)
    parts = [rows[i : i + most] for i in range(0, len(rows), most)]
    return [one for part in parts for one in _tried(subject, part, seconds)]


def _tried(
    subject: Subject, rows: Sequence[Row], seconds: float
) -> list[tuple[RowPredictions, Margins]]:
    still = _still(subject, rows)
    bounds, rig = subject.campaign.limits, subject.campaign.rig
    rests = [plant.bus_at_rest(subject.plant, one) for one, _ in rows]
    if not subject.plant.custom:
        columns, _ = _part(subject, rows, np.zeros(len(rows)), still)
        found = [RowPredictions(**each) for each in columns]
        return [
            (one, margins(bounds, rig, row[0], one, None, rest))
            for one, row, rest in zip(found, rows, rests, strict=True)
        ]
    links = [bus_of(subject, one) for one, _ in rows]
    first = [one.supply_voltage if one.connected else one.set_voltage for one in links]
    _, heave = _part(subject, rows, np.array(first), still)
    told = [
        bus.walk([bus.Stretch(link, *bus.stepped(subject.grid, power), seconds)])[0]
        for link, power in zip(links, heave.dc, strict=True)
    ]
    columns, _ = _part(subject, rows, np.array([one.mean for one in told]), still)
    found = [
        RowPredictions(**{**each, **_voltage(one)}) for each, one in zip(columns, told, strict=True)
    ]
    return [
        (one, margins(bounds, rig, row[0], one, link, rest))
        for one, row, link, rest in zip(found, rows, links, rests, strict=True)
    ]


def bus_of(subject: Subject, setting: RowSetting) -> bus.Bus:
    """The custom drive's bus at a setting, on its supply if both plant and campaign say so."""
    scheme, _ = switching(subject)
    found = plant.bus(subject.plant, setting, scheme)
    if subject.campaign.file.drive.supply == "disconnected":
        return found._replace(connected=0)
    return found


def _voltage(found: bus.Voltage) -> dict[str, float]:
    return {
        "voltage_lowest": found.lowest,
        "voltage_highest": found.highest,
        "dumped": found.dumped,
    }


class _Still(NamedTuple):
    """What of some rows does not depend on the bus."""

    surge: Surge
    poles: Poles


def _still(subject: Subject, rows: Sequence[Row]) -> _Still:
    settings, stator = [one for one, _ in rows], [position for _, position in rows]
    return _Still(surge_of(subject, settings), heave_poles(subject, settings, stator))


def _part(
    subject: Subject, rows: Sequence[Row], voltage: Floats, still: _Still
) -> tuple[list[dict[str, Any]], Heave]:
    """The keywords of `Foreseen` for some rows, their bus as yet unknown."""
    settings, stator = [one for one, _ in rows], [position for _, position in rows]
    campaign = subject.campaign
    rig = campaign.rig
    surge, poles = still
    heave = heave_of(subject, settings, stator, surge.lateral, voltage)
    stiff = plant.stiff_bus(subject.plant, heave.dc)
    columns: dict[str, Floats] = {
        **heave.columns,
        "voltage_lowest": stiff.min(axis=1),
        "voltage_highest": stiff.max(axis=1),
        "surge_position_peak": surge.position_peak,
        "surge_velocity_peak": surge.velocity_peak,
        "surge_force_peak": surge.force_peak,
        "surge_force_rms": surge.force_rms,
        "surge_current_peak": surge.current_peak,
        "surge_current_held": surge.current_held,
        "spectral_radius": poles.radius,
        "gain_margin": poles.gain_margin,
        "decay": poles.decay,
    }
    if surge.poles is not None:
        columns["surge_spectral_radius"] = surge.poles.radius
        columns["surge_gain_margin"] = surge.poles.gain_margin
    out = []
    for i, setting in enumerate(settings):
        told: dict[str, Any] = {name: float(column[i]) for name, column in columns.items()}
        told.setdefault("surge_spectral_radius", None)
        told.setdefault("surge_gain_margin", None)
        limited = told["voltage_given"] < electrics.NO_CEILING
        told |= {
            "voltage_given": told["voltage_given"] if limited else None,
            "dumped": None,
            "stiffness": total_stiffness(rig.stability, setting.spring_rate, setting.ki),
            "settled": heave.settled[i],
        }
        out.append(told)
    return out, heave


def _walked(
    subject: Subject,
    plan: Plan,
    rows: Sequence[CampaignRow],
    buses: dict[Row, bus.Bus],
    powers: dict[Row, tuple[tuple[float, ...], float]],
) -> list[bus.Voltage]:
    """The bus through the plan; one entry for each of ``rows``."""
    segments = plan.segments
    seconds: dict[int, float] = {}
    for at, phase, ticks in zip(segments.row, segments.phase, segments.ticks, strict=True):
        calm = phase in (Phase.TARE, Phase.DONE) or (at == NO_ROW and phase == Phase.MOVING)
        if not calm:
            seconds[at] = seconds.get(at, 0.0) + ticks * plan.dt
    first = rows[0]
    pair = (first.setting, first.stator_position)
    idle = plant.idle_power(subject.plant)
    tare = bus.Stretch(buses[pair], (idle,), bus.STEP, plan.phases.tare)
    standing = plant.standing_power(subject.plant, rows[0].setting, switching(subject)[0])
    still = to_the_first(plan, subject.plant)
    stretches = [tare, bus.Stretch(buses[pair], (standing,), bus.STEP, still)]
    if first.row != NO_ROW:
        stretches.append(bus.Stretch(buses[pair], *powers[pair], seconds.get(NO_ROW, 0.0)))
    for row in rows:
        pair = (row.setting, row.stator_position)
        stretches.append(bus.Stretch(buses[pair], *powers[pair], seconds[row.row]))
    told = bus.walk(stretches)
    found = told[-len(rows) :]
    for before in told[: -len(rows)]:  # what comes before is the first row's matter
        low, high = min(found[0].lowest, before.lowest), max(found[0].highest, before.highest)
        found[0] = found[0]._replace(lowest=low, highest=high)
    return found


def predict(campaign: Campaign, planned: Plan) -> Prediction | None:
    """What a checked campaign will do; None without the device, and where a hoist moves it."""
    if not planned.rows or campaign.file.hoist is not None:
        return None
    subject = subject_of(campaign)
    rows = [*_lead_in(planned), *planned.rows]
    told = []
    for row, found in zip(rows, foreseen(subject, planned, rows), strict=True):
        link = bus_of(subject, row.setting) if subject.plant.custom else None
        rest = plant.bus_at_rest(subject.plant, row.setting)
        used = margins(campaign.limits, campaign.rig, row.setting, found, link, rest)
        told.append(RowPrediction(row, found, used))
    lead_in = told[0] if told[0].row.row == NO_ROW else None
    return Prediction(
        campaign,
        planned,
        tuple(told[1:] if lead_in else told),
        lead_in,
        refused(campaign, told),
        warnings(campaign, told),
        orders(campaign, planned, subject.plant),
    )


def _lead_in(planned: Plan) -> list[CampaignRow]:
    """The set point of the lead-in as a row of its own, where it differs from the first row's."""
    segments, table, first = planned.segments, planned.setpoints, planned.rows[0]
    for phase, index in zip(segments.phase, segments.setpoint, strict=True):
        if phase == Phase.LEAD_IN:
            columns = (getattr(table, name)[index] for name in RowSetting._fields)
            setting = RowSetting(*(float(value) for value in columns))
            return [] if setting == first.setting else [first._replace(row=NO_ROW, setting=setting)]
    return []
