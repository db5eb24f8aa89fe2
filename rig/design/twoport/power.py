"""Power transfer of a two-port: motion, power into it and into its load, and available power.

Powers are means over a cycle, W, from phasors of peak values, line by line. Absorbed power is
negative, and so is power into a load.
"""

from typing import NamedTuple

import numpy as np

from rig.design.twoport.network import Complexes, Floats, TwoPort, input_impedance, output_impedance


class Flow(NamedTuple):
    """Motion and power at each frequency."""

    velocity: Complexes  # m/s
    current: Complexes  # A of the two-port, i_out
    force: Complexes  # N, motor force on the body, C v
    mechanical_1: Floats  # W at the column load cell: into the two-port
    mechanical_2: Floats  # W at the shaft torque sensor: into the motor
    ac: Floats  # W at the motor's terminals: into the load


def flow(z: TwoPort, z_i: Complexes, load: Complexes, excitation: Complexes) -> Flow:
    """Return motion and power under an excitation force (N): eq. 2.2 with F_PTO = Z_in v."""
    z_in = input_impedance(z, load)
    velocity: Complexes = excitation / (z_i + z_in)
    current: Complexes = -z.z21 * velocity / (z.z22 + load)
    force: Complexes = -z.z12 * current
    square_speed = np.abs(velocity) ** 2
    return Flow(
        velocity,
        current,
        force,
        -0.5 * z_in.real * square_speed,
        0.5 * np.real(force * np.conj(velocity)),
        -0.5 * load.real * np.abs(current) ** 2,
    )


def available_power(z_i: Complexes, excitation: Complexes) -> Floats:
    """Return the maximum power that waves can give a take-off, W: -|F_e|^2 / (8 Re Z_i)."""
    return -(np.abs(excitation) ** 2) / (8.0 * z_i.real)


def available_load_power(z: TwoPort, z_i: Complexes, excitation: Complexes) -> Floats:
    """Return the maximum power that hull and take-off can give a load, W: -|V|^2 / (8 Re Z_out).

    V is the open-circuit voltage of the output.
    """
    voltage = z.z21 * excitation / (z_i + z.z11)
    return -(np.abs(voltage) ** 2) / (8.0 * output_impedance(z, z_i).real)


def transducer_gain(z: TwoPort, z_i: Complexes, load: Complexes) -> Floats:
    """Return load power over available wave power; at most 1, negative if the load drives."""
    one = np.ones_like(z_i)
    return flow(z, z_i, load, one).ac / available_power(z_i, one)
