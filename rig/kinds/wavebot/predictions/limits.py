"""The limits that a predicted row is compared with, and its use of each."""

from functools import reduce

from rig.design.margin import Effect, Limit, Margin, Role
from rig.kinds.wavebot.campaign.set_points import RowSetting
from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.predictions.prediction import RowPredictions
from sim_plant.bus import BusParams


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
    bounds: LimitsFile,
    rig: RigFile,
    setting: RowSetting,
    predictions: RowPredictions,
    bus: BusParams | None,
    bus_at_rest: float,
) -> tuple[Margin, ...]:
    """Return a row's use of each limit.

    ``bus`` is that of the custom drive, ``bus_at_rest`` its voltage before any motion (V).
    """

    def allowed(limit: Limit) -> float | None:
        if limit is STROKE:
            return rig.spring.stroke(setting.spring_rate)
        if limit.of_own_gains:
            return 1.0
        if limit.role != "plant":
            return float(reduce(getattr, limit.key, rig if limit.role == "rig" else bounds))  # type: ignore[arg-type]
        if bus is None or predictions.voltage_available is None:
            return None
        if limit is MODULATION:
            return predictions.voltage_available
        return bus.overvoltage if limit is OVERVOLTAGE else bus.undervoltage

    margins = []
    for limit in LIMITS:
        predicted, bound = getattr(predictions, limit.field), allowed(limit)
        if predicted is not None and bound is not None:
            at_rest = bus_at_rest if limit.quantity == "bus voltage" else 0.0
            margins.append(Margin(limit, predicted, bound, at_rest))
    return tuple(margins)
