"""`rig new rig` with PTOs between bodies and several modes, against the bodies' own equations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from command_here import CompletedCommand, rig
from mode_plants import CYLINDER, HEMISPHERE, ROOT, TWO_BODY
from ruamel.yaml import YAML
from test_cli_new_rig import answered

from rig.kinds.modular.first_values import FirstValues, first_values
from rig.kinds.modular.mode_choice import ModeOptions, choose_modes
from rig.kinds.modular.tasks import examine, wired_mode
from sim_plant.modes.bem import read_modes

LUPA = ROOT / "examples" / "lupa" / "hydrodynamics" / "heave.nc"
DISC = ModeOptions(
    TWO_BODY, axes=("pto=float__Heave-disc__Heave",), stiffnesses=("disc__Heave=3000",)
)
SPAR = ModeOptions(
    LUPA, axes=("pto=float__Heave-spar__Heave",),
    masses=("float__Heave=248.7", "spar__Heave=175.5"), stiffnesses=("spar__Heave=330",),
)  # fmt: skip
BODIES = pytest.mark.parametrize("options", [DISC, SPAR], ids=["float and disc", "LUPA"])
NEAR_RESONANCE = pytest.mark.parametrize(
    ("options", "frequency"), [(DISC, 0.4), (SPAR, 0.7)], ids=["float and disc", "LUPA"]
)  # where the Ki of the match is below the static stiffness


def new(folder: Path, options: ModeOptions, *arguments: object) -> CompletedCommand:
    named = {
        "--dof": options.dofs, "--axis": options.axes, "--mass": options.masses,
        "--stiffness": options.stiffnesses,
    }  # fmt: skip
    given = [part for name, texts in named.items() for text in texts for part in (name, text)]
    return rig("new", "rig", "two", "--bem", options.bem, "--folder", folder, *given, *arguments)


def load(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path)


def body_equations(plant: dict[str, Any], bem: Path, frequency: float) -> tuple[Any, Any]:
    """Return impedance (2, 2) and excitation (2) from BEM file and plant file, e^{+i omega t}."""
    modes, omega = read_modes(bem), 2.0 * np.pi * frequency

    def at(values: Any) -> Any:
        return np.array([np.interp(frequency, modes.frequency, each) for each in values.T]).T

    added = np.array([at(modes.added_mass[:, k]) for k in range(2)])
    damping = np.array([at(modes.damping[:, k]) for k in range(2)])
    force = at(modes.excitation.real) - 1j * at(modes.excitation.imag)
    mass, stiffness, viscous = (
        np.diag([mode[key] for mode in plant["modes"].values()])
        for key in ("mass", "stiffness", "linear_damping")
    )
    return damping + viscous + 1j * (omega * (mass + added) - stiffness / omega), force


def relative_power(impedance: Any, force: Any, gain: complex) -> tuple[float, complex]:
    """Return absorbed power (W) and relative velocity of two bodies with a PTO of a gain."""
    between = np.array([1.0, -1.0])
    velocity = between @ np.linalg.solve(impedance - gain * np.outer(between, between), force)
    return float(-0.5 * gain.real * abs(velocity) ** 2), complex(velocity)


@BODIES
def test_gains_are_around_the_greatest_power_of_the_relative_motion(
    options: ModeOptions, tmp_path: Path
) -> None:
    """|F|^2 / 8 R of the Thevenin equivalent is the largest power of the two bodies' equations."""
    assert new(tmp_path, options).returncode == 0
    files = {name: load(tmp_path / "two" / f"{name}.yaml") for name in ("plant", "campaign")}
    sea, (grid,) = files["campaign"]["sea"], files["campaign"]["matrix"]["grid"]
    impedance, force = body_equations(files["plant"], options.bem, sea["frequency_hz"])
    values = first_values(choose_modes(options))
    z, excitation = values.linear.impedance[0, 0], values.linear.excitation[0]
    best = abs(excitation) ** 2 / (8.0 * z.real)
    matched, _ = relative_power(impedance, force, -np.conj(z))
    assert matched == pytest.approx(best, rel=1e-9)
    for step in (0.02, -0.02, 0.02j, -0.02j):
        assert relative_power(impedance, force, -np.conj(z) + step * abs(z))[0] < best
    passive = [relative_power(impedance, force, complex(kp))[0] for kp in grid["kp_n_s_per_m"]]
    assert int(np.argmax(passive)) == 1  # -|Z|, two digits
    assert grid["kp_n_s_per_m"][1] == pytest.approx(-abs(z), rel=0.03)


@BODIES
def test_rows_keep_a_static_stiffness_and_limits_have_room(
    options: ModeOptions, tmp_path: Path
) -> None:
    """Springs in series, K k / (K + k): a larger Ki has no equilibrium."""
    assert new(tmp_path, options).returncode == 0
    plant, campaign, limits = (
        load(tmp_path / "two" / f"{name}.yaml") for name in ("plant", "campaign", "limits")
    )
    own, mooring = (mode["stiffness"] for mode in plant["modes"].values())
    (grid,) = campaign["matrix"]["grid"]
    static = own * mooring / (own + mooring)
    assert max(grid["ki_n_per_m"]) == pytest.approx(0.5 * static, rel=0.05)  # two digits
    sea = campaign["sea"]
    impedance, force = body_equations(plant, options.bem, sea["frequency_hz"])
    omega = 2.0 * np.pi * sea["frequency_hz"]
    positions, forces = [], []
    for kp in grid["kp_n_s_per_m"]:
        for ki in grid["ki_n_per_m"]:
            gain = complex(kp, -ki / omega)
            speed = sea["amplitude_m"] * abs(relative_power(impedance, force, gain)[1])
            positions.append(speed / omega)
            forces.append(abs(gain) * speed)
    own_limits, pto = limits["axes"]["pto"], plant["axes"]["pto"]
    assert own_limits["position_stop_m"] == pytest.approx(2.0 * max(positions), rel=5e-3)
    peak = own_limits["current_peak_a"] * pto["gear_ratio"] * pto["torque_constant_n_m_per_a"]
    assert peak == pytest.approx(2.0 * max(forces), rel=1e-2)


@BODIES
def test_files_of_two_bodies_pass_the_check_with_and_without_wires(
    options: ModeOptions, tmp_path: Path
) -> None:
    assert new(tmp_path, options).returncode == 0
    folder = tmp_path / "two"
    plant = load(folder / "plant.yaml")
    first, second = plant["modes"]
    assert plant["axes"]["pto"]["moves_with"] == {first: 1.0, second: -1.0}
    for wired in (None, folder / "rig_hil.yaml"):
        report = examine(folder / "campaign.yaml", wired)
        assert report.ok, report.text()


@pytest.mark.slow
@NEAR_RESONANCE
def test_two_bodies_run_and_their_optimum_is_the_closed_form(
    options: ModeOptions, frequency: float, tmp_path: Path
) -> None:
    """Rows within 2 % (fit of the radiation, delay, drive), the optimum within 1 % of |F|^2 / 8 R.

    The optimum depends on the square of what detunes the rows.
    """
    assert new(tmp_path, options, "--frequency", frequency).returncode == 0
    campaign = tmp_path / "two" / "campaign.yaml"
    ran = rig("run", campaign, "--runs", tmp_path / "runs", "--json")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    report = json.loads(ran.stdout)
    assert (report["status"], report["reason"]) == ("complete", "PLAN_END")
    plant, sea = load(tmp_path / "two" / "plant.yaml"), load(campaign)["sea"]
    impedance, force = body_equations(plant, options.bem, frequency)
    force = force * sea["amplitude_m"]
    with xarray.open_dataset(Path(report["folder"]) / "rows.nc", engine="h5netcdf") as rows:
        columns = [rows[name].values for name in ("kp", "ki", "power_mechanical", "power_dc")]
    assert columns[0].size == 12
    for kp, ki, mechanical, electric in zip(*columns, strict=True):
        gain = complex(kp, -ki / (2.0 * np.pi * frequency))
        expected, _ = relative_power(impedance, force, gain)
        assert mechanical == pytest.approx(-expected, rel=0.02)
        assert electric < 0.0
    found = rig("optimum", campaign, "--for", "mechanical", "--json",
                "--output", tmp_path / "best.yaml")  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr
    (best,) = json.loads(found.stdout)["optima"]
    between = np.array([1.0, -1.0])
    seen = 1.0 / (between @ np.linalg.solve(impedance, between))
    driving = seen * (between @ np.linalg.solve(impedance, force))
    assert best["power_w"] == pytest.approx(-(abs(driving) ** 2) / (8.0 * seen.real), rel=0.01)


# Several axes.
def values_of(*axes: str, bem: Path = CYLINDER) -> FirstValues:
    options = ModeOptions(bem, axes=axes, stiffnesses=DISC.stiffnesses if bem == TWO_BODY else ())
    return first_values(choose_modes(options), 0.3)


def test_axes_of_uncoupled_modes_have_the_gains_that_each_has_alone() -> None:
    """Heave and pitch of a cylinder do not couple."""
    both = values_of("Heave", "arm=Pitch")
    for name, axis in (("heave", "Heave"), ("arm", "arm=Pitch")):
        alone = values_of(axis).axes[name].impedance
        assert both.axes[name].impedance == pytest.approx(alone, rel=1e-3)


def test_each_of_two_coupled_axes_has_its_best_damping() -> None:
    """A change of one Kp loses power that this axis absorbs while the other one keeps its own."""
    values = values_of("float__Heave", "disc__Heave", bem=TWO_BODY)
    linear, grids = values.linear, list(values.axes.values())

    def absorbed(axis: int, kp: list[float]) -> float:
        speed = np.linalg.solve(linear.impedance - np.diag(kp), linear.excitation)
        return float(-0.5 * kp[axis] * abs(speed[axis]) ** 2)

    best = [-abs(grid.impedance) for grid in grids]
    for axis in (0, 1):
        for share in (0.97, 1.03):
            changed = [kp * share if k == axis else kp for k, kp in enumerate(best)]
            assert absorbed(axis, changed) < absorbed(axis, best)
    stiffness = np.diag([30762.7, 3000.0])
    springs = np.diag([max(grid.ki) for grid in grids])
    assert np.linalg.eigvalsh(stiffness - springs).min() > 0.0


@pytest.mark.parametrize("axes", [("Heave", "arm=Pitch"), ("lever=Heave+1.5*Pitch", "Surge")])
def test_rigs_with_several_axes_pass_the_check(axes: tuple[str, ...], tmp_path: Path) -> None:
    three = ModeOptions(CYLINDER, ("Surge", "Heave", "Pitch"), axes, (), ("Surge=9000",))
    done = new(tmp_path, three)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "two"
    report = examine(folder / "campaign.yaml", folder / "rig_hil.yaml")
    assert report.ok, report.text()
    assert report.campaign is not None
    assert len(report.campaign.rig.axes) == 2
    assert len(load(folder / "campaign.yaml")["matrix"]["list"]) == 12
    nodes = [axis.node for axis in report.campaign.rig.wiring.axes.values()]
    assert nodes == [5, 6]
    mode = wired_mode(report.campaign, emulated=True)
    assert [process.name for process in mode.io_processes] == [
        "emulated devices", "can", "line meter", "line io",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_rig_with_two_axes_is_swept(tmp_path: Path) -> None:
    pair = ModeOptions(CYLINDER, ("Heave", "Pitch"), ("Heave", "arm=Pitch"))
    assert new(tmp_path, pair).returncode == 0
    swept = rig("sweep", tmp_path / "two" / "campaign.yaml", "--sweeps", tmp_path / "sweeps",
                "--json")  # fmt: skip
    assert swept.returncode == 0, swept.stdout + swept.stderr
    assert json.loads(swept.stdout)["rows"] == {"complete": 12}


# What is refused, and what a terminal asks for.
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (ModeOptions(TWO_BODY), "has several modes of the bodies disc, float: float__Heave, disc"),
        (DISC._replace(stiffnesses=()),
         "states no stiffness of disc__Heave: give --stiffness disc__Heave=... (N/m), with that"),
        (DISC._replace(stiffnesses=("disc__Heave=0",)),
         "disc__Heave has a stiffness of 0 N/m and would drift: give --stiffness"),
        (DISC._replace(dofs=("float__Heave", "disc__Heave"), axes=()),
         "2 modes, but no motion of a PTO; choose it with --axis, as pto=float__Heave-disc__Heave "
         "or float__Heave; repeat it for several PTOs"),
        (DISC._replace(axes=("pto=float-disc",)),
         "--axis pto=float-disc: expected NAME=MODES, a sum or difference of float__Heave, disc"),
        (DISC._replace(axes=("pto=float__Heave-float__Heave",)), "expected NAME=MODES"),
        (DISC._replace(axes=("pto=0*float__Heave-disc__Heave",)), "expected NAME=MODES"),
        (DISC._replace(axes=("float__Heave-disc__Heave",)), "'' is no name of a log field"),
        (DISC._replace(axes=("p=float__Heave", "p=disc__Heave")), "p is given twice"),
        (DISC._replace(axes=("a=float__Heave-disc__Heave", "b=disc__Heave-float__Heave")),
         "--axis: the motions of a, b depend on each other; leave out some"),
        (ModeOptions(CYLINDER, axes=("a=Heave-Pitch",)),
         "Pitch is an angle among distances; give its lever arm in m, as 1.5*Pitch"),
    ],
)  # fmt: skip
def test_motions_that_are_open_or_wrong_are_refused(
    options: ModeOptions, reason: str, tmp_path: Path
) -> None:
    done = new(tmp_path, options)
    assert done.returncode == 2
    assert reason in done.stderr
    assert not (tmp_path / "two").exists()


def test_an_axis_that_no_wave_excites_has_no_rig_but_a_plant(tmp_path: Path) -> None:
    """Yaw of a hemisphere: its excitation in the file is rounding."""
    yaw = ModeOptions(HEMISPHERE, ("Yaw",), (), ("Yaw=100",), ("Yaw=20",))
    done = new(tmp_path, yaw)
    assert done.returncode == 2
    assert "Hz do not excite yaw" in done.stderr
    given = ("--dof", "Yaw", "--dof", "Heave", "--mass", "Yaw=100", "--stiffness", "Yaw=20")
    done = rig("plant", "from-bem", HEMISPHERE, *given, "--output", tmp_path / "two.yaml")
    assert done.returncode == 0, done.stderr
    axis = load(tmp_path / "two.yaml")["axes"]["yaw"]
    assert (axis["gear_ratio"], axis["counts_per_revolution"]) == (1, 20_000)
    assert axis["drive"]["standby_w"] == 0


def test_both_commands_take_the_same_options(tmp_path: Path) -> None:
    assert new(tmp_path, DISC).returncode == 0
    given = ("--axis", *DISC.axes, "--stiffness", *DISC.stiffnesses)
    done = rig("plant", "from-bem", TWO_BODY, *given, "--output", tmp_path / "two.yaml")
    assert done.returncode == 0, done.stderr
    assert "PTO          pto = float_heave - disc_heave" in done.stdout
    own, other = load(tmp_path / "two.yaml"), load(tmp_path / "two" / "plant.yaml")
    assert own.pop("radiation") == "two.radiation.json"
    assert own == other


def test_a_mode_without_stiffness_has_no_damping_and_says_so(tmp_path: Path) -> None:
    given = ("--axis", *DISC.axes, "--stiffness", "disc__Heave=0")
    done = rig("plant", "from-bem", TWO_BODY, *given, "--output", tmp_path / "two.yaml")
    assert done.returncode == 0, done.stderr
    assert "warning: disc__Heave: no viscous damping, because the first value is" in done.stdout
    text = (tmp_path / "two.yaml").read_text()
    assert "N*s/m, viscous: none, because 2 % of critical are 0 without stiffness (choose)" in text
    assert text.count("viscous: 2 % of critical (choose)") == 1
    assert "of 0.025 .. 1.5 Hz (of which seas have 0.05 .. 1.5 Hz):" in text


def test_a_terminal_is_asked_for_the_motion_of_the_pto(tmp_path: Path) -> None:
    result = answered(
        tmp_path, str(TWO_BODY), "1, 3", "1,2", "pto=float-disc", "pto=float__Heave-disc__Heave",
        "", "", "", "3000", "", "n",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "'1, 3' is none of them; allowed float__Heave, disc__Heave" in result.output
    assert "--axis pto=float-disc: expected NAME=MODES" in result.output
    assert new(tmp_path, DISC).returncode == 0
    answers, options = (load(tmp_path / name / "plant.yaml") for name in ("asked", "two"))
    assert {**answers, "name": "two"} == options
