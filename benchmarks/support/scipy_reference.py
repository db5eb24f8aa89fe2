"""The plant and law of the arithmetic benchmark, solved by scipy's integrators in two ways.

With the sampled law: it acts once per tick and its command is held until the next tick, so the
integrator restarts at every tick. With a continuous law: the solver takes steps as long as its
tolerance allows. The continuous law is a simpler model.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from controllers import impedance
from controllers.signals import Estimate, Gains
from sim_plant import body, cots_drive, magnetic_spring, pto, wavebot
from sim_plant.parts import drive

Floats = npt.NDArray[np.float64]
_STATES = 11  # hull, its radiation memory, current, three energies


class Model(NamedTuple):
    """A WaveBot in a regular sea with a moving stator, under a PI law."""

    params: wavebot.WaveBotParams
    excitation: Floats  # N, excitation, one repeat period by tick
    stator_start: float  # %, stator
    stator_target: float  # %, stator
    newtons_per_ampere: float  # N/A
    gains: Gains
    ramp: float  # s, of the gains
    dt: float


def derivatives(model: Model, t: float, y: Any, goal: float, force: float) -> list[float]:
    """Return the derivatives of hull, current and energies.

    ``goal`` is the demanded current (A), ``force`` the excitation (N).
    """
    params, hull = model.params, model.params.body
    x, v, z1, z2, z3, z4, z5, current = y[:8]
    stator = min(model.stator_start + params.spring.speed * t, model.stator_target)
    rate = magnetic_spring.table_rate(params.spring, stator)
    motor = model.newtons_per_ampere * current
    between = motor + wavebot.passive_force(params, rate, x, v, 0.0)
    rise = body.acceleration(hull, body.BodyState(x, v, z1, z2, z3, z4, z5), force + between)
    drop = v - hull.a0 * z1 - hull.a1 * z2 - hull.a2 * z3 - hull.a3 * z4 - hull.a4 * z5
    ac = motor * v + pto.copper_loss(params.pto, motor)
    return [
        v, rise, z2, z3, z4, z5, drop, (goal - current) / params.electrics.drive.time_constant,
        between * v, ac, ac + cots_drive.loss(params.electrics.cots, current),
    ]  # fmt: skip


def solve_sampled_law(model: Model, seconds: float, tolerance: float) -> tuple[float, ...]:
    """Return the energies (J) with the sampled law; excitation is linear within a tick."""
    params, dt = model.params, model.dt
    law, driven = impedance.Params(model.ramp), drive.initial()
    memory = impedance.start(law)
    y, table = np.zeros(_STATES), model.excitation
    for tick in range(round(seconds / dt)):
        began, now = tick * dt, float(table[tick % len(table)])
        growth = (float(table[(tick + 1) % len(table)]) - now) / dt
        x, v = y[:2].tolist()
        memory, demand = impedance.step(law, memory, model.gains, Estimate(x, v, 0.0), 0.0, 0.0, dt)
        current, limit = (
            demand.force / model.newtons_per_ampere,
            params.electrics.drive.current_limit,
        )
        driven = drive.drive_step(
            params.electrics.drive, driven, current, 1, 1, 1, 0, drive.UNLIMITED_CURRENT, dt
        )
        goal = min(max(current, -limit), limit) if driven.enabled == 1 else 0.0
        y = solve_ivp(
            lambda t, y, began=began, now=now, growth=growth, goal=goal: derivatives(
                model, began + t, y, goal, now + growth * t
            ),
            (0.0, dt), y, rtol=tolerance, atol=tolerance * 1e-3, first_step=dt,
        ).y[:, -1]  # fmt: skip
    return tuple(y[8:].tolist())


def solve_continuous_law(model: Model, seconds: float, tolerance: float) -> tuple[float, ...]:
    """Return the energies (J) with the continuous law."""
    loop = model.params.electrics.drive
    times = np.arange(len(model.excitation) + 1) * model.dt
    table = np.append(model.excitation, model.excitation[0])
    kp, ki, _ = model.gains

    def slope(t: float, y: Any) -> list[float]:
        share = min(t / model.ramp, 1.0) if t > loop.enable_delay else 0.0
        goal = share * (kp * y[1] + ki * y[0]) / model.newtons_per_ampere
        goal = min(max(goal, -loop.current_limit), loop.current_limit)
        return derivatives(model, t, y, goal, float(np.interp(t % times[-1], times, table)))

    solution = solve_ivp(
        slope, (0.0, seconds), np.zeros(_STATES), method="LSODA", rtol=tolerance,
        atol=tolerance * 1e-3, max_step=0.1,
    )  # fmt: skip
    return tuple(solution.y[8:, -1].tolist())
