"""Identities of the two-port, to 1e-9, and the difference between its two matched loads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form import heave_response, intrinsic_impedance
from matplotlib.image import imread
from measured_data import reference
from rig_command import rig_here
from synthetic_runs import CONFIG, Shape, default_rows, plan_json, run_rows, write_run
from wavebot_ports import BEM, PARAMS, sea

from rig.design.twoport import network as n
from rig.design.twoport.network import (
    available_load_power,
    available_power,
    flow,
    transducer_gain,
)
from rig.design.twoport.pictures import Case, TakeOff, impedances, vary, write_effects
from rig.kinds.wavebot.twin.two_port import MOTOR as WAVEBOT

F = np.linspace(0.2, 1.0, 33)
OMEGA = 2.0 * np.pi * F
Z_I = intrinsic_impedance(PARAMS, F)
DRIVETRAIN = n.linear_drivetrain(OMEGA, 40.0, 724.0, -3000.0)
PORT = n.two_port(OMEGA, DRIVETRAIN, WAVEBOT._replace(inductance=0.005))
EXACT = {"rtol": 1e-9, "atol": 0.0}


def test_constants_of_the_wavebot() -> None:
    """94.27 N/A of the two-port, 76.98 N/A of the drive, 28.1 W of copper at 1000 N amplitude."""
    assert WAVEBOT.transduction == pytest.approx(94.27, abs=0.005)
    assert WAVEBOT.transduction / np.sqrt(1.5) == pytest.approx(76.975, abs=0.005)
    assert 0.5 * WAVEBOT.copper * 1000.0**2 == pytest.approx(28.1, abs=0.05)


def test_intrinsic_impedance_equals_the_oracle() -> None:
    """Eq. 2.1 with A and B of the plant's radiation against its impedance as one expression."""
    body = PARAMS.body
    from closed_form import radiation

    radiated = radiation(PARAMS, F)
    added = radiated.imag / OMEGA
    damping = radiated.real + body.viscous
    intrinsic = n.intrinsic(OMEGA, body.inertia, added, damping, body.hydrostatic)
    assert np.allclose(intrinsic, Z_I, **EXACT)


def test_rotational_and_linear_drivetrain_are_equivalent() -> None:
    gear = WAVEBOT.gear
    shaft = n.rotational_drivetrain(OMEGA, 0.3, 4.0, -20.0)
    linear = n.linear_drivetrain(OMEGA, 0.3 * gear**2, 4.0 * gear**2, -20.0 * gear**2)
    assert np.allclose(gear**2 * shaft, linear, **EXACT)


def test_controller_and_load_convert_both_ways() -> None:
    law = n.controller(OMEGA, -2500.0, 3000.0)
    load = n.load_of(PORT, law)
    g = WAVEBOT.transduction
    assert np.allclose(load, -(g**2) / law - PORT.z22, **EXACT)
    assert np.allclose(n.controller_of(PORT, load), law, **EXACT)
    assert np.allclose(n.input_impedance(PORT, load), DRIVETRAIN - law, **EXACT)
    kp, ki = n.gains(OMEGA, law)
    assert np.allclose(kp, -2500.0, **EXACT)
    assert np.allclose(ki, 3000.0, **EXACT)


def test_the_mechanically_matched_load() -> None:
    """Z_in = Z_i* at Z_l = g^2 / (Z_i* - Z_11) - Z_w; it absorbs all available wave power."""
    load = n.mechanically_matched(PORT, Z_I)
    g = WAVEBOT.transduction
    assert np.allclose(load, g**2 / (np.conj(Z_I) - PORT.z11) - PORT.z22, **EXACT)
    assert np.allclose(n.input_impedance(PORT, load), np.conj(Z_I), **EXACT)
    assert np.abs(n.mismatch(PORT, Z_I, load).at_input).max() < 1e-9
    force = np.full(F.shape, 1000.0 + 300.0j)
    assert np.allclose(
        flow(PORT, Z_I, load, force).mechanical_1, available_power(Z_I, force), **EXACT
    )


def test_load_power_is_stationary_at_the_conjugate_of_z_out() -> None:
    load = n.electrically_matched(PORT, Z_I)
    force = np.full(F.shape, 1000.0 + 0.0j)
    best = flow(PORT, Z_I, load, force).ac
    assert np.allclose(best, available_load_power(PORT, Z_I, force), **EXACT)
    assert np.abs(n.mismatch(PORT, Z_I, load).at_output).max() < 1e-9
    for direction in (1.0, 1j, -1.0, -1j):
        step = 1e-4 * direction * np.abs(load)
        nearby_power = flow(PORT, Z_I, load + step, force).ac
        assert (nearby_power > best).all()
        assert np.allclose(nearby_power, best, rtol=1e-7)  # second order: 1e-4 squared


def test_power_equals_available_minus_reflected_power() -> None:
    """At both ports, for any load; and eq. 2.2: Z_i v = F_e - F_PTO."""
    force = np.full(F.shape, 900.0 - 200.0j)
    for kp, ki in ((-500.0, 0.0), (-2500.0, 3000.0), (-4000.0, -2000.0)):
        load = n.load_of(PORT, n.controller(OMEGA, kp, ki))
        power, mismatch = flow(PORT, Z_I, load, force), n.mismatch(PORT, Z_I, load)
        input_power = available_power(Z_I, force) * (1.0 - np.abs(mismatch.at_input) ** 2)
        load_power = available_load_power(PORT, Z_I, force) * (
            1.0 - np.abs(mismatch.at_output) ** 2
        )
        assert np.allclose(power.mechanical_1, input_power, **EXACT)
        assert np.allclose(power.ac, load_power, rtol=1e-9, atol=1e-9)
        pto = PORT.z11 * power.velocity + PORT.z12 * power.current
        assert np.allclose(Z_I * power.velocity, force - pto, **EXACT)
        voltage = PORT.z21 * power.velocity + PORT.z22 * power.current
        assert np.allclose(voltage, -load * power.current, **EXACT)
        assert np.allclose(power.force, n.controller(OMEGA, kp, ki) * power.velocity, **EXACT)
        copper = 0.5 * WAVEBOT.resistance * np.abs(power.current) ** 2
        assert np.allclose(power.ac, power.mechanical_2 + copper, rtol=1e-9, atol=1e-9)
        assert np.allclose(transducer_gain(PORT, Z_I, load), power.ac / available_power(Z_I, force))
        assert (transducer_gain(PORT, Z_I, load) < 1.0).all()


def test_both_matched_loads_are_equal_without_loss() -> None:
    """R_w = B_d = 0: then, and only then, one load satisfies both conditions of eq. 2.10."""
    lossless = n.two_port(
        OMEGA, n.linear_drivetrain(OMEGA, 40.0, 0.0, -3000.0), WAVEBOT._replace(resistance=0.0)
    )
    mechanical, electrical = (
        n.mechanically_matched(lossless, Z_I),
        n.electrically_matched(lossless, Z_I),
    )
    assert np.allclose(mechanical, electrical, **EXACT)
    for lossy in (
        n.two_port(OMEGA, n.linear_drivetrain(OMEGA, 40.0, 1.0, -3000.0), WAVEBOT),
        n.two_port(OMEGA, n.linear_drivetrain(OMEGA, 40.0, 0.0, -3000.0), WAVEBOT),
    ):
        mechanical, electrical = (
            n.mechanically_matched(lossy, Z_I),
            n.electrically_matched(lossy, Z_I),
        )
        assert np.abs(mechanical - electrical).min() > 1e-3


def test_difference_between_the_matched_loads() -> None:
    """At 0.4 Hz, a = 0.127 m, K_s = 0 the mechanically matched load consumes 28.8 W, while the
    electrically matched load extracts 77 W. BEM radiation; drivetrain 724 N s/m.
    """
    waves = sea(0.4, 0.127)
    z_i = intrinsic_impedance(PARAMS, np.array([0.4]), BEM)
    z = n.two_port(waves.omega, n.linear_drivetrain(waves.omega, 0.0, 724.0, 0.0), WAVEBOT)
    mechanical = flow(z, z_i, n.mechanically_matched(z, z_i), waves.excitation)
    electrical = flow(z, z_i, n.electrically_matched(z, z_i), waves.excitation)
    assert mechanical.ac[0] == pytest.approx(28.8, abs=0.1)
    assert mechanical.mechanical_1[0] == pytest.approx(-179.0, abs=0.5)
    assert electrical.ac[0] == pytest.approx(-77.0, abs=0.5)
    assert electrical.mechanical_1[0] > mechanical.mechanical_1[0] + 40.0


@pytest.mark.parametrize(("kp", "ki", "rate"), [(-2500.0, 0.0, 0.0), (-1500.0, 4000.0, -5905.0)])
def test_powers_against_the_closed_form_of_the_plant(kp: float, ki: float, rate: float) -> None:
    for f in (0.3, 0.5, 0.8):
        waves = sea(f, 0.127)
        z_i = intrinsic_impedance(PARAMS, np.array([f]))
        z11 = n.linear_drivetrain(waves.omega, 0.0, PARAMS.pto.viscous, rate)
        z = n.two_port(waves.omega, z11, WAVEBOT)
        load = n.load_of(z, n.controller(waves.omega, kp, ki))
        power = flow(z, z_i, load, waves.excitation)
        oracle = heave_response(PARAMS, BEM, f, 0.127, kp, ki, rate)
        assert power.mechanical_1[0] == pytest.approx(oracle.lcb, rel=1e-9)
        assert power.mechanical_2[0] == pytest.approx(oracle.trs, rel=1e-9)
        # The plant's torque constant and gear are rounded: copper loss to 1e-5.
        assert power.ac[0] == pytest.approx(oracle.ac, rel=1e-5)


def test_best_shaft_power_of_measured_impedances() -> None:
    """Measured Z_i and Z_id (20 A, -9228 N/m) in waves of 0.127 m: C = -Z_id* takes most at the
    shaft: -2370/+7958 and 143 W at 0.4 Hz, -2541/+2881 and 78 W at 0.5 Hz by an earlier, separate
    calculation on a fit to the same data (so within 7 %); Z_11 is their difference.
    """
    table = np.loadtxt(reference("mask4_impedance_20A_m9228_0p2_1Hz.csv"), delimiter=",")
    for f, kp, ki, watts in ((0.4, -2370.0, 7958.0, 143.0), (0.5, -2541.0, 2881.0, 78.0)):
        neighbours = (
            np.abs(table[:, 0] - f) < 0.021
        )  # mean of five lines, because single lines scatter
        z_i, z_id = (
            np.mean(table[neighbours, i] + 1j * table[neighbours, i + 1])[None] for i in (1, 3)
        )
        waves = sea(f, 0.127)
        z = n.two_port(waves.omega, z_id - z_i, WAVEBOT)
        law = -np.conj(z_id)
        power = flow(z, z_i, n.load_of(z, law), waves.excitation)
        best_kp, best_ki = n.gains(waves.omega, law)
        assert best_kp[0] == pytest.approx(kp, rel=0.07)
        assert best_ki[0] == pytest.approx(ki, rel=0.3)
        assert power.mechanical_2[0] == pytest.approx(-watts, rel=0.07)
        assert power.mechanical_2[0] == pytest.approx(available_power(z_id, waves.excitation)[0])


def test_effect_of_each_setting() -> None:
    """Chapter 5 of the report: the spring changes Im Z_in and both parts of Z_out; gains change
    Z_in and Z_l but not Z_out; Kp changes only the real part of Z_in, Ki only the imaginary part.
    """
    z11 = n.linear_drivetrain(OMEGA, 0.0, 724.0, 0.0)
    base = Case("base", -2000.0, 4000.0, 0.0, WAVEBOT.gear)

    def parts(case: Case) -> tuple[np.ndarray, ...]:
        result = impedances(TakeOff(OMEGA, Z_I, z11, WAVEBOT), case)
        return tuple(part for one in result for part in (one.real, one.imag))

    def changed(case: Case) -> list[bool]:
        pairs = zip(parts(case), parts(base), strict=True)
        return [bool(np.abs(a - b).max() > 1e-9 * np.abs(b).max()) for a, b in pairs]

    assert changed(base._replace(kp=-1000.0)) == [True, False, True, True, False, False]
    assert changed(base._replace(ki=1000.0)) == [False, True, True, True, False, False]
    assert changed(base._replace(spring_rate=-5e3)) == [False, True, False, False, True, True]
    assert changed(base._replace(gear=10.0)) == [True, False, True, True, True, True]


def test_figures(tmp_path: Path) -> None:
    z11 = n.linear_drivetrain(OMEGA, 0.0, 724.0, 0.0)
    base = Case("base", -2000.0, 4000.0, 0.0, WAVEBOT.gear)
    cases = vary(base, kp=1000.0, ki=3000.0)
    assert [case.label for case in cases[1:3]] == ["Kp -3000 N s/m (n)", "Kp -1000 N s/m (p)"]
    for name, cases_drawn in (("gains", cases), ("spring", vary(base, spring_rate=5e3, gear=4.0))):
        path = tmp_path / f"{name}.png"
        write_effects(
            path, TakeOff(OMEGA, Z_I, z11, WAVEBOT), cases_drawn, name, {"run": "r", "mode": "hil"}
        )
        assert float(imread(path)[..., :3].std()) > 0.05


def test_a_run_of_another_law_is_refused(tmp_path: Path) -> None:
    rows = default_rows()[:2]
    config = CONFIG | {"law": {"name": "velocity_table", "file": False}}
    run = write_run(
        tmp_path / "run", run_rows(rows, Shape()), plan_json(rows, Shape()), config=config
    )
    code, _, error = rig_here("twoport", run)
    assert code == 2
    assert "its law is velocity_table; the two-port theory needs a run of the law imp" in error
