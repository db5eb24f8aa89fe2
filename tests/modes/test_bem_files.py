"""BEM files of several modes: every format gives the same coefficients, broken files are named."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import mode_plants
import numpy as np
import pytest
import xarray as xr
from mode_plants import CYLINDER, NUMERIC, TWO_BODY, WAVEBOT, cylinder, dataset, saved

from sim_plant.bem import read_bem
from sim_plant.modes.bem import BemModes, ogilvie, read_modes, stated_mass
from sim_plant.modes.bem_content import Floats, Water

FRESH = Water(density=1000.0, gravity=9.81, depth=np.inf)
ORDER = ("Surge", "Heave", "Pitch")


def assert_same(one: BemModes, other: BemModes, rtol: float) -> None:
    """Compare all coefficients, with the largest one of a matrix as the measure."""
    assert one.modes == other.modes
    np.testing.assert_allclose(one.frequency, other.frequency, rtol=rtol)
    for name in ("added_mass", "damping", "excitation", "added_mass_infinite"):
        values, expected = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(values, expected, atol=rtol * np.abs(expected).max())
    assert (one.depth, one.density, one.gravity) == (other.depth, other.density, other.gravity)


def numeric_copy(folder: Path) -> Path:
    for suffix in (".1", ".3"):
        shutil.copy(NUMERIC.with_suffix(suffix), folder)
    return folder / NUMERIC.name


# Formats.
def test_a_capytaine_file_of_one_mode_is_that_of_the_other_reader() -> None:
    one, other = read_modes(WAVEBOT), read_bem(WAVEBOT)
    assert one.modes == ("Heave",)
    np.testing.assert_array_equal(one.frequency, other.frequency)
    np.testing.assert_array_equal(one.added_mass[:, 0, 0], other.added_mass)
    np.testing.assert_array_equal(one.excitation[:, 0], other.excitation)
    assert one.added_mass_infinite[0, 0] == other.added_mass_infinite


def test_the_hydrostatic_stiffness_of_the_cylinder_is_its_water_plane() -> None:
    bem = cylinder()
    assert bem.stiffness is not None
    assert bem.stiffness[1, 1] == pytest.approx(1000.0 * 9.81 * np.pi, rel=3e-3)  # a 60-gon
    assert (bem.depth, bem.infinite_method) == (np.inf, "file")


def test_excitation_tends_to_the_stiffness_for_long_waves() -> None:
    bem = cylinder()
    assert bem.stiffness is not None
    assert bem.excitation[0, 1] == pytest.approx(bem.stiffness[1, 1], rel=0.02)


def test_numeric_wamit_files_written_by_capytaine_agree_with_its_own_file() -> None:
    bem = read_modes(NUMERIC, ORDER, water=FRESH)
    assert_same(bem, cylinder(), 2e-6)  # seven digits
    assert bem.stiffness is None


def test_hst_and_length_scale(tmp_path: Path) -> None:
    path = numeric_copy(tmp_path)
    path.with_suffix(".hst").write_text("     3     3 2.0E+00\n     5     5 3.0E+00\n")
    bem = read_modes(path, ORDER, water=FRESH._replace(length_scale=2.0))
    assert bem.stiffness is not None
    # C / (rho g L^2), and L^4 for two rotations; A / (rho L^3) and L^5.
    assert bem.stiffness[1, 1] == pytest.approx(2.0 * 9810.0 * 4.0)
    assert bem.stiffness[2, 2] == pytest.approx(3.0 * 9810.0 * 16.0)
    plain = cylinder()
    ratio = bem.added_mass[5] / plain.added_mass[5]
    assert (ratio[1, 1], ratio[2, 2]) == pytest.approx((8.0, 32.0), rel=1e-5)
    assert bem.excitation[5, 1] == pytest.approx(4.0 * plain.excitation[5, 1], rel=1e-5)
    assert bem.excitation[5, 2] == pytest.approx(8.0 * plain.excitation[5, 2], rel=1e-5)


@pytest.mark.parametrize("heading", ["DIFFRACTION", "HASKIND"])
def test_formatted_wamit_output(tmp_path: Path, heading: str) -> None:
    force = f"    {heading} EXCITING FORCES AND MOMENTS"
    path = mode_plants.write_out(tmp_path / "cylinder.out", cylinder(), [1, 3, 5], force=force)
    bem = read_modes(path, ORDER, water=Water(density=1000.0))
    assert_same(bem, cylinder(), 1e-6)
    assert bem.stiffness is not None
    np.testing.assert_allclose(bem.stiffness, cylinder().stiffness, rtol=1e-5, atol=1e-6)


def test_volume_of_a_wamit_file_gives_the_mass_of_a_translation(tmp_path: Path) -> None:
    line = " Volumes (VOLX,VOLY,VOLZ):      0.851200  0.851000  0.850900"
    depth = f" Water depth:        infinite\n{line}"
    path = mode_plants.write_out(tmp_path / "a.out", cylinder(), [1, 3, 5], depth=depth)
    bem = read_modes(path, water=Water(density=1025.0))
    assert stated_mass(bem, 1) == (
        pytest.approx(1025.0 * 0.851),
        "displaced: 1025 kg/m3 * 0.851 m3",
    )
    assert stated_mass(bem, 2) == (None, "")


def test_bemio_file(tmp_path: Path) -> None:
    path = mode_plants.write_bemio(tmp_path / "cylinder.h5", cylinder())
    bem = read_modes(path)
    assert bem.modes == ("Surge", "Sway", "Heave")  # BEMIO numbers the modes
    assert_same(bem._replace(modes=ORDER), cylinder(), 1e-12)
    np.testing.assert_allclose(bem.stiffness, cylinder().stiffness, rtol=1e-12)


def test_capytaine_layouts_agree(tmp_path: Path) -> None:
    """Dimensions in another order, frequency in Hz, two parts of the force, native complex."""
    plain = dataset()
    turned = plain.transpose("influenced_dof", "wave_direction", "complex", "omega", ...)
    assert_same(read_modes(saved(tmp_path / "turned.nc", turned)), cylinder(), 0.0)

    swapped = plain.assign_coords(freq=("omega", plain.omega.values / (2.0 * np.pi)))
    swapped = swapped.swap_dims(omega="freq").drop_vars("omega")
    assert_same(read_modes(saved(tmp_path / "hertz.nc", swapped)), cylinder(), 1e-14)

    parts = plain.rename(excitation_force="diffraction_force")
    parts["Froude_Krylov_force"] = parts.diffraction_force
    parts["diffraction_force"] = 0.0 * parts.diffraction_force
    assert_same(read_modes(saved(tmp_path / "parts.nc", parts)), cylinder(), 0.0)


def over(name: str, values: Floats) -> xr.Dataset:
    """Return the dataset over another coordinate of its finite frequencies, which it keeps."""
    finite = dataset().isel(omega=slice(0, -1))
    return finite.assign_coords({name: ("omega", values)}).swap_dims(omega=name)


def test_other_main_dimensions_agree(tmp_path: Path) -> None:
    """Periods alone, which descend, and wave numbers with the frequencies as a coordinate."""
    omega = dataset().omega.values[:-1]
    periods = over("period", 2.0 * np.pi / omega).drop_vars("omega")
    numbers = over("wavenumber", omega**2 / 9.81)
    for name, data in (("periods", periods), ("numbers", numbers)):
        found = read_modes(saved(tmp_path / f"{name}.nc", data))
        np.testing.assert_allclose(found.frequency, cylinder().frequency, rtol=1e-14)
        np.testing.assert_array_equal(found.damping, cylinder().damping)
        np.testing.assert_array_equal(found.excitation, cylinder().excitation)
    others = numbers.drop_vars(["omega", "freq", "period"], errors="ignore")
    nameless = saved(tmp_path / "nameless.nc", others)
    with pytest.raises(ValueError, match="no omega, freq or period over the dimension wavenumber"):
        read_modes(nameless)


def test_one_of_several_depths_is_chosen(tmp_path: Path) -> None:
    plain = dataset().drop_vars("water_depth")
    deep, shallow = (plain.assign_coords(water_depth=depth) for depth in (np.inf, 5.0))
    shallow["added_mass"] = 1.1 * shallow.added_mass
    both = xr.concat([shallow, deep], "water_depth", data_vars=["added_mass"], coords="minimal",
                     compat="override", join="outer")  # fmt: skip
    path = saved(tmp_path / "depths.nc", both)
    found = read_modes(path, water=Water(depth=5.0))
    np.testing.assert_allclose(found.added_mass, 1.1 * cylinder().added_mass, rtol=1e-14)
    assert found.depth == 5.0
    with pytest.raises(ValueError, match=r"several values of water_depth \(5.0, inf\); choose one"):
        read_modes(path, water=Water(depth=7.0))


def test_netcdf_3_and_4_agree(tmp_path: Path) -> None:
    path = tmp_path / "old.nc"
    dataset().to_netcdf(path, engine="scipy")
    assert path.read_bytes()[:3] == b"CDF"
    assert_same(read_modes(path), cylinder(), 0.0)


def test_the_water_plane_of_a_heaving_body_is_its_stiffness(tmp_path: Path) -> None:
    heave = dataset().sel(radiating_dof=["Heave"], influenced_dof=["Heave"])
    heave = heave.drop_vars("hydrostatic_stiffness").assign(waterplane_area=3.14)
    bem = read_modes(saved(tmp_path / "heave.nc", heave))
    assert bem.stiffness is not None
    assert bem.stiffness[0, 0] == pytest.approx(1000.0 * 9.81 * 3.14)


def test_a_scalar_mode_needs_no_dimension(tmp_path: Path) -> None:
    heave = dataset().sel(radiating_dof="Heave", influenced_dof="Heave")
    assert_same(read_modes(saved(tmp_path / "heave.nc", heave)), cylinder("Heave"), 0.0)


def test_modes_come_in_the_order_asked_for() -> None:
    bem = cylinder("Pitch", "Surge")
    all_modes = cylinder()
    np.testing.assert_array_equal(bem.damping[:, 0, 1], all_modes.damping[:, 2, 0])
    np.testing.assert_array_equal(bem.excitation[:, 1], all_modes.excitation[:, 0])


def test_one_of_several_directions_is_chosen(tmp_path: Path) -> None:
    plain = dataset()
    other = plain.copy(deep=True)
    other["excitation_force"] = 2.0 * plain.excitation_force
    other = other.assign_coords(wave_direction=[np.pi / 2.0])
    both = xr.concat([plain, other], "wave_direction", data_vars="minimal", coords="minimal",
                     compat="override", join="outer")  # fmt: skip
    path = saved(tmp_path / "two.nc", both)
    bem = read_modes(path, direction=90.0)
    np.testing.assert_array_equal(bem.excitation, 2.0 * cylinder().excitation)
    with pytest.raises(ValueError, match="several wave directions: 0, 90 degrees"):
        read_modes(path)
    with pytest.raises(ValueError, match="no wave direction of 45 degrees; it has 0, 90"):
        read_modes(path, direction=45.0)


@pytest.mark.parametrize("path", [CYLINDER, TWO_BODY])
def test_a_missing_infinite_added_mass_is_derived(tmp_path: Path, path: Path) -> None:
    """Ogilvie's relation gives A_inf within 0.2 % of the diagonal where the damping dies out."""
    known = read_modes(path)
    finite = dataset(path)
    finite = finite.isel(omega=np.isfinite(finite.omega.values))
    bem = read_modes(saved(tmp_path / "finite.nc", finite))
    assert bem.infinite_method == "Ogilvie's relation"
    largest = np.sqrt(np.outer(*2 * [np.diag(known.added_mass_infinite)]))
    assert np.all(np.abs(bem.added_mass_infinite - known.added_mass_infinite) < 0.003 * largest)


def test_ogilvie_of_a_known_memory() -> None:
    """K(t) = e^{-t} cos 2t has B = Re K(i w) and A = A_inf + Im K(i w) / w."""
    omega = np.linspace(0.1, 20.0, 300)
    s = 1j * omega
    response = (s + 1.0) / ((s + 1.0) ** 2 + 4.0) - 0.2 * s / (s + 1.0) / (s + 1.0)
    response = response - 0.2 / (s + 1.0)  # no damping at w = 0
    added = 7.0 + response.imag / omega
    found = ogilvie(omega, added[:, None, None], response.real[:, None, None])
    assert found[0, 0] == pytest.approx(7.0, rel=2e-3)


# Broken files: each message names the file and what is wrong.
Change = Callable[[xr.Dataset], xr.Dataset]


def with_value(name: str, value: float) -> Change:
    def change(data: xr.Dataset) -> xr.Dataset:
        data[name] = data[name].copy(deep=True)
        data[name].values[(3,) + (0,) * (data[name].ndim - 1)] = value
        return data

    return change


BROKEN: dict[str, tuple[Change, str]] = {
    "no added mass": (lambda d: d.drop_vars("added_mass"), "no field 'added_mass'; it has"),
    "no damping": (lambda d: d.drop_vars("radiation_damping"), "no field 'radiation_damping'"),
    "no force": (lambda d: d.drop_vars("excitation_force"), "no field 'excitation_force'"),
    "no direction": (lambda d: d.drop_vars("wave_direction"), "no field 'wave_direction'"),
    "NaN in added mass": (with_value("added_mass", np.nan), "added mass is not finite at 0.62"),
    "NaN in damping": (with_value("radiation_damping", np.nan), "damping is not finite"),
    "frequency twice": (
        lambda d: d.isel(omega=[*range(9), 8, *range(10, 20)]),
        "frequencies must ascend; 1.41372 rad/s is followed by 1.41372",
    ),
    "two depths": (
        lambda d: d.drop_vars("water_depth").expand_dims(water_depth=[5.0, 10.0]),
        r"several values of water_depth \(5.0, 10.0\)",
    ),
    "other modes": (
        lambda d: d.assign_coords(radiating_dof=["Surge", "Heave", "Roll"]),
        r"radiating_dof \(Surge, Heave, Roll\) and influenced_dof \(Surge, Heave, Pitch\)",
    ),
    "mode twice": (
        lambda d: d.assign_coords(
            radiating_dof=["Surge", "Heave", "Heave"], influenced_dof=["Surge", "Heave", "Heave"]
        ),
        "a mode appears twice",
    ),
    "real force": (lambda d: d.isel(complex=0, drop=True), "excitation_force is real"),
    "few frequencies": (lambda d: d.isel(omega=slice(0, 5)), "has 5 frequencies; at least 8"),
    "unknown dimension": (
        lambda d: d.assign(added_mass=d.added_mass.expand_dims(speed=[0.0, 1.0])),
        "added_mass has the unexpected dimension speed",
    ),
    "not symmetric": (
        lambda d: d.assign(
            added_mass=d.added_mass.where(d.radiating_dof != "Pitch", 5.0 * d.added_mass)
        ),
        r"added mass of \(Surge, Pitch\) and \(Pitch, Surge\) differ by",
    ),
    "no density": (lambda d: d.drop_vars("rho"), "does not state density_kg_per_m3"),
    "zero gravity": (
        lambda d: d.assign_coords(g=0.0),
        "gravity_m_per_s2 is 0 m/s2; allowed: 9 .. 10.5",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_capytaine_file_is_refused(tmp_path: Path, name: str) -> None:
    change, message = BROKEN[name]
    path = saved(tmp_path / "broken.nc", change(dataset()))
    with pytest.raises(ValueError, match=f"broken.nc: .*{message}"):
        read_modes(path)


def test_other_broken_files_are_refused(tmp_path: Path) -> None:
    text = tmp_path / "text.nc"
    text.write_text("not HDF5")
    with pytest.raises(ValueError, match=r"text.nc: is no whole HDF5 file"):
        read_modes(text)
    with pytest.raises(ValueError, match=r"unknown type of BEM file '.csv'; allowed: .nc, .h5"):
        read_modes(tmp_path / "a.csv")
    with pytest.raises(OSError, match=r"missing.nc"):
        read_modes(tmp_path / "missing.nc")
    with pytest.raises(ValueError, match="no mode 'Roll'; it has Surge, Heave, Pitch"):
        read_modes(CYLINDER, ["Roll"])
    with pytest.raises(
        ValueError, match="states density_kg_per_m3 1000 kg/m3, the plant file 1025"
    ):
        read_modes(CYLINDER, water=Water(density=1025.0))


def test_broken_numeric_files_are_refused(tmp_path: Path) -> None:
    path = numeric_copy(tmp_path)
    with pytest.raises(ValueError, match="does not state density_kg_per_m3"):
        read_modes(path)
    with pytest.raises(ValueError, match="does not state depth_m"):
        read_modes(path, water=FRESH._replace(depth=None))
    good = path.read_text()
    for broken, message in (
        (good.replace("1.0", "one", 1), "are not numbers|expected 4 or 5"),
        (good + "1.0 1 1 2.0 3.0 4.0\n", "has 6 numbers, expected 4 or 5"),
        (good + "1.7 1 1 2.0\n", "the damping is missing"),
        (good + good.splitlines()[-1] + "\n", "appears twice"),
        (good + "2.0 1.5 1 2.0 3.0\n", "1.5 is no mode"),
        (good + "77.0 1 1 2.0 3.0\n", "exciting force is missing at 77 s"),
    ):
        path.write_text(broken)
        with pytest.raises(ValueError, match=f"cylinder.*({message})"):
            read_modes(path, water=FRESH)
    path.write_text(good)
    path.with_suffix(".3").unlink()
    with pytest.raises(ValueError, match=r"cylinder.3 is missing"):
        read_modes(path, water=FRESH)


def test_broken_formatted_output_is_refused(tmp_path: Path) -> None:
    water = Water(density=1000.0)
    for name, line, message in (
        ("gravity", "", "has no line 'Gravity:'"),
        ("depth", "", "has no line 'Water depth:'"),
        ("force", "    RESPONSE AMPLITUDE OPERATORS", "has no exciting forces"),
    ):
        path = mode_plants.write_out(tmp_path / "a.out", cylinder(), [1, 3, 5], **{name: line})
        with pytest.raises(ValueError, match=f"a.out: {message}"):
            read_modes(path, water=water)


def test_broken_bemio_files_are_refused(tmp_path: Path) -> None:
    path = mode_plants.write_bemio(tmp_path / "a.h5", cylinder())
    with h5py.File(path, "a") as file:
        del file["body1/hydro_coeffs/added_mass/inf_freq"]
    with pytest.raises(ValueError, match="no field 'body1/hydro_coeffs/added_mass/inf_freq'"):
        read_modes(path)
    with h5py.File(path, "a") as file:
        file["body1/hydro_coeffs/added_mass/inf_freq"] = np.zeros((3, 6))
    with pytest.raises(ValueError, match=r"inf_freq has the shape \(3, 6\), expected \(3, 3\)"):
        read_modes(path)
    with h5py.File(path, "a") as file:
        del file["body1"]
    with pytest.raises(ValueError, match="has no group 'body1'; it has simulation_parameters"):
        read_modes(path)


# Signs and centres.
def test_negative_radiation_damping_is_named(tmp_path: Path) -> None:
    changed = dataset()
    damping = changed["radiation_damping"]
    changed["radiation_damping"] = damping.where(damping.radiating_dof != "Heave", -damping)
    path = saved(tmp_path / "reversed.nc", changed)
    peak = cylinder().damping[:, 1, 1]
    at, worst = cylinder().frequency[peak.argmax()], peak.max()
    text = f"reversed.nc: radiation damping of Heave is negative: {-worst:.4g} N.s/m at {at:.4g} Hz"
    with pytest.raises(ValueError, match=text):
        read_modes(path)
    assert read_modes(path, ("Surge",)).modes == ("Surge",)


def test_one_negative_value_is_left_to_the_fit(tmp_path: Path) -> None:
    """As of an irregular frequency."""
    changed = dataset()
    changed["radiation_damping"].values[30, 1, 1] *= -1.0
    assert read_modes(saved(tmp_path / "spike.nc", changed)).damping[:, 1, 1].min() < 0.0


def test_centres_of_rotation_and_mass_are_read_of_each_body(tmp_path: Path) -> None:
    assert cylinder().centres == (None,) * 3  # the file has no centre of mass
    one = dataset().assign(center_of_mass=("space_coordinate", [0.0, 0.0, -0.45]))
    centres = read_modes(saved(tmp_path / "one.nc", one)).centres[2]
    assert centres is not None
    assert (centres.rotation, centres.mass) == ((0.0, 0.0, -0.3), (0.0, 0.0, -0.45))
    # e_y x (0, 0, -0.15): pitch moves a centre of mass below the axis to -x.
    np.testing.assert_allclose(centres.lever("Pitch"), [-0.15, 0.0, 0.0])
    np.testing.assert_allclose(centres.lever("Yaw"), 0.0, atol=1e-12)
    points = [[0.0, 0.0, -0.3], [0.0, 0.0, -2.0]]
    two = dataset(TWO_BODY).assign(rotation_center=(("body", "space_coordinate"), points))
    of_disc = read_modes(saved(tmp_path / "two.nc", two)).centres[1]
    assert of_disc is not None
    assert (of_disc.rotation[2], of_disc.mass[2]) == (-2.0, -2.65)
