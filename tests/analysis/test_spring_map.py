"""The spring map: identification of unknown springs, closed forms, refusals, files, positioner."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from hoisted_runs import STATIONS, UnknownSpring, draw_spring, run_spring_mapping
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here
from synthetic_runs import POWERS, Row, Shape, plan_json, run_rows, write_run

from rig.analysis.report import write_products
from rig.analysis.rows import row_table
from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.products import analyse
from rig.kinds.wavebot.spring_map import passes
from rig.kinds.wavebot.spring_map.files import write_calibration
from rig.kinds.wavebot.spring_map.passes import FIT_HALF_ANGLE, Samples
from rig.kinds.wavebot.spring_map.result import findings, natural_frequency, spring_map
from rig.realtime.sequence import Phase
from rig.recording.calibration import (
    RecordingTime,
    apply_calibration,
    open_calibration,
)
from rig.recording.runs import RunError

HALF = [-93.0, -33.0, 7.0, 67.0]  # of the stations: half the time
LEVER = 0.33047  # m/rad


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[UnknownSpring, Path]:
    """A run on a spring unknown to the rig, whose own map is that of Table 4-1."""
    return run_spring_mapping(tmp_path_factory.mktemp("hidden"), 11, stations_percent=HALF)


@pytest.fixture(scope="module")
def table(run: tuple[UnknownSpring, Path]) -> xarray.Dataset:
    return spring_map(run[1])


@pytest.mark.slow
def test_unknown_spring_is_identified(
    run: tuple[UnknownSpring, Path], table: xarray.Dataset
) -> None:
    """The rates of both load cells are within 2 %.

    The column load cell also measures 20 N of friction, which the two passes cancel. The benchmark
    `spring_map` repeats this for eight springs and all stations. Closed forms of the sine law: the
    slope over the window is 1.649 Tp, at zero 2 Tp.
    """
    hidden, _ = run
    np.testing.assert_allclose(table["station"], HALF, atol=0.5)
    true = np.array([hidden.rate(stator) for stator in HALF])
    np.testing.assert_allclose(table["rate"], true, rtol=0.02)
    np.testing.assert_allclose(table["rate_column"], true, rtol=0.02)
    peak = true * LEVER**2 / 1.649
    np.testing.assert_allclose(table["peak"], peak, rtol=0.02)
    # over ±10 deg the slope of sin 2 theta is less than 2 by 0.6 theta² x 4 = 1.2 %
    np.testing.assert_allclose(table["rate_small"], 0.988 * 2.0 / 1.649 * true, rtol=0.02)
    # friction: 20 N Coulomb and 400 N s/m at 0.1 m/s
    np.testing.assert_allclose(table["friction"], 60.0, rtol=0.05)
    frequency = np.sqrt((24337.0 + true) / 1506.17) / (2.0 * math.pi)
    np.testing.assert_allclose(table["natural_frequency"], frequency, rtol=0.01)


@pytest.mark.slow
def test_the_positioner_uses_the_map(
    run: tuple[UnknownSpring, Path], table: xarray.Dataset, tmp_path: Path
) -> None:
    """A requested rate becomes the stator position that gives it on the unknown spring."""
    hidden, _ = run
    path = tmp_path / "measured.yaml"
    known = write_calibration(table, path)
    assert known.file.quantity == "spring_map"
    rig = write_yaml(
        tmp_path / "rig.yaml",
        {"extends": str(CONFIGS / "rigs" / "wavebot.yaml"), "spring_map": "measured.yaml"},
    )
    target_rate = 0.5 * (hidden.rate(-33.0) + hidden.rate(7.0))  # halfway, as the map interpolates
    campaign = write_yaml(
        tmp_path / "asked.yaml",
        {
            "name": "asked",
            "rig": str(rig),
            "sea": {"kind": "regular", "amplitude_m": 0.05, "frequency_hz": 0.5},
            "matrix": {
                "list": [{"spring_n_per_m": target_rate, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}]
            },
        },
    )
    report = check_campaign(campaign)
    assert report.plan is not None, report.text()
    assert report.campaign is not None
    # 2 % of the largest of the two rates, by the slope of the map between the two stations
    tolerance = 0.02 * max(abs(hidden.rate(-33.0)), abs(hidden.rate(7.0)))
    slope = (hidden.rate(-33.0) - hidden.rate(7.0)) / 40.0
    assert report.plan.rows[0].place == pytest.approx(-13.0, abs=tolerance / slope)
    assert "spring map" in {file.role for file in report.campaign.files}
    at = RecordingTime.from_utc("2100-01-01T00:00:00Z")
    assert (
        apply_calibration(
            known.file, apply_calibration(known.file, 7.0, at).value, at, invert=True
        ).value
        == 7.0
    )
    # the run's configuration contains the calibration and the resulting map
    rig_config = report.campaign.rig.model_dump(mode="json", by_alias=True)
    assert rig_config["spring_map"]["name"] == "spring_map"
    assert [p["stator_percent"] for p in rig_config["spring"]["map"]] == HALF
    assert RigFile.model_validate(rig_config) == report.campaign.rig


@pytest.mark.slow
def test_a_map_corrects_rows(run: tuple[UnknownSpring, Path], table: xarray.Dataset) -> None:
    """The rig used Table 4-1; the map corrects its rows to the rates of the unknown spring."""
    hidden, folder = run
    known = write_calibration(table, folder / "again.yaml")
    read = row_table(folder, calibrations=[known])
    true = [hidden.rate(stator) for stator in HALF]
    np.testing.assert_allclose(read["spring_rate"], true, rtol=0.02)
    np.testing.assert_allclose(read["spring_rate_recorded"], [8340.0, 3379.0, -2763.0, -10013.0])


@pytest.mark.slow
def test_command_and_products(
    run: tuple[UnknownSpring, Path], table: xarray.Dataset, tmp_path: Path
) -> None:
    _, folder = run
    written = {path.name for path in write_products(folder, analyse=analyse)}
    assert {"spring_map.nc", "spring_map.csv", "spring_map.png", "rows.csv"} <= written
    assert "surfaces.png" not in written
    text = (folder / "summary.txt").read_text()
    assert "4 of 4 rows complete" in text
    assert "spring rate " in text
    out = tmp_path / "out"
    out.mkdir()
    write_calibration(table, out / "spring_map_v1.yaml")
    arguments = ("spring-map", folder, "-o", out, "--calibrations", out, "--json")
    code, stdout, err = rig_here(*arguments)
    assert (code, err) == (0, "")
    result = json.loads(stdout)
    assert result["calibration"] == "spring_map v2"
    assert all(Path(path).exists() for path in result["written"])
    assert open_calibration(out / "spring_map_v2.yaml").file.supersedes == 1
    code, stdout, _ = rig_here(
        "calibration", "apply", "spring_map@1", "--calibrations", out, "--value", "7",
        "--date", "2100-01-01",
    )  # fmt: skip
    assert code == 0


def test_a_station_with_missing_ticks_is_left_out_and_reported(tmp_path: Path) -> None:
    """Three stations on a spring of 100 sin 2 theta N m; 50 of the 2000 ticks of one are lost."""
    shape = Shape(periods=10)
    rows = [Row(i, 0, 0.0, 0.0, 0.0, dict.fromkeys(POWERS, 0.0)) for i in range(3)]
    plan = plan_json(rows, shape) | {"hoist": {"speed_m_per_s": 0.1, "words": "by hand"}}
    data = run_rows(rows, shape)
    way = np.repeat([1.0, -1.0, 1.0, -1.0], 500)
    angle = 0.9 * np.concatenate([np.linspace(-1.0, 1.0, 500) * sign for sign in way[::500]])
    for i, stator in enumerate((-30.0, 0.0, 30.0)):
        here = (data["plan.row"] == i) & (data["plan.phase"] == Phase.MEASURE)
        data["load.rotor_angle"][here] = angle
        data["load.slew"][here] = 100.0 * np.sin(2.0 * angle)
        data["heave.estimate.velocity"][here] = 0.1 * way
        data["spring_sense.position"][here] = stator
    inside = np.flatnonzero((data["plan.row"] == 1) & (data["plan.phase"] == Phase.MEASURE))
    spring = {"metres_per_radian": LEVER, "mapping": {"slew_lever_m": 1.0}}
    damaged = write_run(
        tmp_path / "torn", np.delete(data, inside[700:750]), plan,
        config={"rig": {"name": "wavebot", "spring": spring}}, ticks=len(data),
    )  # fmt: skip
    message = "row 1 is left out: 50 of 2000 ticks missing from the record"
    map_ = spring_map(damaged)
    assert map_["station"].values.tolist() == [-30.0, 30.0]
    assert map_.attrs["left_out"] == message
    assert message in findings(map_)
    assert message in analyse(damaged).summary.findings
    with_incomplete = spring_map(damaged, incomplete_rows=True)
    assert with_incomplete["station"].values.tolist() == [-30.0, 0.0, 30.0]
    assert "left_out" not in with_incomplete.attrs
    np.testing.assert_allclose(map_["rate"], 164.9 / LEVER**2, rtol=0.01)


def sweep(law: Any, *, half: float = 0.9, noise: float = 0.0, friction: float = 0.0) -> Samples:
    """Return two upward and two downward passes at constant speed, with friction."""
    one = np.linspace(-half, half, 20001)
    angle = np.concatenate([one, one[::-1], one, one[::-1]])
    way = np.repeat([1, -1, 1, -1], len(one))
    random = np.random.default_rng(3)
    torque = law(angle) + noise * random.standard_normal(len(angle)) + friction * way
    force = np.cos(2.0 * angle) + 0.1
    return Samples(angle, way, torque, -torque, force)


def test_closed_forms_of_a_sine_law() -> None:
    """Least squares of sin 2 theta over ±39.27 deg: 1.649 (public fbWecCntrl repository's window);
    friction cancels; cos 2 theta = -0.1 reverses at 47.87 deg."""
    samples = sweep(lambda angle: 100.0 * np.sin(2.0 * angle), friction=7.0)
    curve = passes.average_passes(samples)
    line = passes.estimate_rate(samples, curve)
    theta = FIT_HALF_ANGLE
    exact = 3.0 * (math.sin(2 * theta) / 2 - theta * math.cos(2 * theta)) / (2 * theta**3)
    assert line.slope == pytest.approx(100.0 * exact, rel=2e-4)  # bins of a degree
    assert exact == pytest.approx(1.649, abs=5e-4)
    assert line.passes == 4
    assert line.interval < 1e-6
    assert passes.fit_sine(curve).peak == pytest.approx(100.0, rel=2e-4)
    reversal = passes.find_reversal(curve)
    assert reversal.above == pytest.approx(0.5 * math.acos(-0.1), abs=1e-3)
    assert reversal.below == pytest.approx(-0.5 * math.acos(-0.1), abs=1e-3)


def test_the_interval_covers_noise() -> None:
    """With white noise in the torque of 40 springs, 95 % intervals contain the true slope.

    At least 33 of 40 must: the expected count is 38 with a standard deviation of 1.4.
    """
    covered = 0
    for seed in range(40):
        samples = sweep(lambda angle: 100.0 * np.sin(2.0 * angle))
        random = np.random.default_rng(seed)
        noisy = samples._replace(torque=samples.torque + 5.0 * random.standard_normal(80004))
        clean, curve = passes.average_passes(samples), passes.average_passes(noisy)
        true = passes.window_slope(clean, clean.torque, FIT_HALF_ANGLE)
        line = passes.estimate_rate(noisy, curve)
        covered += abs(line.slope - true) <= line.interval
    assert covered >= 33


def test_a_travel_that_is_too_short_gives_no_rate() -> None:
    samples = sweep(lambda angle: 100.0 * np.sin(2.0 * angle), half=0.6)
    curve = passes.average_passes(samples)
    line = passes.estimate_rate(samples, curve)
    assert math.isnan(line.slope)
    assert line.passes == 0
    assert math.isnan(passes.find_reversal(curve).above)


def test_natural_frequency_of_the_report() -> None:
    """MASK4 report (Sandia), 4.1: 0.65 Hz, 0.73 Hz and 0.48 Hz, to the 2 % of its constants."""
    frequencies = natural_frequency(np.array([0.0, 8340.0, -10013.0]), 24337.0, 1506.17)
    np.testing.assert_allclose(frequencies, [0.65, 0.73, 0.48], rtol=0.025)
    assert np.isnan(natural_frequency(-30000.0, 24337.0, 1506.17))


def bare_map(rates: list[float]) -> xarray.Dataset:
    many = len(rates)
    return xarray.Dataset(
        {
            "rate": ("station", rates),
            "reversal_stroke": ("station", [math.inf] * (many - 1) + [0.2]),
            "travel": ("station", [0.6] * many),
        },
        {"station": ("station", [float(i) for i in range(many)])},
        {"run": "r", "mode": "rehearsal", "started_utc": "2026-05-04T09:30:00Z"},
    )


def test_maps_that_cannot_be_inverted_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    for rates, why in (
        ([3.0, 2.0, 2.5], "neither rise nor fall"),
        ([3.0, math.nan], "no rate at 1 %"),
        ([3.0], "at least 2"),
    ):
        with pytest.raises(RunError, match=why):
            write_calibration(bare_map(rates), path)
        assert not path.exists()
    known = write_calibration(bare_map([300.0, -5.0, -400.0]), path)
    assert known.file.stroke_m == (0.6, 0.6, 0.19)


def test_a_rig_refuses_other_calibrations_as_spring_map(tmp_path: Path) -> None:
    """It also refuses a map without strokes: a limit has no default."""
    wavebot = str(CONFIGS / "rigs" / "wavebot.yaml")
    rate = str(CONFIGS / "calibrations" / "mask4_spring_rate_v1.yaml")
    rig = write_yaml(tmp_path / "rig.yaml", {"extends": wavebot, "spring_map": rate})
    with pytest.raises(ConfigError, match="corrects spring_rate; allowed a spring_map"):
        load(rig, RigFile)
    write_calibration(bare_map([300.0, -5.0, -400.0]), tmp_path / "m.yaml")
    text = (tmp_path / "m.yaml").read_text()
    (tmp_path / "m.yaml").write_text(
        "\n".join(line for line in text.splitlines() if not line.startswith("stroke_m"))
    )
    rig = write_yaml(tmp_path / "rig.yaml", {"extends": wavebot, "spring_map": "m.yaml"})
    with pytest.raises(ConfigError, match="0 strokes; allowed 3, one per station"):
        load(rig, RigFile)


def test_invalid_hoist_campaigns_are_refused(tmp_path: Path) -> None:
    def problems(**keys: Any) -> str:
        valid = {
            "name": "x", "rig": str(CONFIGS / "rigs" / "wavebot_hoist.yaml"),
            "sea": {"kind": "calm"},
            "hoist": {"stations_percent": [7], "low_m": -0.3, "high_m": 0.3,
                      "speed_m_per_s": 0.05},
        }  # fmt: skip
        return check_campaign(write_yaml(tmp_path / "x.yaml", {**valid, **keys})).text()

    assert "period" in problems()
    grid = {"grid": [{"spring_n_per_m": 0, "kp_n_s_per_m": 0, "ki_n_per_m": 0}]}
    assert "the rows are the hoist's stations" in problems(matrix=grid)
    regular = {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5}
    assert "a hoist needs calm water" in problems(sea=regular)
    wide = {"stations_percent": [-95, 7], "low_m": -0.3, "high_m": 0.3, "speed_m_per_s": 0.05}
    assert "allowed -93 .. 67 %" in problems(hoist=wide)
    quick = {"stations_percent": [7, 7], "low_m": -0.1, "high_m": 0.1, "speed_m_per_s": 0.1}
    text = problems(hoist=quick)
    assert "occurs twice" in text
    assert "allowed up to 0.05 m/s" in text


def test_a_run_without_a_hoist_is_refused(tmp_path: Path) -> None:
    code, _, err = rig_here("spring-map", tmp_path, "--runs", tmp_path)
    assert code == 2
    assert err


def test_random_springs_depend_on_the_seed_only() -> None:
    assert draw_spring(5) == draw_spring(5)
    assert draw_spring(5) != draw_spring(6)
    assert len(STATIONS) == 9
