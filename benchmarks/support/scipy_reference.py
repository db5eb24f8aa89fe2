"""The plant and law of the arithmetic benchmark by scipy's integrators, in two ways.

As it is: the law acts once a tick and its command stands until the next one, so the integrator
begins anew with every tick. And with a law that acts all the time, which a solver walks through in
steps as long as its tolerance lets it: a simpler model, told beside it.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from controllers import impedance
from controllers.signals import Estimate, Gains
from sim_plant import body, cots_drive, drive, magnetic_spring, pto, wavebot

Floats = npt.NDArray[np.float64]
_STATES = 11  # hull, its radiation memory, current, three energies


class Model(NamedTuple):
    """A WaveBot in a regular sea, its stator on its way, under a PI law."""

    params: wavebot.WaveBotParams
    excitation: Floats  # N, excitation, one repeat period by tick
    stator_start: float  # %, stator
    stator_target: float  # %, stator
    newtons_per_ampere: float  # N/A
    gains: Gains
    ramp: float  # s, of the gains
    dt: float


def derivatives(model: Model, t: float, y: Any, goal: float, force: float) -> list[float]:
    """How hull, current (towards ``goal``, A) and energies change under an excitation (N)."""
    params, hull = model.params, model.params.body
    x, v, z1, z2, z3, z4, z5, current = y[:8]
    gone = min(model.stator_start + params.spring.speed * t, model.stator_target)
    rate = magnetic_spring.table_rate(params.spring, gone)
    motor = model.newtons_per_ampere * current
    between = motor + wavebot.passive_force(params, rate, x, v, 0.0)
    rise = body.acceleration(hull, body.BodyState(x, v, z1, z2, z3, z4, z5), force + between)
    drop = v - hull.a0 * z1 - hull.a1 * z2 - hull.a2 * z3 - hull.a3 * z4 - hull.a4 * z5
    ac = motor * v + pto.copper_loss(params.pto, motor)
    return [
        v, rise, z2, z3, z4, z5, drop, (goal - current) / params.electrics.drive.time_constant,
        between * v, ac, ac + cots_drive.loss(params.electrics.cots, current),
    ]  # fmt: skip


def solve_sampled_law(made: Model, seconds: float, tolerance: float) -> tuple[float, ...]:
    """Energies (J) of the model as it is, tick by tick; excitation is linear within a tick."""
    params, dt = made.params, made.dt
    law, driven = impedance.Params(made.ramp), drive.initial()
    memory = impedance.start(law)
    y, table = np.zeros(_STATES), made.excitation
    for tick in range(round(seconds / dt)):
        began, now = tick * dt, float(table[tick % len(table)])
        growth = (float(table[(tick + 1) % len(table)]) - now) / dt
        x, v = y[:2].tolist()
        memory, wanted = impedance.step(law, memory, made.gains, Estimate(x, v, 0.0), 0.0, 0.0, dt)
        asked, most = wanted.force / made.newtons_per_ampere, params.electrics.drive.current_limit
        driven = drive.drive_step(
            params.electrics.drive, driven, asked, 1, 1, 1, 0, drive.UNLIMITED_CURRENT, dt
        )
        goal = min(max(asked, -most), most) if driven.enabled == 1 else 0.0
        y = solve_ivp(
            lambda t, y, began=began, now=now, growth=growth, goal=goal: derivatives(
                made, began + t, y, goal, now + growth * t
            ),
            (0.0, dt), y, rtol=tolerance, atol=tolerance * 1e-3, first_step=dt,
        ).y[:, -1]  # fmt: skip
    return tuple(y[8:].tolist())


def solve_continuous_law(made: Model, seconds: float, tolerance: float) -> tuple[float, ...]:
    """Energies (J) with a law that acts all the time."""
    loop = made.params.electrics.drive
    times = np.arange(len(made.excitation) + 1) * made.dt
    table = np.append(made.excitation, made.excitation[0])
    kp, ki, _ = made.gains

    def along(t: float, y: Any) -> list[float]:
        share = min(t / made.ramp, 1.0) if t > loop.enable_delay else 0.0
        goal = share * (kp * y[1] + ki * y[0]) / made.newtons_per_ampere
        goal = min(max(goal, -loop.current_limit), loop.current_limit)
        return derivatives(made, t, y, goal, float(np.interp(t % times[-1], times, table)))

    found = solve_ivp(
        along, (0.0, seconds), np.zeros(_STATES), method="LSODA", rtol=tolerance,
        atol=tolerance * 1e-3, max_step=0.1,
    )  # fmt: skip
    return tuple(found.y[8:, -1].tolist())
