"""The lifted plant and law beside the same arithmetic in C, and beside scipy's integrator.

The C file says the same operations in the same order, so that its energies must be those of the
lifted functions to the last bit; then their times are of the same work. scipy integrates the
continuous model (the law without its sampling) to a tolerance at which its power is as far from
that of a fine one as ours is.
"""

import ctypes
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from benchmarks.support.recorded import ROOT, campaign_file
from benchmarks.support.result import Result, figure, ratios
from controllers import biquads, blocks, impedance
from rig import lift
from rig.campaign import check
from rig.rehearsal import job
from rig.rehearsal.devices import build_world
from sim_plant import (
    analyser,
    body,
    bus,
    cots_drive,
    custom_drive,
    drive,
    electrics,
    magnetic_spring,
    pto,
    wavebot,
)

OF_C, OF_SCIPY = 1.3, 100.0
KP, KI, RAMP = -2500.0, 4000.0, 0.5
TARGET = 20.0  # % of stator travel beyond its start, so that the table is walked
CC = ("-O2", "-ffp-contract=off", "-shared", "-fPIC", "-lm")
FINE, LOOSEST = 1e-10, 1e-2  # relative tolerances of the integrator

Floats = npt.NDArray[np.float64]

_LIFTED = (
    analyser, biquads, blocks, body, bus, cots_drive, custom_drive, drive, electrics, impedance,
    magnetic_spring, pto, wavebot,
)  # fmt: skip
_SOURCE = '''"""Generated: heave, spring, commercial drive and PI law in one compiled function."""

from numba import njit

from controllers import impedance
from controllers.signals import Estimate, Gains
from sim_plant import body, electrics, magnetic_spring, pto, wavebot
from sim_plant.body import BodyState


@njit(cache=True, error_model="numpy")
def walk(params, supplied, law, at_rest, gains, per_ampere, table, start, target, dt, ticks):
    hull = BodyState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    stator = magnetic_spring.stator_at(params.spring, start)
    held = magnetic_spring.force(params.spring, stator.rate, 0.0)
    memory = at_rest
    mechanical = ac = dc = 0.0
    for tick in range(ticks):
        now, after = table[tick % len(table)], table[(tick + 1) % len(table)]
        seen = Estimate(hull.position, hull.velocity, 0.0)
        memory, wanted = impedance.step(law, memory, gains, seen, 0.0, 0.0, dt)
        driven = electrics.command(
            params.electrics, supplied, wanted.force / per_ampere, 1, 1, 1, hull.velocity, dt
        )
        motor = params.pto.force_per_current * driven.mean_current
        x, v = body.predict(params.body, hull, now + motor + held, 0.5 * dt)
        held = wavebot.passive_force(params, stator.rate, x, v, 0.0)
        between = held
        hull = body.correct(params.body, hull, x, v, 0.5 * (now + after) + motor + held, dt)
        stator = magnetic_spring.stator_step(params.spring, stator, target, 1, dt)
        held = wavebot.passive_force(params, stator.rate, hull.position, hull.velocity, 0.0)
        power_ac = motor * v + pto.copper_loss(params.pto, motor)
        power_dc = power_ac + electrics.cots_drive.loss(
            params.electrics.cots, driven.mean_current
        )
        supplied = electrics.power(params.electrics, supplied, driven, 1, power_ac, dt)
        mechanical = mechanical + (motor + between) * v * dt
        ac = ac + power_ac * dt
        dc = dc + power_dc * dt
    return mechanical, ac, dc, supplied.analyser.power_ac
'''


class Model(NamedTuple):
    """A WaveBot in a regular sea."""

    params: wavebot.WaveBotParams
    table: Floats  # N, excitation, one repeat period by tick
    start: float  # %, stator
    per_ampere: float  # N/A
    dt: float


def model(folder: Path) -> Model:
    """The plant of the default rig."""
    campaign = check(campaign_file(folder, 12.0)).campaign
    assert campaign is not None
    devices = job.devices_of(campaign)
    dt = 1.0 / campaign.rig.rate_hz
    begin = build_world(devices | {"compiled": False}, dt).beginning()
    params = begin.params
    return Model(
        params,
        np.array(begin.tables.heave, dtype=np.float64),
        begin.state.stator.position,
        params.pto.force_per_current,
        dt,
    )


def lifted(made: Model) -> Callable[[int], tuple[float, ...]]:
    """The functions of plant and law, compiled: energies (J) after so many ticks."""
    walk = lift.load("benchmark_arithmetic", _SOURCE, _LIFTED).walk
    law = impedance.Params(RAMP)
    gains = impedance.Gains(KP, KI, 0.0)
    supplied = electrics.initial(made.params.electrics)

    def run(ticks: int) -> tuple[float, ...]:
        found: tuple[float, ...] = walk(
            made.params, supplied, law, impedance.start(), gains, made.per_ampere, made.table,
            made.start, made.start + TARGET, made.dt, ticks,
        )  # fmt: skip
        return found

    return run


def in_c(made: Model, folder: Path) -> Callable[[int], tuple[float, ...]] | None:
    """The same in C; None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    library = folder / "arithmetic.so"
    source = ROOT / "benchmarks" / "arithmetic.c"
    subprocess.run([compiler, str(source), "-o", str(library), *CC], check=True)
    walk = ctypes.CDLL(str(library)).walk
    params, spring = made.params, made.params.spring
    given = np.array([
        *lift.numbers(params.body), *lift.numbers(params.pto),
        *lift.numbers(params.electrics.loop), *lift.numbers(params.electrics.cots),
        spring.angle_per_metre, spring.reach, spring.sine, spring.effect, spring.speed,
        KP, KI, RAMP, made.per_ampere,
    ], dtype=np.float64)  # fmt: skip
    stations, rates = np.array(spring.stations), np.array(spring.rates)
    pointer = ctypes.POINTER(ctypes.c_double)

    def at(array: Floats) -> Any:
        return array.ctypes.data_as(pointer)

    double, integer = ctypes.c_double, ctypes.c_int
    walk.restype = None

    def run(ticks: int) -> tuple[float, ...]:
        energy = np.zeros(4)
        walk(
            at(given), at(stations), at(rates), integer(len(stations)), at(made.table),
            integer(len(made.table)), double(made.start), double(made.start + TARGET),
            double(params.electrics.analyser_window), double(made.dt), ctypes.c_long(ticks),
            at(energy),
        )  # fmt: skip
        return tuple(energy.tolist())

    return run


def integrated(made: Model, seconds: float, tolerance: float) -> tuple[float, ...]:
    """Energies (J) of the continuous model by scipy: state of hull, current and three energies."""
    params = made.params
    hull, loop, cots, spring = (
        params.body, params.electrics.loop, params.electrics.cots, params.spring,
    )  # fmt: skip
    times = np.arange(len(made.table) + 1) * made.dt
    table = np.append(made.table, made.table[0])
    period = times[-1]

    def slope(t: float, y: Floats) -> list[float]:
        x, v, z1, z2, z3, z4, z5, current = y[:8]
        share = min(t / RAMP, 1.0)
        enabled = 1.0 if t > loop.enable_delay else 0.0
        goal = enabled * share * (KP * v + KI * x) / made.per_ampere
        goal = min(max(goal, -loop.current_limit), loop.current_limit)
        gone = min(made.start + spring.speed * t, made.start + TARGET)
        rate = magnetic_spring.table_rate(spring, gone)
        motor = made.per_ampere * current
        between = motor + wavebot.passive_force(params, rate, x, v, 0.0)
        state = body.BodyState(x, v, z1, z2, z3, z4, z5)
        force = float(np.interp(t % period, times, table))
        rise = body.acceleration(hull, state, force + between)
        drop = v - hull.a0 * z1 - hull.a1 * z2 - hull.a2 * z3 - hull.a3 * z4 - hull.a4 * z5
        ac = motor * v + pto.copper_loss(params.pto, motor)
        return [
            v, rise, z2, z3, z4, z5, drop, (goal - current) / loop.time_constant,
            between * v, ac, ac + cots_drive.loss(cots, current),
        ]  # fmt: skip

    found = solve_ivp(
        slope, (0.0, seconds), np.zeros(11), method="LSODA", rtol=tolerance,
        atol=tolerance * 1e-3, max_step=0.1,
    )  # fmt: skip
    return tuple(found.y[8:, -1].tolist())


def measure(short: bool) -> Result:
    """Bits and times of both, block after block; then the integrator at our accuracy."""
    blocks_, seconds, span = (3, 200.0, 6.0) if short else (15, 2000.0, 20.0)
    with tempfile.TemporaryDirectory() as scratch:
        made = model(Path(scratch))
        ours, theirs = lifted(made), in_c(made, Path(scratch))
        ticks = round(seconds / made.dt)
        ours(1)  # compiled
        took, took_c = list[float](), list[float]()
        differing = 0
        for _ in range(blocks_):
            seconds_, energy = _timed(ours, ticks)
            took.append(seconds_)
            if theirs is not None:
                seconds_c, energy_c = _timed(theirs, ticks)
                took_c.append(seconds_c)
                differing += sum(a != b for a, b in zip(energy, energy_c, strict=True))
        fine = integrated(made, span, FINE)
        mine = ours(round(span / made.dt))
        wanted = _off(mine, fine)
        tolerance, began, slow = LOOSEST, 0.0, 0.0
        while True:  # the loosest that is as good
            began = time.perf_counter()
            found = integrated(made, span, tolerance)
            slow = time.perf_counter() - began
            if _off(found, fine) <= wanted or tolerance <= 10.0 * FINE:
                break
            tolerance /= 3.0
    per_second = [one / seconds for one in took]
    compared = (
        (
            figure("lifted / C", "ratio", ratios(took, took_c), at_most=OF_C),
            figure("energies that differ in any bit", "of 4", differing, at_most=0),
        )
        if took_c
        else ()
    )
    return Result(
        "arithmetic",
        "heave, spring, drive and PI law in steps of 1 ms: lifted, in C, and by scipy",
        f"{blocks_} blocks of {seconds:g} s, alternating; scipy once over {span:g} s",
        (
            figure("lifted", "x real time", [1.0 / one for one in per_second]),
            *compared,
            figure(
                "scipy solve_ivp / lifted, at equal accuracy",
                "ratio",
                slow / span / float(np.median(per_second)),
                at_least=OF_SCIPY,
            ),
            figure("  error of mean AC power, lifted", "%", 100.0 * wanted),
            figure("  error of mean AC power, scipy", "%", 100.0 * _off(found, fine)),
            figure("  relative tolerance of scipy", "1", tolerance),
        ),
        () if took_c else ("no C compiler on the PATH: not compared with C",),
    )


def _timed(walk: Callable[[int], tuple[float, ...]], ticks: int) -> tuple[float, tuple[float, ...]]:
    began = time.process_time()
    energy = walk(ticks)
    return time.process_time() - began, energy


def _off(energy: tuple[float, ...], fine: tuple[float, ...]) -> float:
    """Relative error of AC energy."""
    return math.fabs(energy[1] - fine[1]) / math.fabs(fine[1])
