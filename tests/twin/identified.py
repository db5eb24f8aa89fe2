"""A short identification of the linear plant, and a plant file that knows nothing of it."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from rehearsing import CONFIGS, rehearse, write_campaign, write_yaml

from rig.config.yaml_source import load_mapping

LINEAR = CONFIGS / "plants" / "wavebot_linear.yaml"
SPRING = -5715.0


def identified(folder: Path) -> None:
    """The run, in `runs`: lines of a twentieth of a hertz at two amplitudes, one period each."""
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
    ended = rehearse(path, folder / "runs")
    assert ended.outcome.status == "complete"


def wrong_plant(folder: Path) -> Path:
    """A plant file of the same rig in which every number that a run can tell is another one."""
    plant, _ = load_mapping(LINEAR)
    made = copy.deepcopy(plant)
    wrong = {
        "body": ("mass", "hydrostatic", "viscous_linear"),
        "pto": ("drivetrain_viscous", "winding_resistance"),
        "drive": ("fixed_loss", "linear_loss", "square_loss"),
    }
    for section, names in wrong.items():
        for name in names:
            made[section][name]["value"] *= 1.4
    made["body"]["viscous_quadratic"]["value"] = 900.0
    made["pto"]["drivetrain_coulomb"]["value"] = 80.0
    radiation: Any = made["body"]["radiation"]
    radiation["numerator"]["value"] = [1.3 * b for b in radiation["numerator"]["value"]]
    made["bem"] = str(CONFIGS / "plants" / made["bem"])
    return write_yaml(folder / "wrong.yaml", made)
