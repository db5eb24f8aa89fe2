"""World: time order, delay, determinism, waves, sensors, cost."""

from __future__ import annotations

import ast
import cmath
import math
import statistics
from pathlib import Path

import pytest
from plant_files import DT, QUIET, ROOT, bem, command, plant, surge_bem, world

from sim_plant import sea_states
from sim_plant.world import Readings, World


def history(rig: World, ticks: int) -> list[Readings]:
    out = []
    for k in range(ticks):
        read = rig.readings()
        out.append(read)
        rig.actuate(
            command(3.0 * math.sin(k * 0.003), wave_trigger=1, stator_target=-10.0, stator_enable=1)
        )
        rig.advance(DT)
    return out


def test_equal_worlds_read_the_same_to_the_bit() -> None:
    sea = sea_states.jonswap(0.127, 2.5, 3.3, 10.0, seed=4)
    first, second, other = (history(world(sea, seed=seed), 3000) for seed in (1, 1, 2))
    assert first == second
    assert first != other


@pytest.mark.parametrize("delay", [0, 1, 7, 20])
def test_readings_are_delay_ticks_old(delay: int) -> None:
    rig = world(sea_states.regular(0.1, 0.5), **QUIET, sensors__delay_ticks=delay)
    truths = []
    for k in range(2000):
        truths.append(rig.truth())
        read = rig.readings()
        then = truths[max(k - delay, 0)]
        assert read.string_pot == then.position
        assert read.elevation == then.elevation
        assert read.force_trs == then.motor
        assert read.force_lcb == pytest.approx(then.motor + then.spring + then.friction, abs=1e-9)
        rig.actuate(command(1.0, wave_trigger=1))
        rig.advance(DT)


def test_forces_lag_as_a_filter_of_first_order() -> None:
    """1/(1 + j omega tau) within 0.1 %, tau = 19.4 ms, at 1 Hz."""
    rig = world(name="wavebot_as_measured", **QUIET, sensors__delay_ticks=0)
    lag, omega = rig.params.sensors.heave_force_lag, 2.0 * math.pi
    assert lag == 0.0194
    read, true = [0j, 0j], [0j, 0j]
    for k in range(12_000):
        rig.actuate(command(10.0 * math.sin(omega * k * DT)))
        rig.advance(DT)
        if k >= 8000:
            now, truth, turn = rig.readings(), rig.truth(), cmath.exp(-1j * omega * k * DT)
            column = truth.motor + truth.spring + truth.friction
            read = [read[0] + now.force_lcb * turn, read[1] + now.force_trs * turn]
            true = [true[0] + column * turn, true[1] + truth.motor * turn]
    for measured, force in zip(read, true, strict=True):
        assert abs(measured / force * (1.0 + 1j * omega * lag) - 1.0) < 1e-3


def test_advance_refuses_another_dt() -> None:
    with pytest.raises(ValueError, match="advances by"):
        world().advance(0.002)
    with pytest.raises(ValueError, match="dt must be"):
        World(plant(), sea_states.calm(), bem(), surge_bem(), dt=0.1, seed=1)


def test_waves_start_at_the_rising_edge_and_repeat_to_the_bit() -> None:
    rig = world(sea_states.regular(0.127, 0.5))
    for _ in range(1000):
        rig.actuate(command())
        rig.advance(DT)
        assert rig.truth()[3] == 0.0
    excitations, elevations = [], []
    for k in range(14000):
        rig.actuate(command(wave_trigger=1))
        truth = rig.truth()
        assert truth.wave_clock == pytest.approx(k * DT)
        excitations.append(truth.excitation)
        elevations.append(truth.elevation)
        rig.advance(DT)
    assert excitations[0] == 0.0
    onset = [abs(e) for e in elevations[:5000]]
    assert max(onset[:500]) < 0.127 * 0.03
    assert max(elevations[5000:]) == pytest.approx(0.127)
    assert excitations[6000:8000] == excitations[8000:10000] == excitations[12000:14000]
    rig.actuate(command())
    rig.advance(DT)
    assert rig.truth().excitation == 0.0


def test_encoder_counts() -> None:
    rig = world(**QUIET)
    rig.release(0.1)
    rig.advance(DT)
    rig.advance(DT)
    offset = plant().sensors.encoder_offset.value
    per_metre = 20000 * 12.4666 / (2 * math.pi)
    assert (rig.readings().heave_counts - offset) / per_metre == pytest.approx(0.1, abs=1e-4)


def test_noise_and_bias_match_the_file() -> None:
    rig = world()
    pots, lcb, trs = [], [], []
    for _ in range(5000):
        rig.advance(DT)
        read = rig.readings()
        pots.append(read.string_pot)
        lcb.append(read.force_lcb)
        trs.append(read.force_trs)
    for values, bias, noise in ((pots, 0.004, 0.0002), (lcb, 15.0, 3.0), (trs, -6.0, 2.0)):
        assert statistics.fmean(values) == pytest.approx(bias, rel=0.03)
        assert statistics.stdev(values) == pytest.approx(noise, rel=0.05)
    assert abs(statistics.correlation(lcb, trs)) < 0.06


def test_diverged_run_does_not_raise() -> None:
    rig = world()
    for position in (1e12, math.inf, math.nan):
        rig.release(position)
        for _ in range(5):
            rig.actuate(command(1.0))
            rig.advance(DT)
    assert rig.readings().heave_counts == 0
    assert math.isnan(rig.readings().string_pot)


def test_sim_plant_is_self_contained_and_uses_no_clock() -> None:
    allowed = {"__future__", "collections", "errno", "fractions", "functools", "h5netcdf",
               "itertools", "math", "numpy", "os", "pathlib", "pydantic", "sim_plant", "stat",
               "typing"}  # fmt: skip
    for path in Path(ROOT / "sim_plant").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                assert {alias.name.split(".")[0] for alias in node.names} <= allowed, path
            if isinstance(node, ast.ImportFrom):
                assert str(node.module).split(".", maxsplit=1)[0] in allowed, path
