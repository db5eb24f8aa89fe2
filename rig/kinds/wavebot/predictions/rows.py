"""Prediction of every row of a campaign in its sea, in the order of the plan."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.campaign.plan import stage_plans
from rig.design.grid import Floats
from rig.design.linear_form import NotLinearError
from rig.design.margin import Margin
from rig.kinds.wavebot.campaign import Campaign, CampaignRow, Plan
from rig.kinds.wavebot.campaign.set_points import RowSetting
from rig.kinds.wavebot.campaign.stability import total_stiffness
from rig.kinds.wavebot.heave_loop import heave_law, row_gains
from rig.kinds.wavebot.predictions import bus
from rig.kinds.wavebot.predictions.drive import NO_VOLTAGE_LIMIT, commercial_bus_voltage, losses
from rig.kinds.wavebot.predictions.model import CampaignModel, build_model
from rig.kinds.wavebot.predictions.motion import (
    Batch,
    heave_poles,
    predict_heave,
    predict_surge,
)
from rig.kinds.wavebot.predictions.prediction import Prediction, RowPrediction, RowPredictions
from rig.kinds.wavebot.predictions.travel import compare_orders
from rig.kinds.wavebot.predictions.verdict import compute_margins, judge
from rig.realtime.sequence import NO_ROW, Phase
from sim_plant.parts.bus import BusParams

MAX_SAMPLES = 500_000  # per batch, so that the arrays fit a processor cache
PASSES = 2  # over motion and bus, which depend on each other

SettingAndStator = tuple[RowSetting, float]
"""A setting and the stator position (%)."""

_Power = tuple[tuple[float, ...], float]  # W into the drive, one value per step, and the step, s


def predict(campaign: Campaign, planned: Plan) -> Prediction | None:
    """Return the prediction of a checked campaign.

    None without the device in the water, for a campaign in which a hoist moves it, and for a law
    without a linear form.
    """
    if not _has_free_body(campaign, planned) or unpredicted_reason(campaign, planned):
        return None
    model, *others = (build_model(campaign._replace(seed=seed)) for seed in campaign.file.seeds)
    predictions: list[RowPrediction] = []
    for stage, in_sea in zip(stage_plans(campaign), (model, *others), strict=True):
        rows = [*([] if predictions else _lead_in(campaign, stage)), *stage.rows]
        predictions += (
            RowPrediction(row, values, compute_margins(in_sea, row.setting, values))
            for row, values in zip(rows, predict_rows(in_sea, stage, rows), strict=True)
        )
    lead_in = predictions[0] if predictions[0].row.row == NO_ROW else None
    return Prediction(
        campaign,
        planned,
        tuple(predictions[1:] if lead_in else predictions),
        lead_in,
        *judge(campaign, predictions),
        compare_orders(campaign, planned, model),
    )


def unpredicted_reason(campaign: Campaign, planned: Plan) -> str:
    """Return why the law of a campaign with rows cannot be predicted; empty if it can."""
    if not _has_free_body(campaign, planned):
        return ""
    try:
        for setting in dict.fromkeys(row.setting for row in planned.rows):
            row_gains(campaign, setting, planned.dt)
    except NotLinearError as error:
        return str(error)
    return ""


def _has_free_body(campaign: Campaign, planned: Plan) -> bool:
    """Return whether the campaign has rows in which no hoist moves the body."""
    return bool(planned.rows) and campaign.file.hoist is None


def _lead_in(campaign: Campaign, planned: Plan) -> list[CampaignRow]:
    """Return the lead-in's set point as a row, or no row if it equals the first row's."""
    first = planned.rows[0]
    parts = campaign.kind.lead_in(campaign.file, first.setting)
    settings = (setting for seconds, setting in parts if seconds > 0.5 * planned.dt)
    setting = next(settings, first.setting)
    return [] if setting == first.setting else [first._replace(row=NO_ROW, setting=setting)]


def predict_rows(
    model: CampaignModel, plan: Plan, rows: Sequence[CampaignRow]
) -> list[RowPredictions]:
    """Return the predicted values of each of ``rows``, given in the order of the plan.

    Equal settings are computed once.
    """
    pairs: list[SettingAndStator] = [(row.setting, row.place) for row in rows]
    unique = list(dict.fromkeys(pairs))
    index_of = {pair: index for index, pair in enumerate(unique)}
    indices = [index_of[pair] for pair in pairs]
    batches = _Batches(model, unique)
    if not model.has_custom_drive:
        columns, _ = batches.predict(np.zeros(len(unique)))
        return [RowPredictions(**columns[index]) for index in indices]
    buses = [_bus(model, setting) for setting, _ in unique]
    voltage = np.array([_start_voltage(one) for one in buses])
    for _ in range(PASSES):
        columns, powers = batches.predict(voltage)
        voltages = _simulate_bus(
            model, plan, rows, [(buses[index], powers[index]) for index in indices]
        )
        means = np.bincount(indices, [one.mean for one in voltages])
        voltage = means / np.bincount(indices)
    return [
        _with_voltage(columns[index], one) for index, one in zip(indices, voltages, strict=True)
    ]


def predict_set_points(
    model: CampaignModel, rows: Sequence[SettingAndStator], seconds: float
) -> list[tuple[RowPredictions, tuple[Margin, ...]]]:
    """Predict independent set points, each held for ``seconds``.

    The custom drive's bus starts at its supply voltage, or at its set voltage if the supply is
    off. The bus is simulated once only: a second pass at the mean voltage changes power by little.
    """
    batches = _Batches(model, rows)
    if model.has_custom_drive:
        buses = [_bus(model, setting) for setting, _ in rows]
        _, powers = batches.predict(np.array([_start_voltage(one) for one in buses]))
        voltages = [
            bus.simulate([bus.BusInterval(one, *power, seconds)])[0]
            for one, power in zip(buses, powers, strict=True)
        ]
        columns, _ = batches.predict(np.array([one.mean for one in voltages]))
        predictions = [
            _with_voltage(each, one) for each, one in zip(columns, voltages, strict=True)
        ]
    else:
        columns, _ = batches.predict(np.zeros(len(rows)))
        predictions = [RowPredictions(**each) for each in columns]
    return [
        (one, compute_margins(model, setting, one))
        for one, (setting, _) in zip(predictions, rows, strict=True)
    ]


def _bus(model: CampaignModel, setting: RowSetting) -> BusParams:
    return model.electrics(setting).bus


def _start_voltage(one: BusParams) -> float:
    return one.supply_voltage if one.supply_connected else one.set_voltage


def _with_voltage(columns: dict[str, Any], voltage: bus.BusVoltage) -> RowPredictions:
    simulated = {
        "voltage_lowest": voltage.lowest,
        "voltage_highest": voltage.highest,
        "dump_power": voltage.dump_power,
    }
    return RowPredictions(**columns | simulated)


class _Batches:
    """Rows in batches; each may be predicted repeatedly at other voltages of the bus."""

    def __init__(self, model: CampaignModel, rows: Sequence[SettingAndStator]) -> None:
        self._model = model
        size = max(1, MAX_SAMPLES // model.grid.samples)
        self._batches = [self._batch(rows[i : i + size]) for i in range(0, len(rows), size)]

    def _batch(self, rows: Sequence[SettingAndStator]) -> Batch:
        settings, stator = [one for one, _ in rows], [position for _, position in rows]
        model = self._model
        law = heave_law(model.campaign, settings, model.heave.timing.dt)
        surge = predict_surge(model, settings)
        columns = surge.columns | heave_poles(model, stator, law)
        return Batch(settings, stator, law, columns, surge.lateral_force)

    def predict(self, voltage: Floats) -> tuple[list[dict[str, Any]], list[_Power]]:
        """Return the fields of `RowPredictions` before the bus simulation, and the power.

        ``voltage`` (V, one per row) is that of the custom drive's bus.
        """
        fields: list[dict[str, Any]] = []
        powers: list[_Power] = []
        for batch in self._batches:
            count = len(batch.settings)
            fields += self._predict_batch(batch, voltage[len(fields) : len(fields) + count], powers)
        return fields, powers

    def _predict_batch(
        self, batch: Batch, voltage: Floats, powers: list[_Power]
    ) -> list[dict[str, Any]]:
        model, stability = self._model, self._model.campaign.rig.stability
        heave = predict_heave(model, batch, voltage)
        columns = heave.columns | batch.columns
        if model.has_custom_drive:
            powers += [bus.block_means(model.grid, power) for power in heave.dc_power]
        else:
            bus_voltage = commercial_bus_voltage(model.params.electrics.cots, heave.dc_power)
            columns["voltage_lowest"] = bus_voltage.min(axis=1)
            columns["voltage_highest"] = bus_voltage.max(axis=1)
        fields = []
        for i, setting in enumerate(batch.settings):
            values: dict[str, Any] = {"surge_spectral_radius": None, "surge_gain_margin": None}
            values |= {name: float(column[i]) for name, column in columns.items()}
            if not values["voltage_available"] < NO_VOLTAGE_LIMIT:
                values["voltage_available"] = None
            ki = float(batch.law.ki[i])
            fields.append(
                values
                | {
                    "dump_power": None,
                    "stiffness": total_stiffness(stability, setting.spring_rate, ki),
                    "converged": heave.converged[i],
                }
            )
        return fields


def _simulate_bus(
    model: CampaignModel,
    plan: Plan,
    rows: Sequence[CampaignRow],
    loads: Sequence[tuple[BusParams, _Power]],
) -> list[bus.BusVoltage]:
    """Simulate the bus through the plan; return one entry for each of ``rows``.

    ``loads`` are the bus and the power into the drive of each row.
    """
    segments = plan.segments
    seconds: dict[int, float] = {}  # in waves
    first_move = 0  # ticks, planned for the stator's move to the first row
    for row_number, phase, ticks in zip(segments.row, segments.phase, segments.ticks, strict=True):
        if row_number == NO_ROW and phase == Phase.MOVING:
            first_move += ticks
        elif phase not in (Phase.TARE, Phase.DONE):
            seconds[row_number] = seconds.get(row_number, 0.0) + ticks * plan.dt
    distance = abs(plan.rows[0].place - model.plant.stator.start.value)
    move_seconds = max(first_move * plan.dt, distance / model.params.spring.speed)
    first, (first_bus, first_power) = rows[0], loads[0]
    # Standby: the drive is on at rest, at the set voltage.
    fixed, active, *_ = losses(model.electrics(first.setting), first_bus.set_voltage)
    standby = fixed if first.setting.velocity_threshold > 0.0 else fixed + active
    intervals = [
        bus.BusInterval(first_bus, (fixed,), bus.STEP, plan.phases.tare),
        bus.BusInterval(first_bus, (standby,), bus.STEP, move_seconds),
    ]
    if first.row != NO_ROW:
        intervals.append(bus.BusInterval(first_bus, *first_power, seconds.get(NO_ROW, 0.0)))
    intervals += [
        bus.BusInterval(row_bus, *power, seconds[row.row])
        for row, (row_bus, power) in zip(rows, loads, strict=True)
    ]
    voltages = bus.simulate(intervals)
    row_voltages = voltages[-len(rows) :]
    for earlier in voltages[: -len(rows)]:  # intervals before the first row count for it
        low = min(row_voltages[0].lowest, earlier.lowest)
        high = max(row_voltages[0].highest, earlier.highest)
        row_voltages[0] = row_voltages[0]._replace(lowest=low, highest=high)
    return row_voltages
