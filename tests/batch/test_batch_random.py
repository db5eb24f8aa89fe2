"""Compiled and interpreted loop give the same bits for random plants, laws and seas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_ways import compiled, differing_fields, interpreted
from rehearsing import CONFIGS, write_campaign, write_yaml

from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.rehearsal.job import MATCHING_KEYS

COUPLED = {"supply_resistance", "capacitance"}  # their product has a lower bound
EXCLUDED = set(MATCHING_KEYS.values()) | {
    ("stator", "start", "value")
}  # tied to the rig file, or a position


def draw_plant(path: Path, rng: np.random.Generator) -> dict[str, Any]:
    """Return a plant file with every physical number changed by up to 10 %."""
    plant, _ = load_mapping(path)

    def scale_values(mapping: Any, path_in_file: tuple[str, ...]) -> None:
        for key, entry in mapping.items():
            key_path = (*path_in_file, key)
            if (
                key == "value"
                and isinstance(entry, float)
                and key_path not in EXCLUDED
                and COUPLED.isdisjoint(path_in_file)
            ):
                unit = mapping.get("unit")
                if unit not in ("1", "tick", "count"):
                    mapping[key] = float(entry * rng.uniform(0.9, 1.1))
            elif isinstance(entry, dict):
                scale_values(entry, key_path)

    scale_values(plant, ())
    for section in (plant, plant["surge"]):
        section["bem"] = str(path.with_name(section["bem"]))
    return plant


def draw_campaign(folder: Path, seed: int) -> Path:
    """Write a campaign with random sea, gains, surge law and drive."""
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
    config: dict[str, Any] = {
        "rig": str(rig),
        "plant": str(write_yaml(folder / "drawn.yaml", draw_plant(plant, rng))),
        "seed": seed + 100,
        "sea": sea,
        "tare": {"duration_s": 0.5},
        "start": {"set_point_s": 1, "lead_in_s": 6},
        "timing": {"settle_s": 0.5} | ({"interval_s": 5} if sea["kind"] == "regular" else {}),
        "matrix": {"list": [point]},
    }
    return write_campaign(folder, **config | {"surge": {"use": surge}})


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(5))
def test_random_numbers_give_the_same_bits(seed: int, tmp_path: Path) -> None:
    path = draw_campaign(tmp_path, seed)
    compiled_result, interpreted_result = compiled(path), interpreted(path)
    assert not differing_fields(compiled_result, interpreted_result)
    assert len(compiled_result.kept) > 1000
