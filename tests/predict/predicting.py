"""Predictions of small campaigns with the shipped configuration, for the tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rehearsing import CONFIGS, write_campaign, write_yaml

from rig.campaign import CheckReport
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.predictions.prediction import Prediction
from rig.kinds.wavebot.predictions.rows import predict
from rig.kinds.wavebot.rehearsal.job import problems
from rig.sweeps import sweep
from rig.sweeps.executors import thread_executor

__all__ = [
    "CONFIGS",
    "check_report",
    "custom_rig",
    "predict_campaign",
    "rows",
    "simulate",
    "write_campaign",
    "write_named_yaml",
]  # fmt: skip

STIFF, SOFT = 490.9, -5715.0


def rows(*gains: tuple[float, float, float], **more: float) -> dict[str, Any]:
    """Return a matrix of rows (spring rate, Kp, Ki)."""
    names = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")
    return {"list": [dict(zip(names, one, strict=True)) | more for one in gains]}


def check_report(path: Path) -> CheckReport:
    """Return the report of a campaign file, as `rig check` creates it."""
    return check_campaign(path, extra_check=problems, predictor=predict)


def predict_campaign(path: Path) -> Prediction:
    """Return the prediction of a campaign file whose rows may be refused."""
    report = check_report(path)
    assert isinstance(report.prediction, Prediction), report.text()
    return report.prediction


def simulate(path: Path) -> Any:
    """Return the row table of a campaign simulated by the compiled loop.

    It is bitwise equal to a rehearsal (tests/batch/test_batch_bits.py) and takes a hundredth of the
    time.
    """
    opened = sweep.open_sweep(path, [], path.parent / "sweeps", sequential=True, lead_in=0.0)
    return sweep.run(opened, thread_executor(1), lambda outcome: None)


def write_named_yaml(folder: Path, name: str, mapping: dict[str, Any]) -> Path:
    """Write a YAML file; return its path."""
    return write_yaml(folder / name, mapping)


def custom_rig(folder: Path, plant: str = "wavebot_custom.yaml", **drive: Any) -> Path:
    """Write a rig file with the custom drive at 75 V and 10 kHz; return its path."""
    drive_block = {
        "kind": "custom", "modulation": "svpwm", "bus_voltage_v": 75, "switching_period_s": 1e-4,
        "hysteresis_a": 0.5, "velocity_threshold_m_per_s": 0, "current_threshold_a": 3,
        "discharge_level": 15, **drive,
    }  # fmt: skip
    return write_named_yaml(
        folder,
        "rig.yaml",
        {
            "extends": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "plant": str(CONFIGS / "plants" / plant),
            "drive": drive_block,
        },
    )
