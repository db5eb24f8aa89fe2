"""Remainder of the free motion at the measured window of an identification: `rig check`."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig as rig_here
from test_modular_identification import change, write_rig

from rig.config.yaml_source import load_mapping
from rig.kinds.modular.build import campaign_params
from rig.kinds.modular.checks import check, reference_warnings
from rig.kinds.modular.free_motion import decay_time, free_motion_warnings, poles
from rig.kinds.modular.match import axis_impedance
from rig.kinds.modular.rehearsal.job import load_model
from rig.planning.input_files import ConfigSource


def load_campaign(folder: Path) -> Any:
    campaign = check(folder / "cylinder" / "campaign.yaml").campaign
    assert campaign is not None
    return campaign


@pytest.fixture(scope="module")
def heave(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("heave")
    write_rig(folder)
    return folder


def settle(folder: Path, seconds: float, kp: float = 0.0) -> Any:
    def edit(campaign: dict[str, Any]) -> None:
        campaign["timing"]["settle_s"] = seconds
        (row,) = campaign["matrix"]["list"]
        (name,) = (key for key in row if key.startswith("kp"))
        row[name] = kp

    change(folder / "cylinder" / "campaign.yaml", edit)
    return load_campaign(folder)


def test_poles_are_the_zeros_of_the_impedance(heave: Path) -> None:
    """At e^(s t) of a free motion no force acts; its impedance is far below that near it."""
    campaign = load_campaign(heave)
    model, _ = load_model(ConfigSource(campaign.plant, campaign.plant_locate))
    assert model is not None
    free = poles(model)
    assert free.size == 2 + len(model.radiation.source)
    for pole in free[np.abs(free) > 1e-6]:
        nearby = abs(axis_impedance(model, -1j * (pole * 1.01)))
        assert abs(axis_impedance(model, -1j * pole)) < 1e-6 * nearby
    assert decay_time(model) == pytest.approx(1.0 / np.abs(free.real).min())


def test_a_remainder_above_a_thousandth_is_a_warning(heave: Path) -> None:
    (warning,) = free_motion_warnings(settle(heave, 20))
    assert warning.key == "timing.settle_s"
    decay, percent, needed = map(
        float, re.findall(r"in ([\d.]+) s, .* s ([\d.]+) % .* % after (\d+) s", warning.message)[0]
    )
    assert percent == pytest.approx(100.0 * math.exp(-20.0 / decay), rel=0.05)
    assert math.exp(-needed / decay) == pytest.approx(0.001, rel=0.1)
    assert free_motion_warnings(settle(heave, needed + 1)) == ()
    code, output, _ = rig_here("check", heave / "cylinder" / "campaign.yaml")
    assert code == 0
    assert "of the free motion remains" not in output
    settle(heave, 20)
    code, output, _ = rig_here("check", heave / "cylinder" / "campaign.yaml")
    assert "of the free motion remains" in " ".join(output.split())


@pytest.mark.parametrize("dof", ["Heave", "Pitch"])
def test_the_amplitude_has_the_unit_of_the_axis(tmp_path: Path, dof: str) -> None:
    """N*m of a rotating axis. A file of 1.0 with N there runs as before, with a warning."""
    campaigns = {}
    for key in ("amplitude_n", "amplitude_n_m"):
        reference = {"kind": "multisine", "repeat_s": 20, key: 5.0, "seed": 5}
        write_rig(tmp_path / key, dof=dof, reference=reference)
        report = check(tmp_path / key / "cylinder" / "campaign.yaml")
        if (dof, key) == ("Heave", "amplitude_n_m"):
            (problem,) = report.problems
            assert problem.key == "reference.amplitude_n_m"
            assert problem.message.startswith("heave does not rotate")
            return
        assert report.campaign is not None
        assert report.plan is not None
        warnings = [*reference_warnings(report.campaign)]
        assert len(warnings) == (dof == "Pitch" and key == "amplitude_n")
        assert all("write amplitude_n_m" in each.message for each in warnings)
        campaigns[key] = campaign_params(report.campaign, report.plan).rig.reference.table
    assert campaigns["amplitude_n"] == campaigns["amplitude_n_m"]
    assert max(map(abs, campaigns["amplitude_n_m"])) == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize("dof", ["Heave", "Pitch"])
def test_an_amplitude_beyond_the_motor_is_a_warning(tmp_path: Path, dof: str) -> None:
    """A typing error of it, which the limits of the drive would cut in silence."""
    key, unit = ("amplitude_n_m", "N*m") if dof == "Pitch" else ("amplitude_n", "N")

    def messages(amplitude: float, scale: float) -> list[str]:
        path = tmp_path / "cylinder" / "campaign.yaml"

        def edit(campaign: dict[str, Any]) -> None:
            campaign["reference"][key] = amplitude
            campaign["matrix"]["list"][0]["reference_scale"] = scale

        change(path, edit)
        report = check(path)
        assert report.campaign is not None
        return [each.message for each in reference_warnings(report.campaign)]

    write_rig(tmp_path, dof=dof, reference={"kind": "multisine", "repeat_s": 20, key: 1.0})
    (message,) = messages(9e5, 1.0)
    current, largest = map(
        float, re.findall(rf"= ([\d.]+) A of \w+ is ([\d.]+) {re.escape(unit)}$", message)[0]
    )
    (axis,) = load_mapping(tmp_path / "cylinder" / "rig.yaml")[0]["axes"].values()
    (limits,) = load_mapping(tmp_path / "cylinder" / "limits.yaml")[0]["axes"].values()
    assert current == limits["current_peak_a"]
    (gear,) = (value for key, value in axis.items() if key.startswith("gear_ratio"))
    factor = axis["torque_constant_n_m_per_a"] * gear
    assert largest == pytest.approx(current * factor, rel=1e-3)
    assert messages(0.99 * largest, 1.0) == []
    assert messages(0.99 * largest, 0.5) == []
    assert len(messages(0.99 * largest, 2.0)) == 1


def test_a_law_that_acts_on_the_motion_is_not_judged(heave: Path) -> None:
    """Its loop has other modes than the plant."""
    assert free_motion_warnings(settle(heave, 20, kp=-500.0)) == ()
