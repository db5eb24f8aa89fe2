"""A new law is one Python file and a campaign: those of the tutorial, through all commands."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from rehearsing import CONFIGS
from rig_command import rig_here

from rig.analysis.effects import compute_effects
from rig.analysis.rows import row_table
from rig.recording.runs.folder import attachments
from tests.docs.blocks import file_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "your_law.md"


def write_example(folder: Path) -> Path:
    """Write law and campaign of the tutorial and return the campaign's path."""
    (folder / "growing_damping.py").write_text(file_of(PAGE, "growing_damping.py"))
    path = folder / "campaign.yaml"
    text = file_of(PAGE, "growing.yaml")
    path.write_text(text.replace("rig: wavebot", f"rig: {CONFIGS / 'rigs' / 'wavebot.yaml'}"))
    return path


@pytest.fixture(scope="module", name="example")
def of_example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_example(tmp_path_factory.mktemp("law"))


@pytest.fixture(scope="module", name="run")
def of_run(example: Path) -> Path:
    code, out, err = rig_here("run", example, "--runs", example.parent / "runs", "--json")
    assert code == 0, out + err
    (run,) = (example.parent / "runs").iterdir()
    return run


def test_check_names_law_and_columns(example: Path) -> None:
    code, out, _ = rig_here("check", example)
    assert code == 0, out
    assert "law       growing_damping (" in out
    assert "not predicted: the law growing_damping has no linear form; " in out
    assert "warning" not in out
    code, out, _ = rig_here("check", example, "--json")
    report = json.loads(out)
    assert report["not_predicted"] == "the law growing_damping has no linear form"
    assert [file["role"] for file in report["files"]][-1] == "law"


def test_rehearsal_has_the_columns_in_row_table_effects_and_surface(run: Path) -> None:
    table = row_table(run)
    assert table["state"].values.tolist() == ["complete"] * 6
    assert table["c0"].values.tolist() == [1000.0] * 3 + [2000.0] * 3
    assert table["c1"].values.tolist() == [0.0, 5000.0, 10000.0] * 2
    assert table["c1"].attrs["units"] == "N*s/m^2"
    assert not {"kp", "ki", "km"} & set(table.variables)
    assert (table["power_mechanical_1"].values < -1.0).all()  # W, absorbed
    found = compute_effects(table, "mechanical_1")
    assert found is not None
    assert {effect.column.name for effect in found.effects} == {"c0", "c1"}
    assert matplotlib.image.imread(run / "surfaces.png").std() > 0.0
    code, out, _ = rig_here("show", run)
    assert code == 0
    assert "c0 +1000 .. +2000 N·s/m" in re.sub(r" +", " ", out)
    assert "no complete row" not in out


def test_one_surface_is_drawn_over_the_columns_of_the_law(run: Path, tmp_path: Path) -> None:
    picture = tmp_path / "surface.png"
    code, out, err = rig_here("plot", run, "--surface", "c0", "c1_n_s_per_m2", "-o", picture)
    assert code == 0, out + err
    assert picture.stat().st_size > 10_000


def test_record_holds_the_law(run: Path, example: Path) -> None:
    config = json.loads((run / "config.json").read_text())
    text = (example.parent / "growing_damping.py").read_text()
    assert (run / "law.py").read_text() == text
    assert attachments(run)["law.py"].decode() == text
    assert config["law"]["name"] == "growing_damping"
    assert len(config["law"]["sha256"]) == 64
    assert config["campaign"]["law"] == {"use": "./growing_damping.py", "max_force_n": 3000.0}
    plan = json.loads((run / "plan.json").read_text())
    assert [column["key"] for column in plan["columns"]][:3] == [
        "spring_n_per_m", "c0_n_s_per_m", "c1_n_s_per_m2",
    ]  # fmt: skip


@pytest.mark.long(group="adding a law")
def test_replay_has_the_same_bits_and_needs_no_file(run: Path, example: Path) -> None:
    code, out, _ = rig_here("replay", run, "--json")
    assert (code, json.loads(out)["notice"]) == (0, "")
    law = example.parent / "growing_damping.py"
    text = law.read_text()
    try:
        law.write_text(text + "\n# edited\n")
        code, out, _ = rig_here("replay", run)
        assert code == 0
        assert "growing_damping.py has changed since the run (sha256)" in out
        law.unlink()
        code, out, _ = rig_here("replay", run)
        assert code == 0
        assert out.startswith("no diff: ")
    finally:
        law.write_text(text)


@pytest.mark.long(group="adding a law")
def test_run_of_a_law_that_is_not_installed_is_shown(run: Path, tmp_path: Path) -> None:
    """Its columns come from the record; only a replay needs the law."""
    copy = tmp_path / run.name
    shutil.copytree(run, copy)
    config = json.loads((copy / "config.json").read_text())
    config["law"] |= {"name": "gone", "file": False}
    config["campaign"]["law"]["use"] = "gone"
    (copy / "config.json").write_text(json.dumps(config))
    program = "import sys; from rig.cli.app import app; app(sys.argv[1:])"
    for arguments in (["show", copy], ["plot", copy, "--surface", "c1", "c0"]):
        subprocess.run([sys.executable, "-c", program, *map(str, arguments)], check=True)
    code, _, err = rig_here("replay", copy)
    assert code != 0
    assert "no law 'gone' is registered" in err


@pytest.mark.slow
@pytest.mark.long(group="adding a law")  # compiles the loop
def test_sweep_repeats_the_rehearsal(run: Path, example: Path) -> None:
    folder = example.parent / "sweeps"
    arguments = ("sweep", example, "--sequential", "--sweeps", folder, "--json")
    code, out, err = rig_here(*arguments)
    assert code == 0, out + err
    import xarray

    swept = xarray.load_dataset(json.loads(out)["result"], engine="h5netcdf")
    measured = row_table(run)
    assert swept["c1"].values.tolist() == measured["c1"].values.tolist()
    for name in ("power_mechanical_1", "power_dc", "position_rms"):
        assert np.array_equal(swept[name].values, measured[name].values), name


@pytest.mark.slow
@pytest.mark.long(group="adding a law")  # compiles the loop
def test_sweep_over_a_parameter_of_the_law(example: Path) -> None:
    folder = example.parent / "sweeps"
    arguments = ("--over", "law.max_force_n=100,3000", "--sweeps", folder, "--json")
    code, out, err = rig_here("sweep", example, *arguments)
    assert code == 0, out + err
    import xarray

    swept = xarray.load_dataset(json.loads(out)["result"], engine="h5netcdf")
    peak = swept["force_peak"].values
    assert peak.shape == (2, 6)
    assert (peak[0] <= 100.0 + 1e-9).all()
    assert (peak[1] > 200.0).all()


@pytest.mark.realtime
def test_hil_runs_the_law(example: Path) -> None:
    wired = CONFIGS / "rigs" / "wavebot_hil.yaml"
    if not wired.exists():
        pytest.skip("no wired rig is shipped")
    two_rows = example.with_name("two_rows.yaml")
    two_rows.write_text(example.read_text().replace("[0, 5000, 10000]", "5000"))
    runs = example.parent / "hil"
    code, out, err = rig_here("run", two_rows, "--rig", wired, "--sim", "--runs", runs, "--json")
    assert code == 0, out + err
    (run,) = runs.iterdir()
    assert row_table(run)["state"].values.tolist() == ["complete"] * 2


def test_matrix_from_csv_has_the_columns_of_the_law(tmp_path: Path) -> None:
    path = write_example(tmp_path)
    text = path.read_text()
    head = text[: text.index("matrix:")]
    path.write_text(head + "matrix: {csv: rows.csv}\n")
    rows = tmp_path / "rows.csv"
    rows.write_text("spring_n_per_m,c0_n_s_per_m,c1_n_s_per_m2\n490.9,1000,0\n490.9,2000,100\n")
    code, out, _ = rig_here("check", path, "--json")
    assert (code, json.loads(out)["points"]) == (0, 2)
    rows.write_text("spring_n_per_m,kp_n_s_per_m,ki_n_per_m\n490.9,-1000,0\n")
    code, out, _ = rig_here("check", path)
    assert code == 2
    assert "allowed spring_n_per_m,c0_n_s_per_m,c1_n_s_per_m2 and any of reference_scale" in out


def check(path: Path) -> tuple[int, dict[str, Any]]:
    code, out, _ = rig_here("check", path, "--json")
    return code, json.loads(out)


def test_law_of_the_rig_file_is_the_default_of_its_campaigns(tmp_path: Path) -> None:
    path = write_example(tmp_path)
    rig = tmp_path / "rig.yaml"
    base = CONFIGS / "rigs" / "wavebot.yaml"
    rig.write_text(f"extends: {base}\nlaw: {{use: ./growing_damping.py, max_force_n: 0.5}}\n")
    text = path.read_text().replace(str(base), str(rig))
    path.write_text(re.sub(r"law: .*\n", "", text))
    code, report = check(path)
    assert code == 2
    (problem,) = report["problems"]
    assert (Path(problem["file"]).name, problem["line"]) == ("rig.yaml", 2)
    assert problem["key"] == "law.max_force_n"
    rig.write_text(rig.read_text().replace("0.5", "500"))
    assert check(path)[0] == 0
