"""A wired modular rig of two axes on free ports of this host: heave, and a pitch that rotates."""

from __future__ import annotations

import copy
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mode_plants import CYLINDER, DRIVE, mapping
from mode_plants import HEAVE as HEAVE_MODE
from mode_plants import PITCH as PITCH_MODE
from modular_rigs import HEAVE, HEAVE_LIMITS, LOOP_LIMITS, PITCH, PITCH_LIMITS
from ruamel.yaml import YAML

from benchmarks.support.free_port import free_port
from rig.emulation.control_client import ControlClient
from rig.execution.emulated_rig import running_devices
from rig.processes.io_processes import IoProcess

HEAVE_GAINS = {"heave_kp_n_s_per_m": -5000, "heave_ki_n_per_m": 500}
PITCH_GAINS = {"pitch_kp_n_m_s_per_rad": -800, "pitch_ki_n_m_per_rad": 200}


def _drive(node: int, counts: int, scaling: str, **values: Any) -> dict[str, Any]:
    amc = scaling == "amc"
    return {
        "node": node,
        "scaling": scaling,
        "current_limit_a": 40,
        "command_deadline_ms": 250,
        "heartbeat_lost_ms": 300,
        "heartbeat_ms": 100,
        "follows": True,
        "mode_first": True,
        "deadlines": {"transition_s": 1.0, "boot_s": 5.0, "ramp_s": 2.0, "stale_s": 0.2},
        "objects": {
            "abort_connection": 2,
            "communication_error": 0,
            "quick_stop_option": 2,
            "fault_reaction_option": 0,
            "encoder_increments": counts,
            "encoder_motor_revolutions": 1,
            "gear_motor_revolutions": 1,
            "gear_shaft_revolutions": 1,
            "feed": counts,
            "feed_shaft_revolutions": 1,
            "max_torque": None if amc else 2000,
            "max_current": None if amc else 2000,
            "position_low": None,
            "position_high": None,
            **({"amc_peak_current": 1000} if amc else {"rated_torque": 123490}),
            "interpolation_time": 1,
            "interpolation_exponent": -3,
        },
        **values,
    }


def _block(line: str, table: str, size: int, *values: dict[str, Any], **keys: Any) -> Any:
    return {
        "line": line, "unit": 1, "table": table, "first": 0, "size": size,
        "word_order": "high first", "period_s": 0.01, "values": list(values), **keys,
    }  # fmt: skip


def datagram_port() -> int:
    """Return a UDP port of loopback that is free now."""
    with socket.socket(type=socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


def wiring_mapping() -> dict[str, Any]:
    """Return a wiring with every sort of source: analog inputs, registers, a load cell."""
    return {
        "can": {
            "interface": "socketcand",
            "channel": "can0",
            "bit_rate": 1000000,
            "options": {"host": "127.0.0.1", "port": free_port(), "tcp_tune": True},
            "own_node": 127,
            "heartbeat_s": 0.05,
            "slow_divider": 20,
            "actuator_divider": 10,
        },
        "axes": {  # in the other order than the rig's
            "pitch": _drive(6, 65536, "rated_current", analog_per_v=[1.0]),
            "heave": _drive(5, 1_048_576, "amc", analog_per_v=[50.0, 100.0]),
        },
        "lines": {
            "meter": {"kind": "tcp", "host": "127.0.0.1", "port": free_port(), "timeout_s": 0.2},
            "io": {"kind": "tcp", "host": "127.0.0.1", "port": free_port(), "timeout_s": 0.2},
        },
        "registers": {
            "meter": _block(
                "meter", "input", 8,
                {"name": "dc", "at": 0, "kind": "f32"},
                {"name": "angle", "at": 3, "kind": "i32", "scale": 1e-6},
                {"name": "height", "at": 6, "kind": "i16", "scale": 1e-4},
                word_order="low first", counter=100,
            ),
        },
        "load_cells": {
            "cell": {
                "host": "127.0.0.1", "port": datagram_port(), "counts_per_force": 1000000,
                "counts_per_torque": 1000000, "force_unit": "N", "torque_unit": "N-m",
                "model": "net_ft", "rate_hz": 0, "turned_over": True, "quiet_s": 0.3,
                "silence_s": 0.5,
            },
        },
        "inputs": _block("io", "discrete", 4, {"name": "e_stop", "at": 1, "kind": "bit"},
                         {"name": "limit_switch", "at": 3, "kind": "bit"}),
        "outputs": _block("io", "coil", 1, {"name": "wave_trigger", "at": 0, "kind": "bit"}),
    }  # fmt: skip


def _sensor(unit: str, source: str, span: float, **values: Any) -> dict[str, Any]:
    return {
        "unit": unit, "source": source, "range": [-span, span], "age_limit_s": 0.4, **values,
    }  # fmt: skip


SENSORS: dict[str, Any] = {
    "pto_force": _sensor("N", "heave.analog_2", 20000, scale=10.0, offset=3.0),
    "elevation": _sensor("m", "pitch.analog_1", 2, tare=True),
    "dc_power": _sensor("W", "meter.dc", 50000),
    "angle": _sensor("deg", "meter.angle", 90, scale=57.29577951308232),
    "height": _sensor("m", "meter.height", 2),
    "pitch_torque": _sensor("N*m", "cell.tz", 5000),
}
UNUSED_INPUT = _sensor("N", "heave.analog_1", 1e6)
"""A sensor on the first input of heave's drive, which the second one needs anyway."""

PLANT_SENSORS = {
    "pto_force": {"signal": "heave.motor_force", "scale": 0.1},
    "elevation": {"signal": "wave.elevation"},
    "dc_power": {"signal": "heave.electric_power"},
    "angle": {"signal": "pitch.position"},
    "height": {"signal": "heave.position"},
    "pitch_torque": {"signal": "pitch.motor_force"},
}


def write_files(folder: Path, **rig: Any) -> Path:
    """Write rig, limits, plant and campaign of the wired rig; return the campaign's path."""
    shutil.copy(CYLINDER, folder)
    slow = {"encoder_age_stop_s": 0.15, "drive_age_stop_s": 0.15, "current_difference_time_s": 0.5}
    limits = {
        "axes": {"heave": HEAVE_LIMITS | slow, "pitch": PITCH_LIMITS | slow},
        "loop": LOOP_LIMITS | {"lost_ticks_stop": 200},
    }
    axes = {
        "pitch": {"moves_with": {"pitch": 1.0}, "gear_ratio": 40.0, "counts_per_revolution": 65536},
        "heave": {"moves_with": {"heave": 1.0}},
    }
    drive = {**DRIVE, "resistance_ohm": 0.5, "standby_w": 5.0}
    axes = {name: {**axis, "drive": drive} for name, axis in axes.items()}
    modes = {
        "heave": HEAVE_MODE | {"linear_damping": 400.0},
        "pitch": PITCH_MODE | {"linear_damping": 100.0},
    }
    rig_file = {
        "name": "float on wires",
        "kind": "modular",
        "rate_hz": 1000,
        "realtime": "best effort",
        "limits": "limits.yaml",
        "plant": "plant.yaml",
        "drive_enable_timeout_s": 5.0,
        "axes": {"heave": HEAVE, "pitch": PITCH},
        "sensors": SENSORS,
        "stations": {
            "mechanical": {"formula": "heave_force * heave_velocity"},
            "pitch": {"formula": "pitch_force * pitch_velocity"},
            "dc": {"formula": "dc_power"},
        },
        "stop": {"duration_s": 2.0, "ramp_s": 0.2},
        "wiring": wiring_mapping(),
    }
    campaign = {
        "name": "wires",
        "rig": "rig.yaml",
        "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        "tare": {"duration_s": 1},
        "start": {"lead_in_s": 4},
        "timing": {"settle_s": 2, "interval_s": 12},
        "matrix": {"list": [HEAVE_GAINS | PITCH_GAINS]},
    }
    plant = mapping(modes, axes, sensors=PLANT_SENSORS, delay_s=0.001)
    for name, content in (
        ("limits", limits), ("plant", plant), ("rig", rig_file | rig), ("campaign", campaign),
    ):  # fmt: skip
        with (folder / f"{name}.yaml").open("w") as stream:
            YAML().dump(copy.deepcopy(content), stream)
    return folder / "campaign.yaml"


@contextmanager
def served(emulator: IoProcess, folder: Path) -> Iterator[ControlClient]:
    """Run emulated devices while the context is open; yield the client of their control port."""
    with running_devices(emulator, folder) as control:
        yield control
    assert (folder / "emulation.stderr").read_text() == ""
