"""Fits the numbers of wavebot_as_measured.yaml to the impedances of MASK4; no part of the program.

    .venv/bin/python configs/plants/fit_as_measured.py ../shared/data

Zikn12.mat and Zidkn12.mat (public repository sandialabs/fbWecCntrl, MASK4/MHKDRCode/Z20A) have the
force of the column load cell and of the torque sensor over velocity, open loop at 20 A, spring set
to -9228 N/m, lines of 1/300 Hz. The plant's model of them is

    Z_i = H ((m + A_inf) s + R + B_i + K_h/s)    Z_id = Z_i + H (B_d + K_d/s)    H = 1/(1 + tau s)

with radiation memory R and A_inf of wavebot.yaml (BEM). m, B_i, K_h, B_d, K_d and tau minimise the
relative error of both, each weighted by the scatter of its own lines. H delays both forces alike:
without it the fit is three times as far off as the means of 15 lines allow
(docs/explanation/plants.md).

Drag, friction and the spring's sine have their equivalent linear size at the motion of that
identification, which is nearly Gaussian: c |v| v is c sqrt(8/pi) sigma_v v, F_c sign(v) is
F_c sqrt(2/pi)/sigma_v v, and sin(2 x/l) is 2 exp(-2 sigma_x²/l²) x/l (Roberts and Spanos, Random
Vibration and Statistical Linearization, ch. 5). Quadratic drag and F_c keep the values of
wavebot.yaml, because one amplitude cannot separate them from the linear ones.
"""

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.optimize import least_squares

from sim_plant.wavebot import WaveBotParams

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

REPEAT = 300.0  # s, of the multisine: bin k of the files is k/300 Hz
BAND = slice(60, 301)  # 0.2 to 1 Hz, where the multisine has lines
SPRING = -9228.0  # N/m, set rate
RMS_CURRENT = 6.7  # A; a flat multisine of these lines has a third of its 20 A peak
START = (860.0, 475.0, 24337.0, 724.0, -5905.0, 0.01)  # m, B_i, K_h, B_d, K_d, tau
FREQUENCY: Floats = np.arange(BAND.start, BAND.stop) / REPEAT


class Fit(NamedTuple):
    """Numbers of the plant file with their standard deviations, in the order of the file."""

    mass: float  # kg
    hydrostatic: float  # N/m
    viscous_linear: float  # N s/m
    drivetrain_viscous: float  # N s/m
    spring_effect: float
    heave_force_lag: float  # s
    deviations: Floats


def read(folder: Path) -> tuple[Complexes, Complexes]:
    """Read Z_i and Z_id (N s/m, force on the body) at `FREQUENCY` from MASK4's files."""
    names = (("Zikn12.mat", "Zi"), ("Zidkn12.mat", "Zid"))
    z_i, z_id = (loadmat(folder / file)[name].ravel()[BAND] for file, name in names)
    return z_i, z_id


def scatter(z: Complexes) -> Complexes:
    """Return the relative difference of each line from its neighbours' mean, by a line's size.

    Its real part is magnitude, its imaginary part phase in rad; no smooth curve comes closer. The
    second difference of equal and independent errors is sqrt(3/2) times one of them.
    """
    return np.asarray((z[1:-1] - 0.5 * (z[:-2] + z[2:])) / z[1:-1] / np.sqrt(1.5))


def model(plant: WaveBotParams, numbers: Any) -> tuple[Complexes, Complexes]:
    """Return Z_i and Z_id for m, B_i, K_h, B_d, K_d and tau, with the radiation of a plant."""
    mass, damping, stiffness, friction, spring, lag = numbers
    s, body = 2j * np.pi * FREQUENCY, plant.body
    memory = np.polyval([body.b4, body.b3, body.b2, body.b1, 0.0], s)
    memory = memory / np.polyval([1.0, body.a4, body.a3, body.a2, body.a1, body.a0], s)
    hull = mass * s + memory + damping + stiffness / s
    amplifier = 1.0 / (1.0 + lag * s)
    return amplifier * hull, amplifier * (hull + friction + spring / s)


def fit(plant: WaveBotParams, added_mass: float, z_i: Complexes, z_id: Complexes) -> Fit:
    """Return the fit; ``plant`` is that of wavebot.yaml, ``added_mass`` (kg) its infinite one."""
    weights = [1.0 / np.sqrt(np.mean(np.abs(scatter(z)) ** 2)) for z in (z_i, z_id)]
    scale = np.abs(START)

    def misfit(numbers: Floats) -> Floats:
        numbers = numbers * scale + [added_mass, 0.0, 0.0, 0.0, 0.0, 0.0]
        pairs = zip(weights, model(plant, numbers), (z_i, z_id), strict=True)
        error = np.concatenate([weight * (ours / theirs - 1.0) for weight, ours, theirs in pairs])
        return np.concatenate([error.real, error.imag])

    found = least_squares(misfit, np.array(START) / scale)
    variance = 2.0 * found.cost / (found.fun.size - scale.size)
    deviation = scale * np.sqrt(variance * np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    mass, damping, stiffness, friction, spring, lag = found.x * scale
    newtons = plant.pto.force_per_current * RMS_CURRENT
    lines = np.sqrt(2.0 / FREQUENCY.size) * newtons / np.abs(z_id)
    speed = np.sqrt(0.5 * np.sum(lines**2))  # rms, m/s
    stroke = np.sqrt(0.5 * np.sum((lines / (2.0 * np.pi * FREQUENCY)) ** 2))  # rms, m
    turn = 2.0 * plant.spring.angle_per_metre
    acting = SPRING * plant.spring.force_per_rate * turn * np.exp(-0.5 * (turn * stroke) ** 2)
    print(f"motion {stroke:.4f} m, {speed:.3f} m/s rms; K_d {spring:.0f} N/m of {acting:.0f}")
    return Fit(
        mass,
        stiffness,
        damping - plant.body.quadratic * np.sqrt(8.0 / np.pi) * speed,
        friction - plant.pto.coulomb * np.sqrt(2.0 / np.pi) / speed,
        spring / acting,
        lag,
        np.abs(deviation[[0, 2, 1, 3, 4, 5]] / [1.0, 1.0, 1.0, 1.0, acting, 1.0]),
    )


if __name__ == "__main__":
    from rig.config.yaml_source import load_mapping
    from sim_plant.parameters import Plant

    shipped = Plant.model_validate(load_mapping(Path(__file__).with_name("wavebot.yaml"))[0])
    infinite = float(shipped.body.added_mass_infinite.value)
    result = fit(shipped.build(), infinite, *read(Path(sys.argv[1])))
    for name, value, deviation in zip(result._fields, result[:-1], result.deviations, strict=False):
        print(f"{name:20} {value:10.4g} ± {deviation:.2g}")
