"""First campaign and PTOs of a plant by linear theory: gains around the impedance match.

The bodies with the matrix Z move with v = Z^-1 (F + T^T f), T the factors of the axes and f the
forces of the PTOs. So an axis moves against the Thevenin impedance Z_pto = (T Z^-1 T^T)^-1 and is
driven by F_pto = Z_pto T Z^-1 F, as one body would be: f = G u gives u = (Z_pto - G)^-1 F_pto.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import interp1d

from rig.config.sea import MAX_AMPLITUDE_M, MIN_AMPLITUDE_M
from rig.kinds.modular.mode_choice import ChosenModes
from rig.kinds.modular.plant_text import (
    COUNTS,
    PEAK_CURRENT,
    SEA_HZ,
    AxisMotion,
    Pto,
    rounded,
    sea_band,
)
from rig.planning.tank import wave_number
from sim_plant.modes import radiation
from sim_plant.modes.bem import axis_damping
from sim_plant.modes.bem_content import Complexes, Floats
from sim_plant.modes.building import factors_between

MARGIN = 2.0  # of the limits above the expected motion and force
STANDBY = 10.0  # W, of a drive; a small rig has less, or nothing would be left of its power
MAX_STOP = 2.0  # m, the farthest position stop that a limits file may have

_COUNTS_PER_JUMP = 100  # resolution of the largest allowed jump
_STEEPNESS = 0.1  # amplitude times wave number of the waves: linear theory holds
_BELOW_RESONANCE = 0.75  # wave frequency over the axis's, so that the match needs a Ki > 0
_STEP = 0.25  # of the match or of |Z|; rounded, so that the grid is even
_KI_STEPS = (0, 1, 2)  # of the match, or of the static stiffness where that is less
_KP_STEPS = (5, 4, 3, 2)  # of |Z|
_MAX_GEAR = 1000.0
_ROUNDING = 1.0e-5  # m or rad per m of amplitude: yaw of a round body, which no wave excites


class LinearPlant(NamedTuple):
    """The motions of n axes at one wave frequency, for e^{+i omega t}."""

    frequency: float  # Hz
    impedance: Complexes  # (n, n), force per velocity: Z_pto
    excitation: Complexes  # (n), force per metre of wave amplitude: F_pto
    compliance: Floats | None  # (n, n), motion per static force; None: a mode drifts
    wave_number: float  # 1/m
    reason: str  # why the waves have this frequency, a sentence


class AxisGrid(NamedTuple):
    """Gains of one axis, and its largest motion and force in the rows of the grid.

    They are 0 if the waves do not excite it.
    """

    impedance: complex  # that it moves against while the others have their best damping
    ki_limit: float  # N/m or N*m/rad: half of it is the largest Ki
    kp: tuple[float, ...]
    ki: tuple[float, ...]
    position: float = 0.0
    velocity: float = 0.0
    force: float = 0.0


class FirstValues(NamedTuple):
    """The rows of the first campaign, in which all axes take their shares at the same time."""

    linear: LinearPlant
    amplitude: float  # m, of the waves
    axes: dict[str, AxisGrid]

    @property
    def omega(self) -> float:
        """Frequency of the waves, rad/s."""
        return 2.0 * math.pi * self.linear.frequency


def first_values(
    chosen: ChosenModes, frequency: float | None = None, amplitude: float | None = None
) -> FirstValues:
    """Return the rows of a first campaign; ValueError for waves that no sea or file has."""
    linear = linear_plant(chosen, frequency)
    omega = 2.0 * math.pi * linear.frequency
    grids = _gains(linear)
    speeds, forces = np.zeros((2, len(grids)))
    for p in range(len(_KP_STEPS)):
        for i in range(len(_KI_STEPS)):
            gains = np.array([complex(each.kp[p], -each.ki[i] / omega) for each in grids])
            speed = np.abs(np.linalg.solve(linear.impedance - np.diag(gains), linear.excitation))
            speeds, forces = np.maximum(speeds, speed), np.maximum(forces, np.abs(gains) * speed)
    excited = speeds / omega > _ROUNDING
    speeds, forces = np.where(excited, speeds, 0.0), np.where(excited, forces, 0.0)
    height = _amplitude(linear, float(speeds.max()) / omega, amplitude)
    axes = {
        name: grid._replace(
            position=float(speed / omega * height), velocity=float(speed * height),
            force=float(force * height),
        )
        for name, grid, speed, force in zip(chosen.axes, grids, speeds, forces, strict=True)
    }  # fmt: skip
    return FirstValues(linear, height, axes)


def linear_plant(chosen: ChosenModes, frequency: float | None = None) -> LinearPlant:
    """Return the axes of a plant at a frequency (Hz), or at one that suits the first of them.

    ValueError for a frequency that no sea or file has.
    """
    bem = chosen.bem
    factors = factors_between(
        (mode.name for mode in chosen.modes), [axis.moves_with for axis in chosen.axes.values()]
    )
    band = sea_band((float(bem.frequency[0]), float(bem.frequency[-1])))
    if band[0] >= band[1]:
        raise ValueError(
            f"the BEM file has {bem.frequency[0]:.3g} .. {bem.frequency[-1]:.3g} Hz, and a sea "
            f"{SEA_HZ[0]:g} .. {SEA_HZ[1]:g} Hz: nothing in common"
        )
    reason = "The frequency of the waves is the given one."
    if frequency is None:
        frequency, reason = _wave_frequency(chosen, factors[0], band)
    elif not band[0] <= frequency <= band[1]:
        raise ValueError(
            f"--frequency {frequency:g} Hz is outside the BEM file and the band of the seas; "
            f"allowed {band[0]:.4g} .. {band[1]:.4g} Hz"
        )
    hertz = np.array([frequency])
    mobility: Any = np.linalg.inv(_impedance(chosen, hertz)[0])
    forces = interp1d(bem.frequency, bem.excitation.conj(), axis=0)(frequency)
    impedance = np.linalg.inv(factors @ mobility @ factors.T)
    stiffness, compliance = stiffness_matrix(chosen), None
    if np.linalg.eigvalsh(stiffness).min() > 0.0:
        compliance = factors @ np.linalg.inv(stiffness) @ factors.T
    return LinearPlant(
        frequency, impedance, impedance @ factors @ mobility @ forces, compliance,
        wave_number(2.0 * math.pi * frequency, bem.depth, bem.gravity), reason,
    )  # fmt: skip


def stiffness_matrix(chosen: ChosenModes) -> Floats:
    """Return the file's stiffness with the diagonal that the plant will state, (modes, modes)."""
    given, count = chosen.bem.stiffness, len(chosen.modes)
    matrix = np.zeros((count, count)) if given is None else given.copy()
    np.fill_diagonal(matrix, [mode.stiffness for mode in chosen.modes])
    return matrix


def _impedance(chosen: ChosenModes, frequency: Floats) -> Complexes:
    """Return the impedance of the bodies at frequencies (Hz), (frequencies, modes, modes)."""
    bem, omega = chosen.bem, 2.0 * np.pi * frequency[:, None, None]
    inertia = np.diag([mode.mass for mode in chosen.modes])
    inertia = inertia + interp1d(bem.frequency, bem.added_mass, axis=0)(frequency)
    damping = np.diag([mode.damping for mode in chosen.modes])
    damping = damping + interp1d(bem.frequency, bem.damping, axis=0)(frequency)
    total: Complexes = damping + 1j * (omega * inertia - stiffness_matrix(chosen) / omega)
    return total


def _wave_frequency(
    chosen: ChosenModes, factors: Floats, band: tuple[float, float]
) -> tuple[float, str]:
    """Return a frequency (Hz) for the axis with the given factors, and the reason for it.

    It is below the highest resonance of the axis while its PTO has no force; without a resonance
    the centre of the band. Between two bodies there is an anti-resonance, too, where they move as
    one: the frequency is above it. Where the axis radiates hardly any waves there, waves hardly
    excite it (Haskind's relation), and the frequency is that of the largest power instead.
    """
    hertz = np.linspace(*band, 1000)
    mobility = np.linalg.inv(_impedance(chosen, hertz))
    impedance = 1.0 / np.einsum("i,fij,j->f", factors, mobility, factors)
    reactance = impedance.imag
    rises = np.flatnonzero((reactance[:-1] < 0.0) & (reactance[1:] >= 0.0))
    falls = np.flatnonzero((reactance[:-1] >= 0.0) & (reactance[1:] < 0.0))
    centre, place = math.sqrt(band[0] * band[1]), "the centre of the band"
    if rises.size:
        resonance = float(hertz[rises[-1]])
        centre = _BELOW_RESONANCE * resonance
        place = f"below the resonance at {resonance:.3g} Hz"
        for fall in falls[falls < rises[-1]][-1:]:
            centre = max(centre, math.sqrt(float(hertz[fall]) * resonance))
    damping = interp1d(chosen.bem.frequency, axis_damping(chosen.bem, factors))(hertz)
    radiating = hertz[radiation.wave_band(damping[:, None, None])]
    first = _short(centre, band)
    if radiating[0] <= first <= radiating[-1]:
        return first, f"The waves are {place}."
    forces = interp1d(chosen.bem.frequency, chosen.bem.excitation.conj(), axis=0)(hertz)
    driven = impedance * np.einsum("i,fij,fj->f", factors, mobility, forces)
    within = (hertz >= radiating[0]) & (hertz <= radiating[-1]) & (impedance.real > 0.0)
    power = np.where(within, np.abs(driven) ** 2 / (8.0 * np.abs(impedance.real)), 0.0)
    best = _short(float(hertz[power.argmax()]), band)
    return best, (
        f"At {first:.3g} Hz, {place}, the axis radiates hardly any waves, so that waves hardly "
        f"excite it; it radiates at {radiating[0]:.3g} .. {radiating[-1]:.3g} Hz. The frequency is "
        "that of the largest power |F|^2 / (8 Re Z) there."
    )


def _short(frequency: float, band: tuple[float, float]) -> float:
    """Return a frequency within a band (Hz) with few digits, so that the sea repeats soon."""
    short = rounded(frequency, 2)
    if short < band[0]:
        return math.ceil(1e3 * band[0]) / 1e3
    return min(short, math.floor(1e3 * band[1]) / 1e3)


def _gains(linear: LinearPlant) -> list[AxisGrid]:
    """Return gains of each axis around its impedance match; motions and forces are not set.

    An axis sees the others with their best damping, which is found by turns. Ki must leave a static
    stiffness: the matches above 0 are scaled down to the limit of equilibrium.
    """
    omega, count = 2.0 * math.pi * linear.frequency, len(linear.impedance)
    seen = np.diag(linear.impedance).copy()
    for _ in range(1 if count == 1 else 50):
        for a in range(count):
            others = np.diag(np.where(np.arange(count) == a, 0.0, -np.abs(seen)))
            seen[a] = 1.0 / np.linalg.inv(linear.impedance - others)[a, a]
    match = -omega * seen.imag
    springs = np.maximum(match, 0.0)
    if linear.compliance is None:
        limit = np.zeros(count)
    else:
        largest = float(np.abs(np.linalg.eigvals(linear.compliance @ np.diag(springs))).max())
        limit = springs / max(largest, 1.0)
    limit = np.where(match > 0.0, limit, match)
    return [
        AxisGrid(
            complex(z), float(end),
            tuple(-each for each in _steps(abs(z), _KP_STEPS)),
            tuple(_steps(float(end), _KI_STEPS)),
        )
        for z, end in zip(seen, limit, strict=True)
    ]  # fmt: skip


def _steps(largest: float, numbers: Iterable[int]) -> Iterator[float]:
    """Yield multiples of one step with two digits."""
    step = rounded(_STEP * largest, 2)
    for number in numbers:
        yield rounded(number * step, 6) + 0.0  # no -0


def _amplitude(linear: LinearPlant, motion: float, amplitude: float | None) -> float:
    """Return the amplitude of the waves (m): the given one, or one that the axes can follow.

    ``motion``: the largest of all axes, per metre of amplitude.
    """
    farthest = MAX_STOP / (MARGIN * motion) if motion > 0.0 else math.inf
    if amplitude is None:
        steep = _STEEPNESS / linear.wave_number
        height = rounded(min(steep, 0.95 * farthest, MAX_AMPLITUDE_M), 2)
        return max(height, MIN_AMPLITUDE_M)
    if amplitude > farthest:
        raise ValueError(
            f"--amplitude {amplitude:g} m moves the axis by {motion * amplitude:.3g} (m or rad); "
            f"allowed up to {farthest:.3g} m"
        )
    if not MIN_AMPLITUDE_M <= amplitude <= MAX_AMPLITUDE_M:
        raise ValueError(
            f"--amplitude {amplitude:g} m is out of range; allowed {MIN_AMPLITUDE_M:g} .. "
            f"{MAX_AMPLITUDE_M:g} m"
        )
    return amplitude


def largest_jump(grid: AxisGrid) -> float:
    """Return the largest jump of the encoder that is no fault, m or rad."""
    return min(MARGIN * max(0.05 * grid.position, 0.02 * grid.velocity), 1.0) or 1.0


def first_pto(
    motion: AxisMotion,
    grid: AxisGrid,
    torque_constant: float | None = None,
    gear_ratio: float | None = None,
) -> Pto:
    """Return a motor that gives twice the largest force of the rows with 20 A."""
    constant = torque_constant or 1.0
    peak_force = MARGIN * grid.force
    gear = gear_ratio or rounded(min(max(peak_force / (constant * PEAK_CURRENT), 1.0), _MAX_GEAR))
    current = max(grid.force / (constant * gear), 0.1)  # A; not 0 where no wave excites the axis
    resistance = 0.1 * grid.velocity * grid.force / (current * current)  # a tenth goes into copper
    finest = 2.0 * math.pi * _COUNTS_PER_JUMP / (gear * largest_jump(grid))
    counts = max(COUNTS, math.ceil(finest / COUNTS) * COUNTS)
    standby = min(STANDBY, 0.05 * grid.velocity * grid.force)
    return Pto(motion, constant, gear, counts, 1.25 * MARGIN * current, resistance, standby)
