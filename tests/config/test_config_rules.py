"""One broken file for every rule of the schema, with the expected message."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, Field, ValidationError
from ruamel.yaml import YAML

from rig.config.problems import ConfigError
from rig.config.pydantic_errors import load
from rig.config.pydantic_errors import problems_from as translate
from rig.config.ranges import unit_of_key
from rig.config.yaml_source import load_mapping
from rig.kinds.modular.config import RigFile as ModularRigFile
from rig.kinds.wavebot.config import LimitsFile, RigFile
from rig.kinds.wavebot.config.campaign_file import CampaignFile

CONFIGS = Path(__file__).parents[2] / "configs"

CAMPAIGN = """\
name: test
rig: rig.yaml
seed: 1
order: as given
repeat: 1
sea:
  kind: regular
  amplitude_m: 0.127
  frequency_hz: 0.5
timing:
  settle_s: 5
  interval_s: 20
start:
  set_point_s: 5
  lead_in_s: 120
tare: {duration_s: 5}
matrix:
  grid:
    - spring_n_per_m: 490.9
      kp_n_s_per_m: [-1000, -2000]
      ki_n_per_m: {from: 0, to: 4000, step: 2000}
"""

MODULAR = """\
name: buoy
kind: modular
rate_hz: 1000
realtime: best effort
limits: limits.yaml
plant: plant.yaml
drive_enable_timeout_s: 5
stop: {duration_s: 3, ramp_s: 0.2}
axes:
  heave:
    motion: translation
    torque_constant_n_m_per_a: 1
    gear_ratio_rad_per_m: 10
    counts_per_revolution: 20000
    encoder_noise_counts: 0.5
    jerk_density_m2_per_s5: 1
    gain_ramp_s: 0.5
    stop_damping_n_s_per_m: 2000
    current_bandwidth_hz: 200
    force_sensor: load_cell
sensors:
  load_cell: {unit: N, range: [-2000, 2000], lag_s: 0.0005, age_limit_s: 0.5}
stations:
  absorbed: {formula: load_cell * heave_velocity}
"""

BROKEN = YAML(typ="safe", pure=True).load(Path(__file__).with_name("broken_files.yaml"))


def problems(path: Path, model: type[BaseModel]) -> list[tuple[int, str, str]]:
    with pytest.raises(ConfigError) as error_info:
        load(path, model)
    return [(p.line, p.key, p.message) for p in error_info.value.problems]


def test_a_valid_file_loads_and_is_frozen(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(CAMPAIGN)
    file, _ = load(path, CampaignFile)
    assert file.matrix.grid is not None
    assert file.matrix.grid[0].ki_n_per_m == (0.0, 2000.0, 4000.0)
    assert type(file.matrix.grid[0].kp_n_s_per_m[0]) is float
    with pytest.raises(ValidationError, match="frozen"):
        file.name = "other"


def broken_files() -> list[Any]:
    rig, limits = CONFIGS / "rigs" / "wavebot.yaml", CONFIGS / "limits" / "wavebot.yaml"
    wired = rig.with_name("wavebot_hil.yaml").read_text()
    segment = rig.with_name("wavebot_ethercat.yaml").read_text()
    sources: tuple[tuple[str, str, type[BaseModel]], ...] = (
        ("campaign", CAMPAIGN, CampaignFile),
        ("rigs", rig.read_text(), RigFile),
        ("wired", wired.replace("extends: wavebot.yaml", f"extends: {rig}"), RigFile),
        ("ethercat", segment.replace("extends: wavebot.yaml", f"extends: {rig}"), RigFile),
        ("limits", limits.read_text(), LimitsFile),
        ("modular", MODULAR, ModularRigFile),
    )
    cases = []
    for source, text, model in sources:
        for rule in BROKEN[source]:
            name = f"{source} {rule['key']}: {rule['message']}"
            cases.append(pytest.param(text, model, rule, id=name))
    return cases


@pytest.mark.parametrize(("text", "model", "rule"), broken_files())
def test_each_rule_reports_line_key_and_message(
    tmp_path: Path, text: str, model: type[BaseModel], rule: Any
) -> None:
    assert text.count(rule["old"]) == 1
    path = tmp_path / "x.yaml"
    path.write_text(text.replace(rule["old"], rule["new"]))
    line = rule["line"]
    if line == 0:
        line = text[: text.index(rule["old"])].count("\n") + 1
    reported = [p for p in problems(path, model) if p[1] == rule["key"]]
    assert [p[:2] for p in reported] == [(line, rule["key"])], problems(path, model)
    assert rule["message"] in reported[0][2]


def numbers(value: Any, at: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    if isinstance(value, dict):
        return [key for name, v in value.items() for key in numbers(v, (*at, name))]
    if isinstance(value, list):
        return [key for i, v in enumerate(value) for key in numbers(v, (*at, i))]
    return [at] if isinstance(value, (int, float)) else []


def every_number() -> list[Any]:
    cases = []
    for source, model in (("rigs", RigFile), ("limits", LimitsFile)):
        mapping, _ = load_mapping(CONFIGS / source / "wavebot.yaml")
        cases += [pytest.param(mapping, model, key, id=str(key)) for key in numbers(mapping)]
    return cases


# Keys added later: older files stay valid, and the default is the safe value.
OPTIONAL = {("supervisor_timeout_s",)}


@pytest.mark.parametrize(("mapping", "model", "key"), every_number())
def test_every_number_of_rig_and_limits_has_a_range_and_no_default(
    tmp_path: Path, mapping: dict[str, Any], model: type[BaseModel], key: tuple[str | int, ...]
) -> None:
    """Each value that is too large, too small, not a number or missing is reported at its key."""
    path = tmp_path / "x.yaml"
    for wrong, message in (
        (1e300, "is out of range; allowed"),
        (-1e300, "is out of range; allowed"),
        ("5", "is not a"),
        (True, "is not a"),
        (None, "is not a"),
        (math.nan, "is not a"),
        ("missing", "missing; allowed"),
    ):
        if wrong == "missing" and key in OPTIONAL:
            continue
        copy = json.loads(json.dumps(mapping))
        inner = copy
        for part in key[:-1]:
            inner = inner[part]
        inner[key[-1]] = wrong
        if wrong == "missing":
            del inner[key[-1]]
        path.write_text(json.dumps(copy, indent=1).replace("NaN", ".nan"))
        reported = [p for p in problems(path, model) if p[1].endswith(str(key[-1]))]
        assert len(reported) == 1, (wrong, reported)
        assert message in reported[0][2]
        assert "allowed" in reported[0][2]
        assert unit_of_key(str(key[-1])) in reported[0][2]


def test_all_problems_of_a_file_are_reported_in_its_order(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(
        CAMPAIGN.replace("seed: 1", "sed: 1")
        .replace("repeat: 1", "repeat: 0")
        .replace("frequency_hz: 0.5", "hs_m: 0.5")
        .replace("[-1000, -2000]", "[1, -2000, abc]")
    )
    reported = problems(path, CampaignFile)
    assert [p[:2] for p in reported] == [
        (3, "sed"),
        (5, "repeat"),
        (9, "sea.hs_m"),
        (20, "matrix.grid[0].kp_n_s_per_m[0]"),
        (20, "matrix.grid[0].kp_n_s_per_m[2]"),
    ]


def test_text_and_json_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.yaml").write_text(CAMPAIGN.replace("[-1000, -2000]", "abc").replace("0.127", ".nan"))
    with pytest.raises(ConfigError) as error_info:
        load(Path("x.yaml"), CampaignFile)
    assert str(error_info.value).splitlines() == [
        "x.yaml:8: sea.amplitude_m: nan is not a finite number; allowed 0.001 .. 0.5 m",
        "x.yaml:20: matrix.grid[0].kp_n_s_per_m: 'abc' is not a number; allowed -20000 .. 0 N*s/m",
        "more checks follow once this is corrected: the rules between keys of x.yaml",
    ]
    first, second = json.loads(error_info.value.to_json())
    assert first["value"] == "nan"
    assert second == {
        "file": "x.yaml",
        "line": 20,
        "key": "matrix.grid[0].kp_n_s_per_m",
        "value": "abc",
        "message": "'abc' is not a number; allowed -20000 .. 0 N*s/m",
        "column": 0,
    }


def test_a_value_of_an_extended_file_is_reported_in_that_file(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(CAMPAIGN.replace("0.127", "9"))
    (tmp_path / "top.yaml").write_text("extends: base.yaml\nrepeat: 0\n")
    with pytest.raises(ConfigError) as error_info:
        load(tmp_path / "top.yaml", CampaignFile)
    assert [(Path(p.file).name, p.line, p.key) for p in error_info.value.problems] == [
        ("top.yaml", 2, "repeat"),
        ("base.yaml", 8, "sea.amplitude_m"),
    ]


class OtherPart(BaseModel):
    mass_kg: float = Field(gt=0)
    kind: int | str = 1


class OtherModel(BaseModel):
    part: OtherPart
    parts: dict[str, OtherPart] = {}


def test_errors_of_other_pydantic_models_are_translated(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("part:\n  mass_kg: -1\n  kind: []\nparts:\n  a:\n    mass_kg: x\n")
    mapping, locate = load_mapping(path)
    with pytest.raises(ValidationError) as error_info:
        OtherModel.model_validate(mapping)
    reported = translate(error_info.value, locate, OtherModel)
    assert [(p.line, p.key) for p in reported][:2] == [(2, "part.mass_kg"), (3, "part.kind")]
    assert reported[0].message == "-1 is out of range; allowed above 0 kg"
    assert reported[-1].message == "'x' is not a number; allowed above 0 kg"
    assert [p.line for p in translate(error_info.value, locate)] == [p.line for p in reported]


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("kp_n_s_per_m", "N*s/m"),
        ("jerk_density_m2_per_s5", "m^2/s^5"),
        ("torque_constant_n_m_per_a", "N*m/A"),
        ("velocity_stop_m_per_s", "m/s"),
        ("stator_percent", "%"),
        ("counts_per_revolution", ""),
        ("encoder_noise_counts", "counts"),
        ("lost_ticks_stop", ""),
        ("small_displacement_factor", ""),
        ("name", ""),
        ("m", ""),
    ],
)
def test_units_are_read_from_keys(key: str, unit: str) -> None:
    assert unit_of_key(key) == unit
