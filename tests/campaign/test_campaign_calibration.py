"""Wave calibration campaigns: the plan without the device, and the keys that are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rig.campaign import build_plan
from rig.config.problems import ConfigError
from rig.config.sea import CalmSea, JonswapSea, PinkSea, RecordedSea, RegularSea
from rig.config.task_file import Timing
from rig.emulation.campaign_sea import requested_sea
from rig.kinds.wavebot.campaign import check_campaign, open_campaign
from rig.kinds.wavebot.rehearsal.job import plant_settings, problems
from rig.planning.windows import WindowError, calibration_window
from rig.realtime import sequence
from rig.realtime.sequence import NO_ROW, Phase

CONFIGS = Path(__file__).parents[2] / "configs"
HEAD = "name: test\nrig: ../rigs/wavebot.yaml\n"
PINK = "sea: {kind: pink, hm0_m: 0.2, repeat_s: 20, seed: 3}\n"


def write_file(write: Any, body: str, sea: str = PINK) -> Path:
    """Write a calibration campaign without a matrix, which the fixture alone would add."""
    path: Path = write("extends: nothing\n", head="")
    path.write_text(HEAD + sea + "device: absent\n" + body)
    return path


def reported_problems(path: Path) -> list[tuple[str, str]]:
    with pytest.raises(ConfigError) as error_info:
        open_campaign(path)
    return [(p.key, p.message) for p in error_info.value.problems]


def test_the_plan_is_a_lead_in_and_one_window_with_all_power_off(write: Any) -> None:
    campaign = open_campaign(write_file(write, "start: {lead_in_s: 30}\ntiming: {periods: 3}\n"))
    planned = build_plan(campaign)
    s = planned.segments
    assert (planned.rows, campaign.points) == ((), ())
    table = list(zip(s.row, s.phase, s.ticks, s.wait, s.drive, s.waves, strict=True))
    assert table == [
        (NO_ROW, Phase.LEAD_IN, 30_000, 0, 0, 1),
        (NO_ROW, Phase.MEASURE, 60_000, 0, 0, 1),
        (NO_ROW, Phase.DONE, 0, 0, 0, 0),
    ]
    assert (planned.duration, planned.wave_seconds, planned.moves) == (90.0, 90.0, 0)
    assert sum(planned.phases) == planned.phases.lead_in + planned.phases.measure == 90.0
    assert (
        plant_settings(campaign._replace(plant={"bem": "x", "surge": {"bem": "y"}}))["device"]
        == "absent"
    )


def test_the_plan_runs_to_its_end_without_the_drive(write: Any) -> None:
    body = "start: {lead_in_s: 5}\ntiming: {periods: 1}\n"
    campaign = open_campaign(write_file(write, body))
    planned = build_plan(campaign)
    state, phase_ticks = sequence.start(0), dict.fromkeys(Phase, 0)
    for tick in range(30_000):
        # the drive is never enabled; the plan alone runs
        state, position = sequence.step(planned.segments, state, tick, 0, True, False)
        phase_ticks[Phase(planned.segments.phase[state.segment])] += 1
        assert planned.segments.drive[state.segment] == 0
        if position.finished:
            break
    assert (phase_ticks[Phase.LEAD_IN], phase_ticks[Phase.MEASURE]) == (5000, 20_000)
    assert phase_ticks[Phase.TARE] == phase_ticks[Phase.MOVING] == 0


def test_the_shipped_calibrations_are_three_realisations_of_one_sea() -> None:
    seas = []
    for number in ("", "_2", "_3"):
        report = check_campaign(CONFIGS / "campaigns" / f"wave_calibration{number}.yaml", problems)
        assert report.ok, report.text()
        assert report.campaign is not None
        assert report.plan is not None
        assert (report.plan.phases.lead_in, report.plan.phases.measure) == (120.0, 1200.0)
        seas.append(report.campaign.file.sea.model_dump())
        assert "device absent" in report.text()
        assert "configs/seas/pink_0p254m.yaml" in report.text()
    assert [sea.pop("realisation") for sea in seas] == [1, 2, 3]
    assert seas[0] == seas[1] == seas[2]


def test_the_report_describes_the_sea(write: Any, tmp_path: Path) -> None:
    (tmp_path / "seas").mkdir()
    (tmp_path / "seas" / "pink.yaml").write_text("kind: pink\nhm0_m: 0.2\nhigh_hz: 0.9\n")
    path = write_file(write, "seed: 8\n", "sea: ../seas/pink.yaml\n")
    report = check_campaign(path)
    assert (
        "pink, amplitude ~ f^-0.5, Hm0 0.2 m, 0.2 .. 0.9 Hz, realisation 1, repeats after 300 s, "
        "phases of seed 8" in report.text()
    )
    summary = report.summary()
    assert summary["device"] == "absent"
    assert summary["sea_keys"]["high_hz"] == 0.9
    assert summary["sea_keys"]["seed"] == 8
    assert [f["role"] for f in summary["files"]][:2] == ["campaign", "sea"]
    assert (summary["rows"], summary["periods_per_row"], summary["measured_s"]) == (0, 4, 1200.0)


@pytest.mark.parametrize(
    ("body", "key", "expected"),
    [
        ("tare: {duration_s: 6}\n", "tare", "device: absent has no use for it"),
        ("repeat: 2\n", "repeat", "device: absent has no use for it"),
        ("order: random\n", "order", "device: absent has no use for it"),
        ("timing: mask4\n", "timing", "device: absent has no rows; leave the key out"),
        ("timing: {settle_s: 3}\n", "timing.settle_s", "use a longer start.lead_in_s instead"),
        (
            "start: {set_point: {kp_n_s_per_m: -1, ki_n_per_m: 0}}\n",
            "start.set_point",
            "device: absent has no gains",
        ),
        (
            "matrix: {list: [{spring_n_per_m: 0, kp_n_s_per_m: -2000, ki_n_per_m: 0}]}\n",
            "matrix",
            "device: absent has no rows; leave the key out",
        ),
        ("timing: {interval_s: 19}\n", "timing.interval_s", "at least 20 s"),
    ],
)
def test_keys_without_a_use_are_refused_without_the_device(
    write: Any, body: str, key: str, expected: str
) -> None:
    ((at, message),) = reported_problems(write_file(write, body))
    assert at == key
    assert expected in message


def test_calm_water_and_a_missing_matrix(write: Any) -> None:
    assert reported_problems(write_file(write, "", "sea: {kind: calm}\n")) == [
        ("sea.kind", "calm water has no waves to calibrate; allowed any other sea")
    ]
    path = write_file(write, "")
    path.write_text(path.read_text().replace("device: absent", "repeat: 0"))
    assert [key for key, _ in reported_problems(path)] == ["matrix", "repeat"]


PINK_SEA = PinkSea.model_validate({"kind": "pink", "hm0_m": 0.2, "repeat_s": 25})


def recorded(end: float, repeat: float) -> RecordedSea:
    return RecordedSea.model_validate(
        {"kind": "recorded", "file": "x.csv", "channel": "a", "unit": "m", "start_s": 0,
         "end_s": end, "repeat_s": repeat}
    )  # fmt: skip


@pytest.mark.parametrize(
    ("sea", "timing", "measure", "periods"),
    [
        (PINK_SEA, {}, 100.0, 4),
        (PINK_SEA, {"periods": 2}, 50.0, 2),
        (PINK_SEA, {"interval_s": 90}, 75.0, 3),
        (JonswapSea.model_validate({"kind": "jonswap", "hs_m": 0.1, "tp_s": 2}), {}, 1200.0, 4),
        (recorded(60, 20), {"periods": 2}, 40.0, 2),
        (
            RegularSea.model_validate({"kind": "regular", "amplitude_m": 0.1, "period_s": 3.45}),
            {},
            17 * 3.45,
            17,
        ),
    ],
)
def test_windows(sea: Any, timing: dict[str, Any], measure: float, periods: int) -> None:
    window = calibration_window(sea, Timing.model_validate(timing))
    assert (window.settle, window.tail, window.move, window.periods) == (0.0, 0.0, 0.0, periods)
    assert window.measure == pytest.approx(measure)


def test_windows_that_cannot_be_cut() -> None:
    with pytest.raises(WindowError, match=r"window of 65 s is not a whole number of .* 20 s"):
        calibration_window(recorded(65, 20), Timing())
    with pytest.raises(WindowError, match="no waves"):
        calibration_window(CalmSea(kind="calm"), Timing())
    with pytest.raises(WindowError, match="3 repeat periods of 25 s do not fit") as error_info:
        calibration_window(PINK_SEA, Timing(interval_s=60, periods=3))
    assert error_info.value.key == ("timing", "interval_s")


def test_the_lines_of_a_record_and_of_a_regular_sea(write: Any, tmp_path: Path) -> None:
    """A window of three repeat periods gives every third line; a sine gives its own period."""
    import numpy as np

    t = np.arange(600) * 0.1
    value = 0.05 * np.cos(2 * np.pi * 8 / 20 * t - 0.4) + 0.02 * np.cos(2 * np.pi * 7 / 60 * t)
    rows = "".join(f"{a:.3f},{b:.9f}\n" for a, b in zip(t, value, strict=True))
    (tmp_path / "campaigns" / "r.csv").write_text("time_s,eta\n" + rows)
    sea = (
        "sea: {kind: recorded, file: r.csv, channel: eta, unit: m, start_s: 0, end_s: 60, "
        "repeat_s: 20}\n"
    )
    lines = requested_sea(open_campaign(write_file(write, "", sea)))
    assert lines["repeat_s"] == pytest.approx(20.0)
    assert lines["cycles"] == list(range(1, 41))  # 0.05 to 2 Hz
    assert lines["amplitude_m"][7] == pytest.approx(0.05, abs=1e-8)
    assert lines["phase_rad"][7] == pytest.approx(-0.4, abs=1e-6)
    assert max(lines["amplitude_m"][:7]) < 1e-8  # 7 cycles in 60 s are not a line of 20 s
    sea = "sea: {kind: regular, amplitude_m: 0.1, period_s: 3.45}\n"
    lines = requested_sea(open_campaign(write_file(write, "", sea)))
    assert lines == {
        "repeat_s": pytest.approx(3.45),
        "cycles": [1],
        "amplitude_m": [0.1],
        "phase_rad": [0.0],
    }


@pytest.mark.parametrize("kind", ["pink", "multisine"])
def test_a_sea_above_its_largest_elevation_is_refused(write: Any, kind: str) -> None:
    """Hm0 0.2 m is an rms of 0.05 m: peaks exceed 0.1 m, but not 0.3 m."""
    sea = f"sea: {{kind: {kind}, hm0_m: 0.2, repeat_s: 60, seed: 1, largest_m: LARGEST}}\n"
    path = write_file(write, "", sea.replace("LARGEST", "0.1"))
    ((key, message),) = reported_problems(path)
    assert key == "sea.largest_m"
    assert message.startswith("the elevation reaches 0.1")
    assert "more than 0.1 m" in message
    assert check_campaign(write_file(write, "", sea.replace("LARGEST", "0.3"))).ok
