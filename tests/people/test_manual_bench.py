"""Manual mode of the bench: jog, homing, signals, brake; limits, refusals, rows that are kept."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chance_set_points import ManualRig, manual_task, run_by_chance, with_pool

from rig.people.orders import LiveColumns, LiveSet

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
RIGS = {
    "velocity": ("rigs/oswec_bench.yaml", "velocity"),
    "torque": ("sessions/torque_closed_loop.yaml", ""),  # its shaft is clamped
    "torque, open": ("rigs/oswec_bench.yaml", "torque"),
    "flap": ("rigs/oswec_flap.yaml", "velocity"),
    "flap, torque": ("sessions/flap_pto_sweep.yaml", ""),
}


def drawn(live: LiveColumns, random_: random.Random, share: float = 0.4) -> LiveSet:
    """Return a set point with values in the allowed ranges, mostly modest, with one signal.

    ``share``: of the largest values and amplitudes, and of 6 Hz.
    """
    values, signal = dict(live.first().values), dict(live.first().signal)
    columns = {each["key"]: each for each in live.describe()}
    for key in values:
        ends = columns[key]["low"], columns[key]["high"]
        if random_.random() < 0.5:
            values[key] = min(1.0, 2.0 * share) * random_.random() ** 2 * random_.choice(ends)
    signal["kind"] = random_.choice(["none", "sine", "step", "chirp"])
    amplitude = random_.choice([key for key in signal if key.startswith("amplitude")])
    signal[amplitude] = share * columns[amplitude]["high"] * random_.random()
    signal["frequency_hz"] = 6.0 * share * random_.random()
    signal["end_frequency_hz"] = 6.0 * share * random_.random()
    return LiveSet(values, signal)


def gently(live: LiveColumns, random_: random.Random) -> LiveSet:
    """Return a set point at which the water does not overload the load cell of a flap."""
    return drawn(live, random_, 0.03)


@pytest.fixture(scope="module")
def open_rig(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], ManualRig]:
    rigs: dict[str, ManualRig] = {}

    def find(name: str) -> ManualRig:
        if name not in rigs:
            file, drive = RIGS[name]
            run = manual_task(CONFIGS / file, tmp_path_factory.mktemp("bench"), drive)
            rigs[name] = with_pool(*run, gently if name == "flap" else drawn, name)
        return rigs[name]

    return find


def check_changes(rig: ManualRig, count: int, seed: int, spacing: int = 400) -> None:
    """Execute set points by chance; commands obey slew and limits, no value passes its stop."""
    rows, _ = run_by_chance(rig, count, seed, spacing)
    params: Any = rig.task.params.rig
    dt, limits = rig.task.dt, params.motor.limits
    assert np.abs(rows["command.velocity"]).max() <= params.speed.max_velocity
    step = np.abs(np.diff(rows["command.velocity"])).max()
    assert step <= params.speed.acceleration * dt * (1 + 1e-9)
    assert np.abs(rows["command.current"]).max() <= limits.current_peak
    step = np.abs(np.diff(rows["command.current"] * limits.newtons_per_ampere)).max()
    assert step <= limits.force_slew * dt * 1.1  # two constants, by direction
    assert np.abs(np.diff(rows["command.brake_current"])).max() <= params.brake.slew * dt * 1.001
    assert np.abs(rows["motor.angle"]).max() < limits.position_stop
    assert np.abs(rows["shaft.velocity"]).max() < limits.velocity_stop
    asked = rows["reference.velocity"] if params.mode == 0 else rows["reference.torque"]
    assert np.abs(asked).max() > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGS)
def test_set_points_by_chance(name: str, open_rig: Callable[[str], ManualRig]) -> None:
    check_changes(open_rig(name), 120, 0)
