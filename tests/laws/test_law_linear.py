"""The linear form of a law: equal to its measured response, and the base of predictions."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from rehearsing import write_campaign
from rig_command import rig_here

from controllers import biquads, impedance
from controllers.signals import Estimate, Gains
from rig.design.impedance import design, response

DT = 1e-3
LINEAR_LAW = '''"""A damper and a spring: F = -b v - k x + reference."""

from typing import NamedTuple

from controllers.law import Column
from controllers.signals import Demand

COLUMNS = (
    Column("damping_n_s_per_m", "damping", "N*s/m", "damping", 0.0, 20_000.0, "Damping."),
    Column("stiffness_n_per_m", "stiffness", "N/m", "stiffness", -3e4, 3e4, "Stiffness."),
)
PARAMETERS = ()


class SetPoint(NamedTuple):
    damping: float
    stiffness: float


class Params(NamedTuple):
    ramp: float


class State(NamedTuple):
    ticks: int


def params(settings, ramp, dt):
    return Params(ramp)


def start(params):
    return State(0)


def step(params, state, setpoint, motion, reference, deficit, dt):
    force = -setpoint.damping * motion.velocity - setpoint.stiffness * motion.position
    return State(state.ticks + 1), Demand(
        -setpoint.damping, -setpoint.stiffness, 0.0, force + reference
    )


def linear(params, setpoint, omega):
    return complex(-setpoint.damping, FACTOR * setpoint.stiffness / omega)
'''
KEYS = {
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "start": {"set_point_s": 1, "lead_in_s": 7},
    "timing": {"settle_s": 1, "interval_s": 5.5},
}


@pytest.mark.parametrize("f_hz", [0.2, 0.5, 2.0])
def test_linear_form_of_the_impedance_law_is_that_of_its_force(f_hz: float) -> None:
    """Force per velocity of the law after its ramp, by the discrete Fourier sum of one period."""
    sections = design([-400.0, 0.0], [1.0, 2.0, 9.0], DT)
    params = impedance.Params(0.0, sections, DT)
    gains, omega = Gains(-900.0, 1500.0, 40.0), 2.0 * math.pi * f_hz
    assert biquads.response(sections, omega * DT) == pytest.approx(
        complex(response(sections, f_hz, DT)), rel=1e-12
    )
    state, period = impedance.start(params), round(1.0 / f_hz / DT)
    total, first = 0j, period * math.ceil(20.0 * f_hz)
    for tick in range(first + period):
        phasor = complex(math.cos(omega * tick * DT), math.sin(omega * tick * DT))
        motion = Estimate(phasor.imag / omega, phasor.real, -omega * phasor.imag)
        state, demand = impedance.step(params, state, gains, motion, 0.0, 0.0, DT)
        total += demand.force * phasor.conjugate() * (2.0 / period) if tick >= first else 0j
    assert total == pytest.approx(impedance.linear(params, gains, omega), rel=1e-6)


def prediction(folder: Path, **keys: object) -> dict[str, object]:
    code, out, _ = rig_here("check", write_campaign(folder, **KEYS, **keys), "--json")
    report: dict[str, object] = json.loads(out)
    assert code == 0, report["problems"]
    return report


def test_linear_law_is_predicted_like_the_impedance_law_of_its_gains(tmp_path: Path) -> None:
    (tmp_path / "linear.py").write_text(LINEAR_LAW.replace("FACTOR", "1.0"))
    own = {"spring_n_per_m": 490.9, "damping_n_s_per_m": 2000, "stiffness_n_per_m": 500}
    same = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": -500}
    zero = {"set_point": {"kp_n_s_per_m": -2000, "ki_n_per_m": -500}, **KEYS["start"]}
    one = prediction(tmp_path, law="./linear.py", matrix={"list": [own]})
    (tmp_path / "reference").mkdir()
    keys = {key: value for key, value in KEYS.items() if key != "start"}
    path = write_campaign(tmp_path / "reference", **keys, start=zero, matrix={"list": [same]})
    _, out, _ = rig_here("check", path, "--json")
    (row,), (other,) = one["predictions"], json.loads(out)["predictions"]  # type: ignore[misc]
    for name in ("position_rms", "power_mechanical_1", "power_dc", "gain_margin", "stiffness"):
        assert row[name] == pytest.approx(other[name], rel=1e-6), name
    code, text, _ = rig_here("check", tmp_path / "campaign.yaml", "--rows")
    assert code == 0
    assert "damping" in text


def test_form_that_changes_with_frequency_is_not_predicted(tmp_path: Path) -> None:
    (tmp_path / "linear.py").write_text(LINEAR_LAW.replace("FACTOR", "omega / (1.0 + omega)"))
    own = {"spring_n_per_m": 490.9, "damping_n_s_per_m": 2000, "stiffness_n_per_m": 500}
    report = prediction(tmp_path, law="./linear.py", matrix={"list": [own]})
    assert report["not_predicted"] == (
        "the linear form of the law linear is not that of a damper, a spring and a mass"
    )
    assert np.isfinite(report["duration_s"])  # type: ignore[arg-type]


def test_gains_are_recommended_for_the_impedance_law_only(tmp_path: Path) -> None:
    from rig.config.problems import ConfigError
    from rig.kinds.wavebot.recommend.set_points import open_on_twin

    row = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -1000, "declutch_s": 0.1}
    path = write_campaign(tmp_path, **KEYS, law="declutching", matrix={"list": [row]})
    plant = Path(__file__).resolve().parents[2] / "configs" / "plants" / "wavebot.yaml"
    with pytest.raises(ConfigError, match="gains are recommended for the impedance law only"):
        open_on_twin(path, plant)
