"""Write MASK4 files as the test's own system did, independent of the exporter.

Bus and field names, signs and clocks follow the scripts of the public fbWecCntrl repository
(MASK4/MHKDRCode): slow scope 200 Hz, power analyser on its own clock, AC power with the opposite
sign.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from scipy.io import savemat

RATE = 200.0
START = 10.0  # s, where runCounter becomes 1
F = 0.5  # Hz
SPEED = 0.2  # m/s
BIAS = 40.0  # N, on both load cells


class Row(NamedTuple):
    kp: float
    ki: float
    spring: float
    mechanical: float  # W


ROWS = (
    Row(-1000.0, 0.0, 490.9, -30.0),
    Row(-2000.0, 0.0, 490.9, -50.0),
    Row(-2000.0, 2000.0, 490.9, -60.0),
    Row(-2000.0, 2000.0, -5715.0, -70.0),  # twice, because the spring moves
    Row(-2000.0, 2000.0, -5715.0, -70.0),
    Row(-1000.0, 0.0, -5715.0, -40.0),
)


def buses(custom: bool = False) -> dict[str, dict[str, Any]]:
    """Return the structure: 10 s, 120 s of hold, six rows of 20 s, then Kp = -999 for 5 s."""
    count = round((START + 120.0 + 20.0 * len(ROWS) + 5.0) * RATE)
    t = 100.0 + np.arange(count) / RATE  # MASK4 time does not begin at 0
    since = np.arange(count) / RATE - START - 120.0
    index = np.clip((since / 20.0).astype(int), 0, len(ROWS) - 1)
    kp, ki, spring, power = (np.array(column)[index] for column in zip(*ROWS, strict=True))
    kp = np.where(since >= 20.0 * len(ROWS), -999.0, kp)
    v = SPEED * np.sin(2.0 * np.pi * F * t)
    lcb = 2.0 * power / SPEED**2 * v + BIAS
    analyser_time = np.arange(t[0] - 0.5, t[-1] + 0.5, 0.0037)  # the analyser's clock
    ac = 0.6 * np.interp(
        analyser_time, t, power
    )  # MASK4 AC power is positive where the log's is negative
    dc = 0.2 * np.interp(analyser_time, t, power)
    hbm = {
        "time": analyser_time,
        "heaveDriveOutSumP": -ac,
        "expDriveInP" if custom else "heaveDriveInP": dc,
    }
    structure: dict[str, dict[str, Any]] = {
        "expCtrl": {"runCounter": (np.arange(count) / RATE >= START).astype(float)},
        "expParamSignals": {"heaveKpUsed": kp, "heaveKiUsed": ki},
        "heaveSignals": {
            "time": t,
            "heaveEncPos_m": -SPEED / (2 * np.pi * F) * np.cos(2 * np.pi * F * t),
            "heaveEncVel_m_s": v,
            "heaveForceI_N": 76.9750 * 3.0 * np.sin(2 * np.pi * F * t),
            "heaveForceTRS_N": 0.8 * (lcb - BIAS) - BIAS,
            "heaveForceLCB_N": lcb,
        },
        "refSignals": {"heaveRefRaw_N": kp * v, "dcBusVoltage_V": np.full(count, 75.0)},
        "setpointSignals": {
            "time": t,
            "trigger": np.where(np.arange(count) / RATE >= START, 9.8, 0.1),
            "syncSine": np.sin(2 * np.pi * t + 0.4),
        },
        "magSpringSignals": {
            "time": t,
            "forceStatorA_N": np.full(count, 900.0),
            "forceStatorB_N": np.full(count, 800.0),
            "forceSlew_N": np.full(count, 55.0),
            "nanoRatePos_percent": np.where(spring > 0.0, -13.0, 27.0),
        },
        "magSpringSetpointSignals": {"targetSpring_N_m": spring},
        "hbmSignals": hbm,
    }
    if custom:
        slow = t[::7]
        structure["toDriveSGSignals"] = {
            "time": slow,
            "switchingPeriod_s": np.full(slow.size, 1e-4),
            "velThreshold_m_s": np.full(slow.size, 0.05),
        }
    return structure


def write(path: Path, structure: dict[str, dict[str, Any]], *, alone: bool = True) -> Path:
    """Write MATLAB 5: one structure, for the scripts' importdata, or one variable per bus."""
    columns = {
        bus: {n: v.reshape(-1, 1) for n, v in fields.items()} for bus, fields in structure.items()
    }
    savemat(path, {"waveBotCtrlMdl": columns} if alone else columns, do_compression=True)
    return path


def write_newer(path: Path, structure: dict[str, dict[str, Any]]) -> Path:
    """Write MATLAB 7.3: HDF5 with MATLAB's user block and transposed matrices."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for bus, fields in structure.items():
            for name, value in fields.items():
                file[f"waveBotCtrlMdl/{bus}/{name}"] = value.reshape(1, -1)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as raw:
        raw.write(head)
    return path
