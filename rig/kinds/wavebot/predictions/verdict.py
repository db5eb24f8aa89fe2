"""Limits of a predicted row: its use of each, refusals and warnings with file and line."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import reduce
from itertools import groupby
from typing import NamedTuple

from rig.config.problems import Problem, display_path, format_key, format_number
from rig.config.yaml_source import KeyPath, SourceMap, kinds_of, load_mapping
from rig.design.margin import Effect, Limit, Margin, Role
from rig.kinds.wavebot.campaign import Campaign, CampaignRow
from rig.kinds.wavebot.campaign.set_points import RowSetting
from rig.kinds.wavebot.predictions.model import CampaignModel
from rig.kinds.wavebot.predictions.prediction import RowPrediction, RowPredictions
from rig.planning.windows import row_windows
from rig.realtime.sequence import NO_ROW

# Residue of a change of gains in the mean over the measurement above which there is a warning.
MAX_RESIDUE = 0.01
_EFFECTS = {"cut": ", force is cut there", "warn": " before a warning", "stop": ", a stop is near"}


def _limit(
    name: str, field: str, key: str, unit: str, effect: Effect = "stop", role: Role = "limits",
    *, quantity: str = "", is_lower_bound: bool = False,
) -> Limit:  # fmt: skip
    """Return the limit of a field of `RowPredictions`."""
    quantity = quantity or field.replace("_", " ")
    return Limit(name, field, role, tuple(key.split(".")), effect, unit, quantity, is_lower_bound)


POSITION = _limit("position", "position_peak", "heave.position_stop_m", "m")
STROKE = _limit("spring stroke", "position_peak", "spring.map", "m", role="rig")
BUS = _limit("bus voltage", "voltage_highest", "bus.voltage_stop_v", "V", quantity="bus voltage")
OVERVOLTAGE = _limit(
    "bus overvoltage", "voltage_highest", "drive.overvoltage_trip.value", "V", role="plant",
    quantity="bus voltage",
)  # fmt: skip
UNDERVOLTAGE = _limit(
    "bus undervoltage", "voltage_lowest", "drive.undervoltage_share.value", "V", role="plant",
    quantity="bus voltage", is_lower_bound=True,
)  # fmt: skip
MODULATION = _limit(
    "modulation", "voltage_required", "drive.scheme_modulation.value", "V", "cut", "plant",
    quantity="voltage need",
)  # fmt: skip
LOOP = _limit("loop gain", "gain_margin", "", "1", "unstable", "campaign", is_lower_bound=True)
SURGE_LOOP = _limit(
    "surge gain", "surge_gain_margin", "", "1", "unstable", "campaign", is_lower_bound=True
)
LIMITS = (
    _limit("position warn", "position_peak", "heave.position_warn_m", "m", "warn"),
    POSITION,
    STROKE,
    _limit("rotor travel", "position_peak", "spring.rotor_travel_stop_m", "m",
           quantity="rotor travel"),
    _limit("velocity", "velocity_peak", "heave.velocity_stop_m_per_s", "m/s"),
    _limit("current peak", "current_peak", "heave.current_peak_a", "A", "cut"),
    _limit("current rms", "current_rms_peak", "heave.current_rms_a", "A", "cut",
           quantity="current rms"),
    BUS,
    _limit("surge position warn", "surge_position_peak", "surge.position_warn_m", "m", "warn"),
    _limit("surge position", "surge_position_peak", "surge.position_stop_m", "m"),
    _limit("surge velocity", "surge_velocity_peak", "surge.velocity_stop_m_per_s", "m/s"),
    _limit("surge current peak", "surge_current_peak", "surge.current_peak_a", "A", "cut"),
    _limit("surge current rms", "surge_current_rms_peak", "surge.current_rms_a", "A", "cut",
           quantity="surge current rms"),
    _limit("stiffness", "stiffness", "stability.least_stiffness_n_per_m", "N/m", "unstable", "rig",
           quantity="stiffness at rest", is_lower_bound=True),
    LOOP, SURGE_LOOP, OVERVOLTAGE, UNDERVOLTAGE, MODULATION,
)  # fmt: skip


def compute_margins(
    model: CampaignModel, setting: RowSetting, predictions: RowPredictions
) -> tuple[Margin, ...]:
    """Return a row's use of each limit."""
    rig, electrics = model.campaign.rig, model.electrics(setting)
    bus_at_rest = setting.bus_voltage if electrics.custom else electrics.cots.bus_voltage

    def allowed(limit: Limit) -> float | None:
        if limit is STROKE:
            return rig.spring.stroke(setting.spring_rate)
        if limit.of_own_gains:
            return 1.0
        if limit.role != "plant":
            return float(reduce(getattr, limit.key, getattr(model.campaign, limit.role)))  # type: ignore[arg-type]
        if not electrics.custom or predictions.voltage_available is None:
            return None
        if limit is MODULATION:
            return predictions.voltage_available
        bus = electrics.bus
        return bus.overvoltage if limit is OVERVOLTAGE else bus.undervoltage

    margins = []
    for limit in LIMITS:
        predicted, bound = getattr(predictions, limit.field), allowed(limit)
        if predicted is not None and bound is not None:
            at_rest = bus_at_rest if limit.quantity == "bus voltage" else 0.0
            margins.append(Margin(limit, predicted, bound, at_rest))
    return tuple(margins)


class LimitLocations:
    """File and line of limits; reads a file only when a message names it."""

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign
        self._read: dict[str, SourceMap] = {"plant": campaign.plant_locate}

    def text(self, limit: Limit, row: CampaignRow) -> str:
        """Return file, line and key of a limit."""
        key = self._stroke(row) if limit is STROKE else limit.key
        if limit.role not in self._read:
            path = next(file.path for file in self._campaign.files if file.role == limit.role)
            self._read[limit.role] = load_mapping(path, kinds=kinds_of(limit.role))[1]
        location = self._read[limit.role](key)
        return f"{display_path(location.path)}:{location.line}: {format_key(key)}"

    def _stroke(self, row: CampaignRow) -> KeyPath:
        """Return the key of the stroke that limits a row: the smaller of the adjacent stations."""
        stations = self._campaign.rig.spring.map
        rate = row.setting.spring_rate
        stroke = self._campaign.rig.spring.stroke(rate)
        candidates = (i for i, station in enumerate(stations) if station.stroke_m == stroke)
        index = min(candidates, key=lambda i: abs(stations[i].rate_n_per_m - rate))
        return ("spring", "map", index, "stroke_m")


class Verdict(NamedTuple):
    """Problems of the rows by point."""

    refused: tuple[Problem, ...]  # a row would trip the rig or be unstable
    warnings: tuple[Problem, ...]  # the rows may run but come close to a limit


def judge(campaign: Campaign, rows: Sequence[RowPrediction]) -> Verdict:
    """Return a problem for every point with a row that may not run or needs a warning."""
    locations = LimitLocations(campaign)
    windows = row_windows(campaign.file.sea, campaign.file.timing, campaign.file.reference)
    settle = windows.settle - windows.bin
    refused, warnings = [], []
    for group in _by_point(rows):
        first = group[0]
        if blocking := [margin for margin in first.margins if margin.blocks]:
            messages = _margin_messages(blocking, locations, first.row)
            refused.append(_problem(campaign, group, messages))
            continue
        near = [margin for margin in first.margins if margin.warns]
        messages = _margin_messages(near, locations, first.row)
        messages += _reliability_warnings(first, settle)
        if messages:
            warnings.append(_problem(campaign, group, messages))
    return Verdict(tuple(refused), tuple(warnings))


def _by_point(rows: Sequence[RowPrediction]) -> Iterable[list[RowPrediction]]:
    """Return the rows grouped by point, the worst row of each first."""
    groups: dict[tuple[bool, int], list[RowPrediction]] = {}
    for one in rows:
        groups.setdefault((one.row.row == NO_ROW, one.row.point), []).append(one)
    for group in groups.values():
        group.sort(key=lambda one: -max(margin.used for margin in one.margins))
    return groups.values()


def _problem(campaign: Campaign, group: list[RowPrediction], messages: list[str]) -> Problem:
    """Return a problem at the line of the point's Kp, or of the lead-in's set point."""
    row = group[0].row
    setting = row.setting
    name = f"row {row.row}" if row.row != NO_ROW else "the lead-in"
    if len(group) > 1:
        name += f" and {len(group) - 1} more of point {row.point}"
    columns = [column for column in campaign.file.heave_law.columns if column.default is None]
    gains = [f"spring {format_number(setting.spring_rate)} N/m"]
    gains += [
        f"{each.label} {format_number(getattr(setting, each.name))} {each.unit}" for each in columns
    ]
    message = f"{name} ({', '.join(gains)}): {'; '.join(messages)}"
    key = ("start", "set_point", "kp_n_s_per_m")
    if row.row == NO_ROW and key in campaign.locate.locations:
        return campaign.locate.problem(key, setting.kp, message)
    first = columns[0].name if columns else "spring_rate"
    location = campaign.points[row.point].locations[first]
    return location.problem(getattr(setting, first), message)


def _margin_messages(
    margins: Iterable[Margin], locations: LimitLocations, row: CampaignRow
) -> list[str]:
    """Return one message per predicted quantity, with all its limits."""
    messages = []
    for quantity, group in groupby(margins, key=lambda margin: margin.limit.quantity):
        limits = list(group)
        if limits[0].limit.of_own_gains:
            messages.append(_stability_message(limits[0]))
            continue
        bounds = " and ".join(_bound_text(margin, locations, row) for margin in limits)
        messages.append(
            f"predicted {quantity} {limits[0].predicted:.3g} {limits[0].limit.unit}, {bounds}"
        )
    return messages


def _stability_message(margin: Margin) -> str:
    axis = "surge" if margin.limit is SURGE_LOOP else "heave"
    up_to = f"up to {margin.predicted:.3g} times"
    if not margin.exceeded:
        return f"the sampled {axis} loop is stable only {up_to} its gains"
    stable = f"stable {up_to} these gains" if margin.predicted > 0.0 else ""
    return f"the sampled {axis} loop is unstable, {stable or 'not stable at lower gains either'}"


def _bound_text(margin: Margin, locations: LimitLocations, row: CampaignRow) -> str:
    limit = margin.limit
    side = "at least" if limit.is_lower_bound else "up to"
    allowed = format_number(float(f"{margin.allowed:.6g}"))
    effect = ""
    if not (margin.exceeded and limit.effect in ("stop", "unstable")):
        effect = ", torque saturates there" if limit is MODULATION else _EFFECTS[limit.effect]
    return f"allowed {side} {allowed} {limit.unit} ({locations.text(limit, row)}){effect}"


def _reliability_warnings(prediction: RowPrediction, settle: float) -> Iterator[str]:
    """Yield warnings that the prediction or the row's mean is less reliable."""
    predicted = prediction.predicted
    if not predicted.converged:
        yield "the predicted motion did not converge, so the prediction is approximate"
    residue = math.exp(-settle / predicted.decay_time) * min(
        1.0, predicted.decay_time / max(prediction.row.measure, 1e-9)
    )
    if prediction.row.row != NO_ROW and residue > MAX_RESIDUE:
        yield (
            f"the slowest mode decays in {predicted.decay_time:.3g} s, so with "
            f"{format_number(settle)} s of settling {100.0 * residue:.0f} % "
            f"of a change of gains remains in the mean over {prediction.row.measure:.4g} s"
        )
