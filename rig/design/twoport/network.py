"""The power take-off as a two-port and its power: eq. 2.1 to 2.10 of the MASK4 report (Sandia).

F_PTO of eq. 2.2 is minus the force on the body; V_out = -Z_l i_out. The control law
F = C v on the body, C = Kp + Ki / (j omega), corresponds to the load Z_l = -g^2 / C - Z_w with the
transduction g = sqrt(3/2) Kt N.

Powers are means over a cycle, W, from phasors of peak values, line by line. Absorbed power is
negative, and so is power into a load.
"""

from typing import Any, NamedTuple

import numpy as np

from rig.spectra.periods import Complexes, Floats


class Motor(NamedTuple):
    """Motor and gear ratio."""

    torque_constant: float  # N m/A, Kt
    gear: float  # rad/m, N: motor radians per metre of the body
    resistance: float  # ohm, R_w
    inductance: float = 0.0  # H, L_w

    @property
    def newtons_per_ampere(self) -> float:
        """Kt N: newtons per ampere of drive current."""
        return self.torque_constant * self.gear

    @property
    def transduction(self) -> float:
        """g = sqrt(3/2) Kt N: newtons per ampere of the two-port, volts per m/s."""
        return float(np.sqrt(1.5)) * self.torque_constant * self.gear

    @property
    def copper(self) -> float:
        """Copper loss per force squared, W/N^2: R_w / g^2."""
        return self.resistance / (self.transduction * self.transduction)


class TwoPort(NamedTuple):
    """The matrix Z of eq. 2.4 at each frequency, from (v, i_out) to (F_PTO, V_out)."""

    z11: Complexes  # N s/m
    z12: Complexes  # N/A
    z21: Complexes  # V s/m
    z22: Complexes  # ohm


def intrinsic(
    omega: Floats, mass: float, added: Floats, damping: Floats, stiffness: float
) -> Complexes:
    """Return Z_i of eq. 2.1, N s/m.

    Mass and added mass are in kg, damping in N s/m, stiffness in N/m.
    """
    return damping + 1j * (omega * (mass + added) - stiffness / omega)


def rotational_drivetrain(omega: Floats, inertia: float, damping: float, rate: float) -> Complexes:
    """Return Z_d of eq. 2.7 at the motor's shaft, N m s/rad: kg m^2, N m s/rad, N m/rad."""
    return 1j * omega * inertia + damping + rate / (1j * omega)


def linear_drivetrain(omega: Floats, mass: float, damping: float, spring_rate: float) -> Complexes:
    """Return Z_11 = N^2 Z_d on the body's side, N s/m: kg, N s/m and the spring rate K_s in N/m."""
    return 1j * omega * mass + damping + spring_rate / (1j * omega)


def two_port(omega: Floats, z11: Complexes, motor: Motor) -> TwoPort:
    """Return Z of eq. 2.5 and 2.6; ``z11`` as `linear_drivetrain`, or N^2 times the rotational Z_d.

    A measured drivetrain impedance, Z_id - Z_i, can be used as ``z11`` directly.
    """
    g = np.full(omega.shape, motor.transduction, dtype=np.complex128)
    winding = np.asarray(motor.resistance + 1j * omega * motor.inductance, dtype=np.complex128)
    return TwoPort(z11, -g, g, winding)


def geared(
    drivetrain: Complexes, spring: Complexes, motor: Motor, gear: float
) -> tuple[Complexes, Motor]:
    """Return Z_11 and motor at another gear ratio (rad/m); the drivetrain scales with N^2.

    ``drivetrain`` is Z_11 without the magnetic spring, which has its own gear; both N s/m.
    """
    scaled: Complexes = drivetrain * (gear / motor.gear) ** 2 + spring
    return scaled, motor._replace(gear=gear)


def controller(omega: Floats, kp: float, ki: float) -> Complexes:
    """Return C = Kp + Ki / (j omega), N s/m: force on the body per velocity; Kp < 0 absorbs."""
    return np.asarray(kp + ki / (1j * omega), dtype=np.complex128)


def gains(omega: Any, response: Any) -> tuple[Any, Any]:
    """Return Kp (N s/m) and Ki (N/m) of a response C at each frequency."""
    return np.real(response), -omega * np.imag(response)


def load_of(z: TwoPort, response: Complexes) -> Complexes:
    """Return Z_l (ohm) of a controller; infinite where its response is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        load: Complexes = z.z12 * z.z21 / response - z.z22
    return load


def controller_of(z: TwoPort, load: Complexes) -> Complexes:
    """Return C (N s/m) of a load."""
    return z.z12 * z.z21 / (load + z.z22)


def input_impedance(z: TwoPort, load: Complexes) -> Complexes:
    """Return Z_in of eq. 2.8, N s/m: the power take-off with its load, seen from the hull."""
    return z.z11 - z.z12 * z.z21 / (z.z22 + load)


def output_impedance(z: TwoPort, z_i: Complexes) -> Complexes:
    """Return Z_out of eq. 2.9, ohm: hull and power take-off, seen from the load."""
    return z.z22 - z.z12 * z.z21 / (z.z11 + z_i)


def mechanically_matched(z: TwoPort, z_i: Complexes) -> Complexes:
    """Return the load (ohm) with Z_in = Z_i* (eq. 2.10a): maximum power into the take-off."""
    return z.z12 * z.z21 / (z.z11 - np.conj(z_i)) - z.z22


def electrically_matched(z: TwoPort, z_i: Complexes) -> Complexes:
    """Return the load (ohm) Z_out* (eq. 2.10b): maximum power into the load."""
    return np.conj(output_impedance(z, z_i))


def reflection(z: Complexes, source: Complexes) -> Complexes:
    """Return (z - source*) / (z + source): 0 for conjugates, magnitude 1 for no power."""
    return (z - np.conj(source)) / (z + source)


class Mismatch(NamedTuple):
    """Deviation of a power take-off from both conditions of eq. 2.10."""

    at_input: Complexes  # reflection of Z_in against Z_i
    at_output: Complexes  # reflection of Z_l against Z_out


def mismatch(z: TwoPort, z_i: Complexes, load: Complexes) -> Mismatch:
    """Return both conditions as reflections (report, chapter 5)."""
    z_in, z_out = input_impedance(z, load), output_impedance(z, z_i)
    return Mismatch(reflection(z_in, z_i), reflection(load, z_out))


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
