"""The lifted plant and law compared with the same arithmetic in C, and with scipy's integrator.

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

from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Figure, Result, figure, ratios
from benchmarks.support.scipy_reference import (
    Floats,
    Model,
    solve_continuous_law,
    solve_sampled_law,
)
from controllers import biquads, blocks, impedance
from controllers.signals import Gains
from rig.compilation import lifting
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import build_world
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

MAX_RATIO_TO_C, MIN_RATIO_TO_SCIPY = 1.3, 100.0
KP, KI, RAMP = -2500.0, 4000.0, 0.5
STATOR_TRAVEL = 20.0  # % of stator travel beyond its start, so that the table is used
CC_OPTIONS = ("-O2", "-ffp-contract=off", "-shared", "-fPIC", "-lm")
FINE_TOLERANCE, LOOSEST_TOLERANCE = 1e-10, 1e-2  # relative tolerances of the integrator

_LIFTED_MODULES = (
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
    stator = magnetic_spring.stator_at_rest(params.spring, start)
    held = magnetic_spring.force(params.spring, stator.rate, 0.0)
    memory = at_rest
    mechanical = ac = dc = 0.0
    for tick in range(ticks):
        now, after = table[tick % len(table)], table[(tick + 1) % len(table)]
        seen = Estimate(hull.position, hull.velocity, 0.0)
        memory, wanted = impedance.step(law, memory, gains, seen, 0.0, 0.0, dt)
        driven = electrics.command_step(
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
        supplied = electrics.power_step(params.electrics, supplied, driven, 1, power_ac, dt)
        mechanical = mechanical + (motor + between) * v * dt
        ac = ac + power_ac * dt
        dc = dc + power_dc * dt
    return mechanical, ac, dc, supplied.analyser.power_ac
'''


def build_model(folder: Path) -> Model:
    """The plant of the default rig."""
    campaign = check_campaign(write_campaign_file(folder, 12.0)).campaign
    assert campaign is not None
    devices = job.plant_settings(campaign)
    dt = 1.0 / campaign.rig.rate_hz
    begin = build_world(devices | {"compiled": False}, dt).initial_conditions()
    params = begin.params
    return Model(
        params,
        np.array(begin.tables.heave, dtype=np.float64),
        begin.state.stator.position,
        begin.state.stator.position + STATOR_TRAVEL,
        params.pto.force_per_current,
        Gains(KP, KI, 0.0),
        RAMP,
        dt,
    )


def compiled_simulation(made: Model) -> Callable[[int], tuple[float, ...]]:
    """The functions of plant and law, compiled: energies (J) after so many ticks."""
    walk = lifting.load("benchmark_arithmetic", _SOURCE, _LIFTED_MODULES).walk
    law = impedance.Params(RAMP)
    supplied = electrics.initial(made.params.electrics)

    def run(ticks: int) -> tuple[float, ...]:
        found: tuple[float, ...] = walk(
            made.params, supplied, law, impedance.start(law), made.gains, made.newtons_per_ampere,
            made.excitation, made.stator_start, made.stator_target, made.dt, ticks,
        )  # fmt: skip
        return found

    return run


def c_simulation(made: Model, folder: Path) -> Callable[[int], tuple[float, ...]] | None:
    """The same in C; None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    library = folder / "arithmetic.so"
    source = ROOT / "benchmarks" / "arithmetic.c"
    subprocess.run([compiler, str(source), "-o", str(library), *CC_OPTIONS], check=True)
    walk = ctypes.CDLL(str(library)).walk
    params, spring = made.params, made.params.spring
    given = np.array([
        *lifting.flatten(params.body), *lifting.flatten(params.pto),
        *lifting.flatten(params.electrics.drive), *lifting.flatten(params.electrics.cots),
        spring.angle_per_metre, spring.force_per_rate, spring.sine, spring.effect, spring.speed,
        KP, KI, RAMP, made.newtons_per_ampere,
    ], dtype=np.float64)  # fmt: skip
    stations, rates = np.array(spring.stator_positions), np.array(spring.rates)
    pointer = ctypes.POINTER(ctypes.c_double)

    def at(array: Floats) -> Any:
        return array.ctypes.data_as(pointer)

    double, integer = ctypes.c_double, ctypes.c_int
    walk.restype = None

    def run(ticks: int) -> tuple[float, ...]:
        energy = np.zeros(4)
        walk(
            at(given), at(stations), at(rates), integer(len(stations)), at(made.excitation),
            integer(len(made.excitation)), double(made.stator_start), double(made.stator_target),
            double(params.electrics.analyser_window), double(made.dt), ctypes.c_long(ticks),
            at(energy),
        )  # fmt: skip
        return tuple(energy.tolist())

    return run


def measure(short: bool) -> Result:
    """Bits and times of both, block after block; then the integrator at our accuracy."""
    blocks_, seconds, span = (3, 200.0, 6.0) if short else (15, 2000.0, 20.0)
    with tempfile.TemporaryDirectory() as scratch:
        made = build_model(Path(scratch))
        ours, theirs = compiled_simulation(made), c_simulation(made, Path(scratch))
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
        mine = ours(round(span / made.dt))
        same, other = (
            _solve_as_accurately(way, made, span, mine)
            for way in (solve_sampled_law, solve_continuous_law)
        )
    per_second = [one / seconds for one in took]
    compared = (
        (
            figure("lifted / C", "ratio", ratios(took, took_c), at_most=MAX_RATIO_TO_C),
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
            *_scipy_figures("", same, span, per_second, MIN_RATIO_TO_SCIPY),
            *_scipy_figures(", a law without ticks", other, span, per_second, None),
        ),
        () if took_c else ("no C compiler on the PATH: not compared with C",),
    )


class _ScipyRun(NamedTuple):
    """scipy at the loosest tolerance that is as good as we are."""

    seconds: float  # of processor
    tolerance: float  # relative
    error: float  # of AC energy
    own_error: float  # error of ours


def _solve_as_accurately(
    way: Callable[[Model, float, float], tuple[float, ...]],
    made: Model,
    span: float,
    mine: tuple[float, ...],
) -> _ScipyRun:
    fine = way(made, span, FINE_TOLERANCE)
    wanted, tolerance = _relative_error(mine, fine), LOOSEST_TOLERANCE
    while True:
        began = time.process_time()
        error = _relative_error(way(made, span, tolerance), fine)
        took = time.process_time() - began
        if error <= wanted or tolerance <= 10.0 * FINE_TOLERANCE:
            return _ScipyRun(took, tolerance, error, wanted)
        tolerance /= 3.0


def _scipy_figures(
    which: str, found: _ScipyRun, span: float, per_second: list[float], at_least: float | None
) -> tuple[Figure, ...]:
    ratio = found.seconds / span / float(np.median(per_second))
    return (
        figure(f"scipy solve_ivp / lifted{which}", "ratio", ratio, at_least=at_least),
        figure("  error of mean AC power, lifted", "%", 100.0 * found.own_error),
        figure("  error of mean AC power, scipy", "%", 100.0 * found.error),
        figure("  relative tolerance of scipy", "1", found.tolerance),
    )


def _timed(walk: Callable[[int], tuple[float, ...]], ticks: int) -> tuple[float, tuple[float, ...]]:
    began = time.process_time()
    energy = walk(ticks)
    return time.process_time() - began, energy


def _relative_error(energy: tuple[float, ...], fine: tuple[float, ...]) -> float:
    """Relative error of AC energy."""
    return math.fabs(energy[1] - fine[1]) / math.fabs(fine[1])
