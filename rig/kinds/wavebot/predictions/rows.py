"""Prediction of every row of a campaign in its sea, in the order of the plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.design.grid import Floats
from rig.design.sampled_loop import Poles
from rig.kinds.wavebot.predictions import bus, electrics, plant
from rig.kinds.wavebot.predictions.heave import HeaveResponse, heave_poles, predict_heave
from rig.kinds.wavebot.predictions.linear_form import missing_reason, row_gains
from rig.kinds.wavebot.predictions.margins import Margin, compute_margins
from rig.kinds.wavebot.predictions.model import CampaignModel, build_model, drive_switching
from rig.kinds.wavebot.predictions.prediction import Prediction, RowPrediction
from rig.kinds.wavebot.predictions.row_prediction import RowPredictions
from rig.kinds.wavebot.predictions.surge import SurgeResponse, predict_surge
from rig.kinds.wavebot.predictions.travel import compare_orders, time_to_first_row
from rig.kinds.wavebot.predictions.verdict import find_refusals, find_warnings
from rig.planning.campaign import Campaign
from rig.planning.campaign.plan import CampaignRow, Plan
from rig.planning.campaign.set_points import RowSetting
from rig.planning.campaign.stability import total_stiffness
from rig.realtime.sequence import NO_ROW, Phase

MAX_SAMPLES = 500_000  # per batch, so that the arrays fit a processor cache
PASSES = 2  # over motion and bus, which depend on each other

SettingAndStator = tuple[RowSetting, float]
"""A setting and the stator position (%)."""

Margins = tuple[Margin, ...]


def predict_rows(
    model: CampaignModel, plan: Plan, rows: Sequence[CampaignRow]
) -> list[RowPredictions]:
    """Return the predicted values of each of ``rows``, given in the order of the plan.

    Equal settings are computed once.
    """
    pairs: list[SettingAndStator] = [(row.setting, row.stator_position) for row in rows]
    unique = list(dict.fromkeys(pairs))
    batch_size = max(1, MAX_SAMPLES // model.grid.samples)
    batches = [unique[i : i + batch_size] for i in range(0, len(unique), batch_size)]
    if not model.plant.has_custom_drive:
        predictions = [
            item
            for batch in batches
            for item in _predict_columns(
                model, batch, np.zeros(len(batch)), _predict_bus_independent(model, batch)
            )[0]
        ]
        by_pair = dict(zip(unique, predictions, strict=True))
        return [RowPredictions(**by_pair[pair]) for pair in pairs]
    buses = {pair: bus_of(model, pair[0]) for pair in unique}
    mean_voltages = {pair: item.supply_voltage if item.connected else item.set_voltage
             for pair, item in buses.items()}  # fmt: skip
    voltages: list[bus.BusVoltage] = []
    by_pair = {}
    bus_independent = [_predict_bus_independent(model, batch) for batch in batches]
    for _ in range(PASSES):
        powers: dict[SettingAndStator, tuple[tuple[float, ...], float]] = {}
        for batch, independent in zip(batches, bus_independent, strict=True):
            columns, heave = _predict_columns(
                model, batch, np.array([mean_voltages[pair] for pair in batch]), independent
            )
            by_pair |= dict(zip(batch, columns, strict=True))
            for pair, power in zip(batch, heave.dc_power, strict=True):
                powers[pair] = bus.block_means(model.grid, power)
        voltages = _simulate_bus(model, plan, rows, buses, powers)
        for pair in unique:
            means = [
                item.mean for item, other in zip(voltages, pairs, strict=True) if other == pair
            ]
            mean_voltages[pair] = sum(means) / len(means)
    return [
        RowPredictions(**{**by_pair[pair], **_voltage_fields(item)})
        for pair, item in zip(pairs, voltages, strict=True)
    ]


def predict_set_points(
    model: CampaignModel, rows: Sequence[SettingAndStator], seconds: float
) -> list[tuple[RowPredictions, Margins]]:
    """Predict independent set points, each held for ``seconds``.

    The custom drive's bus starts at its supply voltage, or at its set voltage if the supply is
    off. The bus is simulated once only: a second pass at the mean voltage changes power by little.
    """
    batch_size = max(1, MAX_SAMPLES // model.grid.samples)
    batches = [rows[i : i + batch_size] for i in range(0, len(rows), batch_size)]
    return [one for batch in batches for one in _predict_batch(model, batch, seconds)]


def _predict_batch(
    model: CampaignModel, rows: Sequence[SettingAndStator], seconds: float
) -> list[tuple[RowPredictions, Margins]]:
    independent = _predict_bus_independent(model, rows)
    bounds, rig = model.campaign.limits, model.campaign.rig
    rest_voltages = [plant.bus_at_rest(model.plant, one) for one, _ in rows]
    if not model.plant.has_custom_drive:
        columns, _ = _predict_columns(model, rows, np.zeros(len(rows)), independent)
        predictions = [RowPredictions(**each) for each in columns]
        return [
            (one, compute_margins(bounds, rig, row[0], one, None, rest_voltage))
            for one, row, rest_voltage in zip(predictions, rows, rest_voltages, strict=True)
        ]
    buses = [bus_of(model, one) for one, _ in rows]
    start_voltages = [one.supply_voltage if one.connected else one.set_voltage for one in buses]
    _, heave = _predict_columns(model, rows, np.array(start_voltages), independent)
    voltages = [
        bus.simulate([bus.BusInterval(bus_, *bus.block_means(model.grid, power), seconds)])[0]
        for bus_, power in zip(buses, heave.dc_power, strict=True)
    ]
    columns, _ = _predict_columns(
        model, rows, np.array([one.mean for one in voltages]), independent
    )
    predictions = [
        RowPredictions(**{**each, **_voltage_fields(one)})
        for each, one in zip(columns, voltages, strict=True)
    ]
    return [
        (one, compute_margins(bounds, rig, row[0], one, bus_, rest_voltage))
        for one, row, bus_, rest_voltage in zip(
            predictions, rows, buses, rest_voltages, strict=True
        )
    ]


def bus_of(model: CampaignModel, setting: RowSetting) -> bus.Bus:
    """Return the custom drive's bus; its supply needs both plant and campaign to connect it."""
    scheme, _ = drive_switching(model)
    bus_ = plant.bus(model.plant, setting, scheme)
    if model.campaign.file.drive.supply == "disconnected":
        return bus_._replace(connected=0)
    return bus_


def _voltage_fields(voltage: bus.BusVoltage) -> dict[str, float]:
    return {
        "voltage_lowest": voltage.lowest,
        "voltage_highest": voltage.highest,
        "dump_power": voltage.dump_power,
    }


class _BusIndependent(NamedTuple):
    """Results of some rows that do not depend on the bus."""

    surge: SurgeResponse
    poles: Poles


def _predict_bus_independent(
    model: CampaignModel, rows: Sequence[SettingAndStator]
) -> _BusIndependent:
    settings, stator = [one for one, _ in rows], [position for _, position in rows]
    return _BusIndependent(predict_surge(model, settings), heave_poles(model, settings, stator))


def _predict_columns(
    model: CampaignModel,
    rows: Sequence[SettingAndStator],
    voltage: Floats,
    independent: _BusIndependent,
) -> tuple[list[dict[str, Any]], HeaveResponse]:
    """Return the fields of `RowPredictions` for some rows, before the bus simulation, and heave."""
    settings, stator = [one for one, _ in rows], [position for _, position in rows]
    campaign = model.campaign
    rig = campaign.rig
    surge, poles = independent
    heave = predict_heave(model, settings, stator, surge.lateral_force, voltage)
    bus_voltage = plant.commercial_bus_voltage(model.plant, heave.dc_power)
    columns: dict[str, Floats] = {
        **heave.columns,
        "voltage_lowest": bus_voltage.min(axis=1),
        "voltage_highest": bus_voltage.max(axis=1),
        "surge_position_peak": surge.position_peak,
        "surge_velocity_peak": surge.velocity_peak,
        "surge_force_peak": surge.force_peak,
        "surge_force_rms": surge.force_rms,
        "surge_current_peak": surge.current_peak,
        "surge_current_rms_peak": surge.current_rms_peak,
        "spectral_radius": poles.radius,
        "gain_margin": poles.gain_margin,
        "decay_time": poles.decay_time,
    }
    if surge.poles is not None:
        columns["surge_spectral_radius"] = surge.poles.radius
        columns["surge_gain_margin"] = surge.poles.gain_margin
    dt, ramp = model.heave.timing.dt, rig.heave.gain_ramp_s
    gains = [row_gains(campaign.file, setting, ramp, dt) for setting in settings]
    predictions = []
    for i, setting in enumerate(settings):
        values: dict[str, Any] = {name: float(column[i]) for name, column in columns.items()}
        values.setdefault("surge_spectral_radius", None)
        values.setdefault("surge_gain_margin", None)
        limited = values["voltage_available"] < electrics.NO_VOLTAGE_LIMIT
        values |= {
            "voltage_available": values["voltage_available"] if limited else None,
            "dump_power": None,
            "stiffness": total_stiffness(rig.stability, setting.spring_rate, gains[i].ki),
            "converged": heave.converged[i],
        }
        predictions.append(values)
    return predictions, heave


def _simulate_bus(
    model: CampaignModel,
    plan: Plan,
    rows: Sequence[CampaignRow],
    buses: dict[SettingAndStator, bus.Bus],
    powers: dict[SettingAndStator, tuple[tuple[float, ...], float]],
) -> list[bus.BusVoltage]:
    """Simulate the bus through the plan; return one entry for each of ``rows``."""
    segments = plan.segments
    seconds: dict[int, float] = {}
    for row_number, phase, ticks in zip(segments.row, segments.phase, segments.ticks, strict=True):
        without_waves = phase in (Phase.TARE, Phase.DONE) or (
            row_number == NO_ROW and phase == Phase.MOVING
        )
        if not without_waves:
            seconds[row_number] = seconds.get(row_number, 0.0) + ticks * plan.dt
    first = rows[0]
    pair = (first.setting, first.stator_position)
    idle = plant.idle_power(model.plant)
    tare = bus.BusInterval(buses[pair], (idle,), bus.STEP, plan.phases.tare)
    standby = plant.standby_power(model.plant, rows[0].setting, drive_switching(model)[0])
    move_seconds = time_to_first_row(plan, model.plant)
    intervals = [tare, bus.BusInterval(buses[pair], (standby,), bus.STEP, move_seconds)]
    if first.row != NO_ROW:
        intervals.append(bus.BusInterval(buses[pair], *powers[pair], seconds.get(NO_ROW, 0.0)))
    for row in rows:
        pair = (row.setting, row.stator_position)
        intervals.append(bus.BusInterval(buses[pair], *powers[pair], seconds[row.row]))
    voltages = bus.simulate(intervals)
    row_voltages = voltages[-len(rows) :]
    for earlier in voltages[: -len(rows)]:  # intervals before the first row count for it
        first_voltage = row_voltages[0]
        low = min(first_voltage.lowest, earlier.lowest)
        high = max(first_voltage.highest, earlier.highest)
        row_voltages[0] = first_voltage._replace(lowest=low, highest=high)
    return row_voltages


def predict(campaign: Campaign, planned: Plan) -> Prediction | None:
    """Return the prediction of a checked campaign.

    None without the device in the water, for a campaign in which a hoist moves it, and for a law
    without a linear form.
    """
    if not planned.rows or campaign.file.hoist is not None:
        return None
    if unpredicted_reason(campaign, planned):
        return None
    model = build_model(campaign)
    rows = [*_lead_in(planned), *planned.rows]
    predictions = []
    for row, values in zip(rows, predict_rows(model, planned, rows), strict=True):
        bus_ = bus_of(model, row.setting) if model.plant.has_custom_drive else None
        rest_voltage = plant.bus_at_rest(model.plant, row.setting)
        margins = compute_margins(
            campaign.limits, campaign.rig, row.setting, values, bus_, rest_voltage
        )
        predictions.append(RowPrediction(row, values, margins))
    lead_in = predictions[0] if predictions[0].row.row == NO_ROW else None
    return Prediction(
        campaign,
        planned,
        tuple(predictions[1:] if lead_in else predictions),
        lead_in,
        find_refusals(campaign, predictions),
        find_warnings(campaign, predictions),
        compare_orders(campaign, planned, model.plant),
    )


def unpredicted_reason(campaign: Campaign, planned: Plan) -> str:
    """Return why the law of a campaign with rows cannot be predicted; empty if it can."""
    if not planned.rows or campaign.file.hoist is not None:
        return ""
    ramp = campaign.rig.heave.gain_ramp_s
    return missing_reason(campaign.file, planned.rows[0].setting, ramp, planned.dt)


def _lead_in(planned: Plan) -> list[CampaignRow]:
    """Return the lead-in's set point as a row, or no row if it equals the first row's."""
    segments, table, first = planned.segments, planned.setpoints, planned.rows[0]
    for phase, index in zip(segments.phase, segments.setpoint, strict=True):
        if phase == Phase.LEAD_IN:
            columns = table._asdict() | table.law._asdict()
            setting = type(first.setting)(
                *(float(columns[name][index]) for name in first.setting._fields)
            )
            return [] if setting == first.setting else [first._replace(row=NO_ROW, setting=setting)]
    return []
