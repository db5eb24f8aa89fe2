"""Broken files of every BEM format: each is refused, by its name, before a plant is made of it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import mode_plants
import numpy as np
import pytest
from mode_plants import CYLINDER, NUMERIC, cylinder
from test_nemoh_files import write_nemoh

from sim_plant.modes.bem import read_modes
from sim_plant.modes.bem_content import Water

WATER = Water(density=1000.0)
FRESH = Water(density=1000.0, gravity=9.81, depth=np.inf)


def capytaine(folder: Path) -> Path:
    return Path(shutil.copy(CYLINDER, folder / "body.nc"))


def netcdf3(folder: Path) -> Path:
    return mode_plants.lupa(folder / "body.nc")


def numeric(folder: Path) -> Path:
    shutil.copy(NUMERIC.with_suffix(".3"), folder / "body.3")
    return Path(shutil.copy(NUMERIC, folder / "body.1"))


def wave_force(folder: Path) -> Path:
    return numeric(folder).with_suffix(".3")


def formatted(folder: Path) -> Path:
    return mode_plants.write_out(folder / "body.out", cylinder(), [1, 3, 5])


def bemio(folder: Path) -> Path:
    return mode_plants.write_bemio(folder / "body.h5", cylinder())


def nemoh(folder: Path) -> Path:
    return write_nemoh(folder / "run", cylinder()) / "results" / "RadiationCoefficients.tec"


Writer = Callable[[Path], Path]
WRITERS: dict[str, Writer] = {
    "Capytaine": capytaine, "NetCDF-3": netcdf3, "WAMIT .1": numeric, "WAMIT .3": wave_force,
    "WAMIT .out": formatted, "BEMIO": bemio, "Nemoh": nemoh,
}  # fmt: skip
WATERS = {"WAMIT .1": FRESH, "WAMIT .3": FRESH, "WAMIT .out": WATER}


def read(path: Path, water: Water | None) -> None:
    """Read a file; one of a Nemoh run by its folder."""
    read_modes(path.parent.parent if path.suffix == ".tec" else path, water=water)


def make_directory(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGES: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "a tenth": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 10]),
    "prose": lambda path: path.write_text("Results of the tank test\nare in the other folder.\n"),
    "a table": lambda path: path.write_text("1, 2, 3\n4, 5, 6\n"),
    "random bytes": lambda path: path.write_bytes(np.random.default_rng(1).bytes(5000)),
    "zeros": lambda path: path.write_bytes(bytes(5000)),
    "a directory": make_directory,
    "missing": lambda path: path.unlink(),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("program", WRITERS)
def test_what_is_no_whole_file_is_refused(tmp_path: Path, program: str, damage: str) -> None:
    path = WRITERS[program](tmp_path)
    read(path, WATERS.get(program))  # the whole file is read
    DAMAGES[damage](path)
    with pytest.raises((ValueError, OSError)) as refused:
        read(path, WATERS.get(program))
    assert path.name in str(refused.value) or path.stem in str(refused.value)


OWN = {
    "Capytaine": ".nc",
    "NetCDF-3": ".nc",
    "WAMIT .1": ".1",
    "WAMIT .out": ".out",
    "BEMIO": ".h5",
}


@pytest.mark.parametrize(
    ("program", "suffix"),
    [
        (program, suffix)
        for program in WRITERS
        for suffix in (".nc", ".h5", ".out", ".1", ".cal")
        if OWN.get(program) != suffix
    ],
)
def test_another_format_under_a_suffix_is_refused(
    tmp_path: Path, program: str, suffix: str
) -> None:
    path = WRITERS[program](tmp_path)
    other = Path(shutil.copy(path, tmp_path / f"other{suffix}"))
    with pytest.raises(ValueError, match="other"):
        read_modes(other, water=FRESH)


Edit = Callable[[str], str]
LINE = re.compile(r"^.*\n", re.MULTILINE)


def without_line(pattern: str) -> Edit:
    """Return an edit that removes the last matching line."""

    def edit(text: str) -> str:
        lines = LINE.findall(text)
        last = max(k for k, line in enumerate(lines) if re.match(pattern, line))
        return "".join(lines[:last] + lines[last + 1 :])

    return edit


def replaced(pattern: str, new: str) -> Edit:
    def edit(text: str) -> str:
        changed = re.sub(pattern, new, text, count=1, flags=re.MULTILINE)
        assert changed != text
        return changed

    return edit


TEXTS: dict[str, tuple[Writer, Edit, str]] = {
    ".1 NaN": (numeric, replaced(r"(\S+)$", "NaN"), "body.1: .*(not finite|NaN)"),
    ".1 mode missing at one period": (
        numeric, without_line(r"\s*\S+\s+3\s+3\s"),
        r"body.1: added mass and damping \(3, 3\) miss at",
    ),
    ".1 doubled": (numeric, lambda t: t + t, "body.1:.*appears twice"),
    ".1 negative period": (numeric, replaced(r"^\s*([1-9]\S+)", r"-\1"), "body.1:.*period is -"),
    ".1 five columns of force": (numeric, lambda t: t + "1 2 3 4 5 6\n", "6 numbers, expected 4"),
    ".1 mode zero": (numeric, lambda t: t + "9.9 0 1 1.0 1.0\n", "body.1:.*0 is no mode"),
    ".3 direction missing at one period": (
        wave_force, lambda t: "".join(LINE.findall(t)[3:]), "body.*exciting force is missing at",
    ),
    ".3 component missing": (
        wave_force, lambda t: "".join(LINE.findall(t)[1:]), "body.*excitation is not finite",
    ),
    ".3 word": (wave_force, replaced(r"\S+$", "large"), "body.3:1:|are not numbers|excitation"),
    ".out no depth": (formatted, without_line(r" Water depth"), "has no line 'Water depth:'"),
    ".out in feet": (
        formatted, replaced(r"Gravity:\s+\S+", "Gravity:   32.174"),
        "gravity_m_per_s2 is 32.174 m/s2; allowed: 9 .. 10.5",
    ),
    ".out period": (formatted, replaced(r"\(sec\) =\s+\S+", "(sec) = often"), "not a wave period"),
    ".out mode missing at one period": (
        formatted, lambda t: t[: t.rindex("     3     3")] + t[t.rindex("     3     5") :],
        r"body.out: added mass and damping \(3, 3\) miss at",
    ),
    ".out no forces": (
        formatted, lambda t: t.replace("EXCITING FORCES", "DRIFT FORCES"), "no exciting forces",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_a_wrong_text_is_refused(tmp_path: Path, name: str) -> None:
    writer, edit, message = TEXTS[name]
    path = writer(tmp_path)
    path.write_text(edit(path.read_text()))
    with pytest.raises(ValueError, match=message):
        read_modes(path, water=WATER if path.suffix == ".out" else FRESH)


def field(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[h5py.File], None]:
    def edit(file: h5py.File) -> None:
        values = change(np.array(file[name][...], np.float64))
        del file[name]
        file[name] = values

    return edit


def first_is_nan(values: np.ndarray) -> np.ndarray:
    values.flat[0] = np.nan
    return values


COEFFICIENTS = "body1/hydro_coeffs"
HDF5: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "NaN": (field(f"{COEFFICIENTS}/excitation/re", first_is_nan), "excitation is not finite at"),
    "negative frequency": (
        field("simulation_parameters/w", lambda w: -w), "frequencies must be numbers of 0 rad/s",
    ),
    "frequency twice": (
        field("simulation_parameters/w", lambda w: np.vstack([w[:1], w[:-1]])), "must ascend",
    ),
    "one mode less": (
        field(f"{COEFFICIENTS}/added_mass/all", lambda a: a[:2]),
        r"added_mass/all has the shape \(2, 3, 60\), expected \(3, 3, 60\)",
    ),
    "turned axes": (
        field(f"{COEFFICIENTS}/radiation_damping/all", lambda b: b.transpose(2, 0, 1)),
        "radiation_damping/all has the shape",
    ),
    "density of t/m3": (
        field("simulation_parameters/rho", lambda rho: rho / 1000.0),
        "density_kg_per_m3 is 1 kg/m3; allowed: 500 .. 2000",
    ),
    "no symmetry": (
        field(f"{COEFFICIENTS}/added_mass/all", lambda a: np.tril(a.T).T),
        "added mass of .* differ by",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HDF5)
def test_a_wrong_field_is_refused(tmp_path: Path, name: str) -> None:
    edit, message = HDF5[name]
    path = bemio(tmp_path)
    with h5py.File(path, "a") as file:
        edit(file)
    with pytest.raises(ValueError, match=f"body.h5: .*{message}"):
        read_modes(path)


def test_the_raw_file_of_lupa_is_refused_for_its_layout() -> None:
    """Its modes have no names, and its dimensions are no dataset's."""
    raw = mode_plants.HERE / "lupa" / "lupa_bem_4dof.nc"
    with pytest.raises(ValueError, match=r"lupa_bem_4dof.nc: has no field 'influenced_dof'"):
        read_modes(raw, water=FRESH)


def test_wave_directions_in_degrees_are_refused(tmp_path: Path) -> None:
    data = mode_plants.dataset().assign_coords(wave_direction=[180.0])
    path = mode_plants.saved(tmp_path / "degrees.nc", data)
    with pytest.raises(ValueError, match=r"degrees.nc: wave_direction is 180 rad; allowed: -6.28"):
        read_modes(path)
