"""The linear plant, rehearsed and identified, against closed forms: loop, log and report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from identified import wrong_plant
from known_device import impedances, surge_impedance
from made_once import made_once
from predicting import predict_campaign, rows
from rehearsing import CONFIGS, rehearse, write_campaign, write_yaml
from rig_command import rig_here

from rig.analysis.report import write_products
from rig.config.yaml_source import load_mapping
from rig.identification.bem import excitation_at, read_bem
from rig.identification.identify import Identification, IdentificationOptions, identify

pytestmark = pytest.mark.slow

BEM = CONFIGS / "plants" / "wavebot_bem.npz"
SPRING_RATE = -5715.0
SEA = {"kind": "pink", "hm0_m": 0.1, "repeat_s": 20, "seed": 3}
MULTISINE = {"kind": "multisine", "repeat_s": 20, "amplitude_a": 20, "seed": 5}


def campaign(folder: Path, name: str, **keys: Any) -> Path:
    """Write a campaign file on the linear plant."""
    plant = str(CONFIGS / "plants" / "wavebot_linear.yaml")
    return write_campaign(folder / name, name=name, plant=plant, seed=4, **keys)


def matrix(rate: float, **more: Any) -> dict[str, Any]:
    return {"grid": [{"spring_n_per_m": rate, "kp_n_s_per_m": 0, "ki_n_per_m": 0, **more}]}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two multisines in calm water, one in two pink seas at another spring rate; the seas alone."""
    folder = made_once(tmp_path_factory, "identification", rehearse_all)
    return {name: folder / name for name in ("calm", "waves", "sea", "waves_2", "sea_2")}


def rehearse_all(folder: Path) -> None:
    start = {"set_point_s": 0, "lead_in_s": 15}
    campaigns = {
        "calm": {
            "sea": {"kind": "calm"},
            "reference": MULTISINE,
            "matrix": matrix(SPRING_RATE, realisation=[1, 2]),
            "timing": {"settle_s": 15, "periods": 1},
            "start": {"set_point_s": 0, "lead_in_s": 2},
        },
        "waves": {
            "sea": SEA,
            "reference": MULTISINE,
            "matrix": matrix(490.9, realisation=1),
            "timing": {"settle_s": 15, "periods": 1},
            "start": start,
        },
        "sea": {"sea": SEA, "device": "absent", "timing": {"periods": 1}, "start": start},
    }
    for name in ("waves", "sea"):
        campaigns[f"{name}_2"] = {**campaigns[name], "sea": {**SEA, "realisation": 2}}
    for name, keys in campaigns.items():
        result = rehearse(campaign(folder / "campaigns", name, **keys), folder)
        assert result.outcome.status == "complete"
        result.folder.rename(folder / name)


@pytest.fixture(scope="module")
def identification(runs: dict[str, Path]) -> Identification:
    return identify(list(runs.values()), IdentificationOptions(order=4, bem=read_bem(BEM)))


def test_the_impedances_equal_the_plant_within_one_percent(identification: Identification) -> None:
    (model,) = identification.models
    assert (model.realisations, model.periods, model.frequency.size) == (2, 2, 17)
    expected = dict(zip(("Z_i", "Z_id"), impedances(model.frequency, SPRING_RATE), strict=True))
    for name, true_value in expected.items():
        relative_error = np.abs(model.responses[name].value / true_value - 1.0)
        assert relative_error.max() < 0.01, (name, relative_error.max())
    drivetrain = model.responses["Z_d"].value
    true_value = expected["Z_id"] - expected["Z_i"]
    assert np.abs(drivetrain / true_value - 1.0).max() < 0.03  # a difference of large numbers
    (member,) = identification.family
    assert member.drivetrain_damping == pytest.approx(724.0, rel=0.01)
    assert member.drivetrain_stiffness == pytest.approx(SPRING_RATE, rel=0.01)
    assert member.distortion < 1e-3


def test_command_current_and_torque_sensor_nearly_agree(identification: Identification) -> None:
    """Fig. 4-5: they differ by the drive's current loop and the loop's delay, 3.5 ms at most."""
    (model,) = identification.models
    trs = model.responses["Y_id_trs"].value
    delay_phase = 2 * np.pi * model.frequency * 0.0035
    assert np.abs(model.responses["Y_id_current"].value / trs - 1.0).max() < 0.005
    relative_error = np.abs(model.responses["Y_id_command"].value / trs - 1.0)
    assert np.all(relative_error < delay_phase + 0.005)


def test_the_models_fit(identification: Identification) -> None:
    second, fourth = identification.fits[0]["Z_i"]
    assert (second.order, fourth.order) == (2, 4)
    assert fourth.fit_percent > 98.0 > second.fit_percent
    assert second.natural_frequency == pytest.approx(0.63, rel=0.01)


def test_the_excitation_equals_bem_within_three_percent(identification: Identification) -> None:
    """At another spring rate than that of Z_i: the hull is the same."""
    (wave_excitation,) = identification.excitations
    assert (wave_excitation.spring_rate, wave_excitation.seas, wave_excitation.experiments) == (
        490.9,
        2,
        2,
    )
    assert wave_excitation.good.all()
    relative_error = np.abs(
        wave_excitation.value / excitation_at(read_bem(BEM), wave_excitation.frequency) - 1.0
    )
    assert relative_error.max() < 0.03
    assert all("of orders 2 and 4 differ" in note for note in identification.notes)


def test_the_twin_uses_the_measured_excitation(
    runs: dict[str, Path], identification: Identification, tmp_path: Path
) -> None:
    """From a plant file with the BEM of another hull: 30 % less, 17 degrees away.

    Within 3 % of the true BEM on every line; power, as the square of it, within twice that.
    """
    with np.load(BEM) as file:
        wrong_bem = {name: file[name] for name in file.files}
    wrong_bem["Fe_complex"] = 0.7 * np.exp(0.3j) * wrong_bem["Fe_complex"]
    np.savez(tmp_path / "other.npz", **wrong_bem)
    surge = "wavebot_surge_bem.npz"
    (tmp_path / surge).write_bytes((CONFIGS / "plants" / surge).read_bytes())
    mapping, _ = load_mapping(wrong_plant(tmp_path))
    plant = write_yaml(tmp_path / "plant.yaml", {**mapping, "bem": str(tmp_path / "other.npz")})
    code, output, error_text = rig_here(
        "twin", *runs.values(), "--plant", plant, "-o", tmp_path / "twin", "--json"
    )
    assert code == 0, error_text
    report = json.loads(output)
    assert report["excitation"].startswith("2 experiments in waves from 0.2 to 1 Hz, eta from elev")
    assert report["notes"] == []
    (measured,) = identification.excitations
    lines = measured.frequency
    twin_bem = read_bem(tmp_path / "twin" / "heave_bem.npz")
    assert (
        np.abs(excitation_at(twin_bem, lines) / excitation_at(read_bem(BEM), lines) - 1.0).max()
        < 0.03
    )
    scale = report["estimates"]["excitation_scale"]["value"]
    assert scale == pytest.approx(1.0, abs=0.005)  # rows in waves need no further factor
    assert np.abs(excitation_at(twin_bem, lines) / (scale * measured.value) - 1.0).max() < 1e-9
    with np.load(tmp_path / "twin" / "heave_bem.npz") as file:
        for name in ("A", "B"):
            interpolated = np.interp(wrong_bem["f_hz"], file["f_hz"], file[name])
            assert interpolated == pytest.approx(wrong_bem[name], rel=1e-12)
        beyond = wrong_bem["f_hz"] > 1.0
        assert np.interp(wrong_bem["f_hz"], file["f_hz"], np.abs(file["Fe_complex"]))[
            beyond
        ] == pytest.approx(scale * np.abs(wrong_bem["Fe_complex"])[beyond])
    keys = {"sea": SEA, "matrix": rows((490.9, -2000.0, 6000.0))}
    power = []
    for name in ("twin/plant.yaml", CONFIGS / "plants" / "wavebot_linear.yaml"):
        path = write_campaign(tmp_path / "sea", **keys, plant=str(tmp_path / name))
        power.append(predict_campaign(path).rows[0].predicted.power_mechanical_1)
    assert power[0] == pytest.approx(power[1], rel=0.06)


def test_probes_of_the_run_itself_are_refused_as_eta(runs: dict[str, Path]) -> None:
    without_calibrations = identify([runs["calm"], runs["waves"], runs["waves_2"]])
    assert without_calibrations.excitations == ()
    assert len(without_calibrations.notes) == 2
    assert "refused as eta" in without_calibrations.notes[0]


def test_the_command_writes_its_files(runs: dict[str, Path], tmp_path: Path) -> None:
    paths = [runs["calm"], runs["waves"], runs["sea"]]
    code, output, _ = rig_here(
        "identify", *paths, "--bem", BEM, "-o", tmp_path, "--probe", "probe_2"
    )
    assert code == 0
    assert "eta from probe_2" in output
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "identification.json", "identification.nc", "identification.pdf", "identification.png",
        "admittance_heave.png", "intrinsic.png", "drivetrain.png", "excitation.png",
    }  # fmt: skip
    content = json.loads((tmp_path / "identification.json").read_text())
    (model,) = content["models"]
    quotient = np.array(model["published_ratio"]["re"])
    with xarray.open_dataset(tmp_path / "identification.nc", engine="h5netcdf") as table:
        assert table["Z_i_0_re"].values == pytest.approx(model["responses"]["Z_i"]["re"])
        assert table["Z_i_0_re"].attrs["units"] == "N*s/m"
        series = table["Z_id_0_re"] + 1j * table["Z_id_0_im"]
        intrinsic = table["Z_i_0_re"] + 1j * table["Z_i_0_im"]
        assert (series / intrinsic).values.real == pytest.approx(quotient)
    code, output, _ = rig_here("identify", "--compare", tmp_path, tmp_path, "--json")
    assert code == 0
    for pair in json.loads(output)["differences"]:
        assert pair["worst"] < 1e-12
        assert pair["share_of_lines_apart"] == 0.0


def test_unusable_runs_and_options_are_refused(runs: dict[str, Path]) -> None:
    for arguments, expected in (
        (("identify",), "no run given"),
        (("identify", runs["waves"]), "no rows in calm water"),
        (("identify", runs["calm"], runs["sea"], "--probe", "probe_9"), "probe_1 | probe_2"),
        (("identify", runs["calm"], "--order", "5", "--no-pictures"), "allowed 2, 4, 6, 8"),
    ):
        code, _, error_text = rig_here(*arguments)
        assert code == 2, error_text
        assert expected in error_text


def test_a_saturated_drive_is_reported(tmp_path: Path) -> None:
    """30 A need more than the 75 V of the custom drive's bus, 5 A do not."""
    path = write_campaign(
        tmp_path,
        name="saturated",
        rig=str(CONFIGS / "rigs" / "wavebot_custom.yaml"),
        sea={"kind": "calm"},
        reference={"kind": "sine", "frequency_hz": 0.625, "amplitude_a": 5},
        matrix=matrix(490.9, reference_scale=[1, 6]),
        timing={"settle_s": 5, "periods": 1},
        tare={"duration_s": 1},
        start={"set_point_s": 0, "lead_in_s": 2},
    )
    result = rehearse(path, tmp_path / "runs")
    assert result.outcome.status == "complete"
    (note,) = [each for each in identify([result.folder]).notes if "saturated" in each]
    assert "row 1: the drive saturated in " in note
    products = {path.name for path in write_products(result.folder)}
    assert products == {"rows.csv", "rows.nc", "summary.txt", "summary.json"}
    summary = (result.folder / "summary.txt").read_text()
    assert "Best points" not in summary
    assert "its impedance: rig identify" in summary


def test_surge_is_identified_from_its_own_current(tmp_path: Path) -> None:
    path = campaign(
        tmp_path,
        "surge",
        sea={"kind": "calm"},
        reference={**MULTISINE, "axis": "surge"},
        surge={"kp_n_s_per_m": -500},  # feedback does no harm
        matrix=matrix(490.9),
        timing={"settle_s": 20, "periods": 1},
        start={"set_point_s": 0, "lead_in_s": 2},
    )
    result = rehearse(path, tmp_path / "runs")
    (model,) = identify([result.folder]).models
    assert (model.axis, set(model.responses)) == ("surge", {"Z_id", "Y_id_command", "Y_id_current"})
    expected = surge_impedance(model.frequency)
    assert np.abs(model.responses["Z_id"].value / expected - 1.0).max() < 0.01
