"""Text of a plant file: modes of a BEM file, a PTO for some of them, and marks what to choose."""

import math
import re
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from string import Template
from typing import NamedTuple

from rig.config.problems import format_number
from sim_plant.modes.bem_content import DEEPEST, Water, rotates

COUNTS = 20_000  # per revolution of an encoder
PEAK_CURRENT = 20.0  # A, of the first motor
STANDBY = 10.0  # W, of the drive
DAMPING_RATIO = 0.02
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


class Pto(NamedTuple):
    """First values of motor, gear, encoder and drive of an axis."""

    torque_constant: float  # N*m/A
    gear_ratio: float  # rad/m or 1
    counts: int  # per revolution
    current_limit: float  # A
    resistance: float  # ohm


class PlantEntries(NamedTuple):
    """All that a plant file states."""

    bem: str  # path relative to the plant file
    band: tuple[float, float]  # Hz, of the BEM file as far as it is used
    water: Water  # what the BEM file does not state
    direction: float | None  # degrees, of the waves, if the BEM file has several
    radiation: str | None  # path of the stored fit
    modes: tuple[ModeEntry, ...]
    axes: dict[str, Pto]  # by the mode that the axis moves with


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
            damping_percent=format_number(100.0 * DAMPING_RATIO),
        )
        for mode in entries.modes
    ]
    by_name = {mode.name: mode for mode in entries.modes}
    axes = [
        fragment(
            "plant_axis",
            rotary=rotates(by_name[axis].dof),
            axis=axis,
            torque_constant=format_number(rounded(pto.torque_constant)),
            gear_ratio=format_number(rounded(pto.gear_ratio)),
            counts=str(pto.counts),
            current_limit=format_number(rounded(pto.current_limit)),
            resistance=format_number(rounded(pto.resistance)),
            standby=format_number(STANDBY),
        )
        for axis, pto in entries.axes.items()
    ]
    one = len(entries.axes) == 1
    sensors = [
        f"  {'' if one else axis + '_'}dc_power: {{signal: {axis}.electric_power, noise: 0.1}}\n"
        for axis in entries.axes
    ]
    stored = entries.radiation
    return fragment(
        "plant",
        name=name,
        water=_water_lines(entries.water, entries.direction),
        bem=entries.bem,
        bem_range=f"{entries.band[0]:.3g} .. {entries.band[1]:.3g} Hz",
        radiation="" if stored is None else f"\nradiation: {stored}   # fit of the BEM file's",
        modes="\n".join(modes),
        axes="\n".join(axes),
        sensors="".join(sensors),
    )


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
