"""`rig merge`: records of a basin and a power analyser resampled to the time of a run."""

from __future__ import annotations

import json
from pathlib import Path

import merging
import numpy as np
import pytest
import xarray
from command_here import rig

from rig.config.problems import ConfigError
from rig.interop.basin.align import rising_edge
from rig.interop.basin.merge import (
    SYNC_FILE,
    MergeSource,
    SyncChannels,
    interpolate_cubic,
    merge,
    row_means,
    write_products,
)
from rig.recording.channel_file import read_recording

CLOCK = SyncChannels(run_sine="clock")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return merging.write_merge_run(tmp_path_factory.mktemp("merge") / "run")


@pytest.fixture(scope="module")
def waves(run: Path) -> Path:
    return merging.write_twe(run.parent / "waves.twe")


@pytest.fixture(scope="module")
def power(run: Path) -> Path:
    return merging.write_analyser(run.parent / "power.csv")


def test_basin_wave_matches_the_probe_of_the_run(run: Path, waves: Path) -> None:
    """Within 0.3 mm of 120 mm: 0.5 ms of clock at 0.38 m/s, and a little of interpolation."""
    merged = merge(run, [MergeSource("waves", waves, unit="inch")], CLOCK)
    table = merged.table
    time = table["time"].values
    assert table.attrs["run"] == "run"
    assert (time[0], round(1.0 / (time[1] - time[0]), 6)) == (0.0, 50.0)
    measured = table["waves.BRIDGEPROBE01"].values
    covered = np.isfinite(measured)
    inside = (time > merging.OFFSET + 0.05) & (time < merging.OFFSET + 79.9)
    assert covered[inside].all()
    assert not covered[time < merging.OFFSET - 0.05].any()
    assert np.abs(measured - merging.wave(time))[covered].max() < 3e-4
    assert "waves.TTLTrigger" not in table
    assert table["waves.BRIDGEPROBE01"].attrs == {"units": "m", "channel": "BRIDGEPROBE01"}


def test_row_means(run: Path, waves: Path, power: Path) -> None:
    """AC power falls by 1 W per second, so its mean is the value at the middle of the window."""
    merged = merge(run, [MergeSource("waves", waves), MergeSource("power", power)], CLOCK)
    table = merged.table
    rows = row_means(table)
    assert [line["row"] for line in rows] == [0, 1, 2]
    for line in rows[:2]:
        inside = (table["plan.row"] == line["row"]) & (table["plan.phase"] == merging.MEASURE)
        middle = float(table["time"].values[inside.values].mean())
        # An edge at 20 Hz is resolved to half a step.
        assert line["power.AC mean [as recorded]"] == pytest.approx(-40.0 - middle, abs=0.026)
        wave = line["waves.BRIDGEPROBE01 deviation [as recorded]"] * 0.0254
        assert wave == pytest.approx(np.hypot(0.1, 0.02) / 2**0.5, rel=1e-3)
    assert np.isnan(rows[2]["power.AC mean [as recorded]"])  # the record ends before the window


def test_merging_twice_gives_the_same_bytes(run: Path, waves: Path, power: Path) -> None:
    sources = [MergeSource("waves", waves, "inch"), MergeSource("power", power)]
    before = [path.read_bytes() for path in write_products(merge(run, sources, CLOCK), run)]
    repeated = write_products(merge(run, sources, CLOCK), run)
    assert [path.name for path in repeated] == [
        "merged.nc", "merged.json", "merged.png", "merged_rows.csv",
    ]  # fmt: skip
    assert [path.read_bytes() for path in repeated] == before


def test_sine_of_the_run_may_come_from_sync_csv(waves: Path, tmp_path: Path) -> None:
    """As for MASK4, whose own DAQ recorded trigger and sine."""
    folder = merging.write_merge_run(tmp_path / "run")
    t = np.arange(0.0, 82.0, 0.005)
    rows = zip(t, np.sin(2 * np.pi * t), 6.0 * (t >= merging.EDGE), strict=True)
    text = "".join(f"{a:.3f},{b:.6f},{c:g}\n" for a, b, c in rows)
    (folder / SYNC_FILE).write_text("time_s,syncSine,trigger\n" + text)
    merged = merge(folder, [MergeSource("waves", waves)], SyncChannels())
    assert merged.alarms == []
    (alignment,) = (record.alignment for record in merged.records)
    assert alignment.method == "edge and sine"
    assert alignment.clock.to_run(40.0) == pytest.approx(47.2508, abs=1e-3)


def test_command_merges_and_reports_alarms(
    run: Path, waves: Path, power: Path, tmp_path: Path
) -> None:
    process = rig(
        "merge", run, waves, f"hbm={power}", "--unit", "waves=inch", "--run-sine", "clock"
    )
    assert (process.returncode, process.stderr) == (0, "")
    assert "waves: edge and sine: offset +7.25" in process.stdout
    assert "drift is not known" in process.stdout
    slipped = merging.write_twe(tmp_path / "slipped.twe", slip=0.02)
    process = rig("merge", run, slipped, "--run-sine", "clock", "--json")
    assert process.returncode == 1
    report = json.loads(process.stdout)
    assert "slips by" in report["alarms"][0]
    assert report["records"][0]["slip_s"] == pytest.approx(0.02, abs=2e-3)
    with xarray.open_dataset(report["written"][0]) as table:
        assert "slipped.BRIDGEPROBE01" in table


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["a.twe"], "a.twe:1: cannot read"),
        (["x=POWER", "x=WAVES"], "a second record named 'x'"),
        (["WAVES", "--unit", "waves=feet"], "'feet' is not a unit; allowed inch, m, mm, cm"),
        (["WAVES", "--unit", "tank=m"], "NAME one of waves"),
        (["WAVES", "--offset", "waves=soon"], "'soon' is not a number of seconds"),
        (["WAVES", "--run-sine", "wave.sine"], "no field 'wave.sine' in this run"),
        (["WAVES", "--match", "waves.BUOY=probes.probe_1"], "'BUOY' is not in the record; allowed"),
        (
            ["WAVES", "--match", "waves.BRIDGEPROBE01=wave"],
            "BRIDGEPROBE01 and its log field correlate in 0 of 7",
        ),
        (["WAVES", "--match", "waves=probes.probe_1"], "write NAME.CHANNEL=FIELD"),
        (["WAVES", "--run-sine", "plan.row"], "dB above the noise; needed 10 dB"),
    ],
)
def test_bad_input_is_reported(
    run: Path, waves: Path, power: Path, options: list[str], message: str
) -> None:
    arguments = [w.replace("WAVES", str(waves)).replace("POWER", str(power)) for w in options]
    process = rig("merge", run, *arguments)
    assert process.returncode in (1, 2)
    assert message in process.stderr


def test_record_without_trigger_needs_an_offset(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("time_s,AC\n" + "".join(f"{i / 20},{i}\n" for i in range(100)))
    with pytest.raises(ConfigError, match="name its trigger, or state the offset"):
        merge(run, [MergeSource("x", path)], CLOCK)
    merged = merge(run, [MergeSource("x", path, offset=5.0)], CLOCK)
    at = np.flatnonzero(np.isclose(merged.table["time"].values, 6.0))[0]
    assert merged.table["x.AC"].values[at] == pytest.approx(20.0)


def test_matched_probe_replaces_the_sine(run: Path, waves: Path) -> None:
    """The basin's probe 1 is the run's probe 1: seven blocks of 10 s without noise."""
    source = MergeSource("waves", waves, match=("BRIDGEPROBE01", "probes.probe_1"))
    (alignment,) = (record.alignment for record in merge(run, [source], SyncChannels()).records)
    assert (alignment.method, alignment.alarms, alignment.lags is not None) == (
        "edge and BRIDGEPROBE01",
        (),
        True,
    )
    assert alignment.clock.to_run(40.0) == pytest.approx(40.0 * (1.0 + 20e-6) + 7.25, abs=5e-4)


def test_recording_has_all_channels(waves: Path) -> None:
    record = read_recording(waves)
    assert list(record.channels) == ["BRIDGEPROBE01", "SINESIGNAL", "TTLTrigger"]
    assert record.rate == 50.0


def test_rounded_rate_keeps_the_time_column(tmp_path: Path) -> None:
    """Only the nominal rate is rounded; alignment uses the time column itself."""
    path = tmp_path / "x.csv"
    path.write_text("time_s,a\n" + "".join(f"{i / 50.001:.6f},0\n" for i in range(5000)))
    record = read_recording(path)
    assert record.rate == 50.0
    assert record.time[-1] == pytest.approx(4999 / 50.001, abs=1e-6)


def test_cubic_interpolation_between_samples() -> None:
    time = np.arange(500) / 50.0
    at = np.linspace(0.0, time[-1], 3777)
    error = interpolate_cubic(time, np.sin(2 * np.pi * time), at) - np.sin(2 * np.pi * at)
    inner = (at > 0.02) & (at < time[-1] - 0.02)
    assert np.abs(error[inner]).max() < 7e-6  # (2 pi / 50)^4 times 3/128
    assert np.abs(error).max() < 1e-4
    assert np.isnan(interpolate_cubic(time, time, np.array([-0.001, 9.981]))).all()
    damaged = np.where(np.arange(500) == 100, np.nan, 1.0)
    affected = np.isnan(interpolate_cubic(time, damaged, at))
    assert (np.abs(at[affected] - 2.0) <= 0.04).all()
    assert affected.any()


def test_bouncing_trigger_rises_once() -> None:
    time = np.arange(6) * 1.0
    edge = rising_edge(time, np.array([0.0, 0.5, 0.45, 0.55, 1.0, 0.9]))
    assert edge is not None
    assert (edge.time, edge.rises) == (3.5, 1)
    assert rising_edge(time, np.ones(6)) is None
    assert rising_edge(time, time[::-1].copy()) is None
