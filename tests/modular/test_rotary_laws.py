"""The laws of this distribution on an axis that rotates: columns and parameters per rad, in N*m."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_here import rig as rig_here
from modular_rigs import (
    PITCH,
    PITCH_LIMITS,
    limits_mapping,
    plant_mapping,
    rig_mapping,
    write_campaign,
)

from rig import laws

HOLD = {"hold_stiffness_n_m_per_rad": 5000.0, "hold_damping_n_m_s_per_rad": 300.0}
TABLE = {"velocity_rad_per_s": [-1.0, 0.0, 1.0], "force_n_m": [600.0, 0.0, -600.0]}
LAWS: dict[str, tuple[dict[str, Any], dict[str, float]]] = {
    "impedance": ({}, {"kp_n_m_s_per_rad": -400.0, "ki_n_m_per_rad": 50.0}),
    "velocity table": (TABLE, {"table_scale": 1.0, "retract_factor": 1.0}),
    "nonlinear damping": (
        {"smoothing_rad_per_s": 0.02},
        {"quadratic_n_m_s2_per_rad2": 400.0, "coulomb_n_m": 20.0},
    ),
    "latching": (
        HOLD | {"arming_speed_rad_per_s": 0.01},
        {"kp_n_m_s_per_rad": -400.0, "latch_s": 0.2},
    ),
    "declutching": (
        {"arming_speed_rad_per_s": 0.01},
        {"kp_n_m_s_per_rad": -400.0, "declutch_s": 0.2},
    ),
    "positioning": (
        HOLD | {"speed_rad_per_s": 0.02, "acceleration_rad_per_s2": 0.1},
        {"goal_rad": 0.02},
    ),
}


def campaign(folder: Path, law: str, parameters: dict[str, Any], row: dict[str, float]) -> Path:
    """Write a campaign of one row with a law on the pitch axis of a rig."""
    return write_campaign(
        folder,
        rig_mapping(axes={"pitch": PITCH}, sensors={}, stations={}),
        limits_mapping(pitch=PITCH_LIMITS),
        plant_mapping(axes={"pitch": plant_mapping()["axes"]["pitch"]}, sensors={}),
        sea={"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5},
        start={"lead_in_s": 1.0},
        timing={"settle_s": 1.0, "interval_s": 4.0},
        tare={"duration_s": 0.5},
        law={"use": law, **parameters},
        matrix={"list": [row]},
    )


def check(path: Path) -> tuple[int, Any]:
    done = rig_here("check", path, "--json")
    return done.returncode, json.loads(done.stdout)


def test_every_law_of_this_distribution_is_tested() -> None:
    assert LAWS.keys() == laws.OWN_MODULES.keys()


@pytest.mark.parametrize("law", LAWS)
def test_law_is_checked_with_rotary_units(law: str, tmp_path: Path) -> None:
    code, report = check(campaign(tmp_path, law, *LAWS[law]))
    assert (code, report["problems"]) == (0, [])


def test_parameters_of_a_translation_are_refused(tmp_path: Path) -> None:
    given = {"hold_stiffness_n_per_m": 5000.0, "hold_damping_n_m_s_per_rad": -1.0}
    code, report = check(campaign(tmp_path, "latching", given, LAWS["latching"][1]))
    problems = {each["key"]: each["message"] for each in report["problems"]}
    assert code == 2
    assert sorted(problems) == [
        "law.hold_damping_n_m_s_per_rad",
        "law.hold_stiffness_n_m_per_rad",
        "law.hold_stiffness_n_per_m",
    ]


def test_message_of_a_law_has_the_keys_of_the_file(tmp_path: Path) -> None:
    rising = {"velocity_rad_per_s": [1.0, -1.0], "force_n_m": [-600.0, 600.0]}
    code, report = check(campaign(tmp_path, "velocity table", rising, LAWS["velocity table"][1]))
    assert code == 2
    (problem,) = report["problems"]
    assert problem["message"] == "velocity_rad_per_s must rise, but -1 follows 1"


def test_latching_is_rehearsed_and_replayed(tmp_path: Path) -> None:
    path = campaign(tmp_path, "latching", *LAWS["latching"])
    done = rig_here("run", path, "--runs", tmp_path, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout)
    assert (result["status"], result["reason"]) == ("complete", "PLAN_END")
    replayed = rig_here("replay", result["folder"], "--json")
    assert json.loads(replayed.stdout)["same"] is True, replayed.stderr
