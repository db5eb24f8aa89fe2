"""Recorded elevation: a real basin file, if available, and broken files."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from measured_data import reference
from scipy.signal import correlate

from rig.campaign import build_plan
from rig.config.problems import ConfigError
from rig.config.sea import RecordedSea
from rig.kinds.wavebot.campaign import open_campaign
from rig.planning.elevation import read_elevation

RECORD = "AWDC-SAADAQ-s00113.twe"  # measured: see tests/measured_data.py


def sea(**changes: Any) -> RecordedSea:
    keys = {
        "kind": "recorded", "file": "x.csv", "channel": "eta", "unit": "m", "start_s": 0.0,
        "end_s": 10.0,
    }  # fmt: skip
    return RecordedSea.model_validate({**keys, **changes})


def csv(folder: Path, time: Any, eta: Any) -> Path:
    path = folder / "x.csv"
    rows = "".join(f"{t:.3f},0,{e}\n" for t, e in zip(time, eta, strict=True))
    path.write_text("time_s,other,eta\n" + rows)
    return path


def test_a_real_record_of_the_basin() -> None:
    recorded = read_elevation(
        reference(RECORD),
        sea(file=RECORD, channel="SAA 01", unit="inch", start_s=120.0, end_s=1320.0),
    )
    eta = recorded.elevation
    assert recorded.rate_hz == 20.0
    assert len(eta) == 24_000
    assert abs(eta.mean()) < 1e-12
    assert 4 * eta.std() == pytest.approx(0.253, rel=0.005)
    lag = 300 * 20
    shifts = np.arange(lag // 2, 3 * lag // 2)
    products = correlate(eta, eta, method="fft")[len(eta) - 1 + shifts]
    energy = np.concatenate([[0.0], np.cumsum(eta * eta)])
    correlation = products / np.sqrt(energy[len(eta) - shifts] * (energy[-1] - energy[shifts]))
    assert shifts[np.argmax(correlation)] == lag  # the sea repeats after exactly 300.0 s
    assert max(correlation) >= 0.98


def test_a_real_record_in_a_campaign(write: Any) -> None:
    head = f"""\
name: test
rig: ../rigs/wavebot.yaml
sea:
  kind: recorded
  file: {reference(RECORD)}
  channel: SAA 01
  unit: inch
  start_s: 120
  end_s: 1320
  repeat_s: 300
"""
    campaign = open_campaign(write(head=head))
    assert campaign.elevation is not None
    planned = build_plan(campaign)
    assert (planned.rows[0].measure, planned.rows[0].periods) == (300.0, 1)


def test_csv_in_millimetres_over_a_window(tmp_path: Path) -> None:
    time = np.arange(1000) / 50.0
    path = csv(tmp_path, time, 7.0 + 100.0 * np.sin(2 * np.pi * 0.5 * time))
    recorded = read_elevation(path, sea(start_s=2.0, end_s=12.0, unit="mm", rate_hz=50.0))
    assert recorded.rate_hz == 50.0
    assert len(recorded.elevation) == 500
    assert np.allclose(recorded.elevation, 0.1 * np.sin(2 * np.pi * 0.5 * (time[100:600] - 2.0)))


def twe(folder: Path, data: str, names: str = "UTC Time\tTime\tP1\tP2") -> Path:
    path = folder / "x.twe"
    head = f"FILENAME:\tx.twe\nCHANNEL NAME:\t{names}\nENG UNITS:\tHHMMSS\tsec\tHHMMSS\tsec\n\n"
    path.write_text((head + data).replace("\n", "\r\n"), newline="")
    return path


def test_twe_with_its_label_column_and_trailing_tab(tmp_path: Path) -> None:
    data = "DATA:\t212720.7\t0.00\t1\t5\t\n\t212720.8\t0.05\t2\t6\t\n\t212720.8\t0.10\t3\t7\t\n"
    recorded = read_elevation(twe(tmp_path, data), sea(channel="P2", unit="inch", end_s=0.15))
    assert recorded.rate_hz == 20.0
    assert np.allclose(recorded.elevation, np.array([-1, 0, 1]) * 0.0254)


@pytest.mark.parametrize(
    ("change", "line", "expected"),
    [
        ({"channel": "zeta"}, 1, "'zeta' is not in the record; allowed other, eta"),
        ({"end_s": 30.0}, 1, "the window 0 .. 30 s is not in the record; it has 0 .. 20 s"),
        ({"rate_hz": 20.0}, 1, "the campaign gives 20 Hz, the time column 50 Hz"),
    ],
)
def test_a_channel_window_or_rate_not_in_the_record_is_refused(
    tmp_path: Path, change: dict[str, Any], line: int, expected: str
) -> None:
    time = np.arange(1000) / 50.0
    with pytest.raises(ConfigError, match="x") as error_info:
        read_elevation(csv(tmp_path, time, time), sea(**change))
    (problem,) = error_info.value.problems
    assert problem.line == line
    assert expected in problem.message


@pytest.mark.parametrize(
    ("text", "line", "expected"),
    [
        ("", 1, "no time column"),
        ("a,eta\n0,1\n", 1, "no time column"),
        ("time_s,eta\n0,1\n", 1, "fewer than 2 samples"),
        ("time_s,eta\n0,1\n1,x\n", 3, "'x' is not a number"),
        ("time_s,eta\n0,1\n1\n", 3, "'' is not a number"),
        ("time_s,eta\n0,1\n1,2\n2,nan\n", 4, "not a finite number"),
        ("time_s,eta\n0,1\n1,2\n2,3\n4,3\n5,3\n6,3\n", 5, "jumps by 2 s"),
        ("time_s,eta\n0,1\n0,2\n0,3\n", 3, "jumps by 0 s"),
        ("time_s,eta\n0,1\n1,2\nnan,3\n3,3\n", 4, "jumps by nan s"),
    ],
)
def test_broken_csv(tmp_path: Path, text: str, line: int, expected: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(ConfigError) as error_info:
        read_elevation(path, sea(end_s=2.0))
    (problem,) = error_info.value.problems
    assert (problem.line, expected in problem.message) == (line, True), problem


def test_broken_twe(tmp_path: Path) -> None:
    path = tmp_path / "x.twe"
    path.write_text("hello\n")
    with pytest.raises(ConfigError, match="not a"):
        read_elevation(path, sea())
    with pytest.raises(ConfigError, match="cannot read"):
        read_elevation(tmp_path / "none.twe", sea())


def test_a_missing_record_is_reported_in_the_campaign(write: Any) -> None:
    head = (
        "name: test\nrig: ../rigs/wavebot.yaml\n"
        "sea: {kind: recorded, channel: eta, unit: m, start_s: 0, end_s: 60,\n  file: none.csv}\n"
    )
    with pytest.raises(ConfigError) as error_info:
        open_campaign(write(head=head))
    (problem,) = error_info.value.problems
    assert (problem.line, problem.key) == (4, "sea.file")
