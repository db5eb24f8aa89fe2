"""First files of a rig with one axis, derived from the coefficients of a BEM file.

The campaign is a grid around the impedance match at one wave frequency; the limits follow from the
motion and the force of its rows by linear theory, motor and gear from that force. They are values
to begin with: the texts mark what a laboratory has to choose.
"""

import math
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from controllers import impedance
from rig.config.problems import format_number
from rig.config.sea import MAX_AMPLITUDE_M, MIN_AMPLITUDE_M
from rig.kinds.modular.plant_text import (
    COUNTS,
    DAMPING_RATIO,
    PEAK_CURRENT,
    STANDBY,
    ModeEntry,
    PlantEntries,
    Pto,
    fragment,
    names_of_modes,
    plant_text,
    rounded,
)
from rig.kinds.new_files import write_new
from rig.planning.tank import wave_number
from sim_plant.modes.bem import BemModes, bem_files, read_modes, stated_mass
from sim_plant.modes.bem_content import Floats, Water, rotates

__all__ = ["Options", "Water", "write_rig"]

TEXTS = ("rig", "limits", "plant", "campaign", "rig_hil", "limits_hil")

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_MARGIN = 2.0  # of the limits above the expected motion and force
_COUNTS_PER_JUMP = 100  # resolution of the largest allowed jump
_STEEPNESS = 0.1  # amplitude times wave number of the waves: linear theory holds
_BELOW_RESONANCE = 0.75  # wave frequency over the body's, so that the match needs a Ki > 0
_MAX_STOP = 2.0  # m, the farthest position stop that a limits file may have
_SEA_HZ = (0.05, 2.0)  # the band of all seas
_KI_SHARES = (0.0, 0.25, 0.5)  # of the match
_KP_SHARES = (1.5, 1.0, 0.75, 0.5)  # of |Z|


class Options(NamedTuple):
    """Options of `rig new rig`; None is derived."""

    bem: Path
    dof: str | None = None  # mode in the BEM file
    axis: str | None = None  # name of the axis
    mass: float | None = None  # kg or kg*m2
    stiffness: float | None = None  # N/m or N*m/rad
    frequency: float | None = None  # Hz, of the waves
    amplitude: float | None = None  # m, of the waves
    torque_constant: float | None = None  # N*m/A
    gear_ratio: float | None = None  # rad/m or 1
    direction: float | None = None  # degrees, of the waves
    water: Water = Water()


class Body(NamedTuple):
    """One mode of a body at one wave frequency."""

    dof: str
    rotates: bool
    mass: float
    mass_source: str
    stiffness: float
    stiffness_source: str
    damping: float  # viscous
    frequency: float  # Hz
    band: tuple[float, float]  # Hz, of the BEM file within that of the seas
    impedance: complex  # force per velocity, e^{+i omega t}
    excitation: float  # force per metre of wave amplitude
    wave_number: float  # 1/m


class Grid(NamedTuple):
    """The rows of the first campaign, and their largest motion and force."""

    kp: tuple[float, ...]
    ki: tuple[float, ...]
    amplitude: float  # m, of the waves
    position: float
    velocity: float
    force: float


def write_rig(name: str, folder: Path, options: Options) -> list[Path]:
    """Write the files of a new rig into ``folder/name``, and return their paths.

    A copy of the BEM file, unless it is in that folder, lets the folder be moved.

    Raises ValueError with every reason why they cannot be derived or written; OSError for a BEM
    file that cannot be read.
    """
    folder = folder / name
    found: dict[Path, str | bytes] = {folder / f"{text}.yaml": "" for text in TEXTS}
    problems = list(_name_problems(name, options))
    if not problems:
        body = read_body(options)
        grid = first_grid(body, options.amplitude)
        texts = file_texts(name, folder, options, body, grid)
        found = {folder / f"{file}.yaml": text for file, text in texts.items()}
        found |= bem_copies(options.bem, folder)
    return write_new(found, problems)


def _name_problems(name: str, options: Options) -> Iterator[str]:
    if not _NAME.fullmatch(name):
        yield (
            f"{name!r} cannot be the name of a rig and its folder; allowed [A-Za-z][A-Za-z0-9_-]*, "
            "at most 40 characters"
        )
    if options.axis is not None and not re.fullmatch(r"[a-z](_?[a-z0-9])*", options.axis):
        yield f"--axis {options.axis!r} is no name of a log field; allowed [a-z][a-z0-9_]*"
    for key in ("mass", "stiffness", "frequency", "amplitude", "torque_constant", "gear_ratio"):
        value = getattr(options, key)
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            yield f"--{key.replace('_', '-')} {value:g}: allowed above 0"


def read_body(options: Options) -> Body:
    """Return the mode that the options choose; ValueError for what cannot be derived."""
    content = read_modes(options.bem, None, direction=options.direction, water=options.water)
    if options.dof is None and len(content.modes) > 1:
        listed = ", ".join(content.modes)
        raise ValueError(f"{options.bem}: has several modes: {listed}; choose one with --dof")
    dof = options.dof or content.modes[0]
    if dof not in content.modes:
        listed = ", ".join(content.modes)
        raise ValueError(f"{options.bem}: has no mode {dof!r}; --dof allows {listed}")
    mode = content.modes.index(dof)
    mass, mass_source, stiffness, stiffness_source = _rigid_body(content, mode, options)
    band, omegas = _band(content, options)
    added = np.interp(omegas, 2.0 * np.pi * content.frequency, content.added_mass[:, mode, mode])
    resonance = _resonance(omegas, mass + added, stiffness)
    omega = 2.0 * math.pi * _wave_frequency(options, band, resonance)
    grid = 2.0 * np.pi * content.frequency
    inertia = mass + float(np.interp(omega, grid, content.added_mass[:, mode, mode]))
    radiation = max(float(np.interp(omega, grid, content.damping[:, mode, mode])), 0.0)
    damping = rounded(2.0 * DAMPING_RATIO * math.sqrt(stiffness * inertia))
    force = float(np.interp(omega, grid, np.abs(content.excitation[:, mode])))
    if not force > 0.0:
        raise ValueError(f"{options.bem}: waves of {omega / 6.2832:.3g} Hz do not excite {dof}")
    return Body(
        dof, rotates(dof), mass, mass_source, stiffness,
        stiffness_source, damping, omega / (2.0 * math.pi), band,
        complex(radiation + damping, omega * inertia - stiffness / omega), force,
        wave_number(omega, content.depth, content.gravity),
    )  # fmt: skip


def _rigid_body(content: BemModes, mode: int, options: Options) -> tuple[float, str, float, str]:
    """Return mass and stiffness of a mode, each with its source."""
    dof = content.modes[mode]
    missing, mass, mass_source = [], options.mass, "given"
    if mass is None:
        mass, mass_source = stated_mass(content, mode)
    if mass is None:
        missing.append(f"mass or moment of inertia of {dof}: give --mass (kg or kg*m2)")
    stiffness, source = options.stiffness, "given"
    if stiffness is None and content.stiffness is not None:
        stiffness, source = float(content.stiffness[mode, mode]), "hydrostatic, of the BEM file"
    if stiffness is None or not stiffness > 0.0:
        missing.append(
            f"stiffness of {dof}: give --stiffness (N/m or N*m/rad), with that of the mooring"
        )
    if mass is None or stiffness is None or missing:
        raise ValueError("\n".join(f"{options.bem}: does not state the {each}" for each in missing))
    return rounded(mass, 5), mass_source, rounded(stiffness, 5), source


def _band(content: BemModes, options: Options) -> tuple[tuple[float, float], Floats]:
    """Return the file's frequencies within the band of the seas, Hz, and a fine grid, rad/s."""
    low = max(float(content.frequency[0]), _SEA_HZ[0])
    high = min(float(content.frequency[-1]), _SEA_HZ[1])
    if low >= high:
        raise ValueError(
            f"{options.bem}: has {content.frequency[0]:.3g} .. {content.frequency[-1]:.3g} Hz, and "
            f"a sea {_SEA_HZ[0]:g} .. {_SEA_HZ[1]:g} Hz: nothing in common"
        )
    return (low, high), 2.0 * np.pi * np.linspace(low, high, 1000)


def _resonance(omegas: Floats, inertia: Floats, stiffness: float) -> float | None:
    """Return the natural frequency, Hz; None if it is outside the band."""
    reactance = omegas * omegas * inertia - stiffness
    for at, (before, after) in enumerate(pairwise(reactance.tolist())):
        if before < 0.0 <= after:
            return float(omegas[at]) / (2.0 * math.pi)
    return None


def _wave_frequency(options: Options, band: tuple[float, float], resonance: float | None) -> float:
    """Return the frequency of the waves, Hz: the given one, or one below the resonance."""
    low, high = band
    frequency = options.frequency
    if frequency is None:
        centre = math.sqrt(low * high) if resonance is None else _BELOW_RESONANCE * resonance
        short = rounded(centre, 2)  # few digits, so that the sea repeats soon
        if short < low:
            return math.ceil(1e3 * low) / 1e3
        return min(short, math.floor(1e3 * high) / 1e3)
    if not low <= frequency <= high:
        raise ValueError(
            f"--frequency {frequency:g} Hz is outside the BEM file and the band of the seas; "
            f"allowed {low:.4g} .. {high:.4g} Hz"
        )
    return frequency


def first_grid(body: Body, amplitude: float | None) -> Grid:
    """Return gains around the impedance match, and the largest motion and force of the rows.

    ValueError if the best damping is beyond the law's range.
    """
    omega = 2.0 * math.pi * body.frequency
    ki_match, passive = -omega * body.impedance.imag, abs(body.impedance)
    kp = tuple(-rounded(share * passive, 2) for share in _KP_SHARES)
    ki = tuple(dict.fromkeys(math.copysign(rounded(abs(share * ki_match), 2), ki_match) + 0.0
                             for share in _KI_SHARES))  # fmt: skip
    columns = {column.name: column for column in impedance.COLUMNS}
    for name, values in (("kp", kp), ("ki", ki)):
        low, high = columns[name].low, columns[name].high
        if not (low <= min(values) and max(values) <= high):
            worst = max(values, key=abs)
            raise ValueError(
                f"the impedance match needs {columns[name].label} = {format_number(worst)}; allowed"
                f" {format_number(low)} .. {format_number(high)}. The body is larger than one of a "
                "test rig: scale the BEM data to the size of the model"
            )
    velocity = force = 0.0
    for p in kp:
        for i in ki:
            gain = complex(p, -i / omega)
            speed = body.excitation / abs(body.impedance - gain)
            velocity, force = max(velocity, speed), max(force, abs(gain) * speed)
    if amplitude is None:
        farthest = 0.95 * _MAX_STOP / (_MARGIN * velocity / omega)
        amplitude = rounded(min(_STEEPNESS / body.wave_number, farthest, MAX_AMPLITUDE_M), 2)
        amplitude = max(amplitude, MIN_AMPLITUDE_M)
    motion = velocity / omega * amplitude
    if _MARGIN * motion > _MAX_STOP:
        raise ValueError(
            f"--amplitude {amplitude:g} m moves the axis by {motion:.3g} (m or rad); allowed up to "
            f"{_MAX_STOP / _MARGIN * amplitude / motion:.3g} m"
        )
    if not MIN_AMPLITUDE_M <= amplitude <= MAX_AMPLITUDE_M:
        raise ValueError(
            f"--amplitude {amplitude:g} m is out of range; allowed {MIN_AMPLITUDE_M:g} .. "
            f"{MAX_AMPLITUDE_M:g} m"
        )
    return Grid(kp, ki, amplitude, motion, velocity * amplitude, force * amplitude)


def file_texts(name: str, folder: Path, options: Options, body: Body, grid: Grid) -> dict[str, str]:
    """Return the text of each file in `TEXTS`."""
    axis = options.axis or names_of_modes([body.dof])[0]
    pto, values = _derived(name, axis, options, body, grid)
    texts = {
        file: fragment(file, rotary=body.rotates, **values) for file in TEXTS if file != "plant"
    }
    mode = ModeEntry(
        axis, body.dof, body.mass, body.mass_source, body.stiffness, body.stiffness_source,
        body.damping,
    )  # fmt: skip
    entries = PlantEntries(
        bem_key(options.bem, folder), body.band, options.water, options.direction, None, (mode,),
        {axis: pto},
    )  # fmt: skip
    return {**texts, "plant": plant_text(name, entries)}


def bem_key(bem: Path, folder: Path) -> str:
    """Return the path of a BEM file, or of its copy, as a plant file in a folder names it."""
    first = bem_files(bem)[0].resolve()
    root = folder.resolve() if first.is_relative_to(folder.resolve()) else _copied_root(bem)
    return first.relative_to(root).as_posix()


def bem_copies(bem: Path, folder: Path) -> dict[Path, bytes]:
    """Return the files of BEM results as copies in a folder, without those that are there."""
    files = [each.resolve() for each in bem_files(bem)]
    if files[0].is_relative_to(folder.resolve()):
        return {}
    copies = {folder / each.relative_to(_copied_root(bem)): each.read_bytes() for each in files}
    return {
        path: content
        for path, content in copies.items()
        if not path.is_file() or path.read_bytes() != content
    }


def _copied_root(bem: Path) -> Path:
    """Return the folder to which the paths of copies are relative: a Nemoh run keeps its own."""
    files = [each.resolve() for each in bem_files(bem)]
    alone = all(each.parent == files[0].parent for each in files)
    return files[0].parent if alone else files[0].parent.parent


def _derived(
    name: str, axis: str, options: Options, body: Body, grid: Grid
) -> tuple[Pto, dict[str, str]]:
    """Return the PTO, and the texts of the other templates' placeholders."""
    omega, period = 2.0 * math.pi * body.frequency, 1.0 / body.frequency
    stop, speed = _MARGIN * grid.position, _MARGIN * grid.velocity
    peak_force = _MARGIN * grid.force
    torque_constant = options.torque_constant or 1.0
    gear = options.gear_ratio or rounded(
        min(max(peak_force / (torque_constant * PEAK_CURRENT), 1.0), 1000.0)
    )
    per_ampere = torque_constant * gear  # N or N*m
    peak = peak_force / per_ampere  # A
    current = grid.force / per_ampere  # A
    resistance = 0.1 * grid.velocity * grid.force / (current * current)  # a tenth goes into copper
    jerk = omega * omega * grid.velocity
    settle, measured = rounded(8.0 * period), 10.0 * period
    jump = min(max(0.05 * stop, 0.02 * speed), 1.0)
    finest = 2.0 * math.pi * _COUNTS_PER_JUMP / (gear * jump)
    counts = max(COUNTS, math.ceil(finest / COUNTS) * COUNTS)
    pto = Pto(torque_constant, gear, counts, 1.25 * peak, resistance)
    numbers = {
        "torque_constant": torque_constant,
        "gear_ratio": gear,
        "jerk_density": min(max(0.05 * jerk * jerk, 1e-4), 1e6),
        "stop_damping": abs(body.impedance),
        "power_range": _MARGIN * (peak_force * speed + STANDBY),
        "position_warn": 0.8 * stop,
        "position_stop": stop,
        "velocity_stop": speed,
        "current_peak": peak,
        "current_rms": 0.75 * peak,
        "force_slew": peak_force / 0.02,
        "encoder_jump": jump,
        "current_difference": 0.2 * peak,
        "tare_span": min(0.1 * stop, 0.5),
        "current_limit": pto.current_limit,
        "resistance_z": body.impedance.real,
        "reactance_z": abs(body.impedance.imag),
        "kp_match": -body.impedance.real,
        "ki_match": -omega * body.impedance.imag,
        "kp_passive": -abs(body.impedance),
        "lead_in": max(30.0, 12.0 * period),
    }
    exact = {
        "margin": _MARGIN, "amplitude": grid.amplitude, "frequency": body.frequency,
        "settle": settle, "interval": math.ceil(10.0 * (settle + measured)) / 10.0,
    }  # fmt: skip
    return pto, {
        **{key: format_number(rounded(value)) for key, value in numbers.items()},
        **{key: format_number(value) for key, value in exact.items()},
        "sign_z": "-" if body.impedance.imag < 0.0 else "+",
        "title": f"{name}, {axis}",
        "name": name,
        "campaign": f"{name}-first",
        "axis": axis,
        "counts": str(counts),
        "periods": "10",
        "bem_range": f"{body.band[0]:.3g} .. {body.band[1]:.3g} Hz",
        "kp": ", ".join(map(format_number, grid.kp)),
        "ki": ", ".join(map(format_number, grid.ki)),
    }
