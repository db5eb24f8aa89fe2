"""The lifted plant and law compared with the same arithmetic in C, and with scipy's integrator.

The C file has the same operations in the same order, so its energies must equal those of the
lifted functions to the last bit, and both times are for the same work. scipy integrates the
continuous model (the law without its sampling) to a tolerance at which its power is as far from
that of a fine solution as the power of the lifted functions.
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

from benchmarks.support.campaigns import open_checked
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
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.devices import build_world
from sim_plant import (
    analyser,
    body,
    cots_drive,
    custom_drive,
    electrics,
    magnetic_spring,
    pto,
    wavebot,
)
from sim_plant.parts import bus, drive, friction

MAX_RATIO_TO_C, MIN_RATIO_TO_SCIPY = 1.3, 100.0
KP, KI, RAMP = -2500.0, 4000.0, 0.5
STATOR_TRAVEL = 20.0  # % beyond the start, so that the table of spring rates is used
CC_OPTIONS = ("-O2", "-ffp-contract=off", "-shared", "-fPIC", "-lm")
FINE_TOLERANCE, LOOSEST_TOLERANCE = 1e-10, 1e-2  # relative tolerances of the integrator

_LIFTED_MODULES = (
    analyser, biquads, blocks, body, bus, cots_drive, custom_drive, drive, electrics, friction,
    impedance,
    magnetic_spring, pto, wavebot,
)  # fmt: skip
_SOURCE = '''"""Generated: heave, spring, commercial drive and PI law in one compiled function."""

from numba import njit

from controllers import impedance
from controllers.signals import Estimate, Gains
from sim_plant import body, electrics, magnetic_spring, pto, wavebot
from sim_plant.body import BodyState


@njit(cache=True)
def simulate(params, supplied, law, at_rest, gains, per_ampere, table, start, target, dt, ticks):
    hull = BodyState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    stator = magnetic_spring.stator_at_rest(params.spring, start)
    passive = magnetic_spring.force(params.spring, stator.rate, 0.0)
    memory = at_rest
    mechanical = ac = dc = 0.0
    for tick in range(ticks):
        now, after = table[tick % len(table)], table[(tick + 1) % len(table)]
        estimate = Estimate(hull.position, hull.velocity, 0.0)
        memory, demand = impedance.step(law, memory, gains, estimate, 0.0, 0.0, dt)
        driven = electrics.command_step(
            params.electrics, supplied, demand.force / per_ampere, 1, 1, 1, hull.velocity, dt
        )
        motor = params.pto.force_per_current * driven.mean_current
        x, v = body.predict(params.body, hull, now + motor + passive, 0.5 * dt)
        passive = wavebot.passive_force(params, stator.rate, x, v, 0.0)
        midway = passive
        hull = body.correct(params.body, hull, x, v, 0.5 * (now + after) + motor + passive, dt)
        stator = magnetic_spring.stator_step(params.spring, stator, target, 1, dt)
        passive = wavebot.passive_force(params, stator.rate, hull.position, hull.velocity, 0.0)
        power_ac = motor * v + pto.copper_loss(params.pto, motor)
        power_dc = power_ac + electrics.cots_drive.loss(
            params.electrics.cots, driven.mean_current
        )
        supplied = electrics.power_step(params.electrics, supplied, driven, 1, power_ac, dt)
        mechanical = mechanical + (motor + midway) * v * dt
        ac = ac + power_ac * dt
        dc = dc + power_dc * dt
    return mechanical, ac, dc, supplied.analyser.power_ac
'''


def build_model(folder: Path) -> Model:
    """Return the model of the default rig."""
    campaign, _ = open_checked(write_campaign_file(folder, 12.0))
    devices = job.plant_settings(campaign)
    dt = 1.0 / campaign.rig.rate_hz
    begin = build_world(devices | {"compiled": False}, dt).conditions()
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


def compiled_simulation(model: Model) -> Callable[[int], tuple[float, ...]]:
    """Return the compiled functions of plant and law: energies (J) after a number of ticks."""
    simulate = lifting.load("benchmark_arithmetic", _SOURCE, _LIFTED_MODULES).simulate
    law = impedance.Params(RAMP)
    supplied = electrics.initial(model.params.electrics)

    def run(ticks: int) -> tuple[float, ...]:
        energies: tuple[float, ...] = simulate(
            model.params, supplied, law, impedance.start(law), model.gains,
            model.newtons_per_ampere, model.excitation, model.stator_start, model.stator_target,
            model.dt, ticks,
        )  # fmt: skip
        return energies

    return run


def c_simulation(model: Model, folder: Path) -> Callable[[int], tuple[float, ...]] | None:
    """Return the same simulation in C; None without a C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    library = folder / "arithmetic.so"
    source = ROOT / "benchmarks" / "arithmetic.c"
    subprocess.run([compiler, str(source), "-o", str(library), *CC_OPTIONS], check=True)
    simulate = ctypes.CDLL(str(library)).simulate
    params, spring = model.params, model.params.spring
    constants = np.array([
        *lifting.flatten(params.body), *lifting.flatten(params.pto),
        *lifting.flatten(params.electrics.drive), *lifting.flatten(params.electrics.cots),
        spring.angle_per_metre, spring.force_per_rate, spring.sine, spring.effect, spring.speed,
        KP, KI, RAMP, model.newtons_per_ampere,
    ], dtype=np.float64)  # fmt: skip
    stations, rates = np.array(spring.stator_positions), np.array(spring.rates)
    double, integer = ctypes.c_double, ctypes.c_int

    def pointer(array: Floats) -> Any:
        return array.ctypes.data_as(ctypes.POINTER(double))

    simulate.restype = None

    def run(ticks: int) -> tuple[float, ...]:
        energy = np.zeros(4)
        simulate(
            pointer(constants), pointer(stations), pointer(rates), integer(len(stations)),
            pointer(model.excitation), integer(len(model.excitation)), double(model.stator_start),
            double(model.stator_target), double(params.electrics.analyser_window),
            double(model.dt), ctypes.c_long(ticks), pointer(energy),
        )  # fmt: skip
        return tuple(energy.tolist())

    return run


def measure(short: bool) -> Result:
    """Compare bits and times in alternating blocks, then the integrator at equal accuracy."""
    blocks_, seconds, span = (3, 200.0, 6.0) if short else (15, 2000.0, 20.0)
    with tempfile.TemporaryDirectory() as scratch:
        model = build_model(Path(scratch))
        compiled, in_c = compiled_simulation(model), c_simulation(model, Path(scratch))
        ticks = round(seconds / model.dt)
        compiled(1)  # compiles
        compiled_s, c_s = list[float](), list[float]()
        differing = 0
        for _ in range(blocks_):
            seconds_, energy = _timed(compiled, ticks)
            compiled_s.append(seconds_)
            if in_c is not None:
                seconds_c, energy_c = _timed(in_c, ticks)
                c_s.append(seconds_c)
                differing += sum(a != b for a, b in zip(energy, energy_c, strict=True))
        energies = compiled(round(span / model.dt))
        sampled, continuous = (
            _solve_as_accurately(solve, model, span, energies)
            for solve in (solve_sampled_law, solve_continuous_law)
        )
    per_second = [one / seconds for one in compiled_s]
    compared = (
        (
            figure("lifted / C", "ratio", ratios(compiled_s, c_s), at_most=MAX_RATIO_TO_C),
            figure("energies that differ in any bit", "of 4", differing, at_most=0),
        )
        if c_s
        else ()
    )
    return Result(
        "arithmetic",
        "heave, spring, drive and PI law in steps of 1 ms: lifted, in C, and by scipy",
        f"{blocks_} blocks of {seconds:g} s, alternating; scipy once over {span:g} s",
        (
            figure("lifted", "x real time", [1.0 / one for one in per_second]),
            *compared,
            *_scipy_figures("", sampled, span, per_second, MIN_RATIO_TO_SCIPY),
            *_scipy_figures(", a law without ticks", continuous, span, per_second, None),
        ),
        () if c_s else ("no C compiler on the PATH: not compared with C",),
    )


class _ScipyRun(NamedTuple):
    """scipy at the loosest tolerance that is as accurate as the lifted functions."""

    seconds: float  # of processor
    tolerance: float  # relative
    error: float  # of AC energy
    own_error: float  # of AC energy, of the lifted functions


def _solve_as_accurately(
    solve: Callable[[Model, float, float], tuple[float, ...]],
    model: Model,
    span: float,
    energies: tuple[float, ...],
) -> _ScipyRun:
    fine_energies = solve(model, span, FINE_TOLERANCE)
    own_error, tolerance = _relative_error(energies, fine_energies), LOOSEST_TOLERANCE
    while True:
        began = time.process_time()
        error = _relative_error(solve(model, span, tolerance), fine_energies)
        seconds = time.process_time() - began
        if error <= own_error or tolerance <= 10.0 * FINE_TOLERANCE:
            return _ScipyRun(seconds, tolerance, error, own_error)
        tolerance /= 3.0


def _scipy_figures(
    suffix: str, scipy: _ScipyRun, span: float, per_second: list[float], at_least: float | None
) -> tuple[Figure, ...]:
    ratio = scipy.seconds / span / float(np.median(per_second))
    return (
        figure(f"scipy solve_ivp / lifted{suffix}", "ratio", ratio, at_least=at_least),
        figure("  error of mean AC power, lifted", "%", 100.0 * scipy.own_error),
        figure("  error of mean AC power, scipy", "%", 100.0 * scipy.error),
        figure("  relative tolerance of scipy", "1", scipy.tolerance),
    )


def _timed(
    simulation: Callable[[int], tuple[float, ...]], ticks: int
) -> tuple[float, tuple[float, ...]]:
    began = time.process_time()
    energy = simulation(ticks)
    return time.process_time() - began, energy


def _relative_error(energy: tuple[float, ...], fine_energies: tuple[float, ...]) -> float:
    """Relative error of AC energy."""
    return math.fabs(energy[1] - fine_energies[1]) / math.fabs(fine_energies[1])
