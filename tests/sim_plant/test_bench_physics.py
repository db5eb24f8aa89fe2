"""Properties of the bench for any parameters: torsion, backlash, energy, brake, cell, stops."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from bench_files import DT, PERIOD, bench, changed, idle, oscillate

from rig.kinds.oswec_bench.rehearsal.compiled_plant import CompiledStepper
from sim_plant.bench import load_cell, transmission
from sim_plant.bench.world import OFF, Actuation, BenchWorld

QUIET = {
    "load_cell__force_noise": 0.0,
    "load_cell__torque_noise": 0.0,
    "load_cell__force_resolution": 0.0,
    "load_cell__torque_resolution": 0.0,
}


def torque(current: float, *, brake: float = 0.0, locked: int = 1) -> Actuation:
    return Actuation(1, 1, 0.0, current, brake, locked)


def hold(world: BenchWorld, actuation: Actuation, ticks: int) -> None:
    for _ in range(ticks):
        world.actuate(actuation)
        world.advance(DT)


def test_torsion_of_a_clamped_shaft() -> None:
    """Beyond the soft zone each N m twists by the three springs in series (thesis, eq. 2.3-2.5)."""
    shaft = 77.2e9 * math.pi * 0.042**4 / (32 * 0.089)
    stiffness = 1 / (1 / 141.0e3 + 1 / shaft + 1 / 41.25e3)
    world = bench(stepper=CompiledStepper)
    twist, shaft_torques = [], []
    for current in (1.0, 2.0, 3.0, 4.0, 5.0):
        hold(world, torque(current), 600)
        truth = world.truth()
        twist.append(truth.motor_angle - truth.shaft_angle)
        shaft_torques.append(truth.shaft_torque)
    assert shaft_torques[0] > 9.4
    assert np.polyfit(shaft_torques, twist, 1)[0] == pytest.approx(1 / stiffness, rel=1e-6)
    rest = np.array(twist) - np.array(shaft_torques) / stiffness
    assert rest == pytest.approx(math.radians(0.0228 + 0.034), rel=1e-6)  # gap and soft zone


def test_deflection_and_torque_are_each_others_inverse() -> None:
    spring = bench().params.transmission
    for load in (-95.0, -9.4, -3.0, -1e-6, 1e-6, 2.0, 9.4, 9.5, 150.0):
        wound = transmission.deflection(spring, load)
        assert transmission.torque(spring, wound) == pytest.approx(load, rel=1e-9)
    assert transmission.torque(spring, 0.999 * spring.half_gap) == 0.0


def test_backlash_is_a_play_operator() -> None:
    """Unbraked, the shaft is the play of the motor, by its definition over turning points.

    Between two turning points of the motor the shaft rests until the gap and the wind-up by
    friction have been crossed, and then keeps that distance.
    """
    world = bench("oswec_bench_unbraked", bearing__viscous=0.0)
    soft = math.radians(0.034) / 9.4
    ahead, behind = (math.radians(0.0228) + t * (1 / 28483.1 + soft) for t in (0.06, 0.12))
    motor, shaft = [], []
    for k in range(3000):
        volts = 0.6 * math.exp(-k / 1500) * math.sin(2 * math.pi * k * DT / 0.5)
        world.actuate(Actuation(1, 0, volts, 0.0, 0.0, 0))
        world.advance(DT)
        truth = world.truth()
        motor.append(truth.motor_angle)
        shaft.append(truth.shaft_angle)
    turns = [
        k
        for k in range(1, 2999)
        if (motor[k] - motor[k - 1]) * (motor[k + 1] - motor[k]) <= 0 and motor[k] != motor[k + 1]
    ]
    rest_angle, expected, last = 0.0, [], 0
    for turn in [*turns, 2999]:
        for k in range(last, turn + 1):
            direction = motor[turn] - motor[last]
            shaft_angle = (
                max(rest_angle, motor[k] - ahead)
                if direction > 0
                else min(rest_angle, motor[k] + behind)
            )
            expected.append(shaft_angle)
        rest_angle, last = expected[-1], turn + 1
    assert len(turns) > 8
    assert np.ptp(motor) > 20 * ahead
    np.testing.assert_allclose(shaft, expected, rtol=0.0, atol=1e-8)


def test_the_brake_never_gives_energy() -> None:
    """For any command, brake, bearing and seal only dissipate, within their holding torque."""
    draw = random.Random(3)
    world = bench(stepper=CompiledStepper, seal__clockwise=0.5, seal__counter=0.3)
    for _ in range(200):
        mode, volts, amps = draw.randrange(2), draw.uniform(-2, 2), draw.uniform(-8, 8)
        actuation = Actuation(1, mode, volts, amps, draw.choice([0.0, 0.1, 0.5, 1.0]), 0)
        for _ in range(40):
            world.actuate(actuation)
            world.advance(DT)
            truth = world.truth()
            assert truth.brake_power >= 0.0
            drag = 0.62 + 0.06 * (abs(truth.shaft_velocity) + 3.0)
            assert abs(truth.shaft_torque) <= truth.brake_torque + drag


def test_energy_of_a_driveline_run() -> None:
    """The motor's work equals that of shaft, gearbox and rotor over whole periods to 0.5 %."""
    world = bench(stepper=CompiledStepper)
    idle(world, 200)
    params, damping = world.params, 62.5
    brake = params.brake
    work = taken = rubbed = 0.0
    omega = 2 * math.pi / PERIOD
    before = world.truth()
    for k in range(4500):
        current = float(
            np.interp(damping * abs(before.shaft_velocity), brake.torques, brake.currents)
        )
        volts = math.radians(15) * omega / 1.535 * math.sin(omega * k * DT)
        world.actuate(Actuation(1, 0, volts, 0.0, current, 0))
        world.advance(DT)
        truth = world.truth()
        if k >= 1500:
            turned = truth.motor_angle - before.motor_angle
            work += truth.motor_torque * turned
            taken += truth.brake_power * DT
            rubbed += truth.gear_friction * abs(turned)
            rubbed += params.motor.viscous * truth.motor_velocity * turned
        before = truth
    assert taken > 0.8 * work > 0
    assert work == pytest.approx(taken + rubbed, rel=5e-3)


def test_two_branches_of_the_brake() -> None:
    """Up to 1 A and back: half the table's distance either way, 2 N m at first, 95 at most."""
    world = bench(stepper=CompiledStepper)
    brake = world.params.brake
    assert world.truth().brake_torque == 2.0
    branch = {}
    for name, currents in (("up", np.linspace(0, 1.1, 12)), ("down", np.linspace(1.1, 0, 12))):
        for current in currents:
            hold(world, OFF._replace(brake_current_a=float(current)), 100)
            branch[name, round(float(current), 2)] = world.truth().brake_torque
    assert max(branch.values()) == pytest.approx(95.0, abs=1e-6)
    for current in (0.2, 0.4, 0.6, 0.8):
        for name, sign in (("up", -1), ("down", 1)):
            middle = np.interp(current + sign * brake.half_width, brake.currents, brake.torques)
            assert branch[name, current] == pytest.approx(middle, abs=1e-6)
    hold(world, OFF, 100)
    remains = np.interp(brake.half_width, brake.currents, brake.torques)
    assert world.truth().brake_torque == pytest.approx(remains, abs=1e-6)


def test_cross_talk_is_recovered_by_its_matrix() -> None:
    """Six independent loads identify the matrix; its inverse recovers the wrench of a run."""
    params = bench(**QUIET).params.load_cell
    normals = [0.0] * 131072
    zero = np.array(load_cell.read(params, load_cell.Wrench(*[0.0] * 6), 0.0, 0, normals))
    loads = np.diag([50.0, 50.0, 50.0, 20.0, 20.0, 20.0])
    cell_readings = np.array(
        [load_cell.read(params, load_cell.Wrench(*row), 0.0, 0, normals) for row in loads]
    )
    matrix = np.linalg.solve(loads, cell_readings - zero).T
    assert np.abs(matrix - np.eye(6)).max() > 1e-3  # the cross-talk is not negligible
    world = bench(stepper=CompiledStepper, load_cell__drift=[0.0] * 6, **QUIET)
    hold(world, torque(4.0), 800)
    reading, truth = world.sense(), world.truth()
    raw = np.array([reading.fx, reading.fy, reading.fz, reading.tx, reading.ty, reading.tz])
    wrench = np.linalg.solve(matrix, raw - zero)
    carried = load_cell.wrench(params, truth.shaft_angle, truth.shaft_torque)
    np.testing.assert_allclose(wrench, carried, rtol=0.0, atol=1e-9)
    assert abs(raw[0] - zero[0] - carried.fx) > 1.0  # N, not applied


def test_cell_drift_matches_the_file() -> None:
    world = bench(stepper=CompiledStepper, load_cell__drift_time=2.0, **QUIET)
    start = world.sense().fz
    hold(world, OFF, 2001)
    assert world.sense().fz - start == pytest.approx(0.8 * (1 - math.exp(-1)), rel=1e-3)


def test_a_seed_repeats_and_another_differs() -> None:
    def cell_readings(seed: int) -> list[float]:
        return oscillate(bench(seed=seed, stepper=CompiledStepper), 10, 42, 1).torque.tolist()

    assert cell_readings(7) == cell_readings(7)
    assert cell_readings(7) != cell_readings(8)


def test_cell_noise_matches_the_file() -> None:
    world = bench(stepper=CompiledStepper, load_cell__torque_resolution=0.0)
    read = []
    for _ in range(4000):
        world.advance(DT)
        read.append(world.sense().tz)
    assert np.std(read) == pytest.approx(0.02, rel=0.05)


def running(world: BenchWorld) -> None:
    hold(world, Actuation(1, 0, 0.5, 0.0, 0.1, 0), 300)
    assert world.sense().enabled == 1
    assert world.truth().shaft_velocity > 0.5


def test_e_stop_removes_power_and_the_brake_stops_the_motion() -> None:
    world = bench()
    running(world)
    world.press_e_stop()
    hold(world, Actuation(1, 0, 0.5, 0.0, 0.1, 0), 50)
    reading = world.sense()
    assert (reading.e_stop, reading.enabled, reading.fault) == (1, 0, 0)
    assert world.truth().shaft_velocity == 0.0
    world.press_e_stop(False)
    hold(world, Actuation(1, 0, 0.5, 0.0, 0.1, 0), 300)
    assert world.sense().enabled == 1


def test_limit_switch_removes_power() -> None:
    world = bench(sensors__travel=10.0)
    hold(world, Actuation(1, 0, 0.5, 0.0, 0.1, 0), 800)
    reading = world.sense()
    assert (reading.limit_switch, reading.enabled) == (1, 0)
    assert math.degrees(world.truth().shaft_angle) < 12.0


def test_missing_and_invalid_commands_trip_the_drive() -> None:
    world = bench()
    running(world)
    for _ in range(210):
        world.advance(DT)
    assert (world.sense().enabled, world.sense().fault) == (0, 1)
    hold(world, OFF, 5)
    assert world.sense().fault == 0
    running(world)
    hold(world, Actuation(1, 0, math.nan, 0.0, 0.1, 0), 2)
    assert (world.sense().enabled, world.sense().fault) == (0, 1)
    assert math.isfinite(world.truth().motor_angle)
    hold(world, OFF, 5)
    running(world)


def test_a_lost_brake_and_a_slipped_coupling_show_in_the_readings() -> None:
    world = bench()
    running(world)
    ahead = world.params.sensors
    before = world.sense()
    world.slip_coupling(math.radians(1.0))
    hold(world, Actuation(1, 0, 0.0, 0.0, 0.5, 0), 50)
    after = world.sense()
    motor = (after.motor_counts - before.motor_counts) / ahead.motor_counts
    shaft = (after.shaft_counts - before.shaft_counts) / ahead.shaft_counts
    assert math.degrees(shaft - motor) == pytest.approx(1.0, abs=0.2)  # plus gap and torsion
    assert after.brake_current_a == pytest.approx(0.5, abs=0.01)
    world.cut_brake_current()
    hold(world, Actuation(1, 0, 0.0, 0.0, 0.5, 0), 50)
    assert world.sense().brake_current_a == pytest.approx(0.0, abs=0.01)
    assert world.truth().brake_torque < 3.0


def test_the_motor_runs_no_faster_than_its_voltage_allows() -> None:
    """37.5 rev/s at the motor, 15.7 rad/s at the output, unbraked under full current."""
    world = bench("oswec_bench_unbraked", stepper=CompiledStepper, sensors__travel=360.0)
    hold(world, torque(11.0, locked=0), 400)
    assert 0.95 * 15.708 < world.truth().motor_velocity < 15.708


def test_any_bench_obeys_the_laws_of_physics() -> None:
    """Random gaps, stiffnesses, inertias: everything stays finite and no part delivers energy."""
    draw = random.Random(5)
    for seed in range(6):
        world = bench(
            seed=seed,
            stepper=CompiledStepper,
            transmission__gearbox_stiffness=draw.uniform(1.0e4, 3.0e5),
            transmission__half_gap=draw.uniform(0.0, 0.2),
            transmission__soft_deflection=draw.uniform(0.0, 0.1),
            transmission__soft_torque=draw.uniform(1.0, 30.0),
            gearbox__dry=draw.uniform(0.0, 4.0),
            motor__inertia=draw.uniform(5.0e-5, 2.0e-3),
        )
        for _ in range(10):
            volts, amps = draw.uniform(-1.0, 1.0), draw.uniform(-6.0, 6.0)
            shaft_torques, locked = draw.choice([0.0, 0.2, 1.0]), draw.choice([0, 0, 1])
            actuation = Actuation(1, draw.randrange(2), volts, amps, shaft_torques, locked)
            for _ in range(150):
                world.actuate(actuation)
                world.advance(DT)
                truth = world.truth()
                assert all(map(math.isfinite, truth))
                assert truth.brake_power >= 0.0
                assert abs(truth.motor_velocity) < 16.0


def test_current_limit_holds_the_velocity_loop() -> None:
    """A clamped shaft: the loop uses its full current limit and no more."""
    world = bench(stepper=CompiledStepper)
    hold(world, Actuation(1, 0, 3.0, 0.0, 0.0, 1), 400)
    truth = world.truth()
    assert truth.motor_torque == pytest.approx(11.173 * 18.0, rel=1e-6)
    assert truth.shaft_torque + truth.gear_friction >= truth.motor_torque - 1e-6
    assert truth.motor_velocity == pytest.approx(0.0, abs=1e-3)


def test_other_tick_length_is_refused() -> None:
    with pytest.raises(ValueError, match="advances by"):
        bench().advance(0.002)
    with pytest.raises(ValueError, match="dt must be"):
        BenchWorld(changed(), dt=0.01, seed=1)
