"""The frequency-domain oracle against the decided numbers, the World against the oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from closed_form import controller, heave_response
from plant_files import DT, QUIET, bem, command, plant, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states

FORCE_PER_CURRENT = 76.9750217


@pytest.mark.parametrize(
    ("f", "trs", "lcb", "ac", "stroke"),
    [(0.4, -66.5, -85.8, -57.2, 0.092), (0.5, -57.8, -74.5, -49.7, 0.068)],
)
def test_decided_numbers(f: float, trs: float, lcb: float, ac: float, stroke: float) -> None:
    """Kp -2500, Ki 0, a 0.127 m, no spring, BEM radiation."""
    params = plant("wavebot_linear").build()
    table = heave_response(params, bem(), f, 0.127, -2500.0, 0.0, 0.0, bem_radiation=True)
    assert table.trs == pytest.approx(trs, abs=0.06)
    assert table.lcb == pytest.approx(lcb, abs=0.06)
    assert table.ac == pytest.approx(ac, abs=0.06)
    assert table.stroke == pytest.approx(stroke, abs=0.0005)
    with_own_states = heave_response(params, bem(), f, 0.127, -2500.0, 0.0, 0.0)
    assert with_own_states.lcb == pytest.approx(table.lcb, rel=0.003)


def test_single_wave_equals_a_spectrum_except_for_the_mean_current() -> None:
    params = plant("wavebot_linear").build()
    single = heave_response(params, bem(), 0.5, 0.127, -2500.0, 1000.0, 0.0)
    spectrum = heave_response(params, bem(), [0.5, 0.6], [0.127, 0.0], -2500.0, 1000.0, 0.0)
    assert spectrum.ac == pytest.approx(single.ac)
    assert spectrum.dc - single.dc == pytest.approx(
        3.6 * single.current * (1 / math.sqrt(math.pi) - 2 / math.pi), abs=1e-9
    )


@pytest.mark.parametrize(("f", "kp", "ki"), [(0.4, -2500.0, 0.0), (0.5, -1500.0, 6000.0)])
def test_world_in_closed_loop(f: float, kp: float, ki: float) -> None:
    """Perfect measurement, one tick of delay: powers within 0.3 % and 0.15 W of the closed form."""
    rig = world(sea_states.regular(0.127, f), "wavebot_linear", stepper=CompiledStepper, **QUIET)
    begin = 60.0
    periods = math.floor(10.0 * f + 1e-9)
    end = round((begin + periods / f) / DT)
    sums = np.zeros(4)
    motion = rig.motion()
    position = 0.0
    for k in range(end):
        (x, v), motion = motion, rig.motion()  # readings are one tick old
        current = (kp * v + ki * x) / FORCE_PER_CURRENT
        rig.actuate(command(current, wave_trigger=1))
        rig.advance(DT)
        if k >= round(begin / DT):
            now = rig.truth()
            read = rig.readings()
            lcb = now.motor + now.spring + now.friction
            sums += (now.motor * now.velocity, lcb * now.velocity, read.power_ac, read.power_dc)
            position = max(position, now.position)
    power = sums / (end - round(begin / DT))
    tau = plant("wavebot_linear").drive.current_time_constant.value
    loop = controller(kp, ki, DT + DT / 2 + tau)
    params = plant("wavebot_linear").build()
    expected = heave_response(params, bem(), f, 0.127, kp, ki, 490.9, loop)
    for measured, predicted in zip(power, expected[:4], strict=True):
        assert measured == pytest.approx(predicted, rel=3e-3, abs=0.15)
    assert position == pytest.approx(expected.stroke, rel=2e-3)
