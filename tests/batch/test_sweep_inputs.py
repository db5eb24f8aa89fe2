"""The name of a sweep's folder, and the check of its workers, depend on every input."""

from __future__ import annotations

import inspect
import shutil
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rehearsing import CONFIGS, write_campaign

from rig.config.problems import ConfigError
from rig.kinds import registry
from rig.sweeps import parameters, sweep
from rig.sweeps.cases import Case
from rig.sweeps.simulator import ROOM, SessionSimulation, Simulation

NONLINEAR = {"quadratic_n_s2_per_m2": 100, "coulomb_n": 0}
POINT = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}


def make_campaign(folder: Path, **keys: Any) -> Path:
    """Write a campaign with two recorded elevations, and a plant with its own BEM data."""
    for name, size in (("one.csv", 0.1), ("other.csv", 0.05)):
        rows = (f"{0.1 * i:.1f},{size * (i % 20 - 10)}" for i in range(200))
        (folder / name).write_text("\n".join(["time,eta", *rows]))
    for name in ("wavebot.yaml", "wavebot_bem.npz", "wavebot_surge_bem.npz"):
        shutil.copy(CONFIGS / "plants" / name, folder / name)
    config: dict[str, Any] = {
        "plant": str(folder / "wavebot.yaml"),
        "sea": {
            "kind": "recorded", "file": "one.csv", "channel": "eta", "unit": "m", "start_s": 0,
            "end_s": 10,
        },
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 10, "lead_in_s": 30},
        "timing": {"settle_s": 3},
        "matrix": {"list": [POINT]},
    }  # fmt: skip
    return write_campaign(folder, **config | keys)


def elevation_option(folder: Path) -> str:
    return f"sea.file={folder / 'one.csv'},{folder / 'other.csv'}"


def open_test_sweep(path: Path, *options: str) -> sweep.Sweep:
    return sweep.open_sweep(
        path, list(options), path.parent / "sweeps", sequential=False, lead_in=5.0
    )


def test_swapped_files_are_another_sweep(tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    before = open_test_sweep(path, elevation_option(tmp_path))
    first, second = tmp_path / "one.csv", tmp_path / "other.csv"
    texts = first.read_text(), second.read_text()
    first.write_text(texts[1])
    second.write_text(texts[0])
    assert open_test_sweep(path, elevation_option(tmp_path)).folder != before.folder


@pytest.mark.parametrize("name", ["one.csv", "wavebot_bem.npz", "wavebot_surge_bem.npz"])
def test_every_file_changes_the_folder(name: str, tmp_path: Path) -> None:
    path = make_campaign(tmp_path)
    before = open_test_sweep(path).folder
    assert open_test_sweep(path).folder == before
    changed = tmp_path / name
    changed.write_bytes(changed.read_bytes() + b"\n")
    assert open_test_sweep(path).folder != before


def test_another_numba_is_another_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_campaign(tmp_path)
    before, original = open_test_sweep(path).folder, metadata.version
    monkeypatch.setattr(metadata, "version", lambda name: original(name) + (name == "numba") * ".1")
    sweep._code_digest.cache_clear()
    try:
        assert open_test_sweep(path).folder != before
    finally:
        sweep._code_digest.cache_clear()


def test_data_changed_during_a_sweep_fail_its_cases(tmp_path: Path) -> None:
    """No result of changed data appears in the folder of the original data."""
    test_sweep = open_test_sweep(make_campaign(tmp_path), elevation_option(tmp_path))
    bem = tmp_path / "wavebot_bem.npz"
    original = bem.read_bytes()
    bem.write_bytes(original + b"\n")
    outcome = test_sweep.cases.run(Case(0, 0, 0))
    assert outcome.failed.endswith("wavebot_bem.npz was changed since the sweep began")
    bem.write_bytes(original)
    elevation = tmp_path / "other.csv"
    elevation.write_text(elevation.read_text() + "\n")
    outcome = test_sweep.cases.run(Case(1, 1, 0))
    assert outcome.failed.endswith("other.csv was changed since the sweep began")


def test_parameter_of_a_law_in_the_rig_file_is_named(tmp_path: Path) -> None:
    law = "{use: nonlinear damping, smoothing_m_per_s: 0.01}"
    wavebot = CONFIGS / "rigs" / "wavebot.yaml"
    (tmp_path / "own.yaml").write_text(f"extends: {wavebot}\nlaw: {law}\n")
    point = {"spring_n_per_m": 490.9, **NONLINEAR}
    path = make_campaign(tmp_path, rig=str(tmp_path / "own.yaml"), matrix={"list": [point]})
    with pytest.raises(ConfigError) as raised:
        open_test_sweep(path, "law.smoothing_m_per_s=0.01,0.02")
    (problem,) = raised.value.problems
    message = "the law is that of the rig file: write rig.law.smoothing_m_per_s=V1,V2,..."
    assert (problem.key, problem.message) == ("law.smoothing_m_per_s", message)
    assert len(open_test_sweep(path, "rig.law.smoothing_m_per_s=0.01,0.02").cases) == 2


@pytest.mark.parametrize(
    ("campaign", "axes", "key", "found"),
    [
        ({}, ["heave"], "law.x", "rig.axes.heave.law.x"),
        ({"law": {"x": 1}}, ["heave"], "law.x", ""),
        ({"law": {"roll": {}}}, ["heave", "roll"], "law.heave.x.0", "rig.axes.heave.law.x.0"),
        ({"law": {"roll": {}}}, ["heave", "roll"], "law.roll.x", ""),
        ({}, [], "law.x", ""),
        ({}, ["heave"], "rig.law.x", ""),
    ],
)
def test_law_of_an_axis_in_the_rig_file(
    campaign: dict[str, Any], axes: list[str], key: str, found: str
) -> None:
    tasks: Any = SimpleNamespace(noun="campaign", keys=("law",), fixed_keys={})
    rig = {"axes": {axis: {"law": {"x": 1}} for axis in axes}}
    files: Any = SimpleNamespace(tasks=tasks, mapping=lambda key: rig if key else campaign)
    (parameter,) = parameters.parse_parameters([f"{key}=1,2"], tasks).parameters
    assert parameters._key_of_rig_law(parameter, files) == found


def test_worker_must_have_the_files_named_by_values(tmp_path: Path) -> None:
    test_sweep = open_test_sweep(make_campaign(tmp_path), elevation_option(tmp_path))
    assert (
        len(sweep.reopen_cases(test_sweep.cases.request, test_sweep.digest))
        == len(test_sweep.cases)
        == 2
    )
    second = tmp_path / "other.csv"
    second.write_text(second.read_text() + "\n")
    with pytest.raises(ValueError, match="has other files for"):
        sweep.reopen_cases(test_sweep.cases.request, test_sweep.digest)


def test_coordinates_are_the_values_of_the_rows(tmp_path: Path) -> None:
    """A short lead-in limits the time at the set point; a list entry has the unit of the list."""
    key = "plant.spring.spring_rates.value.4"
    test_sweep = open_test_sweep(make_campaign(tmp_path), f"{key}=490.9,491")
    table = sweep.run(test_sweep, lambda cases, work: iter(()), lambda outcome: None)
    assert table[key].attrs["units"] == "N/m"
    assert table["start.lead_in_s"].item() == 5.0
    assert table["start.set_point_s"].item() == 5.0
    assert table["start.set_point_s"].attrs["units"] == "s"
    with pytest.raises(ConfigError, match="10 is longer than the lead-in; allowed up to --lead-in"):
        open_test_sweep(tmp_path / "campaign.yaml", "start.set_point_s=1,10")


@pytest.mark.parametrize(
    ("kind", "protocol"),
    [("wavebot", Simulation), ("modular", Simulation), ("oswec bench", SessionSimulation)],
)
def test_the_simulation_of_a_kind_has_all_that_sweeps_use(kind: str, protocol: type) -> None:
    """A sweep imports no kind: the room `simulation` of a kind implements the protocol."""
    members = {name: each for name, each in vars(protocol).items() if inspect.isfunction(each)}
    functions = {name: each for name, each in members.items() if not name.startswith("_")}
    room = registry.find(kind).room(ROOM)
    assert {*functions, *inspect.get_annotations(protocol)} <= set(dir(room))
    for name, declared in functions.items():
        parameters = inspect.signature(getattr(room, name)).parameters
        assert len(parameters) == len(inspect.signature(declared).parameters) - 1, name
