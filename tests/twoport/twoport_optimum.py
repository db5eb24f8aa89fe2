"""Optimal P, PI and spring settings for a sea, by theory: the reference of predictions.

The law is F = (Kp v + Ki x) H; H is the response of estimator, delay and current loop (1: ideal).
The powers of all lines of the sea add. The drive's loss depends on mean |i| of the whole record,
which is that of a sine for one line and of a Gaussian current for many lines.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from rig.design.twoport.network import Motor, controller, linear_drivetrain
from rig.spectra.periods import Complexes, Floats

Station = Literal["mechanical_1", "mechanical_2", "ac", "dc"]

KP_RANGE = (-20_000.0, 0.0)  # N s/m; Kp > 0 would drive the body
KI_RANGE = (-30_000.0, 30_000.0)  # N/m
_GRID = 12  # points per direction, from the best of which the search descends


class Sea(NamedTuple):
    """Excitation of the device by the lines of a sea."""

    omega: Floats  # rad/s
    excitation: Complexes  # N, peak values, exp(+j omega t)


class Device(NamedTuple):
    """Linear model of a device at the lines of a sea."""

    z_i: Complexes  # N s/m, intrinsic impedance
    mass: float  # kg, of the drivetrain, on the body's side
    damping: float  # N s/m, of the drivetrain
    motor: Motor
    stiffness: float  # N/m, hydrostatic; limits Ki
    loop: Complexes | None = None  # H; None: 1


class Drive(NamedTuple):
    """Loss of a drive: fixed + linear mean|i| + square mean i^2 of the drive current."""

    fixed: float  # W
    linear: float  # W/A
    square: float  # W/A^2
    newtons_per_ampere: float  # Kt N


class Setting(NamedTuple):
    """Settings of an operator."""

    kp: float  # N s/m
    ki: float  # N/m
    spring_rate: float  # N/m


class Powers(NamedTuple):
    """Mean power at the stations (W, absorbed is negative), motion and current."""

    mechanical_1: float
    mechanical_2: float
    ac: float
    dc: float
    position_rms: float  # m
    current_rms: float  # A, drive current


def powers(device: Device, drive: Drive, sea: Sea, setting: Setting) -> Powers:
    """Return powers, motion and current of a setting in a sea."""
    omega = sea.omega
    response = controller(omega, setting.kp, setting.ki)
    law = response if device.loop is None else response * device.loop
    z11 = linear_drivetrain(omega, device.mass, device.damping, setting.spring_rate)
    velocity = sea.excitation / (device.z_i + z11 - law)
    half_square_speed = 0.5 * np.abs(velocity) ** 2
    square_force = float(np.sum(np.abs(law) ** 2 * half_square_speed))
    shaft = float(np.sum(law.real * half_square_speed))
    ac = shaft + device.motor.copper * square_force
    rms = float(np.sqrt(square_force)) / drive.newtons_per_ampere
    mean = rms * float(np.sqrt(8.0) / np.pi if omega.size == 1 else np.sqrt(2.0 / np.pi))
    return Powers(
        float(np.sum((law - z11).real * half_square_speed)),
        shaft,
        ac,
        ac + drive.fixed + drive.linear * mean + drive.square * rms * rms,
        float(np.sqrt(np.sum(half_square_speed / omega**2))),
        rms,
    )


class Bounds(NamedTuple):
    """Bounds of the search."""

    kp: tuple[float, float] = KP_RANGE
    ki: tuple[float, float] = KI_RANGE
    spring_rate: tuple[float, float] = (0.0, 0.0)  # equal ends: fixed spring
    min_stiffness: float = 3000.0  # N/m, of K_h + K_s - Ki


class Optimum(NamedTuple):
    """The best setting for one station."""

    station: Station
    setting: Setting
    powers: Powers
    at_bound: tuple[str, ...]  # settings at their bound: the unconstrained optimum lies beyond


def optimum(
    device: Device, drive: Drive, sea: Sea, station: Station, bounds: Bounds | None = None
) -> Optimum:
    """Return the setting within ``bounds`` at which a station absorbs most.

    Equal ends of a bound fix a setting: ``ki=(0, 0)`` gives the best P. Raises ValueError if no
    setting within the bounds leaves the minimum stiffness.
    """
    bounds = bounds or Bounds()
    ranges = np.array([bounds.kp, bounds.ki, bounds.spring_rate])
    stiffness_margin = device.stiffness - bounds.min_stiffness
    if ranges[1, 0] - ranges[2, 1] > stiffness_margin:
        raise ValueError(
            f"Ki of at least {ranges[1, 0]:g} N/m leaves less than {bounds.min_stiffness:g} N/m"
        )
    widths = np.ptp(ranges, axis=1)

    def to_setting(shares: Floats) -> Setting:
        """Return the setting at shares 0 .. 1 of the ranges, Ki limited by stiffness."""
        kp, ki, rate = (ranges[:, 0] + shares * widths).tolist()
        return Setting(kp, min(ki, stiffness_margin + rate), rate)

    def cost(shares: Floats) -> float:
        return float(getattr(powers(device, drive, sea, to_setting(shares)), station))

    setting = to_setting(_minimise(cost, widths > 0.0))
    at_bound = [
        name for name, value, (low, high) in zip(Setting._fields, setting, ranges, strict=True)
        if high > low and min(value - low, high - value) < 1e-4 * (high - low)
    ]  # fmt: skip
    if setting.ki > stiffness_margin + setting.spring_rate - 1e-3 and "ki" not in at_bound:
        at_bound.append("ki")
    return Optimum(station, setting, powers(device, drive, sea, setting), tuple(at_bound))


def _minimise(cost: Callable[[Floats], float], free: Floats) -> Floats:
    """Return the minimum of the cost in the unit cube, over the free directions."""
    grid = [np.linspace(0.02, 0.98, _GRID) if is_free else np.zeros(1) for is_free in free]
    points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, len(grid))
    start = points[int(np.argmin([cost(point) for point in points]))]
    directions = np.flatnonzero(free)

    def place(shares: Floats) -> Floats:
        point = start.copy()
        point[directions] = shares
        return point

    result = minimize(
        lambda shares: cost(place(shares)), start[directions], method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * directions.size, options={"xatol": 1e-9, "fatol": 1e-12},
    )  # fmt: skip
    return place(result.x)
