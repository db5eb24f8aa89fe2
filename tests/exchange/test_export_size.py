"""Size of an export before it is written, disks without room, and the rate of tables."""

from __future__ import annotations

import csv
import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from command_here import rig
from synthetic_runs import POWERS, Row, Shape, plan_json, run_rows, write_run

from rig.analysis.rows import row_table
from rig.interop import export_size
from rig.interop.export_size import check_room, format_bytes
from rig.interop.tables import read_table, select_table
from rig.realtime.sequence import Phase
from rig.recording.runs import open_run
from rig.regular_file import replacing

FORMATS = ("mat", "netcdf", "csv")
GOLDEN = Path(__file__).resolve().parents[1] / "batch" / "golden"


def write(folder: Path, dt: float, change: Any = None) -> Path:
    """Write a run of two rows of 2 s with noise on the power."""
    rows = [Row(i, 0, 490.9, -1000.0, 0.0, dict.fromkeys(POWERS, -9.0 - i)) for i in range(2)]
    shape = Shape(dt=dt, periods=1, settle=55, noise=5.0)
    data = run_rows(rows, shape)
    if change is not None:
        data = change(data)
    return write_run(folder / "run", data, plan_json(rows, shape))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("size"), 0.001)


def disk_with(free: int, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = type(export_size.shutil.disk_usage("/"))(10**12, 10**12 - free, free)
    monkeypatch.setattr(export_size.shutil, "disk_usage", lambda path: usage)


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Refuse to let a file grow beyond ``size`` bytes, as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


# Disks without room.


@pytest.mark.parametrize("form", FORMATS)
def test_too_little_room_is_refused_with_the_numbers(
    run: Path, form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk_with(4321, monkeypatch)
    path = tmp_path / "x"
    process = rig("export", run, "--as", form, "-o", path)
    assert process.returncode == 2
    assert f"{path}: about" in process.stderr
    assert "samples of" in process.stderr
    assert f"4.32 kB free in {tmp_path}: too little room" in process.stderr
    assert "--force" in process.stderr
    assert list(tmp_path.iterdir()) == []
    forced = rig("export", run, "--as", form, "-o", path, "--force", "--json")
    assert forced.returncode == 0
    assert json.loads(forced.stdout)["estimated_bytes"] > 4321
    assert "4.32 kB free" in forced.stderr
    assert path.stat().st_size > 4321


@pytest.mark.parametrize("form", FORMATS)
def test_a_disk_that_fills_up_leaves_the_old_file_and_no_part_of_a_new_one(
    run: Path, form: str, tmp_path: Path
) -> None:
    path = tmp_path / "x"
    path.write_text("of yesterday")
    with largest_file(5_000):
        process = rig("export", run, "--as", form, "-o", path)
    assert process.returncode == 2
    assert f"{path}: File too large" in process.stderr
    assert path.read_text() == "of yesterday"
    assert [each.name for each in tmp_path.iterdir()] == ["x"]


def test_a_device_is_written_itself(run: Path) -> None:
    process = rig("export", run, "--as", "csv", "-o", "/dev/full")
    assert process.returncode == 2
    assert "No space left on device" in process.stderr
    assert Path("/dev/full").is_char_device()


def test_a_folder_that_does_not_exist_is_an_error_of_writing(run: Path, tmp_path: Path) -> None:
    process = rig("export", run, "--as", "csv", "-o", tmp_path / "none" / "x.csv")
    assert process.returncode == 2
    assert f"{tmp_path / 'none' / 'x.csv'}: No such file or directory" in process.stderr


def test_an_error_of_the_program_leaves_the_old_file(tmp_path: Path) -> None:
    path, link = tmp_path / "x", tmp_path / "link"
    path.write_text("old")
    link.symlink_to(path)

    def interrupted() -> None:
        with replacing(link) as part:
            part.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert (path.read_text(), sorted(p.name for p in tmp_path.iterdir())) == ("old", ["link", "x"])
    with replacing(link) as part:
        part.write_text("new")
    assert (path.read_text(), link.is_symlink()) == ("new", True)


# Estimates.


TABLES = (("csv",), ("csv", "--every-tick"), ("netcdf",))
STRUCTURES = (("mat",), ("mat", "--for-scripts"))


@pytest.mark.parametrize(
    ("name", "options"),
    [
        *((name, options) for name in ("cots", "hoist", "modular") for options in TABLES),
        *((name, options) for name in ("cots", "hoist") for options in STRUCTURES),
    ],
)
def test_the_estimate_is_near_the_size(name: str, options: tuple[str, ...], tmp_path: Path) -> None:
    """Within 40 % or 50 kB, of names and attributes: disks are full by factors.

    For the scripts, runs as short as these get 120 s of samples before their rows: 200 kB.
    """
    around = 200_000 if "--for-scripts" in options else 50_000
    path = tmp_path / "x"
    process = rig("export", GOLDEN / f"{name}.mcap", "--as", *options, "-o", path, "--json")
    estimate, size = json.loads(process.stdout)["estimated_bytes"], path.stat().st_size
    assert abs(estimate - size) < max(0.4 * size, around), (estimate, size)


def test_rows_count_in_the_estimate(run: Path) -> None:
    """A third of the ticks: rows 0 and 1 last as long as lead-in, settling and tails."""
    whole, one = select_table(run, ["power"], ()), select_table(run, ["power"], [1])
    measured = open_run(run, ["plan.row"], 1).sizes["time"]
    assert (whole.samples, one.samples) == (open_run(run, ["tick"]).sizes["time"], measured)
    assert one.csv_size().bytes == pytest.approx(
        whole.csv_size().bytes * measured / whole.samples, rel=1e-6
    )


def test_a_large_export_is_announced(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quiet = rig("export", run, "--as", "csv", "-o", tmp_path / "x.csv")
    assert quiet.stderr == ""
    monkeypatch.setattr(export_size, "LARGE_BYTES", 1000)
    process = rig("export", run, "--as", "csv", "-o", tmp_path / "x.csv")
    assert process.returncode == 0
    assert process.stderr.startswith(f"rig export: {tmp_path / 'x.csv'}: about ")
    assert " samples of 28 fields); " in process.stderr


def test_an_empty_record_has_no_size(tmp_path: Path) -> None:
    run = write(tmp_path, 0.001, lambda data: data[:0])
    size = select_table(run, ["power.*"], ()).csv_size()
    assert (size.samples, size.bytes) == (0, 0)
    assert check_room(tmp_path / "x.csv", size) == ""


def test_bytes_have_decimal_units() -> None:
    texts = [format_bytes(count) for count in (0, 999, 1000, 1.5e6, 2.25e9, 4e12)]
    assert texts == ["0 bytes", "999 bytes", "1 kB", "1.5 MB", "2.25 GB", "4e+03 GB"]


# The rate of tables.


def read_csv(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        lines = list(csv.reader(file))
    columns = zip(*lines[1:], strict=True)
    return {name: np.array(c, float) for name, c in zip(lines[0], columns, strict=True)}


def test_csv_has_100_hz_with_means_of_powers_and_values_of_all_else(
    run: Path, tmp_path: Path
) -> None:
    path = tmp_path / "x.csv"
    process = rig("export", run, "--as", "csv", "-o", path)
    remark = (
        "100 of 1000 ticks a second: powers are means over 10 ticks from the time on, all else is "
        "the value at the time"
    )
    assert process.stdout.splitlines()[1].strip() == remark
    table, full = read_csv(path), open_run(run)
    whole = full.sizes["time"] // 10
    for name, values in table.items():
        field, unit = name.removesuffix("]").split(" [")
        every = full[field].values[: 10 * whole].reshape(whole, 10).astype(float)
        expected = every.mean(axis=1) if unit == "W" else every[:, 0]
        assert np.allclose(values[:whole], expected, rtol=1e-12, atol=1e-12), name
    assert {name for name in table if "[W]" in name} == {
        *(f"power.{station} [W]" for station in POWERS),
        *(f"power.mean_{station} [W]" for station in ("mechanical_1", "ac", "dc")),
    }
    assert np.allclose(np.diff(table["time [s]"]), 0.01)


def test_means_of_rows_are_those_of_the_row_table(run: Path) -> None:
    """Samples at the edges of a window cover up to 9 ticks of settling or tail: 0.5 % of it.

    Every 10th value would miss the mean by the noise: 5 W over the root of 200 samples, 0.35 W.
    """
    table = read_table(select_table(run, ["power", "plan"], (), max_rate=100.0))
    for row, expected in enumerate(row_table(run)["power_dc"].values):
        inside = (table["plan.row"] == row) & (table["plan.phase"] == Phase.MEASURE)
        assert float(table["power.dc"][inside].mean()) == pytest.approx(expected, abs=0.1)


def test_an_angle_that_wraps_is_no_mean(tmp_path: Path) -> None:
    def wrap(data: Any) -> Any:
        data["load.rotor_angle"] = (0.37 * data["tick"] + np.pi) % (2 * np.pi) - np.pi
        return data

    run = write(tmp_path, 0.001, wrap)
    table = read_table(select_table(run, ["load.rotor_angle"], (), 100.0))
    tick = np.rint(1000 * table["time"].values)
    expected = (0.37 * tick + np.pi) % (2 * np.pi) - np.pi
    assert np.allclose(table["load.rotor_angle"], expected)


def test_lost_and_unknown_values_stay_where_they_are(tmp_path: Path) -> None:
    """NaN in one tick makes its sample NaN, no other; an interval may lack ticks."""

    def damage(data: Any) -> Any:
        data["power.dc"][103] = np.nan
        data["power.ac"] = data["tick"]
        return np.delete(data, [214, 215, 320, *range(430, 440)])

    table = read_table(
        select_table(write(tmp_path, 0.001, damage), ["power.dc", "power.ac"], (), 100.0)
    )
    time = np.rint(100 * table["time"].values).astype(int)
    assert np.flatnonzero(np.isnan(table["power.dc"])).tolist() == [10]
    assert set(range(60)) - set(time.tolist()) == {32, 43}  # their first ticks are missing
    means = dict(zip(time.tolist(), table["power.ac"].values.tolist(), strict=True))
    assert (means[20], means[31], means[42]) == (204.5, 314.5, 424.5)
    assert means[21] == pytest.approx((sum(range(210, 220)) - 214 - 215) / 8)


@pytest.mark.parametrize(
    ("dt", "step"), [(0.001, 10), (0.002, 5), (0.004, 3), (0.01, 1), (0.02, 1)]
)
def test_the_default_rate_divides_that_of_the_run(dt: float, step: int, tmp_path: Path) -> None:
    selection = select_table(write(tmp_path, dt), ["power.dc"], (), max_rate=100.0)
    assert selection.step == step
    assert selection.rate == pytest.approx(1.0 / dt / step)
    assert (selection.rate_remark == "") == (step == 1)
    assert selection.samples == read_table(selection).sizes["time"]


def test_every_tick_is_an_option(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    assert rig("export", run, "--as", "csv", "--every-tick", "-o", path).stderr == ""
    table, full = read_csv(path), open_run(run)
    assert np.array_equal(table["power.dc [W]"], full["power.dc"].values)
    rated = tmp_path / "y.csv"
    assert rig("export", run, "--as", "csv", "--rate", "1000", "-o", rated).returncode == 0
    assert rated.read_bytes() == path.read_bytes()
    process = rig("export", run, "--as", "csv", "--every-tick", "--rate", "50", "-o", path)
    assert process.returncode == 2
    assert "the run's own rate and 50 Hz exclude each other" in process.stderr
    mat = tmp_path / "x.mat"
    process = rig("export", run, "--as", "mat", "--every-tick", "--for-scripts", "-o", mat)
    assert "1000 Hz, but the scripts of the test count samples at 200 Hz" in process.stderr
    assert rig("export", run, "--as", "mat", "--every-tick", "-o", mat).returncode == 0


def test_netcdf_states_the_method_of_each_variable(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.nc"
    assert rig("export", run, "--as", "netcdf", "--rate", "50", "-o", path).returncode == 0
    with xarray.open_dataset(path) as table:
        assert table["power.dc"].attrs["cell_methods"] == "time: mean (interval: 0.02 s)"
        assert table["load.rotor_angle"].attrs["cell_methods"] == "time: point"
    assert rig("export", run, "--as", "netcdf", "-o", path).returncode == 0
    with xarray.open_dataset(path) as table:
        assert "cell_methods" not in table["power.dc"].attrs
        assert table.sizes["time"] == open_run(run, ["tick"]).sizes["time"]
