"""Text of a plant file: modes of a BEM file, a PTO for some of them, and marks what to choose."""

import math
import re
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from string import Template
from typing import NamedTuple

from rig.config.problems import format_number
from sim_plant.modes.bem_content import DEEPEST, Water, rotates

COUNTS = 20_000  # per revolution of an encoder
PEAK_CURRENT = 20.0  # A, of the first motor
DAMPING_RATIO = 0.02
SEA_HZ = (0.05, 2.0)  # the band of all seas
_COMMENT_COLUMN = 36  # of the written files

# Keys and units of an axis or mode that rotates, in the place of those of one that translates.
_ROTARY = {
    "motion: translation": "motion: rotation",
    "gear_ratio_rad_per_m": "gear_ratio",
    "per m of the axis": "per rad of the axis",
    "jerk_density_m2_per_s5": "jerk_density_rad2_per_s5",
    "_n_s_per_m": "_n_m_s_per_rad",
    "ki_n_per_m": "ki_n_m_per_rad",
    "force_slew_n_per_s": "torque_slew_n_m_per_s",
    "velocity_stop_m_per_s": "velocity_stop_rad_per_s",
    "position_warn_m": "position_warn_rad",
    "position_stop_m": "position_stop_rad",
    "encoder_jump_stop_m": "encoder_jump_stop_rad",
    "tare_span_stop_m": "tare_span_stop_rad",
    "N*s2/m2": "N*m*s2/rad2",
    "N*s/m": "N*m*s/rad",
    "N/m": "N*m/rad",
    "# N (": "# N*m (",
    "The force on the body is F =": "The moment on the body is M =",
    "F/v": "M/v",
    "kg;": "kg*m2;",
    "kg, ": "kg*m2, ",
}


class ModeEntry(NamedTuple):
    """One mode of a plant file, with the sources of its numbers."""

    name: str
    dof: str  # in the BEM file
    mass: float  # kg or kg*m2
    mass_source: str
    stiffness: float  # N/m or N*m/rad
    stiffness_source: str
    damping: float  # viscous


class AxisMotion(NamedTuple):
    """The motion of an axis: the sum of factor times position of some modes."""

    moves_with: dict[str, float]  # factors by the modes' names in the plant file
    rotates: bool


class Pto(NamedTuple):
    """First values of motor, gear, encoder and drive of an axis."""

    motion: AxisMotion
    torque_constant: float  # N*m/A
    gear_ratio: float  # rad/m or 1
    counts: int  # per revolution
    current_limit: float  # A
    resistance: float  # ohm
    standby: float  # W

    @property
    def peak_force(self) -> float:
        """Force at the drive's current limit, N or N*m."""
        return self.current_limit * self.torque_constant * self.gear_ratio


class PlantEntries(NamedTuple):
    """All that a plant file states."""

    bem: str  # path relative to the plant file
    band: tuple[float, float]  # Hz, of the BEM file
    water: Water  # what the BEM file does not state
    direction: float | None  # degrees, of the waves, if the BEM file has several
    radiation: str | None  # path of the stored fit
    modes: tuple[ModeEntry, ...]
    axes: dict[str, Pto]  # by name


def plant_text(name: str, entries: PlantEntries) -> str:
    """Return the text of a plant file."""
    modes = [
        fragment(
            "plant_mode",
            rotary=rotates(mode.dof),
            mode=mode.name,
            dof=mode.dof,
            mass=format_number(mode.mass),
            mass_source=mode.mass_source,
            stiffness=format_number(mode.stiffness),
            stiffness_source=mode.stiffness_source,
            damping=format_number(mode.damping),
            damping_source=_damping_source(mode),
        )
        for mode in entries.modes
    ]
    axes = [
        fragment(
            "plant_axis",
            rotary=pto.motion.rotates,
            axis=axis,
            moves_with=_moves_with(pto.motion),
            torque_constant=format_number(rounded(pto.torque_constant)),
            gear_ratio=format_number(rounded(pto.gear_ratio)),
            counts=str(pto.counts),
            current_limit=format_number(rounded(pto.current_limit)),
            resistance=format_number(rounded(pto.resistance)),
            standby=format_number(rounded(pto.standby)),
        )
        for axis, pto in entries.axes.items()
    ]
    sensors = [
        f"  {sensor}: {{signal: {axis}.electric_power, noise: 0.1}}\n"
        for axis, sensor in power_sensors(entries.axes).items()
    ]
    sensors += [
        f"  {sensor}: {{signal: {axis}.force, noise: {format_number(noise)}}}\n"
        for axis, sensor in force_sensors(entries.axes).items()
        for noise in [rounded(1e-4 * entries.axes[axis].peak_force)]
    ]
    stored = entries.radiation
    return fragment(
        "plant",
        name=name,
        water=_water_lines(entries.water, entries.direction),
        bem=entries.bem,
        bem_range=band_text(entries.band),
        radiation="" if stored is None else f"\nradiation: {stored}   # fit of the BEM file's",
        modes="\n".join(modes),
        axes="\n".join(axes),
        sensors="".join(sensors),
    )


def power_sensors(axes: Iterable[str]) -> dict[str, str]:
    """Return the name of the DC power sensor of each axis."""
    names = list(axes)
    return {name: "dc_power" if len(names) == 1 else f"{name}_dc_power" for name in names}


def force_sensors(axes: Mapping[str, Pto]) -> dict[str, str]:
    """Return the name of the force or torque sensor of each axis."""
    names = {
        name: "torque_sensor" if pto.motion.rotates else "load_cell" for name, pto in axes.items()
    }
    return names if len(axes) == 1 else {name: f"{name}_{each}" for name, each in names.items()}


def sea_band(band: tuple[float, float]) -> tuple[float, float]:
    """Return the frequencies of a BEM file within the band of all seas, Hz; empty: low >= high."""
    return max(band[0], SEA_HZ[0]), min(band[1], SEA_HZ[1])


def band_text(band: tuple[float, float]) -> str:
    """Return a BEM file's frequencies and those that seas have."""
    (low, high), (first, last) = band, sea_band(band)
    used = "" if (first, last) == band else f" (of which seas have {first:.3g} .. {last:.3g} Hz)"
    return f"{low:.3g} .. {high:.3g} Hz{used}"


def _moves_with(motion: AxisMotion) -> str:
    return ", ".join(f"{mode}: {factor!r}" for mode, factor in motion.moves_with.items())


def _damping_source(mode: ModeEntry) -> str:
    """Return where the viscous damping of a mode comes from."""
    percent = f"{format_number(100.0 * DAMPING_RATIO)} % of critical"
    if mode.stiffness > 0.0:
        return percent
    return f"none, because {percent} are 0 without stiffness"


def fragment(template: str, *, rotary: bool = False, **values: str) -> str:
    """Return the text of a template in `rig/templates/rig`, its comments in one column."""
    path = Path(str(resources.files("rig"))) / "templates" / "rig" / f"{template}.yaml"
    text = path.read_text(encoding="utf-8")
    if rotary:
        for old, new in _ROTARY.items():
            text = text.replace(old, new)
    return "\n".join(map(_aligned, Template(text).substitute(values).splitlines())) + "\n"


def _aligned(line: str) -> str:
    """Return a line with its comment in the column of the others."""
    content, mark, comment = line.partition(" # ")
    return f"{content.rstrip():<{_COMMENT_COLUMN}}{mark}{comment}" if mark and content else line


def _water_lines(water: Water, direction: float | None) -> str:
    """Return the lines of what the BEM file does not state."""
    keys = {
        "density": "density_kg_per_m3", "gravity": "gravity_m_per_s2", "depth": "depth_m",
        "length_scale": "length_scale_m",
    }  # fmt: skip
    given = {key: getattr(water, field) for field, key in keys.items()}
    if given["depth_m"] == math.inf:
        given["depth_m"] = DEEPEST
    given["wave_direction_deg"] = direction
    return "".join(f"\n{key}: {v:g}" for key, v in given.items() if v is not None)


def names_of_modes(dofs: Iterable[str]) -> list[str]:
    """Return names of log fields for modes of a BEM file.

    `Heave` and `float__Heave` give `heave`; where two would be the same, `float_heave`.
    """
    given = list(dofs)
    short = [_field_name(dof.rpartition("__")[2]) for dof in given]
    return [
        name if short.count(name) == 1 else _field_name(dof)
        for name, dof in zip(short, given, strict=True)
    ]


def _field_name(text: str) -> str:
    name = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return name if name[:1].isalpha() else f"axis_{name}"


def rounded(value: float, digits: int = 3) -> float:
    """Return a value with some significant digits."""
    return float(f"{value:.{digits}g}")
