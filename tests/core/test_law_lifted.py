"""Every compiled law equals the interpreted one bit by bit, also with NaN and infinity.

These inputs also show that no law turns them into a finite force larger than the law gives
for the motions and gains of the test.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from law_lifting import DT, Inputs, Law, compiled, interpreted, same_bits, state_of

from controllers import (
    blocks,
    brake_damping,
    drive_gating,
    estimator,
    impedance,
    magnetic_spring,
    open_loop,
    oswec_position,
    position_hold,
    signal_generator,
    station_keeping,
    torque_tracking,
)
from controllers.oswec_position import Components, EnvelopeTimes, PeriodicReference
from controllers.signals import Estimate, Gains, SpringCommand
from rig.compilation import lifting
from rig.design.impedance import design
from rig.laws import OWN_MODULES

TICKS = 3000
FORCE = 3e5  # N, larger than any force of a law here for finite input


def motion(rng: np.random.Generator) -> Estimate:
    return Estimate(*(rng.normal(size=3) * [0.2, 0.5, 2.0]).tolist())


def gains(tick: int) -> Gains:
    """Return set points that change every 150 ticks, so that half the ticks are within a ramp."""
    rng = np.random.default_rng(tick // 150)
    return Gains(*(rng.normal(size=3) * [2e3, 5e3, 100.0]).tolist())


def of_impedance(rng: np.random.Generator, tick: int) -> Inputs:
    reference = float(rng.normal() * 300.0)
    deficit = float(rng.choice([0.0, rng.normal() * 500.0]))
    return gains(tick), motion(rng), reference, deficit


def of_station(rng: np.random.Generator, tick: int) -> Inputs:
    return gains(tick), motion(rng)


def of_hold(rng: np.random.Generator, tick: int) -> Inputs:
    return float(np.random.default_rng(tick // 700).normal() * 0.1), motion(rng)


def of_gate(rng: np.random.Generator, tick: int) -> Inputs:
    v, i, threshold = (rng.normal(size=3) * [0.1, 2.0, 0.1]).tolist()
    return v, i, float(rng.choice([0.0, threshold]))


def of_reference(rng: np.random.Generator, tick: int) -> Inputs:
    slow = np.random.default_rng(tick // 80)
    scale, realisation = float(slow.normal()), int(slow.integers(-1, 4))
    return scale, realisation, int(rng.choice([tick - 20, 3 * 10**9 + tick]))


def of_signal(rng: np.random.Generator, tick: int) -> Inputs:
    row = np.random.default_rng(tick // 130)
    kind, amplitude = float(row.integers(0, 4)), float(row.normal() * 500.0)
    frequency, end = row.uniform(0.0, 20.0, 2).tolist()
    return (signal_generator.SetPoint(kind, amplitude, frequency, end, float(row.uniform(0, 0.2))),)


def of_estimator(rng: np.random.Generator, tick: int) -> Inputs:
    return float(rng.normal() * 0.1), int(rng.integers(1, 4))


def of_spring(rng: np.random.Generator, tick: int) -> Inputs:
    rate = float(np.random.default_rng(tick // 50).uniform(-12e3, 10e3))
    return rate, int(rng.integers(0, 2))


def of_position(rng: np.random.Generator, tick: int) -> Inputs:
    row = np.random.default_rng(tick // 500)
    columns = row.normal(size=(4, 5)) * [0.2, 5.0, 3.0, 0.1, 0.01] + [0, 0, 0, 1, 0]
    components = Components(*map(tuple, columns.T.tolist()))
    clock = DT * (tick % 500) - 0.05
    return (
        components,
        PeriodicReference(1, 3, EnvelopeTimes(0.1, 0.3)),
        clock,
        float(40.0 * math.sin(0.02 * tick) + rng.normal()),
    )


def of_tracking(rng: np.random.Generator, tick: int) -> Inputs:
    reference, measured = (rng.normal(size=2) * 40.0).tolist()
    return reference, measured, float(rng.choice([0.0, rng.normal() * 10.0]))


def of_brake(rng: np.random.Generator, tick: int) -> Inputs:
    damping = float(rng.choice([0.0, 42.0, 104.0]))
    return damping, float(rng.choice([0.0, 0.4])), float(rng.normal())


ONE = design([-800.0, -1900.0], [1.0, 0.5], DT)
THREE = design(
    [-4594.69, -75223.29, -668098.5, -543002.2, 0.0],
    [1.0, 18.185, 155.3015, 660.4136, 1316.647, 922.0699],
    DT,
)
TABLE = tuple(np.random.default_rng(9).normal(scale=400.0, size=37).tolist())
SPRING = magnetic_spring.Params((-1e4, -3e3, 500.0, 8e3), (67.0, 7.0, -13.0, -93.0), 0.5)
MAP = (-0.0044, -0.0014, -0.0005, 0.0005, 0.0014, 0.0044)  # rad
AT_REST = magnetic_spring.State(SpringCommand(0.0, 0.0, 0), 0)

LAWS = {
    "impedance": Law(
        impedance, impedance.Params(0.1), impedance.start(impedance.Params(0.1)), of_impedance
    ),
    "impedance, one section": Law(
        impedance,
        impedance.Params(0.1, ONE),
        impedance.start(impedance.Params(0.1, ONE)),
        of_impedance,
    ),
    "impedance, three sections": Law(
        impedance,
        impedance.Params(0.1, THREE),
        impedance.start(impedance.Params(0.1, THREE)),
        of_impedance,
    ),
    "reference": Law(open_loop, open_loop.Params(TABLE, 0.05, 1), open_loop.start(), of_reference),
    "reference, three": Law(
        open_loop, open_loop.Params(TABLE, 0.05, 3), open_loop.start(), of_reference
    ),
    "reference, none": Law(
        open_loop, open_loop.Params((), 0.05, 1), open_loop.start(), of_reference, min_outcomes=1
    ),
    "reference, array": Law(
        open_loop, open_loop.Params(TABLE, 0.05, 1), open_loop.start(), of_reference, table="table"
    ),
    "signal generator": Law(
        signal_generator, signal_generator.Params(0.05), signal_generator.start(), of_signal
    ),
    "station keeping": Law(
        station_keeping,
        station_keeping.Params(0.1, 0.02, 0.2, 3e4, 4e4),
        station_keeping.start(),
        of_station,
    ),
    "gate": Law(
        drive_gating,
        drive_gating.Params(3.0, 0.0),
        drive_gating.start(),
        of_gate,
        takes_dt=False,
        min_outcomes=2,
    ),
    "gate, hysteresis": Law(
        drive_gating,
        drive_gating.Params(0.0, 0.3),
        drive_gating.start(),
        of_gate,
        takes_dt=False,
        min_outcomes=2,
    ),
    "hold": Law(
        position_hold,
        position_hold.Params(0.05, 2e4, 3e3, 0.1, 0.2),
        position_hold.start(),
        of_hold,
    ),
    "estimator": Law(
        estimator,
        estimator.Params(0.2, 20.0, 1000.0),
        Estimate(0.0, 0.0, 0.0),
        of_estimator,
        returns="state",
    ),
    "position": Law(
        oswec_position,
        oswec_position.Params((), (), 100.0, 0.005, 0.2),
        oswec_position.start(),
        of_position,
    ),
    "position in the instant": Law(
        oswec_position,
        oswec_position.Params((-90.0, -9.0, -1.0, 1.0, 9.0, 90.0), MAP, 100.0, 0.004, 0.2),
        oswec_position.start(),
        of_position,
    ),
    "torque": Law(
        torque_tracking,
        torque_tracking.Params(17.0, 16.0, 0.3, 20.0, 30.0),
        torque_tracking.start(),
        of_tracking,
    ),
    "brake": Law(
        brake_damping,
        brake_damping.Params((2.0, 30.0, 95.0), (0.0, 0.3, 1.0), 50.0, 0.0075),
        brake_damping.start(),
        of_brake,
        returns="state",
        min_outcomes=300,
    ),
    "magnetic spring": Law(
        magnetic_spring,
        SPRING,
        AT_REST,
        of_spring,
        returns="state",
        takes_dt=False,
        min_outcomes=50,
    ),
}


def test_every_law_is_tested() -> None:
    """Signals and blocks are no laws; the blocks are compiled with every law that uses them.

    tests/batch/test_batch_bits.py compiles the heave laws in the place of the impedance law.
    """
    folder = Path(impedance.__file__).parent
    files = {path.stem for path in folder.glob("*.py")} - {"__init__", "law", "signals"}
    heave_laws = {module.rpartition(".")[2] for module in OWN_MODULES.values()}
    files -= {"blocks", "biquads", "turning_point", *(heave_laws - {"impedance"})}
    assert files == {law.module.__name__.split(".")[-1] for law in LAWS.values()}


@pytest.fixture(scope="module", params=LAWS)
def pair(request: pytest.FixtureRequest) -> Any:
    law = LAWS[request.param]
    return law, compiled(law)


def test_compiled_and_interpreted_give_the_same_bits(pair: Any) -> None:
    law, tick = pair
    for seed in (1, 2):
        rng, state = np.random.default_rng(seed), law.start
        outcomes = set()
        for n in range(TICKS):
            inputs = law.inputs(rng, n)
            returned = interpreted(law, state, inputs)
            numbers = lifting.flatten(returned)
            assert same_bits(numbers, tick(state, inputs)), (n, inputs)
            assert all(map(math.isfinite, numbers))
            state = state_of(law, returned)
            outcomes.add(tuple(numbers))
        assert len(outcomes) >= law.min_outcomes


def spoiled(inputs: Inputs, rng: np.random.Generator) -> Inputs:
    """Return the inputs with one float replaced by NaN or infinity."""
    floats = [i for i, leaf in enumerate(leaves(inputs)) if isinstance(leaf, float)]
    at, bad = int(rng.choice(floats)), float(rng.choice([math.nan, math.inf, -math.inf]))

    def rebuilt(tree: Any, start: int) -> tuple[Any, int]:
        if not isinstance(tree, tuple):
            return (bad if start == at else tree), start + 1
        parts = []
        for item in tree:
            part, start = rebuilt(item, start)
            parts.append(part)
        return (tuple(parts) if type(tree) is tuple else type(tree)(*parts)), start

    rebuilt_tree: Inputs = rebuilt(inputs, 0)[0]
    return rebuilt_tree


def leaves(tree: Any) -> list[Any]:
    if isinstance(tree, tuple):
        return [leaf for item in tree for leaf in leaves(item)]
    return [tree]


def test_compiled_and_interpreted_agree_for_values_that_are_not_finite(pair: Any) -> None:
    """One float in twenty ticks is NaN or infinite: the same bits or NaN on both sides.

    A law with such a value in its memory restarts after ten ticks.
    """
    law, tick = pair
    rng, state, caught, bad_forces = np.random.default_rng(3), law.start, 0, 0
    for n in range(TICKS):
        inputs = law.inputs(rng, n)
        if n % 20 == 0:
            inputs = spoiled(inputs, rng)
        returned = interpreted(law, state, inputs)
        numbers = lifting.flatten(returned)
        assert same_bits(numbers, tick(state, inputs)), (n, inputs)
        force = numbers[-1]
        if law.returns == "state, given":
            assert not math.isfinite(force) or abs(force) <= FORCE
            bad_forces += not math.isfinite(force)
        state = state_of(law, returned)
        caught = 0 if all(map(math.isfinite, lifting.flatten(state))) else caught + 1
        if caught == 10:
            state, caught = law.start, 0
    if law.returns == "state, given" and law.min_outcomes > 2:  # a force that is not always zero
        assert bad_forces > 50


ROOM = """'''Generated: functions of the laws other than `step`.'''

from numba import njit
from controllers import open_loop, position_hold, station_keeping


@njit(cache=True, error_model="numpy")
def others():
    hold = position_hold.rezero(position_hold.start(), 0.25)
    there = position_hold.arrived(hold, 0.25)
    return hold.target, there, open_loop.start(), station_keeping.start()
"""


def test_the_other_functions_of_the_laws_compile_too() -> None:
    module = lifting.load("law_room", ROOM, (blocks, open_loop, position_hold, station_keeping))
    assert module.others() == module.others.py_func()
