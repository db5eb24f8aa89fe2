"""The best P, PI and spring settings for a sea, at each power station.

The law is F = (Kp v + Ki x) H, H what estimator, delay and current loop make of it (1: nothing).
Powers of all lines of the sea add up; the drive's loss knows mean |i| of the whole record: that of
a sine for one line, of a Gaussian current for many.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from rig.design.twoport.network import Complexes, Floats, Motor, controller, linear_drivetrain

Station = Literal["mechanical_1", "mechanical_2", "ac", "dc"]

KP = (-20_000.0, 0.0)  # N s/m; Kp > 0 would drive the body
KI = (-30_000.0, 30_000.0)  # N/m
_STARTS = 4  # in each direction: surfaces have one valley, but a bent one


class Sea(NamedTuple):
    """Lines of a sea as the device feels them."""

    omega: Floats  # rad/s
    excitation: Complexes  # N, peak, of exp(+j omega t)


class Device(NamedTuple):
    """What is known of a device at the lines of a sea."""

    z_i: Complexes  # N s/m, intrinsic impedance
    mass: float  # kg, of the drivetrain on the body's side
    damping: float  # N s/m, of the drivetrain
    motor: Motor
    stiffness: float  # N/m, hydrostatic: what a stable setting must not use up
    loop: Complexes | None = None  # H; None: 1


class Drive(NamedTuple):
    """Loss of a drive: fixed + linear mean|i| + square mean i^2 of the drive current."""

    fixed: float  # W
    linear: float  # W/A
    square: float  # W/A^2
    newtons_per_ampere: float  # Kt N


class Setting(NamedTuple):
    """What an operator sets."""

    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m


class Powers(NamedTuple):
    """Mean power at the stations (W, negative is absorbed) and the motion."""

    mechanical_1: float
    mechanical_2: float
    ac: float
    dc: float
    position_rms: float  # m
    current_rms: float  # A of the drive


def powers(device: Device, drive: Drive, sea: Sea, setting: Setting) -> Powers:
    """What a setting gives in a sea."""
    omega = sea.omega
    made = controller(omega, setting.kp, setting.ki)
    law = made if device.loop is None else made * device.loop
    z11 = linear_drivetrain(omega, device.mass, device.damping, setting.spring_rate)
    velocity = sea.excitation / (device.z_i + z11 - law)
    size = 0.5 * np.abs(velocity) ** 2
    square_force = float(np.sum(np.abs(law) ** 2 * size))
    shaft = float(np.sum(law.real * size))
    ac = shaft + device.motor.copper * square_force
    rms = float(np.sqrt(square_force)) / drive.newtons_per_ampere
    mean = rms * float(np.sqrt(8.0) / np.pi if omega.size == 1 else np.sqrt(2.0 / np.pi))
    return Powers(
        float(np.sum((law - z11).real * size)),
        shaft,
        ac,
        ac + drive.fixed + drive.linear * mean + drive.square * rms * rms,
        float(np.sqrt(np.sum(size / omega**2))),
        rms,
    )


class Bounds(NamedTuple):
    """Where settings are looked for."""

    kp: tuple[float, float] = KP
    ki: tuple[float, float] = KI
    spring_rate: tuple[float, float] = (0.0, 0.0)  # equal: the spring stays there
    least_stiffness: float = 3000.0  # N/m, of K_h + K_s - Ki


class Optimum(NamedTuple):
    """The best setting for one station."""

    station: Station
    setting: Setting
    powers: Powers
    at_bound: tuple[str, ...]  # settings that stand at their bound: the true best lies beyond


def optimum(
    device: Device, drive: Drive, sea: Sea, station: Station, bounds: Bounds | None = None
) -> Optimum:
    """The setting within ``bounds`` at which a station absorbs most.

    Equal ends of a bound hold a setting: ``ki=(0, 0)`` asks for the best P. ValueError if nothing
    within the bounds leaves the least stiffness.
    """
    bounds = bounds or Bounds()
    ranges = np.array([bounds.kp, bounds.ki, bounds.spring_rate])
    stiff = device.stiffness - bounds.least_stiffness
    if ranges[1, 0] - ranges[2, 1] > stiff:
        raise ValueError(
            f"Ki of at least {ranges[1, 0]:g} N/m leaves less than {bounds.least_stiffness:g} N/m"
        )
    scale = np.maximum(np.ptp(ranges, axis=1), 1e-9)

    def at(shares: Floats) -> Setting:
        """The setting at shares 0 .. 1 of the ranges, Ki within what stiffness leaves."""
        kp, ki, rate = (ranges[:, 0] + np.clip(shares, 0.0, 1.0) * np.ptp(ranges, axis=1)).tolist()
        return Setting(kp, min(ki, stiff + rate), rate)

    def cost(shares: Floats) -> float:
        return float(getattr(powers(device, drive, sea, at(shares)), station))

    best = _least(cost, np.ptp(ranges, axis=1) > 0.0)
    setting = at(best)
    ends = zip(Setting._fields, setting, ranges, scale, strict=True)
    edge = [
        name for name, value, (low, high), room in ends
        if high > low and min(value - low, high - value) < 1e-4 * room
    ]  # fmt: skip
    if setting.ki > stiff + setting.spring_rate - 1e-3 and "ki" not in edge:
        edge.append("ki")
    return Optimum(station, setting, powers(device, drive, sea, setting), tuple(edge))


def _least(cost: Callable[[Floats], float], free: Floats) -> Floats:
    """The place of the least cost in the unit cube over the free directions."""
    axes = [np.linspace(0.02, 0.98, _STARTS * 3) if one else np.zeros(1) for one in free]
    starts = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    costs = np.array([cost(start) for start in starts])
    best, least = starts[0], np.inf
    for start in starts[np.argsort(costs)[:_STARTS]]:
        found = minimize(
            cost, start, method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(axes),
            options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 2000},
        )  # fmt: skip
        if found.fun < least:
            best, least = np.asarray(found.x), float(found.fun)
    return np.asarray(best, dtype=np.float64)
