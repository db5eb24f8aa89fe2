"""A short identification run of the linear plant, and a plant file with wrong parameters."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from rehearsing import CONFIGS, rehearse, write_campaign, write_yaml

from rig.config.yaml_source import load_mapping

LINEAR = CONFIGS / "plants" / "wavebot_linear.yaml"
SPRING = -5715.0


def rehearse_identification(folder: Path) -> None:
    """Rehearse a run into `runs`: lines every 0.05 Hz at two amplitudes, one period each."""
    rows = {
        "spring_n_per_m": SPRING, "kp_n_s_per_m": 0, "ki_n_per_m": 0, "reference_scale": [1, 2],
    }  # fmt: skip
    path = write_campaign(
        folder / "calm",
        name="calm",
        plant=str(LINEAR),
        sea={"kind": "calm"},
        reference={"kind": "multisine", "repeat_s": 20, "amplitude_a": 12, "seed": 5},
        matrix={"grid": [rows]},
        timing={"settle_s": 15, "periods": 1},
        start={"set_point_s": 0, "lead_in_s": 2},
    )
    result = rehearse(path, folder / "runs")
    assert result.outcome.status == "complete"


def wrong_plant(folder: Path) -> Path:
    """Write a plant file of the same rig in which every identifiable parameter is wrong."""
    plant, _ = load_mapping(LINEAR)
    changed = copy.deepcopy(plant)
    changed_keys = {
        "body": ("mass", "hydrostatic", "viscous_linear"),
        "pto": ("drivetrain_viscous", "winding_resistance"),
        "drive": ("fixed_loss", "linear_loss", "square_loss"),
    }
    for section, names in changed_keys.items():
        for name in names:
            changed[section][name]["value"] *= 1.4
    changed["body"]["viscous_quadratic"]["value"] = 900.0
    changed["pto"]["drivetrain_coulomb"]["value"] = 80.0
    radiation: Any = changed["body"]["radiation"]
    radiation["numerator"]["value"] = [1.3 * b for b in radiation["numerator"]["value"]]
    for section_with_bem in (changed, changed["surge"]):
        section_with_bem["bem"] = str(CONFIGS / "plants" / section_with_bem["bem"])
    return write_yaml(folder / "wrong.yaml", changed)
