"""The additions of CONTRIBUTING.md, made as they are printed: a log field, a picture, a sensor.

A law, a station and a driver have tests of their own, which the table of the page names.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_here import rig as rig_here
from lab_package import ROOT, rig, write_project
from matplotlib.image import imread
from ruamel.yaml import YAML

from rig.recording.runs import open_run

PAGE = (ROOT / "CONTRIBUTING.md").read_text()
BEM = ROOT / "configs" / "plants" / "wavebot_bem.nc"


def blocks(heading: str, language: str) -> list[str]:
    """Return the code blocks of a language below a heading of the page."""
    section = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    return re.findall(rf"```{language}\n(.*?)```", section, re.DOTALL)


def apply_diff(file: Path, diff: str) -> None:
    """Change a file as a printed diff, whose hunks are separated by `...`."""
    text = file.read_text()
    for hunk in diff.split("...\n"):
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if line[0] in " -")
        new = "".join(line[1:] for line in lines if line[0] in " +")
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text)


@pytest.fixture(scope="module", name="lab")
def of_lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of a new kind with one field and one picture more, and a run of it."""
    lab = tmp_path_factory.mktemp("lab")
    write_project(lab)
    package = lab / "wec_lift" / "wec_lift"
    before = {path: path.read_text() for path in package.rglob("*.py")}
    (field,), (picture,) = blocks("Add a field of the log", "diff"), blocks("Add a picture", "diff")
    apply_diff(package / "tick.py", field)
    apply_diff(package / "products.py", picture)
    changed = {path.name for path, text in before.items() if path.read_text() != text}
    assert changed == {"tick.py", "products.py"}
    return lab


@pytest.fixture(scope="module", name="report")
def of_report(lab: Path) -> dict[str, object]:
    code, out, err = rig(lab, "run", "wec_lift/configs/holds.yaml", "--json")
    assert code == 0, err
    report: dict[str, object] = json.loads(out)
    return report


def test_field_is_in_the_log_with_its_unit(lab: Path, report: dict[str, object]) -> None:
    run = lab / str(report["folder"])
    data = open_run(run, fields=["goal", "axis.estimate.position"])
    distance = data["goal.distance"]
    assert distance.attrs["units"] == "m"
    expected = data["goal.position"].values - data["axis.estimate.position"].values
    assert np.array_equal(distance.values, expected)
    assert np.abs(distance.values).max() > 1e-3
    code, out, err = rig(lab, "plot", run, "-f", "goal.distance", "--json")
    assert code == 0, err
    (traces,) = json.loads(out)
    assert imread(traces).std() > 0.0
    code, out, err = rig(lab, "replay", run, "--json")
    assert code == 0, err
    assert json.loads(out)["same"] is True


def test_picture_is_a_product_of_the_run(lab: Path, report: dict[str, object]) -> None:
    (picture,) = report["products"]  # type: ignore[misc]
    assert Path(picture).name == "holds.png"
    assert imread(lab / picture).std() > 0.0
    (lab / picture).unlink()
    code, out, err = rig(lab, "plot", str(report["folder"]), "--json")
    assert code == 0, err
    assert json.loads(out) == [picture]
    assert (lab / picture).is_file()


def merge(file: Path, block: str) -> None:
    """Add the entries of a printed block to those of a YAML file."""
    yaml = YAML(pure=True)
    content = yaml.load(file)
    _add(content, yaml.load(block))
    yaml.dump(content, file)


def _add(content: Any, entries: dict[str, Any]) -> None:
    for key, value in entries.items():
        if isinstance(content.get(key), dict):
            _add(content[key], value)
        else:
            content[key] = value


@pytest.mark.slow
def test_sensor_and_station_are_yaml_alone(tmp_path: Path) -> None:
    arguments = ("--bem", BEM, "--stiffness", "24337", "--folder", tmp_path)
    assert rig_here("new", "rig", "buoy", *arguments).returncode == 0
    of_rig, of_plant, of_wires = blocks("Add a sensor", "yaml")
    merge(tmp_path / "buoy" / "rig.yaml", of_rig)
    merge(tmp_path / "buoy" / "plant.yaml", of_plant)
    merge(tmp_path / "buoy" / "rig.yaml", blocks("Add a station", "yaml")[0])
    campaign = tmp_path / "buoy" / "campaign.yaml"
    text = campaign.read_text()
    campaign.write_text(re.sub(r"\[(-?\d+), .*?\]", r"[\1]", text))  # one row
    on_wires = tmp_path / "buoy" / "rig_hil.yaml"
    unwired = rig_here("check", campaign, "--rig", on_wires)
    assert "sensors.elevation" in unwired.stdout
    assert "has no source, which a rig with wiring needs" in unwired.stdout
    merge(on_wires, of_wires)
    wired = rig_here("check", campaign, "--rig", on_wires)
    assert wired.returncode == 0, wired.stdout + wired.stderr
    done = rig_here("run", campaign, "--runs", tmp_path / "runs", "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    data = open_run(Path(json.loads(done.stdout)["folder"]))
    assert data["elevation.value"].attrs["units"] == "m"
    amplitude = YAML(typ="safe").load(campaign)["sea"]["amplitude_m"]
    measured = data["elevation.value"].values[data["plan.row"].values == 0]
    assert measured.max() == pytest.approx(amplitude, abs=0.01)
    velocity = data["heave.estimate.velocity"].values
    assert np.allclose(data["power.friction"].values, 30.0 * velocity * velocity)


def test_tests_that_the_page_names_exist() -> None:
    table = PAGE.split("## What to touch\n")[1].split("\n## ")[0]
    rows = [line for line in table.splitlines() if line.startswith("| a ")]
    assert len(rows) >= 8
    for row in rows:
        names = re.findall(r"`(tests/\S+\.py)`", row)
        assert names, row
        for name in names:
            assert (ROOT / name).is_file(), name
