"""The two-port theory against the published optima of another program, from the hull's own BEM.

WecOptTool's WaveBot tutorial (Sandia): regular waves of 0.0625 m at 0.3 Hz; a lossless take-off,
then one of 12 rad/m, 6.7 N m/A, 0.5 ohm, 2 kg m2 and 1 N m s/rad. Without its limit of force the
optima are -138.8 W mechanical and -29.1 W electrical.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rig.design.twoport import network
from rig.design.twoport.network import Motor
from sim_plant.bem import excitation_at, read_bem

BEM = Path(__file__).resolve().parents[2] / "configs" / "plants" / "wavebot_bem.nc"
OMEGA = 2.0 * np.pi * np.array([0.3])
TOP, BOTTOM, CYLINDER, CONE = 0.88, 0.35, 0.16, 0.37  # m, radii and wetted heights of the hull
DENSITY, GRAVITY = 1000.0, 9.81


def test_wavebot_tutorial_of_wecopttool() -> None:
    """Within 1.5 %: the mechanical optimum has the radiation damping of the tutorial's coarse mesh.

    The electrical one hardly depends on it: 0.5 %.
    """
    hull = read_bem(BEM)
    frequency = OMEGA / (2.0 * np.pi)
    added, damping = (
        np.interp(frequency, hull.frequency, values) for values in (hull.added_mass, hull.damping)
    )
    cone = math.pi * CONE / 3.0 * (TOP**2 + TOP * BOTTOM + BOTTOM**2)
    mass = DENSITY * (math.pi * TOP**2 * CYLINDER + cone)
    stiffness = DENSITY * GRAVITY * math.pi * TOP**2
    z_i = network.intrinsic(OMEGA, mass, added, damping, stiffness)
    force = 0.0625 * excitation_at(hull, frequency)
    assert network.available_power(z_i, force)[0] == pytest.approx(-138.8, rel=0.015)
    motor = Motor(6.7, 12.0, 0.5)
    drivetrain = network.rotational_drivetrain(OMEGA, 2.0, 1.0, 0.0)
    ports = network.two_port(OMEGA, motor.gear**2 * drivetrain, motor)
    assert network.available_load_power(ports, z_i, force)[0] == pytest.approx(-29.1, rel=0.005)
