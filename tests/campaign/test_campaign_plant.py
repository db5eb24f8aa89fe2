"""Problems of the simulated plant are reported together with other problems of a campaign."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from rig.design import axis_params
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.rehearsal.job import problems

CONFIGS = Path(__file__).parents[2] / "configs"
BROKEN_SEA = """\
name: test
rig: ../rigs/wavebot.yaml
sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.28985507246}
"""


def change(path: Path, *pairs: tuple[str, str]) -> None:
    text = path.read_text()
    for old, new in pairs:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path.write_text(text)


def line_of(path: Path, text: str) -> int:
    before, problem_keys, _ = path.read_text().partition(text)
    assert problem_keys
    return before.count("\n") + 1


@pytest.fixture
def rig(tmp_path: Path, write: Any) -> Path:
    """The shipped rig, with the shipped plant instead of the stub."""
    shutil.copytree(CONFIGS / "plants", tmp_path / "plants", dirs_exist_ok=True)
    return tmp_path / "rigs" / "wavebot.yaml"


def reported_problems(path: Path) -> list[tuple[str, int, str, str]]:
    report = check_campaign(path, problems)
    return [(Path(p.file).name, p.line, p.key, p.message) for p in report.problems]


def test_the_shipped_files_have_no_problems(rig: Path, write: Any) -> None:
    assert reported_problems(write()) == []


def test_problems_of_the_plant_are_reported_with_all_others(
    rig: Path, write: Any, tmp_path: Path
) -> None:
    change(
        rig,
        ("name: WaveBot\n", "name: ''\n"),
        ("heave:\n  torque_constant_n_m_per_a: 6.1745", "heave:\n  torque_constant_n_m_per_a: 6.5"),
    )
    change(tmp_path / "limits" / "wavebot.yaml", ("  current_rms_a: 20 ", "  current_rms_a: 41 "))
    change(
        tmp_path / "plants" / "wavebot.yaml",
        ("bem: wavebot_bem.npz", "bem: none.npz"),
        ("delay_ticks: {value: 1,", "delay_ticks: {value: 1.5,"),
    )
    problem_keys = [
        place[:3:2] for place in reported_problems(write("repeat: 0\n", head=BROKEN_SEA))
    ]
    assert problem_keys == [
        ("test.yaml", "sea.frequency_hz"),
        ("test.yaml", "repeat"),
        ("wavebot.yaml", "name"),
        ("wavebot.yaml", "heave.current_rms_a"),
        ("wavebot.yaml", "bem"),
        ("wavebot.yaml", "sensors.delay_ticks.value"),
    ]


@pytest.mark.parametrize(
    ("key", "old", "new"),
    [
        ("counts_per_revolution", "20000", "4096"),
        ("gear_ratio_rad_per_m", "12.4666", "12.4667"),
        ("torque_constant_n_m_per_a", "6.1745", "6.1746"),
    ],
)
def test_scales_of_rig_and_plant_must_agree(
    rig: Path, write: Any, key: str, old: str, new: str
) -> None:
    change(rig, (f"{key}: {old} ", f"{key}: {new} "), ("name: WaveBot\n", "name: ''\n"))
    *_, (file, line, at, message) = reported_problems(write())
    assert (file, line, at) == ("wavebot.yaml", line_of(rig, f"{key}:"), f"heave.{key}")
    assert message.startswith(f"{new} is not the simulated plant's {old} (")
    assert message.endswith("; the two must agree")


def test_an_estimator_that_cannot_be_designed_is_reported(
    rig: Path, write: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.design.estimator._MAX_STEPS", 2)
    axis_params._cached_design.cache_clear()  # removes gains designed by an earlier test
    ((file, line, key, message),) = reported_problems(write())
    at = line_of(rig, "jerk_density_m2_per_s5:")
    assert (file, line, key) == ("wavebot.yaml", at, "heave.jerk_density_m2_per_s5")
    assert message.startswith("0.5: the estimator's gain did not settle")


def test_a_plant_that_cannot_be_built_is_reported(rig: Path, write: Any, tmp_path: Path) -> None:
    plant = tmp_path / "plants" / "wavebot.yaml"
    change(plant, ("0.685398163", "1.0e-200"))
    ((file, line, key, message),) = reported_problems(write())
    assert (file, line, key) == ("wavebot.yaml", 1, "")
    assert message.startswith("cannot be simulated: ")


@pytest.mark.parametrize("folder", ["", "data/"])
def test_a_bem_file_may_be_in_any_folder(
    rig: Path, write: Any, tmp_path: Path, folder: str
) -> None:
    """An absolute path, or one relative to the plant file, for heave and surge alike."""
    plants = tmp_path / "plants"
    place = f"{tmp_path}/elsewhere" if not folder else str(plants / folder)
    Path(place).mkdir()
    for name in ("wavebot_bem.npz", "wavebot_surge_bem.npz"):
        (plants / name).rename(Path(place) / name)
    named = folder or f"{place}/"
    change(plants / "wavebot.yaml", ("bem: wavebot_bem.npz", f"bem: {named}wavebot_bem.npz"))
    ((_, _, key, message),) = reported_problems(write())
    assert key == "surge.bem"
    assert "wavebot_surge_bem.npz: No such file or directory; allowed the path of" in message
    change(plants / "wavebot.yaml", ("bem: wavebot_surge", f"bem: {named}wavebot_surge"))
    assert reported_problems(write()) == []


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04cut off", b"text"])
def test_an_invalid_bem_file_is_reported(
    rig: Path, write: Any, tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "plants" / "wavebot_bem.npz").write_bytes(content)
    ((_, line, key, message),) = reported_problems(write())
    assert (line, key) == (line_of(tmp_path / "plants" / "wavebot.yaml", "bem:"), "bem")
    assert message.startswith("cannot be read: ")


def test_the_bem_file_of_surge_is_checked_too(rig: Path, write: Any, tmp_path: Path) -> None:
    (tmp_path / "plants" / "wavebot_surge_bem.npz").write_bytes(b"text")
    ((_, line, key, message),) = reported_problems(write())
    place = line_of(tmp_path / "plants" / "wavebot.yaml", "bem: wavebot_surge_bem")
    assert (line, key) == (place, "surge.bem")
    assert message.startswith("cannot be read: ")


@pytest.mark.parametrize("name", sorted(p.name for p in (CONFIGS / "plants").glob("wavebot*.yaml")))
def test_every_shipped_plant_can_be_rehearsed(rig: Path, write: Any, name: str) -> None:
    assert reported_problems(write(f"plant: ../plants/{name}\n")) == []


def test_problems_of_a_drive_are_reported_at_its_key(rig: Path, write: Any, tmp_path: Path) -> None:
    plant = tmp_path / "plants" / "wavebot.yaml"
    change(plant, ("analyser_window: {value: 0.005,", "analyser_window: {value: 5.0,"))
    ((_, line, key, message),) = reported_problems(write())
    at = "drive.analyser_window.value"
    assert (line, key) == (line_of(plant, "analyser_window:"), at)
    assert message.startswith("5 is out of range; allowed ")
    change(plant, ("kind: cots", "kind: amc"))
    ((_, line, key, message),) = reported_problems(write())
    assert (line, key) == (line_of(plant, "kind: amc"), "drive.kind")
    assert message.startswith("'amc' is not known; allowed cots, custom")


def test_a_truncated_or_damaged_bem_file_is_reported(rig: Path, write: Any, tmp_path: Path) -> None:
    path = tmp_path / "plants" / "wavebot_bem.npz"
    whole = path.read_bytes()
    for i in range(1, 12):
        path.write_bytes(whole[: i * len(whole) // 12])
        assert [p[2] for p in reported_problems(write())] == ["bem"]
        start = i * len(whole) // 12
        path.write_bytes(whole[:start] + bytes(40) + whole[start + 40 :])
        assert {p[2] for p in reported_problems(write())} <= {"bem"}


@pytest.mark.parametrize(
    ("key", "value", "nearest"),
    [
        ("frequency_hz", 0.28985507246, [0.2898509980320495, 0.2898550724637681]),
        ("frequency_hz", 1.99999, [1.9997222222222222, 2.0]),
        ("period_s", 3.45678, [3.456777996070727, 3.45679012345679]),
    ],
)
def test_a_wave_that_does_not_repeat_is_reported_with_the_nearest_ones(
    rig: Path, write: Any, key: str, value: float, nearest: list[float]
) -> None:
    head = "name: test\nrig: ../rigs/wavebot.yaml\nsea:\n  kind: regular\n  amplitude_m: 0.1\n"
    ((_, line, at, message),) = reported_problems(write(head=f"{head}  {key}: {value}\n"))
    assert (line, at) == (6, f"sea.{key}")
    unit = {"frequency_hz": "Hz", "period_s": "s"}[key]
    assert message.startswith(
        f"{value} {unit} repeats on no whole second up to 3600 s; the nearest "
    )
    assert nearest[0] < value < nearest[1]
    for neighbour in nearest:
        assert f"{neighbour!r} {unit} (repeats after " in message
        assert reported_problems(write(head=f"{head}  {key}: {neighbour!r}\n")) == []
