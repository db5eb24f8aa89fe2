"""Coverage of the intervals of bench sessions: share that contains the hidden true value."""

import math
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.support import blind_bench
from benchmarks.support.blind_bench import GEAR_RATIO, NOMINAL_GAIN, SessionRow
from benchmarks.support.result import Figure, Result, figure
from rig.kinds.oswec_bench.products import (
    brake_map,
    losses,
    torque_constant,
    torque_map,
    velocity_constant,
)
from rig.kinds.oswec_bench.products.estimate import Estimate
from sim_plant.bench import brake

SEEDS, SHORT_SEEDS = 200, 4
NOMINAL_COVERAGE = 95.0
DEGREE = math.pi / 180.0
AMPLITUDES = (5.0, 10.0, 15.0, 20.0)  # deg
CURRENTS = (1.12, 1.96, 2.79, 3.35, 3.91, 4.47)  # A, of Table 3.1
BRAKE_CURRENTS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.7, 0.5, 0.3, 0.1, 0.0)  # A

Coverage = dict[str, tuple[bool, float]]
"""By constant: True if its interval contains the truth; half width relative to the truth."""


def measure(short: bool) -> Result:
    """Draw benches, simulate and analyse their sessions, count the covered constants."""
    benches: list[Coverage] = []
    seeds = SHORT_SEEDS if short else SEEDS
    for seed in range(seeds):
        benches.append(analyse_bench(seed))
        if (seed + 1) % 10 == 0:
            print(f"coverage: {seed + 1} of {seeds} benches", file=sys.stderr, flush=True)
    return build_result(benches, short=short)


def build_result(benches: list[Coverage], *, short: bool) -> Result:
    """Return the result of the benches with seeds 0, 1, 2 ..."""
    seeds = len(benches)
    return Result(
        "coverage",
        "share of blind benches whose constants lie within the stated 95 % intervals",
        f"{seeds} benches drawn from seeds 0 to {seeds - 1}; torque constant, velocity constant, "
        "losses, driveline and brake map of each",
        tuple(_figures(benches, short=short)),
        (
            "Sessions are shorter than those in configs/sessions, and simulated without the loop.",
            "The brake's torque is that of the load cell, including the bearing, as in the "
            "session.",
        ),
    )


def _figures(benches: list[Coverage], *, short: bool) -> Iterator[Figure]:
    # Three standard deviations of a share of so many seeds below the stated coverage.
    min_share = NOMINAL_COVERAGE - 300.0 * math.sqrt(0.95 * 0.05 / len(benches))
    for name in benches[0]:
        inside = [each[name][0] for each in benches if name in each]
        half_widths = [100.0 * each[name][1] for each in benches if name in each]
        share = 100.0 * float(np.mean(inside))
        yield figure(
            f"{name}: share inside", "%", share, at_least=None if short else round(min_share, 1)
        )
        yield figure(f"{name}: half width", "%", half_widths)


def analyse_bench(seed: int) -> Coverage:
    """Return the coverage of the constants of one bench by its sessions."""
    values = blind_bench.draw_constants(seed)
    benches = (
        *_torque_constants(values, seed), *_velocity_constants(values, seed),
        *_driveline_constants(values, seed), *_brake_constants(values, seed),
    )  # fmt: skip
    return {
        name: (estimate.covers(truth), estimate.uncertainty / abs(truth))
        for name, estimate, truth in benches
    }


Constants = Iterator[tuple[str, Estimate, float]]


def _torque_constants(values: dict[str, float], seed: int) -> Constants:
    rows = [SessionRow({"current_amplitude_a": a}, a, 10.0, 3) for a in CURRENTS]
    run = blind_bench.simulate_session(values, seed, "torque_constant", rows)
    motor = torque_constant.analyse_session(run).constants["torque_constant_motor"]
    yield "torque constant of the motor", motor, GEAR_RATIO * values["motor.torque_constant"]
    rows = [_sine_row(a, period, 10) for a in AMPLITUDES for period in (1.5, 3.0)]
    run = blind_bench.simulate_session(values, seed, "losses", rows)
    constants = losses.analyse_session(run, motor).constants
    yield "bearing, clockwise", constants["bearing_positive"], values["bearing.clockwise"]
    yield "bearing, counter-clockwise", constants["bearing_negative"], values["bearing.counter"]
    yield "bearing, viscous", constants["bearing_viscous"], values["bearing.viscous"]
    # The load does not vary, so the share of the bearing's torque is part of the dry friction.
    share = 0.5 * (values["gearbox.share_forward"] + values["gearbox.share_back"])
    load = 0.5 * (values["bearing.clockwise"] + values["bearing.counter"])
    load += values["bearing.viscous"] * float(
        np.mean([np.abs(p.reference_velocity).mean() for p in run.points])
    )
    yield "gearbox, dry", constants["gearbox_dry"], values["gearbox.dry"] + share * load


def _velocity_constants(values: dict[str, float], seed: int) -> Constants:
    rows = [_sine_row(a, 1.5, 10) for a in (5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0)]
    run = blind_bench.simulate_session(values, seed, "velocity_constant", rows)
    constants = velocity_constant.analyse_session(run).constants["velocity_constant"]
    yield "velocity constant", constants, values["velocity_loop.gain"]


def _driveline_constants(values: dict[str, float], seed: int) -> Constants:
    rows = [_sine_row(a, 1.5, 4, damping=r) for a in AMPLITUDES for r in (42.0, 83.3)]
    run = blind_bench.simulate_session(values, seed, "driveline", rows)
    fit = torque_map.fit_map([torque_map.bin_deflection(point.motion()) for point in run.points])
    transmission = blind_bench.build_plant(values, with_brake=True).build().transmission
    yield "half gap", fit.half_gap, values["transmission.half_gap"] * DEGREE
    yield "soft zone", fit.soft_zone, values["transmission.soft_deflection"] * DEGREE
    yield "stiffness", fit.stiffness, transmission.stiffness


def _brake_constants(values: dict[str, float], seed: int) -> Constants:
    rows = [
        _sine_row(15.0, 3.0, 3)._replace(brake=current, plan_row={"brake_current_a": current})
        for current in BRAKE_CURRENTS
    ]
    run = blind_bench.simulate_session(values, seed, "brake_map", rows)
    branches: Any = brake_map.analyse_session(run).maps["brake_map"]
    params = blind_bench.build_plant(values, with_brake=True).build()
    for name, sign in (("rising", -1.0), ("falling", 1.0)):
        branch = branches[name]
        i = int(np.argmin(np.abs(np.array(branch["current_a"]) - 0.5)))
        speed = 15.0 * DEGREE * 2.0 * math.pi / 3.0 * values["velocity_loop.gain"] / NOMINAL_GAIN
        dry = 0.5 * (params.bearing.clockwise + params.bearing.counterclockwise)
        # Where the shaft has at least half its top speed, its mean is 3 sqrt(3) / 2 pi of it.
        friction = dry + params.bearing.viscous * speed * 1.5 * math.sqrt(3.0) / math.pi
        magnetisation = 0.5 + sign * params.brake.half_width
        truth = brake.torque_of_magnetisation(params.brake, magnetisation) + friction
        half = branch["uncertainty_n_m"][i]
        constants = Estimate(branch["torque_n_m"][i], half, "N*m", "")
        yield f"brake at 0.5 A, {name}", constants, truth


def _sine_row(amplitude: float, period: float, periods: int, damping: float = 0.0) -> SessionRow:
    """Return a row with a sine of an amplitude (deg) at the nominal velocity constant."""
    volts = amplitude * DEGREE * 2.0 * math.pi / period / NOMINAL_GAIN
    plan_row = {"amplitude_deg": amplitude, "period_s": period, "damping_n_m_s_per_rad": damping}
    return SessionRow(plan_row, volts, period, periods, damping=damping)
