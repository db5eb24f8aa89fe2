"""Small modular rigs as mappings of their files, and their cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mode_plants import CYLINDER, DRIVE, mapping
from mode_plants import HEAVE as HEAVE_MODE
from mode_plants import PITCH as PITCH_MODE
from rehearsing import write_yaml

from controllers import open_loop, signal_generator
from controllers.signals import AxisSense, PanelSense
from rig.config.law_settings import IMPEDANCE, ImpedanceSettings
from rig.kinds.modular.build import composition, modular_params
from rig.kinds.modular.config import LimitsFile, RigFile
from rig.kinds.modular.tick import WaveSense, compose
from rig.realtime.sequence import NO_ROW, Phase, Segments

DT = 1e-3

HEAVE: dict[str, Any] = {
    "motion": "translation",
    "torque_constant_n_m_per_a": 1.5,
    "gear_ratio_rad_per_m": 12.0,
    "counts_per_revolution": 1_048_576,
    "encoder_noise_counts": 0.3,
    "jerk_density_m2_per_s5": 10.0,
    "gain_ramp_s": 0.0,
    "stop_damping_n_s_per_m": 2000.0,
}
PITCH: dict[str, Any] = {
    "motion": "rotation",
    "torque_constant_n_m_per_a": 1.5,
    "gear_ratio": 40.0,
    "counts_per_revolution": 65_536,
    "encoder_noise_counts": 0.3,
    "jerk_density_rad2_per_s5": 10.0,
    "gain_ramp_s": 0.0,
    "stop_damping_n_m_s_per_rad": 300.0,
}
FORCE: dict[str, Any] = {"unit": "N", "tare": True, "range": [-5000, 5000], "age_limit_s": 0.1}
POWER: dict[str, Any] = {"unit": "W", "range": [-20000, 20000], "age_limit_s": 0.5}
PLANT_SENSORS: dict[str, Any] = {
    "pto_force": {"signal": "heave.motor_force"},
    "dc_power": {"signal": "pitch.current"},
}
STATIONS: dict[str, Any] = {
    "mechanical": {"formula": "pto_force * heave_velocity"},
    "dc": {"formula": "dc_power", "label": "electrical DC"},
}

DRIVE_LIMITS: dict[str, Any] = {
    "current_peak_a": 40.0,
    "current_rms_a": 20.0,
    "current_rms_time_s": 10.0,
    "encoder_age_stop_s": 0.02,
    "drive_age_stop_s": 0.1,
    "current_difference_stop_a": 5.0,
    "current_difference_time_s": 0.2,
}
HEAVE_LIMITS: dict[str, Any] = DRIVE_LIMITS | {
    "motion": "translation",
    "position_warn_m": 0.5,
    "position_stop_m": 0.6,
    "velocity_stop_m_per_s": 2.0,
    "force_slew_n_per_s": 1e6,
    "encoder_jump_stop_m": 0.05,
    "tare_span_stop_m": 0.02,
}
PITCH_LIMITS: dict[str, Any] = DRIVE_LIMITS | {
    "motion": "rotation",
    "position_warn_rad": 0.5,
    "position_stop_rad": 0.6,
    "velocity_stop_rad_per_s": 2.0,
    "torque_slew_n_m_per_s": 1e6,
    "encoder_jump_stop_rad": 0.05,
    "tare_span_stop_rad": 0.02,
}
LOOP_LIMITS: dict[str, Any] = {"lost_ticks_stop": 20, "panel_age_stop_s": 0.5}


def rig_mapping(**changes: Any) -> dict[str, Any]:
    """Return a rig file with a heave axis, a force sensor and a power meter."""
    return {
        "name": "float",
        "kind": "modular",
        "rate_hz": 1000,
        "realtime": "best effort",
        "limits": "limits.yaml",
        "plant": "plant.yaml",
        "drive_enable_timeout_s": 5.0,
        "axes": {"heave": HEAVE},
        "sensors": {"pto_force": FORCE, "dc_power": POWER},
        "stations": STATIONS,
        "stop": {"duration_s": 3.0, "ramp_s": 0.2},
    } | changes


def limits_mapping(**axes: Any) -> dict[str, Any]:
    """Return a limits file; by default with the limits of heave."""
    return {"axes": axes or {"heave": HEAVE_LIMITS}, "loop": LOOP_LIMITS}


def plant_mapping(**values: Any) -> dict[str, Any]:
    """Return a plant of heave and pitch whose axes come in the other order than the rig's."""
    axes = {
        "pitch": {"moves_with": {"pitch": 1.0}, "gear_ratio": 40.0, "counts_per_revolution": 65536},
        "heave": {"moves_with": {"heave": 1.0}, "drive": {**DRIVE, "enable_delay_s": 0.01}},
    }
    modes = {"heave": HEAVE_MODE, "pitch": PITCH_MODE}
    return mapping(modes, axes, sensors=PLANT_SENSORS) | values


def write_campaign(
    folder: Path, rig: dict[str, Any], limits: dict[str, Any], plant: dict[str, Any], **keys: Any
) -> Path:
    """Write a campaign with its rig, limits and plant file, and return its path."""
    write_yaml(folder / "rig.yaml", rig)
    write_yaml(folder / "limits.yaml", limits)
    write_yaml(folder / "plant.yaml", plant | {"bem": str(CYLINDER)})
    return write_yaml(folder / "campaign.yaml", {"name": "test", "rig": "rig.yaml", **keys})


def two_axes() -> tuple[RigFile, LimitsFile]:
    """Return a rig with heave and pitch."""
    rig = RigFile.model_validate(rig_mapping(axes={"heave": HEAVE, "pitch": PITCH}))
    bounds = LimitsFile.model_validate(limits_mapping(heave=HEAVE_LIMITS, pitch=PITCH_LIMITS))
    return rig, bounds


def one_axis() -> tuple[RigFile, LimitsFile]:
    """Return the rig of `rig_mapping` and its limits."""
    return RigFile.model_validate(rig_mapping()), LimitsFile.model_validate(limits_mapping())


def composed(rig: RigFile) -> Any:
    """Return the composed tick of a rig whose axes all have the impedance law."""
    return compose(composition(rig, dict.fromkeys(rig.axes, IMPEDANCE)))


def params(rig: RigFile, bounds: LimitsFile, segments: Segments, **gains: Any) -> Any:
    """Return the loop's parameters; ``gains``: Kp, Ki, Km of each axis in the only set point."""
    tick = composed(rig)
    columns = {name: tuple((gain,) for gain in gains[name]) for name in rig.axes}
    return modular_params(
        rig,
        bounds,
        dict.fromkeys(rig.axes, (IMPEDANCE, ImpedanceSettings())),
        segments,
        tick.Setpoints(
            **columns, reference_scale=(1.0,), realisation=(0,), signal=signal_generator.columns(1)
        ),
        open_loop.Params((), 0.1, 1),
        next(iter(rig.axes)),
    )


def measuring(tare: int, ticks: int) -> Segments:
    """Return a plan: tare with the drives off, then one measured row, then the end."""
    none = (0, 0, 0)
    return Segments(
        row=(NO_ROW, 0, NO_ROW),
        phase=(int(Phase.TARE), int(Phase.MEASURE), int(Phase.DONE)),
        ticks=(tare, ticks, 0),
        wait=none,
        timeout=none,
        restart=(0, 1, 2),
        setpoint=none,
        drive=(0, 1, 0),
        waves=(0, 1, 0),
    )


def axis_sense(counts: int, current: float = 0.0, enabled: int = 1) -> AxisSense:
    """Return fresh readings of an axis."""
    return AxisSense(counts, 0.0, current, enabled, 0, 0.0)


def sense(tick: Any, *axes: AxisSense, **sensors: tuple[float, float]) -> Any:
    """Return a tick's readings; ``sensors``: value and age of each, in order."""
    readings = (kind(*sensors[name]) for kind, name in zip(tick.READINGS, sensors, strict=True))
    return tick.Sense(*axes, *readings, WaveSense(0.0), PanelSense(0, 0, 0.0))
