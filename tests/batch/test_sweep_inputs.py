"""What a sweep's folder is named by, and what its workers must have: no input is missed."""

from __future__ import annotations

import shutil
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS, write_campaign

from rig.config.problems import ConfigError
from rig.sweep import sweep
from rig.sweep.cases import Case

LIST = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}


def campaign(folder: Path, **keys: Any) -> Path:
    """Two recorded elevations, and a plant with BEM data of its own."""
    for name, size in (("one.csv", 0.1), ("other.csv", 0.05)):
        rows = (f"{0.1 * i:.1f},{size * (i % 20 - 10)}" for i in range(200))
        (folder / name).write_text("\n".join(["time,eta", *rows]))
    for name in ("wavebot.yaml", "wavebot_bem.npz", "wavebot_surge_bem.npz"):
        shutil.copy(CONFIGS / "plants" / name, folder / name)
    whole: dict[str, Any] = {
        "plant": str(folder / "wavebot.yaml"),
        "sea": {
            "kind": "recorded", "file": "one.csv", "channel": "eta", "unit": "m", "start_s": 0,
            "end_s": 10,
        },
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 10, "lead_in_s": 30},
        "timing": {"settle_s": 3},
        "matrix": {"list": [LIST]},
    }  # fmt: skip
    return write_campaign(folder, **whole | keys)


def elevations(folder: Path) -> str:
    return f"sea.file={folder / 'one.csv'},{folder / 'other.csv'}"


def opened(path: Path, *overs: str) -> sweep.Sweep:
    return sweep.open_sweep(
        path, list(overs), path.parent / "sweeps", sequential=False, lead_in=5.0
    )


def test_files_that_change_places_are_another_sweep(tmp_path: Path) -> None:
    path = campaign(tmp_path)
    before = opened(path, elevations(tmp_path))
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    texts = one.read_text(), other.read_text()
    one.write_text(texts[1])
    other.write_text(texts[0])
    assert opened(path, elevations(tmp_path)).folder != before.folder


@pytest.mark.parametrize("name", ["one.csv", "wavebot_bem.npz", "wavebot_surge_bem.npz"])
def test_every_file_names_the_folder(name: str, tmp_path: Path) -> None:
    path = campaign(tmp_path)
    before = opened(path).folder
    assert opened(path).folder == before
    changed = tmp_path / name
    changed.write_bytes(changed.read_bytes() + b"\n")
    assert opened(path).folder != before


def test_another_numba_is_another_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = campaign(tmp_path)
    before, sound = opened(path).folder, metadata.version
    monkeypatch.setattr(metadata, "version", lambda name: sound(name) + (name == "numba") * ".1")
    sweep._code.cache_clear()
    try:
        assert opened(path).folder != before
    finally:
        sweep._code.cache_clear()


def test_data_that_change_while_a_sweep_runs_fail_its_cases(tmp_path: Path) -> None:
    """Nothing is reckoned with them under a name that says something else."""
    swept = opened(campaign(tmp_path), elevations(tmp_path))
    bem = tmp_path / "wavebot_bem.npz"
    whole = bem.read_bytes()
    bem.write_bytes(whole + b"\n")
    outcome = swept.cases.run(Case(0, 0, 0))
    assert outcome.failed.endswith("wavebot_bem.npz was changed since the sweep began")
    bem.write_bytes(whole)
    elevation = tmp_path / "other.csv"
    elevation.write_text(elevation.read_text() + "\n")
    outcome = swept.cases.run(Case(1, 1, 0))
    assert outcome.failed.endswith("other.csv was changed since the sweep began")


def test_a_worker_must_have_the_files_that_values_name(tmp_path: Path) -> None:
    swept = opened(campaign(tmp_path), elevations(tmp_path))
    assert len(sweep.same_cases(swept.cases.asked, swept.digest)) == len(swept.cases) == 2
    other = tmp_path / "other.csv"
    other.write_text(other.read_text() + "\n")
    with pytest.raises(ValueError, match="has other files for"):
        sweep.same_cases(swept.cases.asked, swept.digest)


def test_coordinates_are_what_the_rows_had(tmp_path: Path) -> None:
    """A short lead-in cuts the time at the set point; an entry of a list has the list's unit."""
    key = "plant.spring.spring_rates.value.4"
    swept = opened(campaign(tmp_path), f"{key}=490.9,491")
    table = sweep.run(swept, lambda cases, work: iter(()), lambda outcome: None)
    assert table[key].attrs["units"] == "N/m"
    assert table["start.lead_in_s"].item() == 5.0
    assert table["start.set_point_s"].item() == 5.0
    assert table["start.set_point_s"].attrs["units"] == "s"
    with pytest.raises(ConfigError, match="10 is longer than the lead-in; allowed up to --lead-in"):
        opened(tmp_path / "campaign.yaml", "start.set_point_s=1,10")
