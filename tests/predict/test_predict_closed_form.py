"""The prediction of the linear plant against its closed form.

The oracle (tests/sim_plant/closed_form.py) shares no code with `rig.kinds.wavebot.predictions`: it
uses impedances and no records. Here it uses the same sampled controller. Its mean |i| is that of a
sine, or for many waves that of a Gaussian current, which the current in a sea of 300 s is within a
few per cent.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from closed_form import Response, heave_response
from predicting import CONFIGS, STIFF, predict_campaign, rows, write_campaign

from rig.config.pydantic_errors import load
from rig.config.yaml_source import load_mapping
from rig.design.axis_params import metres_per_count
from rig.design.estimator import design, response
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.predictions.prediction import RowPredictions
from sim_plant import sea_states
from sim_plant.bem import read_bem
from sim_plant.parameters import Plant

GAINS = [(kp, ki) for kp in (-1000.0, -2500.0, -4000.0) for ki in (0.0, 4000.0, 8000.0)]
DT = 0.001


@pytest.fixture(scope="module")
def plant() -> Plant:
    mapping, _ = load_mapping(CONFIGS / "plants" / "wavebot_linear.yaml")
    return Plant.model_validate(mapping)


def sampled_controller(plant: Plant, kp: float, ki: float) -> Callable[[Any], Any]:
    """Return the controller with estimator, one tick of delay, hold and current loop."""
    rig = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)[0]
    motor = rig.heave
    estimator_params = design(
        metres_per_count(motor), motor.encoder_noise_counts, motor.jerk_density_m2_per_s5, DT
    )
    lag = 0.001

    def controller(f_hz: Any) -> Any:
        s = 2j * np.pi * np.atleast_1d(np.asarray(f_hz, dtype=float))
        position, velocity, _ = response(estimator_params, s.imag, DT)
        law = (kp * velocity + ki * position) / s
        return law * np.exp(-s * 1.5 * DT) / (1.0 + s * lag)

    return controller


def predict_gains(tmp_path: Path, sea: dict[str, Any]) -> dict[Any, RowPredictions]:
    """Return the predictions by (Kp, Ki)."""
    path = write_campaign(
        tmp_path,
        plant=str(CONFIGS / "plants" / "wavebot_linear.yaml"),
        sea=sea,
        matrix=rows(*((STIFF, kp, ki) for kp, ki in GAINS)),
        surge={"use": "off"},
    )
    predicted_rows = predict_campaign(path).rows
    return {
        (prediction.row.setting.kp, prediction.row.setting.ki): prediction.predicted
        for prediction in predicted_rows
    }


def compare(predicted: RowPredictions, oracle: Response, current_share: float) -> None:
    """Compare within 0.5 %; electrical power within 0.5 % of shaft power plus copper loss."""
    assert predicted.power_mechanical_1 == pytest.approx(oracle.lcb, rel=5e-3)
    assert predicted.power_mechanical_2 == pytest.approx(oracle.trs, rel=5e-3)
    copper = oracle.ac - oracle.trs
    assert predicted.power_ac == pytest.approx(oracle.ac, abs=5e-3 * (abs(oracle.trs) + copper))
    loss = oracle.dc - oracle.ac
    assert predicted.power_dc - predicted.power_ac == pytest.approx(loss, rel=current_share)
    assert predicted.position_rms * 2**0.5 == pytest.approx(oracle.stroke, rel=1e-4)
    assert predicted.current_rms * 2**0.5 == pytest.approx(oracle.current, rel=1e-3)


@pytest.mark.parametrize("f", [0.3, 0.4, 0.5, 0.8])
def test_regular_waves(f: float, tmp_path: Path, plant: Plant) -> None:
    params, hull = plant.build(), read_bem(CONFIGS / "plants" / plant.bem)
    predictions = predict_gains(
        tmp_path, {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": f}
    )
    assert len(predictions) == len(GAINS)
    for (kp, ki), predicted in predictions.items():
        controller = sampled_controller(plant, kp, ki)
        oracle = heave_response(params, hull, f, 0.1, kp, ki, STIFF, controller)
        compare(predicted, oracle, 1e-3)
        assert predicted.position_peak == pytest.approx(oracle.stroke, rel=1e-4)
        assert predicted.velocity_peak == pytest.approx(oracle.velocity, rel=1e-4)


def test_irregular_waves(tmp_path: Path, plant: Plant) -> None:
    sea_block = {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 300, "seed": 3}
    params, hull = plant.build(), read_bem(CONFIGS / "plants" / plant.bem)
    sea = sea_states.jonswap(0.127, 2.5, 3.3, 300.0, 3)
    lines, amplitude = sea_states.frequencies(sea), np.abs(sea.amplitude)
    for (kp, ki), predicted in predict_gains(tmp_path, sea_block).items():
        controller = sampled_controller(plant, kp, ki)
        oracle = heave_response(params, hull, lines, amplitude, kp, ki, STIFF, controller)
        compare(predicted, oracle, 0.02)  # mean |i| of this record, not of a Gaussian one
        # The peak is that of the record, with the phases of these waves.
        assert 2.5 * predicted.position_rms < predicted.position_peak < 5.0 * predicted.position_rms


def test_the_peak_depends_on_the_phases_of_the_sea(tmp_path: Path) -> None:
    """Another seed gives other peaks and the same rms."""
    peaks, rms = [], []
    for seed in (1, 2, 3):
        sea = {"kind": "jonswap", "hs_m": 0.127, "tp_s": 2.5, "repeat_s": 300, "seed": seed}
        predicted = predict_gains(tmp_path / str(seed), sea)[-2500.0, 0.0]
        peaks.append(predicted.position_peak)
        rms.append(predicted.position_rms)
    assert np.ptp(peaks) > 0.02 * np.mean(peaks)
    assert np.ptp(rms) < 1e-9
