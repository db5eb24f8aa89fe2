"""The twin of a rehearsed linear plant against the plant, through log, file and command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray
from identified import LINEAR, SPRING, identified, wrong_plant
from made_once import made_once
from predicting import predicted, rows, write_campaign
from rig_command import rig_here

from rig.analysis.rows import row_table
from rig.config.yaml_source import load_mapping
from rig.design.recommend import report
from rig.design.recommend.recommendation import RecommendOptions, advise
from rig.identification.twin.plant_file import identified_up_to

pytestmark = pytest.mark.slow

SEA = {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5}
GAINS = [
    (SPRING, -1200.0, 0.0), (SPRING, -2500.0, 2000.0), (SPRING, -3500.0, -3000.0),
    (490.9, -2000.0, 6000.0),
]  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = made_once(tmp_path_factory, "twin", identified)
    (run,) = (folder / "runs").glob("*/")
    return run


@pytest.fixture(scope="module")
def plant(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made by the command, from a plant file whose numbers are wrong."""
    folder = tmp_path_factory.mktemp("file")
    code, out, err = rig_here(
        "twin", run, "--plant", wrong_plant(folder), "-o", folder / "twin", "--json"
    )
    assert code == 0, err
    told = json.loads(out)
    assert "no row in waves" in told["notes"][0]
    return folder / "twin" / "plant.yaml"


def test_the_twin_gives_the_power_of_the_plant_it_was_identified_from(
    plant: Path, tmp_path: Path
) -> None:
    """Within 0.5 % of the mechanical power, 0.3 W at least: bands of two periods, no more."""
    asked = {"sea": SEA, "matrix": rows(*GAINS)}
    ours = predicted(write_campaign(tmp_path / "twin", **asked, plant=str(plant)))
    true = predicted(write_campaign(tmp_path / "true", **asked, plant=str(LINEAR)))
    assert len(ours.rows) == len(GAINS)
    for one, other in zip(ours.rows, true.rows, strict=True):
        most = max(0.3, 0.005 * abs(other.predicted.power_mechanical_1))
        for name in ("power_mechanical_1", "power_mechanical_2", "power_ac", "power_dc"):
            gap = getattr(one.predicted, name) - getattr(other.predicted, name)
            assert abs(gap) < most, (one.row.setting, name, gap)
        assert one.predicted.stroke == pytest.approx(other.predicted.stroke, rel=0.005)


def test_the_twin_knows_how_far_it_was_identified(plant: Path, run: Path) -> None:
    """Amplitudes of the rows as their table has them; the lines up to 2.5 Hz make 1 % of it."""
    known, table = identified_up_to(plant), row_table(run)
    assert set(known) == {"stroke", "velocity_rms"}
    for name, (least, greatest) in known.items():
        measured = table[name].values
        assert least == pytest.approx(measured.min(), rel=0.01)
        assert greatest == pytest.approx(measured.max(), rel=0.01)
    assert identified_up_to(LINEAR) == {}


STATIONS = ("power_mechanical_1", "power_mechanical_2", "power_ac", "power_dc")


def swept(path: Path, folder: Path, count: int) -> xarray.Dataset:
    """Row by row in sequence, as a rehearsal goes."""
    code, out, err = rig_here("sweep", path, "--sequential", "--sweeps", folder, "--json")
    assert code == 0, err
    told = json.loads(out)
    assert told["rows"] == {"complete": count}
    return xarray.load_dataset(told["result"], engine="h5netcdf")


def test_rehearsals_and_sweeps_run_on_the_twin_as_on_the_plant(plant: Path, tmp_path: Path) -> None:
    """The commands a person gives, in an irregular sea of 0.2 to 1 Hz, the band identified.

    Its lines lie between those of the pushes. Twin and plant differ by 0.02 W of DC power at most
    and by 0.005 W at the other stations; allowed is about five times that.
    """
    asked = {
        "sea": {"kind": "pink", "hm0_m": 0.25, "repeat_s": 25, "seed": 8},
        "matrix": rows(GAINS[1], GAINS[3]),
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": 20},
        "timing": {"settle_s": 10, "periods": 1},
    }
    twin = write_campaign(tmp_path / "twin", name="twin", plant=str(plant), **asked)
    true = write_campaign(tmp_path / "true", name="true", plant=str(LINEAR), **asked)
    ours, plants = (swept(path, tmp_path / "sweeps", 2) for path in (twin, true))
    assert np.abs(plants["power_mechanical_1"].values).min() > 20.0  # W: there is something to miss
    for name in STATIONS:
        most = 0.1 if name == "power_dc" else 0.025
        gap = np.abs(ours[name].values - plants[name].values)
        assert np.all(gap < most), (name, gap)
    asked |= {
        "sea": {"kind": "pink", "hm0_m": 0.25, "repeat_s": 10, "seed": 8},
        "matrix": rows(GAINS[1]),
        "start": {"set_point_s": 1, "lead_in_s": 5},
        "timing": {"settle_s": 1, "periods": 1},
    }
    short = write_campaign(tmp_path / "short", name="short", plant=str(plant), **asked)
    ours = swept(short, tmp_path / "sweeps", 1)
    code, out, err = rig_here("run", short, "--runs", tmp_path / "runs", "--json")
    assert code == 0, err
    told = json.loads(out)
    assert told["status"] == "complete"
    rehearsed = row_table(told["folder"])
    for name in STATIONS:  # the same loop, interpreted and compiled
        np.testing.assert_array_equal(rehearsed[name].values, ours[name].values)


def test_every_number_says_where_it_is_from(plant: Path) -> None:
    mapping, _ = load_mapping(plant)
    assert mapping["name"] == "twin of WaveBot, linear"
    assert mapping["body"]["hydrostatic"]["source"].startswith("identified, ")
    assert "standard deviation" in mapping["drive"]["linear_loss"]["source"]
    assert mapping["drive"]["current_limit"]["source"] == "AMC 040A400 peak current"
    assert mapping["body"]["hydrostatic"]["value"] == pytest.approx(24337.0, rel=0.005)
    assert mapping["drive"]["linear_loss"]["value"] == pytest.approx(3.6, rel=0.01)
    assert plant.read_text().startswith("# Identified twin of the device in ")


def test_what_is_recommended_can_be_checked_and_holds(run: Path, tmp_path: Path) -> None:
    """The best of the recommendation is best on the plant, too: no neighbour is better by 0.3 W."""
    base = write_campaign(tmp_path / "base", sea=SEA, matrix=rows(GAINS[0]), plant=str(LINEAR))
    asked = RecommendOptions(
        campaign=base, rows=9, plant=wrong_plant(tmp_path), spring=(-8000.0, 490.9)
    )
    advice = advise([run], asked, tmp_path / "advice")
    path, numbers = report.write(advice, tmp_path / "advice")
    told = json.loads(numbers.read_text())
    assert len(told["rows"]) == 9
    assert told["rows"][0]["why"] == "best DC power"
    assert all(row["half_width_95"]["dc"] > 0.0 for row in told["rows"])
    found = predicted(path)
    assert not found.refused
    assert len(found.rows) == 9
    by_gains = {one.row.setting[1:3]: one.predicted for one in found.rows}
    for row in told["rows"]:
        true = by_gains[row["kp"], row["ki"]]
        assert true.power_dc == pytest.approx(row["power_dc_w"], abs=row["half_width_95"]["dc"])
        assert true.stroke == pytest.approx(row["stroke_m"], abs=row["half_width_95"]["stroke"])
    best = by_gains[told["rows"][0]["kp"], told["rows"][0]["ki"]]
    assert best.power_dc <= min(one.power_dc for one in by_gains.values()) + 0.3
    laws = {(o["station"], o["law"]): o for o in told["optima"]}
    assert len(laws) == 9
    assert laws["dc", "PI and spring"]["power_dc_w"] <= laws["dc", "PI"]["power_dc_w"]
    assert laws["dc", "PI"]["power_dc_w"] <= laws["dc", "P"]["power_dc_w"]
    assert laws["ac", "PI"]["power_ac_w"] <= laws["dc", "PI"]["power_ac_w"]
    assert "± " in report.as_text(advice)
    assert np.isfinite([row["power_ac_w"] for row in told["rows"]]).all()


def test_what_cannot_be_told_is_said(run: Path, tmp_path: Path) -> None:
    code, _, err = rig_here("recommend", run)
    assert code == 2
    assert "say which sea, --campaign" in err
    calm = write_campaign(tmp_path, sea={"kind": "calm"}, matrix=rows(GAINS[0]))
    code, _, err = rig_here("recommend", run, "--campaign", calm, "-o", tmp_path / "out" / "x.yaml")
    assert code == 2
    assert "gains are recommended for a sea" in err


def test_two_port_pictures_of_what_was_measured(run: Path, tmp_path: Path) -> None:
    code, out, err = rig_here("twoport", run, "-o", tmp_path, "--json")
    assert code == 0, err
    written = [Path(name) for name in json.loads(out)["written"]]
    assert [path.name for path in written] == [
        "twoport_gains.png", "twoport_spring_gear.png", "twoport_transfer.png",
    ]  # fmt: skip
    assert all(path.stat().st_size > 20_000 for path in written)
