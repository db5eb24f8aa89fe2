"""Travel times of waves in a tank, and the warnings of a check about rows."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError
from rehearsing import write_campaign

from rig.config.sea import JonswapSea
from rig.config.tank import Beach, Tank
from rig.kinds.wavebot.campaign import check_campaign
from rig.planning import tank as travel
from rig.presentation.phrases import format_duration
from rig.realtime.sequence import Phase

# The Large Wave Flume with LUPA (Oregon State University): 1:12 beach, 12 ft high at the wall.
FLUME = Tank(
    depth_m=2.74,
    device_m=28.688,
    length_m=76.224,
    beach=Beach(start_m=76.224 - 12.0 * 3.6576, slope=1.0 / 12.0),
)
# Period, published time to the device and from there to the shore and back, s.
PUBLISHED = (
    (1.23, 29.887, 75.578), (1.38, 26.633, 67.297), (1.68, 21.763, 55.182), (2.5, 13.065, 38.154),
    (3.0, 10.305, 33.860), (4.0, 7.877, 30.099), (5.0, 6.930, 28.572), (6.0, 6.465, 27.800),
)  # fmt: skip


@pytest.mark.parametrize(("period", "arrival", "reflection"), PUBLISHED)
def test_travel_times_are_those_published_for_the_flume(
    period: float, arrival: float, reflection: float
) -> None:
    """Arrival to the printed 1 ms.

    The published reflection is a sum over points that leaves out the last wet one, where waves are
    slowest: 0.6 s less than the integral up to the shore line.
    """
    assert travel.travel_time(FLUME, period) == pytest.approx(arrival, abs=6e-4)
    assert 0.5 < travel.reflection_time(FLUME, period) - reflection < 0.6


def test_group_velocity_has_its_limits() -> None:
    """g T / 4 pi in deep water, sqrt(g h) in shallow water."""
    deep = travel.GRAVITY / (4.0 * math.pi)
    assert travel.group_velocity(1.0, 1000.0) == pytest.approx(deep)
    assert travel.group_velocity(300.0, 1.0) == pytest.approx(math.sqrt(travel.GRAVITY), rel=1e-3)


def test_long_waves_run_up_a_beach_in_closed_form() -> None:
    """Of shallow-water waves: 2 sqrt(h / g) / slope to the shore; of 200 s, to 1e-4."""
    beach = Tank(depth_m=2.0, device_m=10.0, length_m=100.0, beach=Beach(start_m=10.0, slope=0.05))
    expected = 4.0 * math.sqrt(2.0 / travel.GRAVITY) / 0.05
    assert travel.reflection_time(beach, 200.0) == pytest.approx(expected, rel=1e-4)
    assert beach.shore_m == 50.0
    wall = Tank(depth_m=2.0, device_m=10.0, length_m=100.0)
    speed = travel.group_velocity(2.0, 2.0)
    assert travel.reflection_time(wall, 2.0) == pytest.approx(180.0 / speed)


TANK = {
    "depth_m": 2.74,
    "device_m": 28.688,
    "length_m": 76.224,
    "beach": {"start_m": 32.333, "slope": 0.08333},
    "still_s": 30,
    "ramp_s": 20,
}


def check(folder: Path, **keys: Any) -> Any:
    base = {
        "sea": {"kind": "regular", "amplitude_m": 0.1, "period_s": 2.5},
        "timing": {"settle_s": 1, "interval_s": 22},
        "matrix": {
            "list": [
                {"spring_n_per_m": 490.9, "kp_n_s_per_m": kp, "ki_n_per_m": 0}
                for kp in (-2000, -2500)
            ]
        },
    }
    return check_campaign(write_campaign(folder, **{**base, **keys}))


def test_a_check_reports_times_and_warns_of_rows(tmp_path: Path) -> None:
    report = check(tmp_path, tank=TANK, start={"lead_in_s": 40})
    times = json.loads(report.to_json())["tank"]
    assert times["first_s"] == pytest.approx(43.065, abs=1e-3)
    assert times["full_s"] == pytest.approx(63.065, abs=1e-3)
    assert times["reflected_s"] == pytest.approx(81.79, abs=0.01)
    early, late = (warning.message for warning in report.warnings)
    assert "before the waves have their full height at the device (63.1 s)" in early
    assert "23 s more of lead-in are enough" in early
    assert "measured after the first reflected waves are back at the device (81.8 s)" in late
    assert "tank" in report.text()


def test_a_check_adds_up_the_seas(tmp_path: Path) -> None:
    """Durations of all seas are those of each one alone, added; so are the rows of warnings."""
    sea = {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2.5, "repeat_s": 20}
    timing = {"timing": {"settle_s": 1, "interval_s": 22}, "sea": sea}
    one, all_three = (
        check(tmp_path / str(seed), tank=TANK, seed=seed, start={"lead_in_s": 40}, **timing)
        for seed in (3, [3, 4, 5])
    )
    single, total = one.summary(), all_three.summary()
    for key in ("duration_s", "wave_clock_s", "measured_s"):
        assert total[key] == pytest.approx(3 * single[key]), key
    assert total["phases_s"] == pytest.approx({k: 3 * v for k, v in single["phases_s"].items()})
    assert f"{total['measured_s']:.6g} s in total" in all_three.text()
    (early,) = (w.message for w in all_three.warnings if "full height" in w.message)
    assert early.startswith("rows 0-5 (6) are measured from")
    ends = {
        "sea": sea | {"repeat_s": 200},
        "timing": {"settle": "measured", "end": {"precision_w": 0.2}},
    }
    one, all_three = (check(tmp_path / f"ends{s}", seed=s, **ends) for s in (3, [3, 4, 5]))
    planned, summary = one.plan, all_three.summary()
    assert summary["least_duration_s"] == pytest.approx(3 * planned.least_duration)
    assert summary["least_duration_s"] < summary["duration_s"]
    least, most = (format_duration(summary[k]) for k in ("least_duration_s", "duration_s"))
    assert f"in each of 3 seas, one after the other: {least} to {most} in all" in all_three.text()


def test_a_long_tank_and_lead_in_are_quiet(tmp_path: Path) -> None:
    long = {"depth_m": 2.74, "device_m": 10, "length_m": 2000}
    report = check(tmp_path, tank=long, start={"lead_in_s": 60})
    assert (report.problems, report.warnings) == ((), ())


def test_a_tank_may_be_a_file(tmp_path: Path) -> None:
    (tmp_path / "flume.yaml").write_text(yaml.safe_dump(TANK))
    report = check(tmp_path, tank="flume.yaml", start={"lead_in_s": 64})
    assert report.problems == ()
    assert ("tank", "flume.yaml") in [(file.role, file.path.name) for file in report.campaign.files]


def test_waves_of_a_band_arrive_one_after_the_other(tmp_path: Path) -> None:
    """The longest waves are the first at the device, and the first that come back."""
    sea = {"kind": "pink", "hm0_m": 0.1, "low_hz": 0.2, "high_hz": 1.0, "repeat_s": 20}
    times = json.loads(check(tmp_path, tank=TANK, sea=sea).to_json())["tank"]
    assert (times["longest_period_s"], times["shortest_period_s"]) == (5.0, 1.0)
    assert times["first_s"] == pytest.approx(30.0 + 6.930, abs=1e-3)
    assert times["full_s"] > 50.0 + 29.887  # of 1.23 s
    calm = json.loads(check(tmp_path, tank=TANK, sea={"kind": "calm"}).to_json())
    assert "tank" not in calm


def test_the_band_of_a_jonswap_sea_has_nine_tenths_of_its_energy() -> None:
    """Pierson-Moskowitz in closed form: a share exp(-1.25 (Tp f)^-4) of the energy is below f."""
    sea = JonswapSea(kind="jonswap", hs_m=0.1, tp_s=2.0, gamma=1.0)
    longest, shortest = travel.sea_periods(sea) or (0.0, 0.0)
    assert longest == pytest.approx(2.0 * (math.log(20.0) / 1.25) ** 0.25, rel=1e-3)
    assert shortest == pytest.approx(2.0 * (-math.log(0.95) / 1.25) ** 0.25, rel=2e-3)
    narrow = travel.sea_periods(sea.model_copy(update={"gamma": 7.0})) or (0.0, 0.0)
    assert longest > narrow[0] > 2.0 > narrow[1] > shortest


# Regular waves of 2.5 s are back after 81.79 s. A row has 1 s of settling, then 20 s = 8 periods.
ENDED = {**TANK, "windows": "end before the reflection"}


@pytest.mark.parametrize(
    ("lead_in", "measured", "tail"),
    [
        (
            39.0,
            [20.0, 17.5],
            [1.0, 3.5],
        ),  # rows from 40 and 62 s on: 19.79 s are left for the second
        (20.0, [20.0, 20.0], [1.0, 1.0]),
        (57.0, [20.0, 0.0], None),
    ],
)
def test_windows_end_before_the_reflection_with_whole_periods(
    lead_in: float, measured: list[float], tail: list[float] | None, tmp_path: Path
) -> None:
    report = check(tmp_path, tank=ENDED, start={"lead_in_s": lead_in, "set_point_s": 1})
    if tail is None:
        (problem,) = report.problems
        assert problem.key == "tank.windows"
        assert "the window of row 1 begins 80.0 s after the start of the waves" in problem.message
        assert "are back after 81.8 s" in problem.message
        return
    plan = report.plan
    rows = [(row.measure, row.periods) for row in plan.rows]
    assert rows == [(seconds, round(seconds / 2.5)) for seconds in measured]
    segments = list(zip(plan.segments.phase, plan.segments.ticks, strict=True))
    assert [n / 1000 for phase, n in segments if phase == Phase.MEASURE] == measured
    assert [n / 1000 for phase, n in segments if phase == Phase.TAIL] == tail
    assert not any("reflected" in warning.message for warning in report.warnings)
    assert plan.wave_seconds == pytest.approx(lead_in + 44.0, abs=0.01)
    text = report.text()
    assert (f"{measured[1]:g} s = {measured[1] / 2.5:g} periods") in text
    assert ("or more per row" in text) == (measured[0] != measured[1])


def test_an_irregular_window_keeps_what_is_left_of_its_repeat_period(tmp_path: Path) -> None:
    sea = {"kind": "pink", "hm0_m": 0.1, "low_hz": 0.2, "high_hz": 1.0, "repeat_s": 100}
    row = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    keys = {"sea": sea, "timing": {"settle_s": 1}, "matrix": {"list": [row]}}
    report = check(tmp_path, tank=ENDED, start={"lead_in_s": 20, "set_point_s": 1}, **keys)
    (measured,) = report.plan.rows
    reflected = json.loads(report.to_json())["tank"]["reflected_s"]
    assert measured.measure == pytest.approx(reflected - 21.0, abs=1e-9)
    assert measured.periods == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"windows": "short"}, "end before the reflection"),
        ({"device_m": 70.0}, "70 m is not in the water; allowed below 65.2"),
        ({"depth_m": math.nan}, "finite number"),
        ({"depth_m": 0.0}, "greater than or equal to 0.1"),
        ({"beach": {"start_m": 90.0, "slope": 0.1}}, "starts behind the wall"),
        ({"beach": {"start_m": 3.0}}, "slope"),
        ({"colour": "blue"}, "Extra inputs"),
    ],
)
def test_an_impossible_tank_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Tank.model_validate({**TANK, **change})
