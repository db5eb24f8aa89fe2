"""The compiled loop gives what a rehearsal gives, to the bit, and stops where it stops."""

from __future__ import annotations

import inspect
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_ways import STILL_CLOCK, compiled, interpreted, opened
from law_lifting import same_bits
from rehearsing import CONFIGS, write_campaign, write_yaml

import rig
from rig.execution.rehearsal.devices import PlantDevices
from rig.kinds.wavebot import KIND
from rig.realtime import cycle
from rig.realtime.safety import RUN, STOP_0, Mode, Reason
from rig.sweep import lifting, plant_coupling
from rig.sweep.column import Column
from rig.sweep.compiled import BESIDE, LIFTED
from rig.sweep.pages import TICKS
from rig.sweep.simulation import KEPT, Subject

QUICK = {
    "sea": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "tare": {"duration_s": 1},
    "start": {"set_point_s": 1, "lead_in_s": 7},
    "timing": {"settle_s": 1, "interval_s": 5.5},
    "matrix": {
        "list": [
            {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0},
            {"spring_n_per_m": 300.0, "kp_n_s_per_m": -2500, "ki_n_per_m": 4000},
        ]
    },
}
POINT = QUICK["matrix"]["list"][0]  # type: ignore[index]
CUSTOM = {
    "rig": str(CONFIGS / "rigs" / "wavebot_custom.yaml"),
    "timing": {"settle_s": 0, "interval_s": 4},
    "matrix": {
        "list": [
            POINT | {"bus_voltage_v": 80, "switching_period_s": 1e-4, "discharge_level": 15},
            POINT | {"bus_voltage_v": 60, "velocity_threshold_m_per_s": 0.1, "discharge_level": 3},
        ]
    },
}
ZC = {"zc": {"numerator": [-400, 0], "denominator": [1, 2.0, 9.0]}}
KINDS: dict[str, dict[str, Any]] = {
    "regular": {},
    "irregular": {
        "sea": {"kind": "jonswap", "hs_m": 0.2, "tp_s": 2.5, "repeat_s": 10},
        "timing": {"settle_s": 1},
    },
    "custom drive": CUSTOM,
    "islanded": CUSTOM | {"drive": {"supply": "disconnected"}},
    "held in surge": {"surge": {"use": "hold"}},
    "surge off": {"surge": {"use": "off"}},
    "open loop": {"reference": {"kind": "multisine", "amplitude_a": 8}},
    "realisations": {
        "reference": {"kind": "multisine", "amplitude_a": 8},
        "matrix": {"list": [POINT | {"realisation": 3}, POINT | {"realisation": 1}]},
    },
    "recorded reference": {
        "reference": {
            "kind": "recorded",
            "file": "push.csv",
            "channel": "push",
            "unit": "N",
            "end_s": 4,
        },
    },
    "tripped": {
        "sea": {"kind": "regular", "amplitude_m": 0.4, "frequency_hz": 0.5},
        "matrix": {"list": [POINT, POINT | {"kp_n_s_per_m": -100, "ki_n_per_m": 3000}]},
        "timing": {"settle_s": 0, "interval_s": 5.5},
    },
}


def campaign(folder: Path, kind: str) -> Path:
    push = (f"{0.01 * i:.2f},{300.0 * math.sin(0.05 * i):.6f}" for i in range(500))
    (folder / "push.csv").write_text("\n".join(["time,push", *push]))
    return write_campaign(folder, **QUICK | KINDS[kind])


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    found, plan = opened(campaign(tmp_path_factory.mktemp("campaign"), "regular"))
    return Subject(found, plan)


@pytest.mark.slow  # where the loop has not been compiled yet
@pytest.mark.parametrize("kind", KINDS)
def test_every_kept_field_has_the_bits_of_a_rehearsal(kind: str, tmp_path: Path) -> None:
    path = campaign(tmp_path, kind)
    ours, theirs = compiled(path), interpreted(path)
    assert ours.reason == theirs.reason
    assert ours.kept.shape == theirs.kept.shape
    differing = [
        n for i, n in enumerate(KEPT) if ours.kept[:, i].tobytes() != theirs.kept[:, i].tobytes()
    ]
    assert not differing
    if kind == "tripped":
        assert ours.reason not in ("NONE", "PLAN_END")
        assert all(ours.reason in why for why in ours.incomplete_reason[-1:])
    else:
        assert ours.reason == "PLAN_END"
        assert ours.incomplete_reason == ("", "")
        assert len(ours.kept) >= 8000


# --- senses that are none


def spoiled(readings: Any, rng: np.random.Generator) -> Any:
    """Readings with one of them gone: no number, without end, or far outside all sense."""
    values = list(readings)
    at = int(rng.integers(len(values)))
    if isinstance(values[at], float):
        values[at] = float(rng.choice([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e9, -1.0]))
    else:
        values[at] = int(rng.choice([-1, 2, 10**6, -(2**62), 2**62]))
    return type(readings)(*values)


def by_hand(subject: Subject, params: Any, machine: Any, readings: Any) -> tuple[Any, Any]:
    """The interpreted cycle on these readings: state and what the plant is told."""
    sense = plant_coupling.sense(readings, subject.begin.delay)
    state, command, _ = cycle.make(KIND)(
        params, machine.loop, sense, 0, machine.tick, STILL_CLOCK, 1, subject.dt
    )
    return state, plant_coupling.actuation(command)


@pytest.mark.slow
def test_senses_that_are_none_give_the_same_mode_reason_and_command(
    subject: Subject, tmp_path: Path
) -> None:
    """From a running state, one spoiled sense, then ten sound ones, over and over."""
    _, plan = opened(campaign(tmp_path, "regular"))
    columns = subject.columns(plan)
    page, kept = Column(np.empty(len(KEPT) * TICKS)), Column(np.empty(len(KEPT) * 20_000))

    def advance(machine: Any, until: int) -> Any:
        return subject.advance(
            columns, subject.constants, subject.tables, subject.normals, subject.dt,
            subject.begin.delay, machine, until, page, kept, 0,
        )[0]  # fmt: skip

    running = advance(subject.start(), 5000)
    assert running.loop.safety.mode == RUN
    rng, seen = np.random.default_rng(7), set()
    for _ in range(300):
        machine = running._replace(line=(running.line[0], spoiled(running.line[1], rng)))
        for _ in range(10):
            state, told = by_hand(subject, subject.params, machine, machine.line[1])
            machine = advance(machine, machine.tick + 1)
            assert same_bits(lifting.numbers(machine.loop), lifting.numbers(state))
            assert same_bits(lifting.numbers(machine.wire), lifting.numbers(told))
            assert all(map(math.isfinite, lifting.numbers(machine.wire)))
            guard = machine.loop.safety
            if guard.mode == STOP_0:
                assert machine.wire.heave_current == machine.wire.surge_current == 0.0
                assert machine.wire.heave_enable == machine.wire.surge_enable == 0
        seen.add((Mode(guard.mode).name, Reason(guard.reason).name))
    assert {reason for _, reason in seen} >= {"NONE", "NOT_FINITE", "ENCODER_JUMP", "DRIVE_FAULT"}


# --- the words between loop and plant


class Told:
    """A world that keeps what it is told."""

    delay = 0.002

    def __init__(self, readings: Any) -> None:
        self._readings, self.told = readings, ()

    def readings(self) -> Any:
        return self._readings

    def actuate(self, actuation: Any) -> None:
        self.told = actuation


def test_words_are_those_of_the_rehearsals_devices() -> None:
    from rig.kinds.wavebot import Command
    from sim_plant.signals import Readings

    readings = Readings(*range(100, 100 + len(Readings._fields)))
    world: Any = Told(readings)
    devices = PlantDevices(world, 0.001)
    assert devices.read(0.0) == plant_coupling.sense(readings, world.delay)
    numbers = iter(range(200, 300))

    def filled(kind: Any) -> Any:
        hints = inspect.get_annotations(kind, eval_str=True).values()
        words = [getattr(hint, "__origin__", hint) for hint in hints]
        return kind(*(filled(w) if hasattr(w, "_fields") else next(numbers) for w in words))

    command = filled(Command)
    command = command._replace(
        drive=command.drive._replace(settings=command.drive.settings._replace(bus_voltage=0.0))
    )
    devices.write(command)
    assert world.told == plant_coupling.actuation(command)


# --- compiled code that is not today's


def imported(modules: Any) -> set[str]:
    """Our modules that some modules import from."""
    from test_house import imports, tree_of

    named = {name for m in modules for name in imports(tree_of(Path(m.__file__ or "")))}
    return {name for name in named if name.split(".")[0] in ("controllers", "rig", "sim_plant")}


def test_all_that_compiled_code_is_made_of_names_its_folder(monkeypatch: Any) -> None:
    """An edit anywhere below the cycle or the plant, or in their words, is another folder."""
    parts = {module.__name__ for module in (*LIFTED, *BESIDE)}
    passing = {"controllers", "rig.kinds.wavebot", "rig.realtime", "sim_plant"}  # only names
    assert imported(LIFTED) - parts <= passing | {"sim_plant.units"}  # which has types alone
    now = lifting.cache_folder("x", (*LIFTED, *BESIDE))
    sound = inspect.getsource
    for edited in (*LIFTED, *BESIDE, lifting):

        def read(module: Any, edited: Any = edited) -> str:
            return sound(module) + ("# edited" if module is edited else "")

        monkeypatch.setattr(inspect, "getsource", read)
        assert lifting.cache_folder("x", (*LIFTED, *BESIDE)) != now, edited.__name__
    monkeypatch.setattr(inspect, "getsource", sound)
    assert lifting.cache_folder("x", (*LIFTED, *BESIDE)) == now
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert lifting.cache_folder("x", (*LIFTED, *BESIDE)) != now


WHERE = """
from rig.sweep import lifting
from rig.sweep.column import Column
from rig.sweep.compiled import BESIDE, LIFTED
from rig.sweep.pages import TICKS
print(lifting.cache_folder("x", (*LIFTED, *BESIDE)))
"""


def said_in(tree: Path, *words: str, **environment: str) -> str:
    """What a process of its own says, with the packages of a tree.

    Not optimised, which takes a third less time and gives the same bits.
    """
    done = subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": str(tree), "NUMBA_OPT": "0", **environment},
        cwd=tree,  # which Python looks into before anything else, or not at all
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.strip()


@pytest.mark.slow
def test_an_edited_law_is_seen_and_no_index_leaves_its_table(tmp_path: Path) -> None:
    """Compiled once for both: the edited law, with numba's bounds checking on.

    With Z_c(s) and a reference in the law. Code is cached in the folder that its sources name,
    which without bounds checking is another than this process's own, too.
    """
    rig_file = str(CONFIGS / "rigs" / "wavebot.yaml")
    whole = QUICK | {"law": ZC, "reference": {"kind": "multisine", "amplitude_a": 8}}
    path = write_yaml(tmp_path / "zc.yaml", {"name": "zc", "rig": rig_file, **whole})
    before = interpreted(path).summary()
    here, tree = Path(rig.__file__).parents[1], tmp_path / "tree"
    for name in ("controllers", "rig", "sim_plant"):
        shutil.copytree(here / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    assert said_in(tree, "-c", WHERE) == str(lifting.cache_folder("x", (*LIFTED, *BESIDE)))
    law = tree / "controllers" / "impedance.py"
    text = law.read_text()
    edited = text.replace("force = kp * velocity", "force = 1.01 * kp * velocity", 1)
    assert edited != text
    law.write_text(edited)
    assert said_in(tree, "-c", WHERE) != str(lifting.cache_folder("x", (*LIFTED, *BESIDE)))
    program = str(Path(__file__).with_name("both_ways.py"))
    ours, theirs = json.loads(said_in(tree, program, str(path), NUMBA_BOUNDSCHECK="1"))
    assert ours == theirs
    assert ours["ticks"] == before["ticks"] == 8000
    assert ours["reason"] == "PLAN_END"
    assert ours["power"] != before["power"]
    assert ours["power"] == pytest.approx(before["power"], rel=0.1)
