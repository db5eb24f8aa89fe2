"""The stator's axial force in whole runs: the stroke limit stops the body before it reverses.

MASK4 report (Sandia), Fig. 4-3: at small spring rates the force on the stator changes its sign at
the extremes of motion. The stroke limit prevents that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rehearsing import CONFIGS, load_rows, rehearse, write_campaign, write_yaml

from rig.config.pydantic_errors import load
from rig.config.yaml_source import load_mapping
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.realtime.safety import STOP_0, STOP_1
from rig.recording.runs import open_run
from sim_plant.parameters import Plant
from sim_plant.stator_force import force_reversal

RIG = load(CONFIGS / "rigs" / "wavebot.yaml", RigFile)[0]
FIELDS = [
    "tick", "safety.mode", "heave.estimate.position", "load.stator_a", "load.stator_b",
]  # fmt: skip


def rehearse_large_motion(folder: Path, spring: float, ki: float, rig: Path | None = None) -> Any:
    """Rehearse a soft row in large waves; return the result and the log."""
    path = write_campaign(
        folder,
        **({"rig": str(rig)} if rig is not None else {}),
        sea={"kind": "regular", "amplitude_m": 0.2, "frequency_hz": 0.4},
        surge={"use": "hold"},
        tare={"duration_s": 1},
        start={"lead_in_s": 10},
        timing={"settle_s": 5, "periods": 4},
        matrix={"list": [{"spring_n_per_m": spring, "kp_n_s_per_m": -1000, "ki_n_per_m": ki}]},
    )
    result = rehearse(
        path, folder / "runs"
    )  # without the prediction, which would refuse the stiff row
    return result, open_run(result.folder, fields=FIELDS)


def largest_displacement(data: Any) -> float:
    """Return the largest distance from the zero, m."""
    return float(np.abs(data["heave.estimate.position"].values).max())


def stator_force(data: Any) -> Any:
    """Return the recorded stator force, N."""
    return data["load.stator_a"].values + data["load.stator_b"].values


def test_the_stroke_limit_stops_the_body_before_the_force_reverses(tmp_path: Path) -> None:
    """Near the smallest spring rate the body is damped to rest at 0.25 m, the force stays > 0."""
    result, data = rehearse_large_motion(tmp_path, 490.9, 12000.0)
    assert (result.outcome.status, result.outcome.reason) == ("fault", "SPRING_STROKE")
    modes = data["safety.mode"].values
    assert modes[-1] == STOP_0
    assert STOP_1 in modes  # a controlled stop: damping, then power off
    assert 0.25 < largest_displacement(data) < 0.255
    assert stator_force(data).min() > 0.0


def test_a_spring_that_does_not_reverse_may_go_farther(tmp_path: Path) -> None:
    """At -5715 N/m the same motion is measured completely: only heave's own stop limits it."""
    result, data = rehearse_large_motion(tmp_path, -5715.0, 5800.0)
    assert result.outcome.status == "complete"
    assert 0.25 < largest_displacement(data) < 0.35
    assert stator_force(data).min() > 0.0
    assert load_rows(result).stator_force_min.item() > 0.0


def test_without_the_limit_the_force_reverses_where_the_report_shows_it(tmp_path: Path) -> None:
    """At -13 % the sign changes at the extremes of motion, beyond the limit of 0.25 m."""
    spring_map = RIG.model_dump()["spring"]["map"]
    rig = write_yaml(
        tmp_path / "rig.yaml",
        {
            "extends": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "spring": {"map": [{**station, "stroke_m": 0.35} for station in spring_map]},
        },
    )
    result, data = rehearse_large_motion(tmp_path, 490.9, 12000.0, rig)
    assert result.outcome.status == "complete"
    force, position = stator_force(data), np.abs(data["heave.estimate.position"].values)
    sign_changes = position[1:][np.diff(np.sign(force)) != 0.0]
    assert sign_changes.size >= 4
    mapping, _ = load_mapping(CONFIGS / "plants" / "wavebot.yaml")
    params = Plant.model_validate(mapping).build()
    expected = force_reversal(params.stator, params.spring, -13.0).stroke
    assert expected > 0.255
    np.testing.assert_allclose(sign_changes, expected, atol=0.003)
    assert (force[position < 0.25] > 0.0).all()
    assert load_rows(result).stator_force_min.item() < 0.0
