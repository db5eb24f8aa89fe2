"""The compiled loop gives the same bits as a rehearsal, and stops at the same tick."""

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
from both_ways import (
    STILL_CLOCK,
    compiled,
    differing_fields,
    interpreted,
    open_campaign_plan,
    open_simulator,
)
from law_lifting import same_bits
from rehearsing import CONFIGS, write_campaign, write_yaml

import rig
from rig.compilation import cache_folder, lifting
from rig.compilation.cache_folder import code_folder
from rig.emulation.row_simulation import RowBlock
from rig.kinds.wavebot.build import wavebot_params
from rig.kinds.wavebot.rehearsal import plant_coupling
from rig.kinds.wavebot.rehearsal.devices import WaveBotPlantDevices
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.kinds.wavebot.tick import KIND
from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST
from rig.realtime.safety import RUN, STOP_0, Mode
from tests.docs.blocks import file_of

LAW_PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "your_law.md"
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
DT = 0.001  # s
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
SPRING = {"spring_n_per_m": 490.9}
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
    "velocity table": {
        "law": {
            "use": "velocity table",
            "velocity_m_per_s": [-0.6, -0.2, 0.0, 0.3, 0.7],
            "force_n": [900, 500, 0, -600, -800],
        },
        "matrix": {
            "list": [
                SPRING | {"table_scale": 1, "retract_factor": 1},
                SPRING | {"table_scale": 0.7, "retract_factor": 0.4},
            ]
        },
    },
    "nonlinear damping": {
        "law": "nonlinear damping",
        "matrix": {
            "list": [
                SPRING | {"quadratic_n_s2_per_m2": 4000, "coulomb_n": 0},
                SPRING | {"quadratic_n_s2_per_m2": 1000, "coulomb_n": 200},
            ]
        },
    },
    "latching": {
        "law": {
            "use": "latching",
            "hold_stiffness_n_per_m": 30_000,
            "hold_damping_n_s_per_m": 3000,
        },
        "matrix": {
            "list": [
                SPRING | {"kp_n_s_per_m": -1500, "latch_s": 0.1},
                SPRING | {"kp_n_s_per_m": -1000, "latch_s": 0},
            ]
        },
    },
    "declutching": {
        "law": "declutching",
        "matrix": {
            "list": [
                SPRING | {"kp_n_s_per_m": -2500, "declutch_s": 0.2},
                SPRING | {"kp_n_s_per_m": -2000, "declutch_s": 0.1},
            ]
        },
    },
    "choice of laws": {
        "law": {
            "use": ["impedance", "./growing.py", "latching"],
            "hold_stiffness_n_per_m": 30_000,
            "hold_damping_n_s_per_m": 3000,
        },
        "matrix": {
            "list": [
                POINT | {"law": "growing", "c0_n_s_per_m": 1500, "c1_n_s_per_m2": 4000},
                POINT | {"law": 2, "latch_s": 0.1},
            ]
        },
    },
    "law of a file, excited": {
        "law": "./growing.py",
        "reference": {"kind": "multisine", "amplitude_a": 8},
        "matrix": {
            "list": [
                SPRING | {"c0_n_s_per_m": 1500, "c1_n_s_per_m2": 4000},
                SPRING | {"c0_n_s_per_m": 2000, "c1_n_s_per_m2": 0},
            ]
        },
    },
}


def make_campaign(folder: Path, case: str) -> Path:
    push = (f"{0.01 * i:.2f},{300.0 * math.sin(0.05 * i):.6f}" for i in range(500))
    (folder / "push.csv").write_text("\n".join(["time,push", *push]))
    (folder / "growing.py").write_text(file_of(LAW_PAGE, "growing_damping.py"))
    return write_campaign(folder, **QUICK | KINDS[case])


@pytest.fixture(scope="module")
def simulator(tmp_path_factory: pytest.TempPathFactory) -> CampaignSimulator:
    found, plan = open_campaign_plan(make_campaign(tmp_path_factory.mktemp("campaign"), "regular"))
    return CampaignSimulator(found, plan)


@pytest.mark.slow  # if the loop is not compiled yet
@pytest.mark.sampled  # each law is compiled by itself, and the reference is a whole rehearsal
@pytest.mark.parametrize("case", KINDS)
def test_every_stored_field_has_the_bits_of_a_rehearsal(case: str, tmp_path: Path) -> None:
    path = make_campaign(tmp_path, case)
    compiled_result, interpreted_result = compiled(path), interpreted(path)
    assert not differing_fields(compiled_result, interpreted_result)
    if case == "tripped":
        assert compiled_result.reason not in ("NONE", "PLAN_END")
        assert all(
            compiled_result.reason in reason for reason in compiled_result.incomplete_reason[-1:]
        )
    else:
        assert compiled_result.reason == "PLAN_END"
        assert compiled_result.incomplete_reason == ("", "")
        assert len(compiled_result.kept) >= 8000


# --- invalid readings


def spoil(readings: Any, rng: np.random.Generator) -> Any:
    """Return readings with one of them invalid: NaN, infinite, or far out of range."""
    values = list(readings)
    at = int(rng.integers(len(values)))
    if isinstance(values[at], float):
        values[at] = float(rng.choice([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e9, -1.0]))
    else:
        values[at] = int(rng.choice([-1, 2, 10**6, -(2**62), 2**62]))
    return type(readings)(*values)


def step_interpreted(
    simulator: CampaignSimulator, params: Any, loop: Any, tick: int, readings: Any
) -> tuple[Any, Any]:
    """Run the interpreted cycle on these readings; return its state and the plant input."""
    sense = plant_coupling.sense(readings, simulator.plant.age)
    state, command, _ = cycle.make(KIND)(params, loop, sense, NO_REQUEST, tick, STILL_CLOCK, 1, DT)
    return state, plant_coupling.actuation(command)


@pytest.mark.slow
def test_invalid_readings_give_the_same_mode_reason_and_command(
    simulator: CampaignSimulator, tmp_path: Path
) -> None:
    """From a running state, one invalid reading and nine valid ones, repeatedly."""
    campaign, plan = open_campaign_plan(make_campaign(tmp_path, "regular"))
    params = wavebot_params(campaign, plan.segments, plan.setpoints)
    ticks = simulator.ticks(plan, RowBlock(KIND.row_type))
    memory, begin = ticks.memory, 0
    while begin < 5000:
        begin += ticks.execute(begin, NO_REQUEST, 100)
    running, device_then = memory.get("state"), memory.get("device")
    assert running.safety.mode == RUN
    rng, outcomes = np.random.default_rng(7), set()
    for _ in range(300):
        current, following = device_then.in_transit
        memory.set("state", running)
        memory.set("device", device_then._replace(in_transit=(current, spoil(following, rng))))
        for tick in range(begin, begin + 10):
            state, plant_input = step_interpreted(
                simulator,
                params,
                memory.get("state"),
                tick,
                memory.get("device").in_transit[1],
            )
            assert ticks.execute(tick, NO_REQUEST, 1) == 1
            loop, device = memory.get("state"), memory.get("device")
            assert same_bits(lifting.flatten(loop), lifting.flatten(state))
            assert same_bits(lifting.flatten(device.plant_input), lifting.flatten(plant_input))
            assert all(map(math.isfinite, lifting.flatten(device.plant_input)))
            safety = loop.safety
            if safety.mode == STOP_0:
                command = device.plant_input
                assert command.heave_current == command.surge_current == 0.0
                assert command.heave_enable == command.surge_enable == 0
        outcomes.add((Mode(safety.mode).name, KIND.reason_table.name(safety.reason)))
    assert {reason for _, reason in outcomes} >= {
        "NONE",
        "NOT_FINITE",
        "ENCODER_JUMP",
        "DRIVE_FAULT",
    }


# --- conversions between loop and plant


class RecordingWorld:
    """A simulated world that records its actuation."""

    delay = 0.002

    def __init__(self, readings: Any) -> None:
        self._readings, self.actuation = readings, ()

    def readings(self) -> Any:
        return self._readings

    def actuate(self, actuation: Any) -> None:
        self.actuation = actuation


def test_conversions_equal_those_of_the_rehearsal_devices() -> None:
    from rig.kinds.wavebot.tick import Command
    from sim_plant.signals import Readings

    readings = Readings(*range(100, 100 + len(Readings._fields)))
    world: Any = RecordingWorld(readings)
    devices = WaveBotPlantDevices(world, 0.001)
    assert devices.read(0.0) == plant_coupling.sense(readings, world.delay)
    numbers = iter(range(200, 300))

    def fill(signal_type: Any) -> Any:
        hints = inspect.get_annotations(signal_type, eval_str=True).values()
        types = [getattr(hint, "__origin__", hint) for hint in hints]
        return signal_type(*(fill(t) if hasattr(t, "_fields") else next(numbers) for t in types))

    command = fill(Command)
    command = command._replace(
        drive=command.drive._replace(settings=command.drive.settings._replace(bus_voltage=0.0))
    )
    devices.write(command)
    assert world.actuation == plant_coupling.actuation(command)


# --- outdated compiled code


def imported_modules(modules: Any) -> set[str]:
    """Return the modules of this project that some modules import from."""
    from test_house import imports, parse_file

    named = {name for m in modules for name in imports(parse_file(Path(m.__file__ or "")))}
    return {name for name in named if name.split(".")[0] in ("controllers", "rig", "sim_plant")}


def test_cache_folder_depends_on_every_compiled_source(
    simulator: CampaignSimulator, monkeypatch: Any
) -> None:
    """An edit of any module of cycle, plant or their types leads to another folder."""
    modules = simulator.source.modules
    parts = {module.__name__ for module in modules}
    passing = {  # packages that only re-export, and modules with nothing but types
        "controllers", "rig.kinds.wavebot.tick", "rig.realtime", "sim_plant", "sim_plant.parts",
        "controllers.law", "sim_plant.units",
    }  # fmt: skip
    # They write or find code before it is compiled; what they give is in text and digest.
    writing = {"rig.compilation", "rig.laws", "rig.stations",
               "rig.realtime.loop", "rig.realtime.compiled_tick", "rig.realtime.object_code",
               "rig.realtime.live_setpoints", "rig.realtime.tick",
               "rig.recording.row_layout"}  # fmt: skip
    missing = {
        name for name in imported_modules(modules) - parts
        if not name.startswith("rig.compilation.")
    }  # fmt: skip
    assert missing <= passing | writing
    now = code_folder("x", modules)
    getsource = inspect.getsource
    for edited in modules:

        def read(module: Any, edited: Any = edited) -> str:
            return getsource(module) + ("# edited" if module is edited else "")

        monkeypatch.setattr(inspect, "getsource", read)
        assert code_folder("x", modules) != now, edited.__name__
    monkeypatch.setattr(inspect, "getsource", getsource)
    assert code_folder("x", modules) == now
    monkeypatch.setattr(cache_folder, "_COMPILERS", (*cache_folder._COMPILERS, "plant_step.py"))
    assert code_folder("x", modules) != now
    monkeypatch.undo()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert code_folder("x", modules) != now


PRINT_CACHE_FOLDER = """
import sys
from pathlib import Path
from both_ways import open_simulator
print(open_simulator(Path(sys.argv[1]))[0].source.folder)
"""


def run_in_tree(tree: Path, *arguments: str, **environment: str) -> str:
    """Return the output of a separate process that uses the packages of a source tree.

    Its code is not optimised, which takes a third less time and gives the same bits.
    """
    paths = f"{tree}:{Path(__file__).parent}"
    process = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": paths, "NUMBA_OPT": "0", **environment},
        cwd=tree,  # Python searches it first
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return process.stdout.strip()


@pytest.mark.slow
@pytest.mark.long
def test_edited_law_is_recompiled_and_no_index_leaves_its_table(tmp_path: Path) -> None:
    """One compilation tests both: the edited law, with numba's bounds checking on.

    The law has Z_c(s) and a reference. The name of the cache folder depends on the sources and on
    bounds checking, so it differs from this process's own folder.
    """
    rig_file = str(CONFIGS / "rigs" / "wavebot.yaml")
    config = QUICK | {"law": ZC, "reference": {"kind": "multisine", "amplitude_a": 8}}
    path = write_yaml(tmp_path / "zc.yaml", {"name": "zc", "rig": rig_file, **config})
    unedited = interpreted(path).summary()
    root, tree = Path(rig.__file__).parents[1], tmp_path / "tree"
    for name in ("controllers", "rig", "sim_plant"):
        shutil.copytree(root / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    folder = str(open_simulator(path)[0].source.folder)
    assert run_in_tree(tree, "-c", PRINT_CACHE_FOLDER, str(path)) == folder
    law = tree / "controllers" / "impedance.py"
    text = law.read_text()
    edited = text.replace("force = kp * velocity", "force = 1.01 * kp * velocity", 1)
    assert edited != text
    law.write_text(edited)
    assert run_in_tree(tree, "-c", PRINT_CACHE_FOLDER, str(path)) != folder
    program = str(Path(__file__).with_name("both_ways.py"))
    compiled_result, interpreted_result = json.loads(
        run_in_tree(tree, program, str(path), NUMBA_BOUNDSCHECK="1")
    )
    assert compiled_result == interpreted_result
    assert compiled_result["ticks"] == unedited["ticks"] == 8000
    assert compiled_result["reason"] == "PLAN_END"
    assert compiled_result["power"] != unedited["power"]
    assert compiled_result["power"] == pytest.approx(unedited["power"], rel=0.1)
