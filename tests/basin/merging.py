"""Write a synthetic run and records of other recorders, independent of the code that reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from synthetic_runs import Row, Shape, plan_json, run_rows, write_run

from rig.realtime.sequence import Phase

OFFSET, DRIFT = 7.25, 20e-6  # run time = tau (1 + DRIFT) + OFFSET
EDGE = 10.0  # s of run time


def write_merge_run(folder: Path) -> Path:
    """Write a run of three rows at 100 Hz; the wave maker starts at 10 s, probe 1 has its wave."""
    power = {"mechanical_1": -60.0, "mechanical_2": -50.0, "ac": -40.0, "dc": -20.0}
    rows = [Row(i, 0, 490.9, -2000.0, 2000.0 * i, power) for i in range(3)]
    shape = Shape(lead_in=2000, periods=10)
    data = run_rows(rows, shape)
    data["plan.wave_clock"] = np.where(data["time"] >= EDGE, data["time"] - EDGE, -1.0)
    data["probes.probe_1"] = wave(data["time"])
    return write_run(folder, data, plan_json(rows, shape))


def wave(t: Any) -> Any:
    """Return the wave elevation (m) at run time t."""
    return 0.1 * np.sin(2.0 * np.pi * 0.5 * t) + 0.02 * np.cos(2.0 * np.pi * 0.9 * t)


def write_twe(path: Path, rate: float = 50.0, length: float = 80.0, slip: float = 0.0) -> Path:
    """Write a basin record: waves in inches, TTL at 5 V, the 1 Hz sine at 20 dB."""
    random = np.random.default_rng(5)
    tau = np.arange(round(length * rate)) / rate
    t = tau * (1.0 + DRIFT) + OFFSET + np.where(tau > 0.5 * length, slip, 0.0)
    columns = {
        "UTC Time": 120000.0 + tau,
        "Time": tau,
        "BRIDGEPROBE01": wave(t) / 0.0254,
        "SINESIGNAL": 2.0 * np.sin(2.0 * np.pi * t) + 0.14 * random.normal(size=tau.size),
        "TTLTrigger": np.where(t >= EDGE, 5.0, 0.0),
    }
    lines = ["FILENAME:\tx.twe", "CHANNEL NAME:\t" + "\t".join(columns), ""]
    for i, row in enumerate(zip(*columns.values(), strict=True)):
        cells = "\t".join(f"{value:.6f}" for value in row)
        lines.append(("DATA:" if i == 0 else "") + "\t" + cells + "\t")
    path.write_text("\r\n".join(lines) + "\r\n", newline="")
    return path


def write_analyser(path: Path, offset: float = 3.0, rate: float = 20.0) -> Path:
    """Write the record of a power analyser on its own clock, without a sine."""
    tau = np.arange(round(60.0 * rate)) / rate
    t = tau + offset
    rows = [f"{a:.3f},{-40.0 - t_:.6f},{float(t_ >= EDGE):g}" for a, t_ in zip(tau, t, strict=True)]
    path.write_text("time_s,AC,TTL\n" + "\n".join(rows) + "\n")
    return path


MEASURE = Phase.MEASURE
