"""Set points without an equilibrium: closed forms, reports of a check, simulated rows, optima."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray
from mode_plants import TWO_BODY
from modular_rigs import (
    HEAVE,
    HEAVE_LIMITS,
    PITCH,
    PITCH_LIMITS,
    limits_mapping,
    plant_mapping,
    rig_mapping,
    write_campaign,
)
from rehearsing import write_yaml
from rig_command import rig_here

from rig.campaign import open_campaign
from rig.campaign.simulated_rows import is_settled
from rig.design.static_stability import largest_gain, unstable_motion
from rig.kinds.modular.equilibrium import equilibrium_check
from rig.kinds.rig_file import kind_of_task
from rig.sweeps.simulator import campaign_kind, problems

BODY, MOORING = 30_762.7, 4_000.0  # N/m
SERIES = BODY * MOORING / (BODY + MOORING)
REGULAR = {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.4}
TIMES = {
    "tare": {"duration_s": 0.5},
    "start": {"lead_in_s": 6},
    "timing": {"settle_s": 1, "interval_s": 13.5},
}


def two_bodies(folder: Path, ki: list[float], **limits: Any) -> Path:
    """Write a campaign of a float on a plate that hangs on a mooring; the PTO is between them."""
    modes = {
        "float": {"dof": "float__Heave", "mass": 3000.0, "stiffness": BODY},
        "plate": {"dof": "disc__Heave", "mass": 9000.0, "stiffness": 0.0, "linear_damping": 3000.0},
    }
    stop = {"position": 0.3, "stiffness": 1e6, "damping": 1e4}
    axis = plant_mapping()["axes"]["heave"]
    axis |= {"moves_with": {"float": 1.0, "plate": -1.0}, "end_stop": stop}
    mooring = {"stiffness": {"plate": {"plate": MOORING}}}
    plant = plant_mapping(modes=modes, axes={"heave": axis}, sensors={}, mooring=mooring)
    rig = rig_mapping(sensors={}, stations={"shaft": {"formula": "heave_force * heave_velocity"}})
    bounds = limits_mapping(
        heave=HEAVE_LIMITS | {"current_rms_a": 400, "current_peak_a": 400} | limits
    )
    rows = {"grid": [{"kp_n_s_per_m": [-4000, -2000], "ki_n_per_m": ki}]}
    path = write_campaign(folder, rig, bounds, plant, sea=REGULAR, **TIMES, matrix=rows)
    write_yaml(folder / "plant.yaml", plant | {"bem": str(TWO_BODY)})
    return path


def check_of(path: Path) -> Any:
    campaign = open_campaign(campaign_kind(kind_of_task(path)), path, problems)
    return campaign, equilibrium_check(campaign)


# --- closed forms


def test_a_gain_between_two_bodies_is_limited_by_springs_in_series() -> None:
    stiffness, relative = np.diag([BODY, MOORING]), np.array([1.0, -1.0])
    assert largest_gain(stiffness, relative) == pytest.approx(SERIES, rel=1e-12)
    assert largest_gain(np.diag([BODY]), np.ones(1)) == pytest.approx(BODY, rel=1e-12)
    for share, stable in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
        left = stiffness - share * SERIES * np.outer(relative, relative)
        assert (unstable_motion(left) is None) == stable


def test_a_free_body_has_no_static_stiffness_and_drifts_without_running_away() -> None:
    free, relative = np.diag([BODY, 0.0]), np.array([1.0, -1.0])
    assert unstable_motion(free) is None
    assert largest_gain(free, relative) == 0.0
    assert unstable_motion(free - 1.0 * np.outer(relative, relative)) is not None


def test_a_gain_can_hold_one_unstable_motion_but_not_two() -> None:
    assert largest_gain(np.diag([-500.0]), np.ones(1)) == pytest.approx(-500.0)
    assert largest_gain(np.diag([-500.0, -300.0]), np.array([1.0, 0.2])) is None
    assert largest_gain(np.diag([BODY, -300.0]), np.array([1.0, 0.0])) is None


@pytest.mark.parametrize("seed", range(5))
def test_the_largest_gain_is_where_the_stiffness_stops_being_definite(seed: int) -> None:
    """Against bisection of the smallest eigenvalue, four modes."""
    rng = np.random.default_rng(seed)
    root, factors = rng.normal(size=(4, 4)), rng.normal(size=4)
    stiffness = root @ root.T + 0.1 * np.eye(4)
    low, high = 0.0, 1e6
    for _ in range(100):
        middle = 0.5 * (low + high)
        smallest = np.linalg.eigvalsh(stiffness - middle * np.outer(factors, factors))[0]
        low, high = (middle, high) if smallest > 0.0 else (low, middle)
    assert largest_gain(stiffness, factors) == pytest.approx(low, rel=1e-9)


# --- set points of a campaign


def test_a_set_point_is_judged_by_mass_matrix_and_lines(tmp_path: Path) -> None:
    campaign, check = check_of(two_bodies(tmp_path, [0.0]))
    values = campaign.points[0].values | {"km": 0.0}

    def found(ki: float) -> Any:
        return check(SimpleNamespace(**values | {"ki": ki}))

    assert found(SERIES * (1.0 - 1e-6)) is None
    finding = found(SERIES * (1.0 + 1e-6))
    assert (finding.column, finding.can_run) == ("ki", True)
    assert f"exceeds the static stiffness {SERIES:.4g} N/m" in finding.message


def test_gains_of_two_axes_share_the_stiffness(tmp_path: Path) -> None:
    """Heave and pitch of the cylinder are not coupled: each is limited by its own stiffness."""
    rig = rig_mapping(axes={"heave": HEAVE, "pitch": PITCH}, sensors={}, stations={
        "shaft": {"formula": "heave_force * heave_velocity"}})  # fmt: skip
    limits = limits_mapping(heave=HEAVE_LIMITS, pitch=PITCH_LIMITS | {"current_rms_a": 40.0})
    row = {"heave_kp_n_s_per_m": -4000, "heave_ki_n_per_m": 5000,
           "pitch_kp_n_m_s_per_rad": -300, "pitch_ki_n_m_per_rad": 30_000}  # fmt: skip
    plant = plant_mapping(sensors={})
    plant["modes"]["pitch"] = {**plant["modes"]["pitch"], "stiffness": 2500.0}
    path = write_campaign(
        tmp_path, rig, limits, plant, sea=REGULAR, **TIMES, matrix={"list": [row]}
    )
    code, text, _ = rig_here("check", path, "--json")
    (problem,) = json.loads(text)["problems"]
    assert code == 2
    assert problem["key"] == "matrix.list[0].pitch_ki_n_m_per_rad"
    assert problem["value"] == 30_000
    assert (
        "exceeds the static stiffness 2500 N*m/rad of the motion of axis pitch"
        in (problem["message"])
    )
    assert "allowed below 2500 N*m/rad; the rig would stop at 0.6 rad" in problem["message"]


@pytest.mark.parametrize(
    ("limits", "end"),
    [
        ({}, "an end stop holds the axis at about 0.3 m"),
        ({"current_rms_a": 20}, "the current limit holds the axis at about 0.102 m"),
    ],
)
def test_a_held_row_is_a_warning(limits: dict[str, Any], end: str, tmp_path: Path) -> None:
    """18 N/A: 20 A are 360 N, and 360 N / 3539.7 N/m = 0.102 m."""
    path = two_bodies(tmp_path, [0, 9000], **limits)
    code, text, _ = rig_here("check", path, "--json")
    report = json.loads(text)
    assert code == 0
    (warning,) = (each for each in report["warnings"] if "equilibrium" in each["message"])
    assert warning["key"] == "matrix.grid[0].ki_n_per_m[1]"
    assert warning["message"].startswith(
        "point 1 (and 1 more like it) leaves no equilibrium: Ki 9000 N/m"
    )
    assert warning["message"].endswith(f"; {end}")


def test_a_row_that_the_rig_would_stop_is_refused(tmp_path: Path) -> None:
    path = two_bodies(tmp_path, [0, 9000], position_stop_m=0.25, position_warn_m=0.2)
    code, text, _ = rig_here("check", path)
    assert code == 2
    assert "the rig would stop at 0.25 m" in text


# --- simulated rows


@pytest.mark.slow
def test_a_row_at_an_end_stop_is_shown_and_never_the_best(tmp_path: Path) -> None:
    path = two_bodies(tmp_path, [0, 25_000])
    code, text, error = rig_here("check", path, "--simulate", "--json")
    assert code == 0, error
    rows = json.loads(text)["simulated"]
    assert [row["end_stop"] for row in rows[::2]] == [0.0, 0.0]
    assert all(0.7 < row["end_stop"] <= 1.0 for row in rows[1::2])
    assert all(row["position_peak"] > 0.3 for row in rows[1::2])
    assert all(row["flags"].startswith("NO_EQUILIBRIUM END_STOP") for row in rows[1::2])
    code, text, _ = rig_here("check", path, "--simulate")
    assert "x peak" in text
    assert "NO_EQUILIBRIUM END_STOP" in text
    best = tmp_path / "best.yaml"
    code, text, error = rig_here("optimum", path, "--lead-in", 5, "--output", best, "--json")
    assert code == 0, error
    report = json.loads(text)
    assert report["rejected"]
    assert all("equilibrium" in reason for reason in report["rejected"])
    (optimum,) = report["optima"]
    assert optimum["values"]["ki"] < SERIES
    assert optimum["row"]["flags"] == ""
    assert rig_here("check", best)[0] == 0


@pytest.mark.slow
def test_no_best_row_is_an_error_with_reasons(tmp_path: Path) -> None:
    path = two_bodies(tmp_path, [9000, 9500])
    code, _, error = rig_here("optimum", path, "--output", tmp_path / "best.yaml")
    assert code == 1
    assert (
        "no row can be the best: too little stiffness for an equilibrium, at an end stop" in error
    )


@pytest.mark.slow
def test_the_lead_in_grows_until_the_waves_have_built_up(tmp_path: Path) -> None:
    """A wave maker that needs 60 s; a lead-in of 15 s would measure a quarter of the waves."""
    rows = {"list": [{"kp_n_s_per_m": -4000, "ki_n_per_m": 0}]}
    rig = rig_mapping(sensors={}, stations={"shaft": {"formula": "heave_force * heave_velocity"}})
    powers = {}
    for onset in (5.0, 60.0):
        folder = tmp_path / str(onset)
        folder.mkdir()
        plant = plant_mapping(sensors={}, wave_onset_s=onset)
        path = write_campaign(
            folder, rig, limits_mapping(), plant, sea=REGULAR, **TIMES, matrix=rows
        )
        code, text, error = rig_here("sweep", path, "--sweeps", folder, "--json")
        assert code == 0, error
        with xarray.load_dataset(json.loads(text)["result"]) as table:
            assert table["flags"].values.tolist() == [""]
            powers[onset] = float(table["power_shaft"][0])
            assert float(table["lead_in"][0]) == (15.0 if onset == 5.0 else 60.0)
    assert powers[60.0] == pytest.approx(powers[5.0], rel=2e-3)


# --- settled motion


def waves(amplitude: Any = 1.0, mean: Any = 0.0, seconds: float = 20.0) -> bool:
    """Return whether a motion of 0.7 Hz is settled, at 1 kHz: periods of 1428.57 ticks."""
    time, omega = np.arange(0.0, seconds, 0.001), 2.0 * np.pi * 0.7
    position = mean + amplitude * np.sin(omega * time)
    return is_settled(position, np.gradient(position, 0.001), 1000.0 / 0.7, 0.001)


def test_a_motion_that_repeats_is_settled() -> None:
    time = np.arange(0.0, 20.0, 0.001)
    assert waves()
    assert waves(seconds=1.4286)  # one period: its begin and end
    assert waves(mean=3.0)
    assert not waves(mean=0.003 * time)  # a drift of 6 % of the amplitude over the window
    assert waves(mean=0.0003 * time)
    assert not waves(amplitude=1.0 + 0.1 * np.exp(-time / 10.0))
    assert waves(amplitude=1.0 + 0.1 * np.exp(-time / 2.0) * 0.1)
    assert not waves(amplitude=np.exp(0.005 * time))


def test_drift_within_one_repeat_period_is_found() -> None:
    time = np.arange(0.0, 1.4286, 0.001)
    assert not waves(mean=0.05 * time, seconds=1.4286)


def test_less_than_a_period_and_rest_are_taken_as_settled() -> None:
    assert waves(mean=5.0, amplitude=0.0)
    assert waves(amplitude=np.linspace(0.0, 1.0, 1000), seconds=1.0)
