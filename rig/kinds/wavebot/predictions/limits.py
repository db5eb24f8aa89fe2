"""The limits that a predicted row is compared with, and its use of each."""

from rig.design.margin import Effect, Limit, Margin, Role
from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.predictions.prediction import RowPredictions
from rig.planning.campaign.set_points import RowSetting
from sim_plant.bus import BusParams


def _limit(
    name: str, key: str, effect: Effect, unit: str, quantity: str, role: Role = "limits",
    *, is_lower_bound: bool = False,
) -> Limit:  # fmt: skip
    return Limit(name, role, tuple(key.split(".")), effect, unit, quantity, is_lower_bound)


POSITION_WARN = _limit("position warn", "heave.position_warn_m", "warn", "m", "position peak")
POSITION = _limit("position", "heave.position_stop_m", "stop", "m", "position peak")
STROKE = _limit("spring stroke", "spring.map", "stop", "m", "position peak", "rig")
ROTOR = _limit("rotor travel", "spring.rotor_travel_stop_m", "stop", "m", "rotor travel")
VELOCITY = _limit("velocity", "heave.velocity_stop_m_per_s", "stop", "m/s", "velocity peak")
CURRENT_PEAK = _limit("current peak", "heave.current_peak_a", "cut", "A", "current peak")
CURRENT_RMS = _limit("current rms", "heave.current_rms_a", "cut", "A", "current rms")
BUS = _limit("bus voltage", "bus.voltage_stop_v", "stop", "V", "bus voltage")
OVERVOLTAGE = _limit(
    "bus overvoltage", "drive.overvoltage_trip.value", "stop", "V", "bus voltage", "plant"
)
UNDERVOLTAGE = _limit(
    "bus undervoltage", "drive.undervoltage_share.value", "stop", "V", "bus voltage", "plant",
    is_lower_bound=True,
)  # fmt: skip
MODULATION = _limit(
    "modulation", "drive.scheme_modulation.value", "cut", "V", "voltage need", "plant"
)
SURGE_WARN = _limit(
    "surge position warn", "surge.position_warn_m", "warn", "m", "surge position peak"
)
SURGE_POSITION = _limit(
    "surge position", "surge.position_stop_m", "stop", "m", "surge position peak"
)
SURGE_VELOCITY = _limit(
    "surge velocity", "surge.velocity_stop_m_per_s", "stop", "m/s", "surge velocity peak"
)
SURGE_PEAK = _limit("surge current peak", "surge.current_peak_a", "cut", "A", "surge current peak")
SURGE_RMS = _limit("surge current rms", "surge.current_rms_a", "cut", "A", "surge current rms")
STIFFNESS = _limit(
    "stiffness", "stability.least_stiffness_n_per_m", "unstable", "N/m", "stiffness at rest",
    "rig", is_lower_bound=True,
)  # fmt: skip
LOOP = _limit("loop gain", "", "unstable", "1", "gain margin", "campaign", is_lower_bound=True)
SURGE_LOOP = _limit(
    "surge gain", "", "unstable", "1", "surge gain margin", "campaign", is_lower_bound=True
)

_RELATIVE_TO_REST = (BUS, OVERVOLTAGE, UNDERVOLTAGE)


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
    heave, surge = bounds.heave, bounds.surge
    x = predictions.position_peak
    pairs: list[tuple[Limit, float | None, float]] = [
        (POSITION_WARN, x, heave.position_warn_m),
        (POSITION, x, heave.position_stop_m),
        (STROKE, x, rig.spring.stroke(setting.spring_rate)),
        (ROTOR, x, bounds.spring.rotor_travel_stop_m),
        (VELOCITY, predictions.velocity_peak, heave.velocity_stop_m_per_s),
        (CURRENT_PEAK, predictions.current_peak, heave.current_peak_a),
        (CURRENT_RMS, predictions.current_rms_peak, heave.current_rms_a),
        (BUS, predictions.voltage_highest, bounds.bus.voltage_stop_v),
        (SURGE_WARN, predictions.surge_position_peak, surge.position_warn_m),
        (SURGE_POSITION, predictions.surge_position_peak, surge.position_stop_m),
        (SURGE_VELOCITY, predictions.surge_velocity_peak, surge.velocity_stop_m_per_s),
        (SURGE_PEAK, predictions.surge_current_peak, surge.current_peak_a),
        (SURGE_RMS, predictions.surge_current_rms_peak, surge.current_rms_a),
        (STIFFNESS, predictions.stiffness, rig.stability.least_stiffness_n_per_m),
        (LOOP, predictions.gain_margin, 1.0),
        (SURGE_LOOP, predictions.surge_gain_margin, 1.0),
    ]
    if bus is not None and predictions.voltage_available is not None:
        pairs += [
            (OVERVOLTAGE, predictions.voltage_highest, bus.overvoltage),
            (UNDERVOLTAGE, predictions.voltage_lowest, bus.undervoltage),
            (MODULATION, predictions.voltage_required, predictions.voltage_available),
        ]
    return tuple(
        Margin(limit, predicted, allowed, bus_at_rest if limit in _RELATIVE_TO_REST else 0.0)
        for limit, predicted, allowed in pairs
        if predicted is not None
    )
