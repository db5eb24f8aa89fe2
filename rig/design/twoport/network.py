"""The power take-off as a two-port: eq. 2.1 to 2.10 of the MASK4 report (Sandia).

F_PTO of eq. 2.2 is minus the force on the body, V_out = -Z_l i_out. The controller's law
F = C v on the body, C = Kp + Ki / (j omega), is the load Z_l = -g^2 / C - Z_w with the transduction
g = sqrt(3/2) Kt N.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class Motor(NamedTuple):
    """Motor and gear."""

    torque_constant: float  # N m/A, Kt
    gear: float  # rad/m, N: motor radians per metre of the body
    resistance: float  # ohm, R_w
    inductance: float = 0.0  # H, L_w

    @property
    def transduction(self) -> float:
        """g = sqrt(3/2) Kt N: newtons per ampere of the two-port, volts per m/s."""
        return float(np.sqrt(1.5)) * self.torque_constant * self.gear

    @property
    def copper(self) -> float:
        """Copper loss per force squared, W/N^2: R_w / g^2."""
        return self.resistance / (self.transduction * self.transduction)


WAVEBOT = Motor(6.1745, 12.4666, 0.5)
"""The WaveBot's heave motor (public fbWecCntrl repository, demo_waveBot.m)."""


class TwoPort(NamedTuple):
    """The matrix Z of eq. 2.4 at each frequency: F_PTO, V_out of v, i_out."""

    z11: Complexes  # N s/m
    z12: Complexes  # N/A
    z21: Complexes  # V s/m
    z22: Complexes  # ohm


def intrinsic(
    omega: Floats, mass: float, added: Floats, damping: Floats, stiffness: float
) -> Complexes:
    """Z_i of eq. 2.1, N s/m: mass and added mass in kg, damping in N s/m, stiffness in N/m."""
    made: Complexes = damping + 1j * (omega * (mass + added) - stiffness / omega)
    return made


def rotational_drivetrain(omega: Floats, inertia: float, damping: float, rate: float) -> Complexes:
    """Z_d of eq. 2.7 at the motor's shaft, N m s/rad: kg m^2, N m s/rad, N m/rad."""
    made: Complexes = 1j * omega * inertia + damping + rate / (1j * omega)
    return made


def linear_drivetrain(omega: Floats, mass: float, damping: float, spring_rate: float) -> Complexes:
    """Z_11 = N^2 Z_d on the body's side, N s/m: kg, N s/m and the spring rate K_s in N/m."""
    made: Complexes = 1j * omega * mass + damping + spring_rate / (1j * omega)
    return made


def two_port(omega: Floats, z11: Complexes, motor: Motor) -> TwoPort:
    """Z of eq. 2.5 and 2.6; ``z11`` as `linear_drivetrain`, or N^2 times the rotational Z_d.

    A measured series impedance, Z_id - Z_i, is ``z11`` as it is.
    """
    g = np.full(omega.shape, motor.transduction, dtype=np.complex128)
    winding = np.asarray(motor.resistance + 1j * omega * motor.inductance, dtype=np.complex128)
    return TwoPort(z11, -g, g, winding)


def geared(
    drivetrain: Complexes, spring: Complexes, motor: Motor, gear: float
) -> tuple[Complexes, Motor]:
    """Z_11 and motor with another gear ratio (rad/m): what turns with the motor scales with N^2.

    ``drivetrain`` is Z_11 without the magnetic spring, which keeps its own gear; both N s/m.
    """
    made: Complexes = drivetrain * (gear / motor.gear) ** 2 + spring
    return made, motor._replace(gear=gear)


def controller(omega: Floats, kp: float, ki: float) -> Complexes:
    """C = Kp + Ki / (j omega), N s/m: force on the body per velocity; Kp < 0 absorbs."""
    return np.asarray(kp + ki / (1j * omega), dtype=np.complex128)


def gains(omega: Any, response: Any) -> tuple[Any, Any]:
    """Kp (N s/m) and Ki (N/m) that give C at one frequency."""
    return np.real(response), -omega * np.imag(response)


def load_of(z: TwoPort, response: Complexes) -> Complexes:
    """Z_l (ohm) of a controller; infinite where it does nothing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        made: Complexes = z.z12 * z.z21 / response - z.z22
    return made


def controller_of(z: TwoPort, load: Complexes) -> Complexes:
    """C (N s/m) of a load."""
    made: Complexes = z.z12 * z.z21 / (load + z.z22)
    return made


def input_impedance(z: TwoPort, load: Complexes) -> Complexes:
    """Z_in of eq. 2.8, N s/m: the power take-off with its load, as the hull feels it."""
    made: Complexes = z.z11 - z.z12 * z.z21 / (z.z22 + load)
    return made


def output_impedance(z: TwoPort, z_i: Complexes) -> Complexes:
    """Z_out of eq. 2.9, ohm: hull and power take-off, as the load feels them."""
    made: Complexes = z.z22 - z.z12 * z.z21 / (z.z11 + z_i)
    return made


def mechanically_matched(z: TwoPort, z_i: Complexes) -> Complexes:
    """The load (ohm) with Z_in = Z_i* (eq. 2.10a): most power into the take-off."""
    made: Complexes = z.z12 * z.z21 / (z.z11 - np.conj(z_i)) - z.z22
    return made


def electrically_matched(z: TwoPort, z_i: Complexes) -> Complexes:
    """The load (ohm) Z_out* (eq. 2.10b): most power into the load."""
    return np.conj(output_impedance(z, z_i))


def reflection(z: Complexes, source: Complexes) -> Complexes:
    """Mismatch (z - source*) / (z + source): 0 where they are conjugates, size 1 at no power."""
    made: Complexes = (z - np.conj(source)) / (z + source)
    return made


class Mismatch(NamedTuple):
    """How far a take-off is from both conditions of eq. 2.10."""

    at_input: Complexes  # reflection of Z_in against Z_i
    at_output: Complexes  # reflection of Z_l against Z_out
    resistance_in: Floats  # N s/m, Re Z_in - Re Z_i
    reactance_in: Floats  # N s/m, Im Z_in + Im Z_i
    resistance_out: Floats  # ohm, Re Z_l - Re Z_out
    reactance_out: Floats  # ohm, Im Z_l + Im Z_out


def mismatch(z: TwoPort, z_i: Complexes, load: Complexes) -> Mismatch:
    """Both conditions, as reflections and as their four real parts (chapter 5 of the report)."""
    z_in, z_out = input_impedance(z, load), output_impedance(z, z_i)
    return Mismatch(
        reflection(z_in, z_i),
        reflection(load, z_out),
        z_in.real - z_i.real,
        z_in.imag + z_i.imag,
        load.real - z_out.real,
        load.imag + z_out.imag,
    )
