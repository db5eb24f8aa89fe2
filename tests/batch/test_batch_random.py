"""Every law and plant both ways over numbers drawn from a seed: the same bits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_ways import compiled, interpreted
from rehearsing import CONFIGS, write_campaign, write_yaml

from rig.config.yaml_source import load_mapping
from rig.execution.rehearsal.job import MATCHING_KEYS
from rig.sweep.simulation import KEPT

SEEDS = range(6)
BOUND = {"supply_resistance", "capacitance"}  # their product has a least value
AGREED = set(MATCHING_KEYS.values()) | {
    ("stator", "start", "value")
}  # with the rig file, or a place


def drawn_plant(path: Path, rng: np.random.Generator) -> dict[str, Any]:
    """A plant file with every physical number up to a tenth off."""
    plant, _ = load_mapping(path)

    def walk(inside: Any, at: tuple[str, ...]) -> None:
        for key, entry in inside.items():
            here = (*at, key)
            if (
                key == "value"
                and isinstance(entry, float)
                and here not in AGREED
                and BOUND.isdisjoint(at)
            ):
                unit = inside.get("unit")
                if unit not in ("1", "tick", "count"):
                    inside[key] = float(entry * rng.uniform(0.9, 1.1))
            elif isinstance(entry, dict):
                walk(entry, here)

    walk(plant, ())
    plant["bem"] = str(path.with_name(plant["bem"]))
    return plant


def drawn(folder: Path, seed: int) -> Path:
    """A campaign of two rows: sea, gains, law of surge and drive by chance."""
    rng = np.random.default_rng(seed)
    custom = bool(rng.integers(2))
    name = "wavebot_custom" if custom else "wavebot"
    rig = CONFIGS / "rigs" / f"{name}.yaml"
    surge = ("station keeping", "hold", "off")[int(rng.integers(3))]
    point = {
        "spring_n_per_m": float(rng.uniform(-5000, 400)),
        "kp_n_s_per_m": float(rng.uniform(-4000, -1000)),
        "ki_n_per_m": float(rng.uniform(0, 4000)),
    }
    if custom:
        point["bus_voltage_v"] = float(rng.uniform(60, 100))
        point["velocity_threshold_m_per_s"] = float(rng.uniform(0.0, 0.1))
    sea: dict[str, Any] = {"kind": "regular", "amplitude_m": float(rng.uniform(0.02, 0.1)),
                           "frequency_hz": 0.5}  # fmt: skip
    if rng.integers(2):
        sea = {"kind": "jonswap", "hs_m": float(rng.uniform(0.05, 0.15)), "tp_s": 2.5,
               "repeat_s": 10, "seed": seed + 1}  # fmt: skip
    plant = CONFIGS / "plants" / f"{name}.yaml"
    whole: dict[str, Any] = {
        "rig": str(rig),
        "plant": str(write_yaml(folder / "drawn.yaml", drawn_plant(plant, rng))),
        "seed": seed + 100,
        "sea": sea,
        "tare": {"duration_s": 0.5},
        "start": {"set_point_s": 1, "lead_in_s": 6},
        "timing": {"settle_s": 0.5} | ({"interval_s": 5} if sea["kind"] == "regular" else {}),
        "matrix": {"list": [point]},
    }
    return write_campaign(folder, **whole | {"surge": {"use": surge}})


@pytest.mark.parametrize("seed", SEEDS)
def test_numbers_by_chance_give_the_same_bits(seed: int, tmp_path: Path) -> None:
    path = drawn(tmp_path, seed)
    ours, theirs = compiled(path), interpreted(path)
    assert ours.reason == theirs.reason
    assert ours.kept.shape == theirs.kept.shape
    assert len(ours.kept) > 1000
    differing = [
        n for i, n in enumerate(KEPT) if ours.kept[:, i].tobytes() != theirs.kept[:, i].tobytes()
    ]
    assert not differing
