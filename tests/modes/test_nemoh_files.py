"""Folders of Nemoh runs: layouts of versions 2 and 3, and what is refused.

`write_nemoh` follows the manual and the files of versions 2.3 and 3.0.2, not the reader.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from mode_plants import cylinder

from sim_plant.modes.bem import BemModes, bem_files, read_modes, stated_mass

MOTIONS = {
    "Surge": "1 1. 0. 0. 0. 0. 0.",
    "Heave": "1 0. 0. 1. 0. 0. 0.",
    "Pitch": "2 0. 1. 0. 0. 0. -0.3",
}
RIGID = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")


def write_nemoh(
    folder: Path, bem: BemModes, *, version: int = 3, unit: str = "w (rad/s)", angles: int = 1
) -> Path:
    """Write a run of some modes of one body, as Nemoh 2.3 or 3.0.2 does; return its folder."""
    names = ("Results", "Mesh") if version == 2 else ("results", "mesh")
    results, mesh = (folder / name for name in names)
    for each in (results, mesh):
        each.mkdir(parents=True)
    omega = 2.0 * np.pi * bem.frequency
    count = len(bem.modes)
    motions = [f"{MOTIONS[mode]}\t! {mode}" for mode in bem.modes]
    cases = f"{omega.size}\t{omega[0]:.9f}\t{omega[-1]:.9f}"
    (folder / "Nemoh.cal").write_text(
        "\n".join([
            "--- Environment -----------------------------------------------------------------",
            f"{bem.density:.1f}\t\t! RHO \t! KG/M**3 \t! Fluid specific volume ",
            f"{bem.gravity}\t\t! G \t! M/S**2 ! Gravity",
            "0.  \t! DEPTH ! M ! Water depth", "0.\t0. ! XEFF YEFF ! M ! Wave measurement point",
            "--- Description of floating bodies ----------------------------------------------",
            "1\t! Number of bodies", "--- Body 1 ---", "mesh\\body.dat ! Name of mesh file",
            "5000 1250 ! Number of points and number of panels",
            f"{count} ! Number of degrees of freedom", *motions,
            f"{count} ! Number of resulting generalised forces", *motions,
            "0 ! Number of lines of additional information",
            "--- Load cases to be solved -----------------------------------------------------",
            ("" if version == 2 else "1 ") + f"{cases}\t! Number of wave frequencies, Min, and Max",
            f"{angles}\t0.\t{90.0 * (angles - 1)} ! Number of directions, Min and Max (degrees)",
            "--- Post processing -------------------------------------------------------------",
            "0 0.1 10. ! IRF", "0 ! Show pressure", "",
        ])
    )  # fmt: skip
    column = {"w (rad/s)": omega, "f (Hz)": bem.frequency, "T (s)": 1.0 / bem.frequency}[unit]
    head = f'VARIABLES="{unit}"'

    def rows(*values: Sequence[float]) -> list[str]:
        return ["".join(f"  {v:.7E}" for v in row) for row in np.column_stack([column, *values])]

    text = [head, *(f'"A   1   {k}" "B   1   {k}"' for k in range(1, count + 1))]
    for j in range(count):
        text.append(f'Zone t="Motion of body    1 in DoF   {j + 1}",I={omega.size:6d},F=POINT')
        pairs = [(bem.added_mass[:, i, j], bem.damping[:, i, j]) for i in range(count)]
        text += rows(*(values for pair in pairs for values in pair))
    (results / "RadiationCoefficients.tec").write_text("\n".join(text) + "\n")
    text = [head, *(f'"abs(F   1   {k})" "angle(F   1   {k})"' for k in range(1, count + 1))]
    what = "Diffraction force" if version == 2 else "Excitation force"
    for k in range(angles):
        text.append(f'Zone t="{what} - beta = {90.0 * k:7.3f} deg",I={omega.size:6d},F=POINT')
        forces = [(1.0 + k) * bem.excitation[:, i] for i in range(count)]
        text += rows(*(part for x in forces for part in (np.abs(x), np.angle(x))))
    (results / "ExcitationForce.tec").write_text("\n".join(text) + "\n")
    (mesh / "Hydrostatics.dat").write_text(
        " XF =   0.000 - XG =   0.000\n YF =   0.000 - YG =   0.000\n ZF =  -0.500 - ZG =  -0.300\n"
        " Displacement =  0.3135900E+01\n Waterplane area =  0.3135900E+01\n"
    )
    assert bem.stiffness is not None
    places = [RIGID.index(mode) for mode in bem.modes]
    full = np.zeros((6, 6))
    full[np.ix_(places, places)] = bem.stiffness
    inertia = np.diag([3135.9, 3135.9, 3135.9, 900.0, 1079.0, 1100.0])
    if version == 2:
        np.savetxt(mesh / "KH.dat", full, fmt="%15.7E")
        np.savetxt(mesh / "Inertia_hull.dat", inertia[3:, 3:], fmt="%15.7E")
    else:
        (folder / "Mechanics").mkdir()
        np.savetxt(folder / "Mechanics" / "Kh.dat", full, fmt="%15.7E")
        np.savetxt(folder / "Mechanics" / "Inertia.dat", inertia, fmt="%15.7E")
    return folder


@pytest.mark.parametrize(
    ("version", "unit"), [(2, "w (rad/s)"), (3, "w (rad/s)"), (3, "f (Hz)"), (3, "T (s)")]
)
def test_a_run_gives_back_its_coefficients(tmp_path: Path, version: int, unit: str) -> None:
    """To the seven digits of the files; the unit of the frequency follows from `Nemoh.cal`."""
    expected = cylinder()
    folder = write_nemoh(tmp_path / "run", expected, version=version, unit=unit)
    for path in (folder, folder / "Nemoh.cal"):
        found = read_modes(path)
        assert found.modes == expected.modes
        for name in ("frequency", "added_mass", "damping", "excitation", "stiffness"):
            values = getattr(expected, name)
            np.testing.assert_allclose(
                getattr(found, name), values, atol=2e-7 * np.abs(values).max(), err_msg=name
            )
        assert (found.depth, found.density, found.gravity) == (np.inf, 1000.0, 9.81)
        assert found.infinite_method == "Ogilvie's relation"
        known = np.abs(np.diag(expected.added_mass_infinite))
        gap = np.abs(found.added_mass_infinite - expected.added_mass_infinite)
        assert np.all(gap < 0.003 * np.sqrt(np.outer(known, known)))


def test_masses_come_from_inertia_or_volume(tmp_path: Path) -> None:
    new = read_modes(write_nemoh(tmp_path / "new", cylinder()))
    assert stated_mass(new, 2) == (1079.0, "Mechanics/Inertia.dat")
    old = read_modes(write_nemoh(tmp_path / "old", cylinder(), version=2))
    assert stated_mass(old, 1) == (pytest.approx(3135.9), "displaced: 1000 kg/m3 * 3.1359 m3")
    assert stated_mass(old, 2) == (1079.0, "Inertia_hull.dat: mass spread evenly over the hull")


def test_one_of_several_directions_is_chosen(tmp_path: Path) -> None:
    folder = write_nemoh(tmp_path / "run", cylinder(), angles=2)
    found = read_modes(folder, direction=90.0)
    np.testing.assert_allclose(found.excitation, 2.0 * cylinder().excitation, rtol=1e-6, atol=1e-2)
    with pytest.raises(ValueError, match="several wave directions: 0, 90 degrees"):
        read_modes(folder)


def test_all_files_of_a_run_are_named(tmp_path: Path) -> None:
    folder = write_nemoh(tmp_path / "run", cylinder(), version=2)
    names = {path.relative_to(folder).as_posix() for path in bem_files(folder)}
    assert names == {
        "Nemoh.cal", "Results/RadiationCoefficients.tec", "Results/ExcitationForce.tec",
        "Mesh/Hydrostatics.dat", "Mesh/KH.dat", "Mesh/Inertia_hull.dat",
    }  # fmt: skip


# Broken runs: file, what is done to its text, and the message.
Edit = Callable[[str], str]
BROKEN: dict[str, tuple[str, Edit, str]] = {
    "empty cal": ("Nemoh.cal", lambda _: "", r"Nemoh.cal: is empty"),
    "binary cal": ("Nemoh.cal", lambda _: "\0\1", "Nemoh.cal: is a binary file"),
    "truncated cal": (
        "Nemoh.cal", lambda t: t[: t.index("0 ! Number of lines")],
        r"Nemoh.cal:\d+: number of additional lines expected",
    ),
    "word in cal": (
        "Nemoh.cal", lambda t: t.replace("9.81", "gravity"), "Nemoh.cal:3: gravity expected",
    ),
    "density in t/m3": (
        "Nemoh.cal", lambda t: t.replace("1000.0", "1.025"),
        "density_kg_per_m3 is 1.025 kg/m3; allowed: 500 .. 2000",
    ),
    "measured elsewhere": (
        "Nemoh.cal", lambda t: t.replace("0.\t0. ! XEFF", "5.\t0. ! XEFF"),
        r"measurement point is \(5, 0\) m; allowed: \(0, 0\)",
    ),
    "other forces": (
        "Nemoh.cal", lambda t: "".join(t.rsplit("2 0. 1. 0. 0. 0. -0.3", 1)[0])
        + "2 0. 1. 0. 0. 0. 0.0" + t.rsplit("2 0. 1. 0. 0. 0. -0.3", 1)[1],
        "3 degrees of freedom and 3 forces that are not along them",
    ),
    "other frequencies": (
        "Nemoh.cal", lambda t: t.replace("9.424777961", "8.0"), "in none of the units rad/s, Hz, s",
    ),
    "truncated results": (
        "results/RadiationCoefficients.tec", lambda t: t[: len(t) // 2],
        "RadiationCoefficients.tec.*has (blocks of|\\d+ numbers)",
    ),
    "missing motion": (
        "results/RadiationCoefficients.tec", lambda t: t[: t.rindex("Zone")],
        "has blocks of 60, 60 rows; Nemoh.cal has 3 blocks of 60",
    ),
    "doubled direction": (
        "results/ExcitationForce.tec", lambda t: t + t[t.index("Zone") :],
        "has blocks of 60, 60 rows; Nemoh.cal has 1 blocks of 60",
    ),
    "NaN": (
        "results/RadiationCoefficients.tec", lambda t: re.sub(r"  \S+$", "  NaN", t.strip()),
        "damping is not finite at 9.42478 rad/s",
    ),
    "stars": (
        "results/ExcitationForce.tec", lambda t: re.sub(r"  \S+$", "  *******", t.strip()),
        r"ExcitationForce.tec:\d+: .* are not numbers",
    ),
    "stiffness of five rows": (
        "Mechanics/Kh.dat", lambda t: t[: t.rstrip().rindex("\n")], "is no matrix of 6 x 6 numbers",
    ),
    "stiffness of another program": (
        "Mechanics/Kh.dat", lambda _: "3 3 0.7\n", "Kh.dat: is no matrix of 6 x 6 numbers",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_run_is_refused(tmp_path: Path, name: str) -> None:
    file, edit, message = BROKEN[name]
    folder = write_nemoh(tmp_path / "run", cylinder())
    path = folder / file
    path.write_text(edit(path.read_text()))
    with pytest.raises(ValueError, match=message) as refused:
        read_modes(folder)
    assert str(folder) in str(refused.value)


def test_missing_parts_are_refused(tmp_path: Path) -> None:
    folder = write_nemoh(tmp_path / "run", cylinder())
    (folder / "results" / "ExcitationForce.tec").unlink()
    with pytest.raises(ValueError, match=r"Nemoh.cal: its folder has no results/ExcitationForce"):
        read_modes(folder)
    (folder / "Nemoh.cal").unlink()
    with pytest.raises(OSError, match=r"Nemoh.cal"):
        read_modes(folder)
