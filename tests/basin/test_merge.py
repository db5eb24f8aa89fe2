"""`rig merge`: a basin's record and a power analyser's on the time of a run."""

from __future__ import annotations

import json
from pathlib import Path

import merging
import numpy as np
import pytest
import xarray
from command_here import rig

from rig.config import ConfigError
from rig.interop.basin.merge import SYNC, Source, SyncChannels, merge
from rig.interop.basin.products import row_means, write
from rig.interop.basin.recording import read_recording
from rig.interop.basin.resample import cubic
from rig.interop.basin.sync import rising_edge

CLOCK = SyncChannels(run_sine="clock")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return merging.run(tmp_path_factory.mktemp("merge") / "run")


@pytest.fixture(scope="module")
def waves(run: Path) -> Path:
    return merging.twe(run.parent / "waves.twe")


@pytest.fixture(scope="module")
def power(run: Path) -> Path:
    return merging.analyser(run.parent / "power.csv")


def test_the_basins_wave_stands_where_the_runs_own_probe_saw_it(run: Path, waves: Path) -> None:
    """Within 0.3 mm of 120 mm: 0.5 ms of clock at 0.38 m/s, and a little of interpolation."""
    merged = merge(run, [Source("waves", waves, unit="inch")], CLOCK)
    table = merged.table
    time = table["time"].values
    assert table.attrs["run"] == "run"
    assert (time[0], round(1.0 / (time[1] - time[0]), 6)) == (0.0, 50.0)
    seen = table["waves.BRIDGEPROBE01"].values
    covered = np.isfinite(seen)
    inside = (time > merging.OFFSET + 0.05) & (time < merging.OFFSET + 79.9)
    assert covered[inside].all()
    assert not covered[time < merging.OFFSET - 0.05].any()
    assert np.abs(seen - merging.wave(time))[covered].max() < 3e-4
    assert "waves.TTLTrigger" not in table
    assert table["waves.BRIDGEPROBE01"].attrs == {"units": "m", "channel": "BRIDGEPROBE01"}


def test_by_row(run: Path, waves: Path, power: Path) -> None:
    """AC of the analyser's file falls by 1 W a second: its mean is that of the window's middle."""
    merged = merge(run, [Source("waves", waves), Source("power", power)], CLOCK)
    table = merged.table
    rows = row_means(table)
    assert [line["row"] for line in rows] == [0, 1, 2]
    for line in rows[:2]:
        inside = (table["plan.row"] == line["row"]) & (table["plan.phase"] == merging.MEASURE)
        middle = float(table["time"].values[inside.values].mean())
        # Of an edge at 20 Hz: half a step.
        assert line["power.AC mean [as recorded]"] == pytest.approx(-40.0 - middle, abs=0.026)
        wave = line["waves.BRIDGEPROBE01 deviation [as recorded]"] * 0.0254
        assert wave == pytest.approx(np.hypot(0.1, 0.02) / 2**0.5, rel=1e-3)
    assert np.isnan(rows[2]["power.AC mean [as recorded]"])  # its record ends before


def test_the_same_files_give_the_same_bytes(run: Path, waves: Path, power: Path) -> None:
    sources = [Source("waves", waves, "inch"), Source("power", power)]
    before = [path.read_bytes() for path in write(merge(run, sources, CLOCK), run)]
    again = write(merge(run, sources, CLOCK), run)
    assert [path.name for path in again] == [
        "merged.nc", "merged.json", "merged.png", "merged_rows.csv",
    ]  # fmt: skip
    assert [path.read_bytes() for path in again] == before


def test_the_runs_side_of_the_sine_may_lie_beside_the_record(waves: Path, tmp_path: Path) -> None:
    """As with MASK4, whose DAQ recorded trigger and sine itself."""
    folder = merging.run(tmp_path / "run")
    t = np.arange(0.0, 82.0, 0.005)
    rows = zip(t, np.sin(2 * np.pi * t), 6.0 * (t >= merging.EDGE), strict=True)
    text = "".join(f"{a:.3f},{b:.6f},{c:g}\n" for a, b, c in rows)
    (folder / SYNC).write_text("time_s,syncSine,trigger\n" + text)
    merged = merge(folder, [Source("waves", waves)], SyncChannels())
    assert merged.alarms == []
    (one,) = merged.alignments
    assert one.method == "edge and sine"
    assert one.clock.to_run(40.0) == pytest.approx(47.2508, abs=1e-3)


def test_command(run: Path, waves: Path, power: Path, tmp_path: Path) -> None:
    done = rig("merge", run, waves, f"hbm={power}", "--unit", "waves=inch", "--run-sine", "clock")
    assert (done.returncode, done.stderr) == (0, "")
    assert "waves: edge and sine: offset +7.25" in done.stdout
    assert "drift is not known" in done.stdout
    slipped = merging.twe(tmp_path / "slipped.twe", slip=0.02)
    done = rig("merge", run, slipped, "--run-sine", "clock", "--json")
    assert done.returncode == 1
    told = json.loads(done.stdout)
    assert "slips by" in told["alarms"][0]
    assert told["records"][0]["slip_s"] == pytest.approx(0.02, abs=2e-3)
    with xarray.open_dataset(told["written"][0]) as table:
        assert "slipped.BRIDGEPROBE01" in table


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.twe"], "a.twe:1: cannot read"),
        (["x=POWER", "x=WAVES"], "a second record named 'x'"),
        (["WAVES", "--unit", "waves=feet"], "'feet' is no unit; allowed inch, m, mm, cm"),
        (["WAVES", "--unit", "tank=m"], "NAME one of waves"),
        (["WAVES", "--offset", "waves=soon"], "'soon' is not a number of seconds"),
        (["WAVES", "--run-sine", "wave.sine"], "no field 'wave.sine' in this run"),
        (["WAVES", "--match", "waves.BUOY=probes.probe_1"], "'BUOY' is not in the record; allowed"),
        (
            ["WAVES", "--match", "waves.BRIDGEPROBE01=wave"],
            "BRIDGEPROBE01 and its twin in the run are alike in 0 of 7",
        ),
        (["WAVES", "--match", "waves=probes.probe_1"], "write NAME.CHANNEL=FIELD"),
        (["WAVES", "--run-sine", "plan.row"], "dB above what is beside it"),
    ],
)
def test_bad_input_is_named(
    run: Path, waves: Path, power: Path, words: list[str], said: str
) -> None:
    given = [w.replace("WAVES", str(waves)).replace("POWER", str(power)) for w in words]
    done = rig("merge", run, *given)
    assert done.returncode in (1, 2)
    assert said in done.stderr


def test_a_record_without_a_trigger_is_refused_by_name(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("time_s,AC\n" + "".join(f"{i / 20},{i}\n" for i in range(100)))
    with pytest.raises(ConfigError, match="name its trigger, or state the offset"):
        merge(run, [Source("x", path)], CLOCK)
    merged = merge(run, [Source("x", path, offset=5.0)], CLOCK)
    at = np.flatnonzero(np.isclose(merged.table["time"].values, 6.0))[0]
    assert merged.table["x.AC"].values[at] == pytest.approx(20.0)


def test_a_probe_that_both_recorded_stands_in_for_a_sine(run: Path, waves: Path) -> None:
    """The basin's probe 1 is the run's probe 1: seven blocks of 10 s without noise."""
    source = Source("waves", waves, match=("BRIDGEPROBE01", "probes.probe_1"))
    (one,) = merge(run, [source], SyncChannels()).alignments
    assert (one.method, one.alarms, one.drift_known) == ("edge and BRIDGEPROBE01", (), True)
    assert one.clock.to_run(40.0) == pytest.approx(40.0 * (1.0 + 20e-6) + 7.25, abs=5e-4)


def test_a_recording_has_all_its_channels(waves: Path) -> None:
    record = read_recording(waves)
    assert list(record.channels) == ["BRIDGEPROBE01", "SINESIGNAL", "TTLTrigger"]
    assert record.rate == 50.0


def test_a_rate_near_whole_hertz_but_not_whole_keeps_its_time_column(tmp_path: Path) -> None:
    """What is whole is the name of the rate; alignment uses the time column itself."""
    path = tmp_path / "x.csv"
    path.write_text("time_s,a\n" + "".join(f"{i / 50.001:.6f},0\n" for i in range(5000)))
    record = read_recording(path)
    assert record.rate == 50.0
    assert record.time[-1] == pytest.approx(4999 / 50.001, abs=1e-6)


def test_cubic_between_samples() -> None:
    time = np.arange(500) / 50.0
    at = np.linspace(0.0, time[-1], 3777)
    error = cubic(time, np.sin(2 * np.pi * time), at) - np.sin(2 * np.pi * at)
    inner = (at > 0.02) & (at < time[-1] - 0.02)
    assert np.abs(error[inner]).max() < 7e-6  # (2 pi / 50)^4 times 3/128
    assert np.abs(error).max() < 1e-4
    assert np.isnan(cubic(time, time, np.array([-0.001, 9.981]))).all()
    spoilt = np.where(np.arange(500) == 100, np.nan, 1.0)
    gone = np.isnan(cubic(time, spoilt, at))
    assert (np.abs(at[gone] - 2.0) <= 0.04).all()
    assert gone.any()


def test_a_trigger_that_bounces_about_its_middle_rises_once() -> None:
    time = np.arange(6) * 1.0
    edge = rising_edge(time, np.array([0.0, 0.5, 0.45, 0.55, 1.0, 0.9]))
    assert edge is not None
    assert (edge.time, edge.rises) == (3.5, 1)
    assert rising_edge(time, np.ones(6)) is None
    assert rising_edge(time, time[::-1].copy()) is None
