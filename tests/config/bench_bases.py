"""Valid files of the bench as mappings; together they contain every key with a number."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench.config.constants_file import ConstantsFile
from rig.kinds.oswec_bench.config.limits_file import BenchLimitsFile
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.config.session_file import SessionFile

CONFIGS = Path(__file__).parents[2] / "configs"
TIMING = {"rise_s": 1.5, "settle_periods": 1, "periods": 4}
DRIVELINE = {
    "name": "test", "session": "driveline", "rig": "rig.yaml", "timing": TIMING, "seed": 1,
    "rows": [{"amplitude_deg": 5, "period_s": 1.5, "damping_n_m_s_per_rad": 42,
              "brake_current_a": 0}],
    "position_feedback_per_s": 1, "tare": {"duration_s": 5}, "repeat": 1,
}  # fmt: skip


def as_grid(mapping: dict[str, Any]) -> dict[str, Any]:
    """Return the session with its row as a grid."""
    mapping_copy = deepcopy(mapping)
    (row,) = mapping_copy.pop("rows")
    mapping_copy["grid"] = [{key: [value] for key, value in row.items()}]
    return mapping_copy


def session(kind: str, row: dict[str, float], **keys: Any) -> dict[str, Any]:
    """Return a session of one row."""
    return {"name": "test", "session": kind, "rig": "rig.yaml", "timing": TIMING, "rows": [row],
            **keys}  # fmt: skip


TRACKING = session("torque_tracking", {"torque_amplitude_n_m": 20, "period_s": 20}, shaft="clamped")
CURRENT = session("torque_constant", {"current_amplitude_a": 2, "period_s": 20}, shaft="clamped")
DECAY = session("flap_free_decay", {"release_deg": 10, "period_s": 3.5})
SWEEP = session(
    "flap_pto_sweep",
    {"wave_amplitude_m": 0.05, "period_s": 1.5, "pto_damping_n_m_s_per_rad": 50},
)
IRREGULAR = session(
    "driveline", {"amplitude_deg": 5},
    irregular={"low_hz": 0.3, "high_hz": 1.2, "repeat_s": 30, "seed": 7, "draws": 10},
)  # fmt: skip
BRANCH = {"current_a": [0, 1], "torque_n_m": [2, 90], "uncertainty_n_m": [0.1, 0.2]}
CONSTANTS = {
    "name": "driveline", "rig": "OSWEC bench", "run": "r1", "date": "2026-11-22",
    "constants": {"stiffness": {"value": 28483, "unit": "N*m/rad", "uncertainty": 30}},
    "brake_map": {"rising": BRANCH, "falling": BRANCH},
    "deflection_map": {"torque_n_m": [-90, 90], "deflection_deg": [-0.2, 0.2]},
    "driveline": [{
        "row": 0, "amplitude_deg": 5, "period_s": 1.5, "damping_n_m_s_per_rad": 42,
        "rms_velocity_rad_per_s": 0.25, "rms_torque_n_m": 10.5, "amplitude_difference_deg": 0.036,
        "phase_shift_percent": 0.3,
    }],
}  # fmt: skip


def wired_bench() -> dict[str, Any]:
    """Return the wired bench, with the optional keys that the shipped file lacks."""
    rig, _ = load_mapping(CONFIGS / "rigs" / "oswec_bench_hil.yaml")
    wiring = rig["wiring"]
    wiring["lines"]["amplifiers"] = {
        "kind": "rtu", "port": "/tmp/amplifiers", "baud": 115200, "parity": "N", "stop_bits": 1,
        "timeout_s": 0.25, "slowest_s": 0.25,
    }  # fmt: skip
    for name in ("inputs", "brake"):
        wiring[name]["prepare"] = deepcopy(wiring["analog"]["prepare"])
    return rig


BASES: dict[str, tuple[type[BaseModel], dict[str, Any]]] = {
    "driveline": (SessionFile, DRIVELINE),
    "driveline, grid": (SessionFile, as_grid(DRIVELINE)),
    "tracking": (SessionFile, TRACKING),
    "tracking, grid": (SessionFile, as_grid(TRACKING)),
    "current": (SessionFile, CURRENT),
    "current, grid": (SessionFile, as_grid(CURRENT)),
    "decay": (SessionFile, DECAY),
    "decay, grid": (SessionFile, as_grid(DECAY)),
    "sweep": (SessionFile, SWEEP),
    "sweep, grid": (SessionFile, as_grid(SWEEP)),
    "irregular": (SessionFile, IRREGULAR),
    "rig": (BenchRigFile, load_mapping(CONFIGS / "rigs" / "oswec_bench.yaml")[0]),
    "wired": (BenchRigFile, wired_bench()),
    "limits": (BenchLimitsFile, load_mapping(CONFIGS / "limits" / "oswec_bench.yaml")[0]),
    "constants": (ConstantsFile, CONSTANTS),
}
"""Model and a mapping that it accepts, by name."""
