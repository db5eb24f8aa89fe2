"""The plant in time: closed form, energy balance, integrator error, free decay.

Tests over minutes of the plant's time run compiled, with the same bits (tests/rehearsal/
test_compiled_plant).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from closed_form import intrinsic_impedance
from plant_files import DT, QUIET, bem, command, plant, surge_bem, world

from rig.kinds.wavebot.rehearsal.compiled_plant import CompiledStepper
from sim_plant import sea_states
from sim_plant.signals import Actuation
from sim_plant.wavebot import Excitation, WaveBotParams, WaveBotState, initial, step


@pytest.mark.parametrize("frequency", [0.25, 0.4, 0.5, 0.8])
def test_driven_linear_plant_is_the_closed_form(frequency: float) -> None:
    """Sinusoidal current, spring at -13 %: complex v/F within 0.1 % of 1/(Z_i + Z_d)."""
    rig = world(name="wavebot_linear", stepper=CompiledStepper, **QUIET)
    periods = 4 / frequency
    begin, end = round(80.0 / DT), round((80.0 + periods) / DT)
    velocity, force = [], []
    for k in range(end):
        rig.actuate(command(8.0 * math.sin(2 * math.pi * frequency * k * DT)))
        rig.advance(DT)
        if k >= begin:
            truth = rig.truth()
            velocity.append(truth.velocity)
            force.append(truth.motor)
    turn = np.exp(-2j * np.pi * frequency * DT * np.arange(end - begin))
    measured = np.dot(velocity, turn) / np.dot(force, turn)
    params = plant("wavebot_linear").build()
    s = 2j * np.pi * frequency
    impedance = intrinsic_impedance(params, frequency) + params.pto.viscous + 490.9 / s
    assert abs(measured * impedance - 1) <= 1e-3


def row(params: WaveBotParams, dt: float, seconds: float) -> list[WaveBotState]:
    """Integrate one row of damping from rest in a regular sea at any step, drive long on."""
    sea = sea_states.regular(0.127, 0.5)
    often = math.ceil(seconds / sea.repeat) + 1
    force = np.tile(sea_states.excitation(sea, bem(), dt), often)
    surge_force = np.tile(sea_states.excitation(sea, surge_bem(), dt), often)
    state = initial(params, 27.0, 0.0)
    states = []
    hold = round(DT / dt)
    current = 0.0
    for k in range(round(seconds / dt)):
        if k % hold == 0:  # commands hold over the tick for any step
            current = -2500.0 / 76.975 * state.body.velocity
            states.append(state)
        wires = Actuation(current, 1, 27.0, 0, 1, 0.0, 0, 1)
        now, after = (Excitation(float(force[i]), float(surge_force[i])) for i in (k, k + 1))
        state = step(params, state, wires, 1, now, after, dt)
    return states


@pytest.mark.parametrize("name", ["wavebot", "wavebot_linear"])
def test_integrator_error(name: str) -> None:
    """Position against 16 times finer steps: 3e-6 of the stroke, a quarter at half the step."""
    params = plant(name).build()
    loop = params.electrics.drive._replace(enable_delay=0.0)
    params = params._replace(electrics=params.electrics._replace(drive=loop))
    steps = {part: [s.body.position for s in row(params, DT / part, 6.0)] for part in (1, 2, 16)}
    fine = np.array(steps[16])
    error = {part: np.max(np.abs(np.array(steps[part]) - fine)) for part in (1, 2)}
    assert error[1] <= 3e-6 * np.ptp(fine) / 2
    assert error[1] / error[2] == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("name", ["wavebot", "wavebot_linear", "wavebot_as_measured"])
def test_energy_balance(name: str) -> None:
    """Work of all forces = change of kinetic and stored energy, to 1e-5 of the turnover."""
    rig = world(sea_states.regular(0.127, 0.5), name)
    body = rig.params.body
    work = dict.fromkeys(("excitation", "motor", "friction", "drag", "radiation"), 0.0)
    turned = 0.0
    before = rig.truth()
    for _ in range(20000):
        rig.actuate(command(-20.0 * before.velocity, wave_trigger=1))
        rig.advance(DT)
        after = rig.truth()
        moved = after.position - before.position
        for key in work:
            done = 0.5 * (getattr(before, key) + getattr(after, key)) * moved
            work[key] += done
            turned += abs(done)
        before = after
    rate = rig.truth().spring_rate
    reach, per_metre = rig.params.spring.force_per_rate, rig.params.spring.angle_per_metre
    stored = 0.5 * rate * before.position**2
    if rig.params.spring.sine:
        stored = rate * reach * math.sin(per_metre * before.position) ** 2 / per_metre
    kinetic = 0.5 * body.inertia * before.velocity**2
    gained = kinetic + 0.5 * body.hydrostatic * before.position**2 + stored
    assert abs(sum(work.values()) - gained) <= 1e-5 * turned
    assert work["excitation"] > 0
    assert all(work[key] < 0 for key in ("motor", "friction", "drag", "radiation"))


def test_free_decay() -> None:
    """Release from 0.03 m, linear, drive off: the modal solution to 1e-5, frequency 0.654 Hz."""
    rig = world(name="wavebot_linear")
    rig.release(0.03)
    positions = [0.03]
    for _ in range(8000):
        rig.advance(DT)
        positions.append(rig.truth().position)
    body, pto = rig.params.body, rig.params.pto
    motion = np.zeros((7, 7))
    motion[0, 1] = motion[6, 1] = 1.0
    motion[1, :2] = -(body.hydrostatic + 490.9), -(body.viscous + pto.viscous)
    motion[1, 3:] = -body.b1, -body.b2, -body.b3, -body.b4
    motion[1] /= body.inertia
    motion[[2, 3, 4, 5], [3, 4, 5, 6]] = 1.0
    motion[6, 2:] = -body.a0, -body.a1, -body.a2, -body.a3, -body.a4
    poles, modes = np.linalg.eig(motion)
    weights = np.linalg.solve(modes, np.eye(7)[0] * 0.03)
    time = DT * np.arange(8001)
    exact = ((modes[0] * weights) @ np.exp(np.outer(poles, time))).real
    np.testing.assert_allclose(positions, exact, rtol=0.0, atol=1e-5 * 0.03)
    slowest = poles[np.argmin(np.where(poles.imag > 1.0, np.abs(poles.real), np.inf))]
    assert slowest.imag / (2 * np.pi) == pytest.approx(0.654, abs=0.001)


def test_quadratic_and_linear_drag_are_one_loss() -> None:
    """254 + 8/(3 pi) 1216 v equals 475 N s/m at 0.21 m/s: never both."""
    body = plant().build().body
    assert body.viscous + body.quadratic * 8 / (3 * math.pi) * 0.21 == pytest.approx(
        475.0, rel=0.02
    )
