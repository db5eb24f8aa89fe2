"""Known delays of a force's channel, against a signal on a fine grid; the intervals of a fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from rehearsing import CONFIGS
from scipy.signal import lfilter

from rig.emulation.bem_impedance import read_impedance
from rig.identification.channels import AxisChannels, ForceChannel, recorded_channels
from rig.identification.fit import fit

TICK, PERIOD, FINE = 1e-3, 2.0, 100  # s, s, steps of a tick
TAU = 1.0 / (2.0 * np.pi * 200.0)  # s


def line(values: np.ndarray, hertz: float) -> complex:
    """Return the complex amplitude of a line of one period."""
    time = np.arange(values.size) * (PERIOD / values.size)
    return complex(np.mean(values * np.exp(-2j * np.pi * hertz * time)) * 2.0)


@pytest.mark.parametrize("hertz", [0.5, 5.0, 50.0])
def test_a_command_is_corrected_for_hold_and_current_loop(hertz: float) -> None:
    """A staircase through a first-order lag that is solved exactly on a grid of 10 us."""
    ticks = round(PERIOD / TICK)
    command = np.cos(2.0 * np.pi * hertz * np.arange(ticks) * TICK + 0.3)
    stairs = np.tile(np.repeat(command, FINE), 2)
    decay = np.exp(-TICK / FINE / TAU)
    current = lfilter([0.0, 1.0 - decay], [1.0, -decay], stairs)[-ticks * FINE :]
    channel = ForceChannel("command", "command", "", hold_s=TICK, time_constant_s=TAU)
    factor = channel.force_per_reading(np.array([2.0 * np.pi * hertz]))[0]
    expected = line(current, hertz) / line(command, hertz)
    assert factor == pytest.approx(expected, rel=1e-5)
    delay = -np.angle(factor) / (2.0 * np.pi * hertz)
    if hertz < 10.0:
        assert delay == pytest.approx(0.5e-3 + TAU, rel=1e-3)


def test_a_lag_of_a_sensor_is_taken_out() -> None:
    channel = ForceChannel("cell", "cell", "", lag_s=0.02)
    omega = np.array([1.0, 10.0])
    reading = np.exp(-1j * omega * 0.02)
    assert channel.force_per_reading(omega) * reading == pytest.approx(np.ones(2))


def test_delays_are_in_the_record_of_a_run() -> None:
    """A record without them has none."""
    command = ForceChannel("command", "command", "a.command.force", hold_s=1e-3)
    declared = AxisChannels(command, command=command)
    record = {"axis": "a", "channels": declared.as_record()}
    assert recorded_channels(record) == declared
    del record["channels"]["command"]
    assert recorded_channels(record).command is None


def test_intervals_of_a_fit_contain_the_truth() -> None:
    """95 +- 3 % of 400 fits of a second-order device with noise; 0.6 % of standard error."""
    rng = np.random.default_rng(3)
    frequency = np.arange(4, 21) / 20.0
    s = 2j * np.pi * frequency
    truth = np.array([1400.0, 1900.0, 23000.0])
    y = 1.0 / (truth[0] * s + truth[1] + truth[2] / s)
    inside = []
    for _ in range(400):
        noise = rng.normal(size=(2, s.size)) * 1e-2 * np.abs(y).max()
        model = fit(frequency, 1.0 / (y + noise[0] + 1j * noise[1]))
        inside.append(np.abs(np.array(model[:3]) - truth) <= model.intervals)
    covered = np.mean(inside, axis=0)
    assert ((covered > 0.92) & (covered < 0.98)).all(), covered


def test_parameters_that_lines_do_not_determine_have_no_interval() -> None:
    """Lines at one frequency determine no mass apart from stiffness."""
    frequency = np.array([0.4, 0.4 + 1e-12, 0.4 + 2e-12])
    s = 2j * np.pi * frequency
    model = fit(frequency, (1400.0 * s + 1900.0 + 23000.0 / s) * np.array([1.0, 1.01, 1.02]))
    assert np.isnan(model.intervals).all()


def test_impedance_of_a_bem_file(tmp_path: Path) -> None:
    path = CONFIGS / "plants" / "cylinder_bem.nc"
    found = read_impedance(path, "heave")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        heave = data.sel(influenced_dof="Heave", radiating_dof="Heave").isel(omega=20)
        omega = float(heave["omega"])
        inertia = float(heave["added_mass"]) + float(heave["inertia_matrix"])
        expected = complex(
            float(heave["radiation_damping"]),
            omega * inertia - float(heave["hydrostatic_stiffness"]) / omega,
        )
    assert found.at(np.array([omega / (2.0 * np.pi)]))[0] == pytest.approx(expected, rel=1e-6)
    assert np.isnan(found.at(np.array([9.0]))).all()
    with pytest.raises(ValueError, match=r"has no mode of belt; it has .*Heave"):
        read_impedance(path, "belt")
    with pytest.raises(ValueError, match="no hydrostatic stiffness of Heave"):
        read_impedance(path.with_name("wavebot_bem.nc"), "heave")
