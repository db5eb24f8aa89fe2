"""One pass of `rig check` finds all problems, or names the checks that follow.

A sound campaign gets two errors in different layers: the report must hold both, or say that more
checks follow. Without that line it must hold both.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest
from rig_command import rig_here

CONFIGS = Path(__file__).parents[2] / "configs"

CAMPAIGN = """\
name: sound
rig: rig.yaml
seed: 1
law: impedance
sea: {kind: regular, amplitude_m: 0.127, frequency_hz: 0.5}
timing: {settle_s: 4, interval_s: 12}
start: {lead_in_s: 20}
matrix:
  list:
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}
"""

VELOCITY = "velocity_stop_m_per_s: 1.5\n  current_peak_a: 40             # AMC"  # of heave

# Name, file, text to replace, its replacement, and a part of the message that reports it.
ERRORS = (
    ("syntax", "campaign.yaml", "start: {lead_in_s: 20}", "start: {lead_in_s: 20", "YAML syntax"),
    ("twice", "campaign.yaml", "seed: 1", "seed: 1\nseed: 2", "duplicate key"),
    ("schema", "campaign.yaml", "amplitude_m: 0.127", "amplitude_m: 9", "9 is out of range"),
    ("key", "campaign.yaml", "seed: 1", "seed: 1\ncolour: red", "'key': 'colour'"),
    ("rule", "campaign.yaml", "settle_s: 4", "settle_s: 12", "leaves nothing to measure"),
    ("window", "campaign.yaml", "interval_s: 12", "interval_s: 5", "timing.interval_s"),
    ("law", "campaign.yaml", "law: impedance", "law: ./absent.py", "absent.py cannot be read"),
    ("rig", "campaign.yaml", "rig: rig.yaml", "rig: absent.yaml", "absent.yaml"),
    ("spring", "campaign.yaml", "spring_n_per_m: 490.9", "spring_n_per_m: 45000", "45000"),
    ("limits file", "rig.yaml", "limits: limits.yaml", "limits: gone.yaml", "gone.yaml"),
    ("plant file", "rig.yaml", "plant: plant.yaml", "plant: lost.yaml", "lost.yaml"),
    ("rate", "rig.yaml", "rate_hz: 1000", "rate_hz: 7", "7 is out of range"),
    ("limit", "limits.yaml", "position_stop_m: 0.35", "position_stop_m: -3", "-3 is out of range"),
    ("row", "limits.yaml", VELOCITY, VELOCITY.replace("1.5", "0.05"), "predicted velocity"),
    ("bem", "plant.yaml", "wavebot_bem.npz", "absent.npz", "absent.npz"),
    ("mass", "plant.yaml", "value: 860.0, unit: kg", "value: -1, unit: kg", "body.mass"),
)
NAMES = [error[0] for error in ERRORS]


@pytest.fixture(scope="module")
def sound() -> dict[str, str]:
    """The texts of a campaign and its files, by name."""
    rig = (CONFIGS / "rigs" / "wavebot.yaml").read_text()
    plant = (CONFIGS / "plants" / "wavebot.yaml").read_text()
    for name in ("wavebot_bem.npz", "wavebot_surge_bem.npz"):
        plant = plant.replace(f" {name}", f" {CONFIGS}/plants/{name}")
    for key in ("limits", "plant"):
        (line,) = (line for line in rig.splitlines() if line.startswith(f"{key}:"))
        rig = rig.replace(line, f"{key}: {key}.yaml")
    return {
        "campaign.yaml": CAMPAIGN,
        "rig.yaml": rig.replace("../", f"{CONFIGS}/"),
        "limits.yaml": (CONFIGS / "limits" / "wavebot.yaml").read_text(),
        "plant.yaml": plant,
    }


def write(files: dict[str, str], folder: Path, *errors: str) -> Path:
    """Write the files with these errors; return the campaign."""
    texts = dict(files)
    for _, file, old, new, _ in (each for each in ERRORS if each[0] in errors):
        assert texts[file].count(old) == 1, (file, old)
        texts[file] = texts[file].replace(old, new)
    for file, text in texts.items():
        (folder / file).write_text(text)
    return folder / "campaign.yaml"


def report_of(path: Path) -> dict[str, object]:
    """Return the JSON report of `rig check`; its exit code must agree with it."""
    code, out, _ = rig_here("check", path, "--json")
    report: dict[str, object] = json.loads(out)
    assert code == (0 if report["ok"] else 2)
    return report


def test_a_sound_campaign_has_nothing_unchecked(sound: dict[str, str], tmp_path: Path) -> None:
    report = report_of(write(sound, tmp_path))
    assert report["ok"], report["problems"]
    assert report["unchecked"] == []


@pytest.mark.parametrize("error", ERRORS, ids=NAMES)
def test_each_error_is_found(sound: dict[str, str], tmp_path: Path, error: tuple[str, ...]) -> None:
    report = report_of(write(sound, tmp_path, error[0]))
    assert error[-1] in str(report["problems"])


@pytest.mark.parametrize("first", NAMES)
def test_two_errors_are_found_or_more_checks_follow(
    sound: dict[str, str], tmp_path: Path, first: str
) -> None:
    messages = {error[0]: error[-1] for error in ERRORS}
    places = {error[0]: error[1:3] for error in ERRORS}
    for second in NAMES[NAMES.index(first) + 1 :]:
        pair = first, second
        texts = [old for _, old in (places[name] for name in pair)]
        if places[first] == places[second] or any(
            a in b for a, b in itertools.permutations(texts, 2)
        ):
            continue  # both change the same text
        report = report_of(write(sound, tmp_path, *pair))
        found = [messages[name] in str(report["problems"]) for name in pair]
        assert any(found), pair
        assert all(found) or report["unchecked"], pair


def test_people_read_which_checks_follow(sound: dict[str, str], tmp_path: Path) -> None:
    path = write(sound, tmp_path, "schema")
    for command in ("check", "run", "compile"):
        code, out, err = rig_here(command, path)
        assert code == 2
        (line,) = (line for line in (out + err).splitlines() if line.startswith("more checks"))
        assert "once this is corrected" in line
        assert "the prediction of each row" in line


@pytest.mark.parametrize("name", ["law", "rig"])
def test_an_unknown_law_or_rig_hides_no_error_of_the_sea(
    sound: dict[str, str], tmp_path: Path, name: str
) -> None:
    path = write(sound, tmp_path, name, "schema", "key")
    report = report_of(path)
    assert "9 is out of range" in str(report["problems"])
    assert report["unchecked"]


def test_a_session_names_the_checks_that_follow(tmp_path: Path) -> None:
    path = tmp_path / "session.yaml"
    path.write_text("name: a/b\nrig: oswec_bench\nsession: driveline\nrepeat: 0\n")
    report = report_of(path)
    assert len(report["problems"]) >= 2  # type: ignore[arg-type]
    assert "the set points against the limits and the correction" in str(report["unchecked"])
