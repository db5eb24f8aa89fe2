"""The settling time of rows against the decay of the sampled loop, wave by wave, in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from predicting import CONFIGS
from rehearsing import write_yaml

from rig.campaign.plan import stage_plans
from rig.design import sampled_loop
from rig.kinds.wavebot import heave_loop
from rig.kinds.wavebot.campaign import open_campaign
from sim_plant.parameters import Plant

CAMPAIGN = open_campaign(Path(CONFIGS) / "campaigns" / "default.yaml")
LEFT = 0.021  # of the amplitude, of any wave


@pytest.mark.parametrize("frequency", [0.2, 0.35, 0.5, 0.7, 1.0])
def test_what_is_left_of_a_motion_after_the_settling_time(frequency: float) -> None:
    """A row of the default campaign that moves steadily with a wave, which then ends.

    This is the difference of two rows with the same wave and gains, one of which begins at rest.
    """
    rows = stage_plans(CAMPAIGN)[0].rows
    rig, plant = CAMPAIGN.rig, Plant.model_validate(CAMPAIGN.plant)
    params, dt = plant.build(), 1.0 / rig.rate_hz
    body = heave_loop.linear_body(params.body, params.pto.viscous)
    timing = heave_loop.loop_timing(plant, params.electrics.drive, rig.heave, dt)
    law = heave_loop.heave_law(CAMPAIGN, [row.setting for row in rows], dt)
    stiffness = heave_loop.spring_stiffness(
        params.spring, heave_loop.spring_rates(params.spring, [row.place for row in rows])
    )
    times = heave_loop.transients(CAMPAIGN, rows)
    left = []
    for i in range(0, len(rows), 5):
        stiff = body._replace(stiffness=body.stiffness + float(stiffness[i]))
        gains = (float(law.kp[i]), float(law.ki[i]), float(law.km[i]))
        plant_matrices = sampled_loop.discretise(stiff, timing)
        loop = sum(sampled_loop.closed_loop_matrices(*plant_matrices, timing, law.sections, gains))
        size = len(loop)
        push = np.zeros(size)
        push[1] = dt / body.inertia  # a force on the body over a tick
        advance = np.exp(2j * np.pi * frequency * dt)
        steady = np.linalg.solve(advance * np.eye(size) - loop, push)
        ticks = round((times[i] - rig.heave.gain_ramp_s) / dt)
        state, step = np.linalg.matrix_power(loop, ticks) @ steady, np.linalg.matrix_power(loop, 50)
        amplitudes = []
        for _ in range(20):  # the next second
            amplitudes.append(abs(state[0]) / abs(steady[0]))
            state = step @ state
        left.append(max(amplitudes))
    assert max(left) < LEFT
    assert np.median(left) > 0.1 * heave_loop.REMAINDER  # the time is not much longer than needed
    assert min(times) > 3.0


def test_a_law_without_a_linear_form_settles_for_the_longest_time(tmp_path: Path) -> None:
    path = write_yaml(
        tmp_path / "campaign.yaml",
        {
            "name": "test",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "sea": {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2.0},
            "law": {"use": "velocity table", "velocity_m_per_s": [-1, 0, 1], "force_n": [9, 0, -9]},
            "matrix": {"list": [{"spring_n_per_m": 490.9, "table_scale": 1, "retract_factor": 1}]},
            "timing": {"settle": "measured", "settle_s": 7},
        },
    )
    plan = stage_plans(open_campaign(path))[0]
    assert plan.phases.settle == 7.0
