"""Output of commands for people: without dictionaries, lists or objects of Python."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from made_once import made_once
from rig_command import rig_here

from rig.config.differences import value_text

pytestmark = pytest.mark.slow

REPR = re.compile(
    r"\{'|\['|\('|\{\"|\[\"|Path\(|\bNone\b|\bnan\b|\bTrue\b|\bFalse\b"
    r"|<[a-z_.]+ object|<class|array\(|np\.|dtype|dict_|\w+\(\w+="
)
CAMPAIGN = """\
extends: quick
name: {name}
seed: {seed}
sea: {{kind: jonswap, hs_m: 0.254, tp_s: 3.17, repeat_s: 20}}
timing: {{settle_s: 4, interval_s: 24}}
matrix:
  list:
    - {{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}}
    - {{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 4000}}
"""
SEEDS = {"one": "1", "three": "3", "several": "[1, 3]"}


def rehearse(folder: Path) -> None:
    """Rehearse one campaign in the seas of different seeds, and a session."""
    for name, seed in SEEDS.items():
        campaign = folder / f"{name}.yaml"
        campaign.write_text(CAMPAIGN.format(name=name, seed=seed))
        code, _, error = rig_here("run", campaign, "--runs", folder / "runs")
        assert code == 0, error
    code, _, error = rig_here("run", "flap_free_decay", "--runs", folder / "runs")
    assert code == 0, error


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the campaigns and of their runs."""
    return made_once(tmp_path_factory, "seeds", rehearse)


def printed(*arguments: str | Path, codes: tuple[int, ...] = (0,)) -> str:
    """Return all that a command prints."""
    code, out, error = rig_here(*arguments)
    assert code in codes, (arguments, out, error)
    return out + error


def test_a_comparison_names_seas_in_words(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "compared.png"
    text = printed("compare", "one", "three", "--runs", folder / "runs", "-o", out)
    (warning,) = {line for line in text.splitlines() if line.startswith("!!")}
    assert warning == (
        "!! DIFFERENT SEAS: "
        "A JONSWAP, Hs 0.254 m, Tp 3.17 s, gamma 3.3, repeats after 20 s, seed 1; "
        "B JONSWAP, Hs 0.254 m, Tp 3.17 s, gamma 3.3, repeats after 20 s, seed 3"
    )
    assert not REPR.search(text), REPR.search(text)
    several = printed("compare", "one", "several", "--runs", folder / "runs", "-o", out)
    assert "repeats after 20 s, seeds 1, 3" in several
    assert not REPR.search(several), REPR.search(several)


@pytest.mark.parametrize(
    "arguments",
    [
        ("show", "several"), ("show", "flap_free_decay"), ("runs",), ("replay", "one"),
        ("replay", "three", "--with", "{folder}/one.yaml"), ("check", "{folder}/several.yaml"),
        ("check", "{folder}/one.yaml", "--rows"), ("check", "flap_free_decay"), ("recover", "one"),
        ("sweep", "{folder}/one.yaml", "--over", "seed=1,2", "--out", "{out}"),
        ("optimum", "{folder}/one.yaml", "-o", "{out}/best.yaml"),
        ("compare", "one", "flap_free_decay"),
        ("plot", "several"), ("export", "one", "--as", "csv", "-o", "{out}/one.csv"),
        ("campaigns",), ("kinds",), ("laws",), ("calibration", "list"), ("devices", "wavebot"),
        ("show", "absent"), ("recommend", "one"), ("identify", "one"), ("spring-map", "one"),
        ("surge-damping", "one"), ("twin", "one"), ("twoport", "one"),
    ],
    ids=" ".join,
)  # fmt: skip
def test_no_command_prints_an_object_of_python(
    folder: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    filled = [each.format(folder=folder, out=tmp_path) for each in arguments]
    of_runs = {"show", "runs", "replay", "recover", "compare", "plot", "export", "recommend",
               "identify", "spring-map", "surge-damping", "twin", "twoport"}  # fmt: skip
    if arguments[0] in of_runs:
        filled += ["--runs", str(folder / "runs")]
    text = printed(*filled, codes=(0, 1, 2))
    assert "Traceback" not in text
    assert "No such option" not in text, text
    assert not REPR.search(text), (REPR.search(text), text)


def test_an_accepted_change_of_files_is_in_words(folder: Path, tmp_path: Path) -> None:
    """A resumed run names what has changed, also where a key has a mapping or a list."""
    campaign = tmp_path / "one.yaml"
    campaign.write_text(CAMPAIGN.format(name="one", seed="[1, 3]").replace("0.254", "0.2"))
    text = printed("run", campaign, "--resume", "one", "--runs", folder / "runs", codes=(2,))
    assert not REPR.search(text), text


def test_values_of_a_configuration_in_words() -> None:
    value = {"kind": "regular", "amplitude_m": 0.127, "phases": [1, 2.5], "on": True, "x": None}
    text = "kind regular, amplitude m 0.127, phases 1, 2.5, on true, x absent"
    assert value_text(value) == text
    assert value_text([]) == "none"
    assert value_text([{"a": 1}, {"a": 2}]) == "a 1; a 2"
