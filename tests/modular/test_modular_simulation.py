"""The compiled loop of a modular rig gives the same bits as a rehearsal of the same files."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from typing import Any

import pytest
from both_ways import compiled, differing_fields, interpreted, open_simulator
from modular_rigs import (
    FORCE,
    HEAVE,
    HEAVE_LIMITS,
    PITCH,
    PITCH_LIMITS,
    PLANT_SENSORS,
    POWER,
    limits_mapping,
    plant_mapping,
    rig_mapping,
    write_campaign,
)

from rig.compilation.cache_folder import code_folder
from tests.docs.blocks import file_of

LAW_PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorials" / "your_law.md"
REGULAR = {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.4}
IRREGULAR = {"kind": "jonswap", "hs_m": 0.15, "tp_s": 2.5, "repeat_s": 10}
TIMES = {
    "tare": {"duration_s": 0.5},
    "start": {"lead_in_s": 6},
    "timing": {"settle_s": 0.5, "interval_s": 5.5},
}
FIRST = {
    "heave_kp_n_s_per_m": -4000.0,
    "heave_ki_n_per_m": 500.0,
    "heave_km_kg": 20.0,
    "pitch_kp_n_m_s_per_rad": -300.0,
    "pitch_ki_n_m_per_rad": 0.0,
}
SECOND = FIRST | {"heave_kp_n_s_per_m": -2000.0, "pitch_ki_n_m_per_rad": 50.0}
CASES: dict[str, dict[str, Any]] = {
    "regular": {"sea": REGULAR, "matrix": {"list": [FIRST, SECOND]}},
    "irregular, excited in pitch": {
        "sea": IRREGULAR,
        "timing": {"settle_s": 0.5},
        "reference": {"kind": "multisine", "axis": "pitch", "amplitude_a": 3},
        "matrix": {"list": [FIRST | {"realisation": 2}, SECOND | {"realisation": 1}]},
    },
    "tripped": {
        "sea": REGULAR | {"amplitude_m": 0.35},
        "matrix": {
            "list": [FIRST, FIRST | {"heave_kp_n_s_per_m": -100.0, "heave_ki_n_per_m": 9000.0}]
        },
    },
    "law of a file, nonlinear damping": {
        "sea": REGULAR,
        "law": {"heave": {"use": "./growing.py", "max_force_n": 900}, "pitch": "nonlinear damping"},
        "matrix": {
            "list": [
                {"heave_c0_n_s_per_m": 1500, "heave_c1_n_s_per_m2": 4000,
                 "pitch_quadratic_n_m_s2_per_rad2": 400, "pitch_coulomb_n_m": 20},
            ]
        },
    },
}  # fmt: skip


def make_campaign(folder: Path, case: str) -> Path:
    """Write the files of a case: heave and pitch, a tared force sensor with noise and a scale."""
    (folder / "growing.py").write_text(file_of(LAW_PAGE, "growing_damping.py"))
    rig = rig_mapping(
        axes={"heave": HEAVE | {"gain_ramp_s": 0.3}, "pitch": PITCH},
        sensors={"pto_force": FORCE | {"scale": 1.5, "offset": -7.0}, "dc_power": POWER},
    )
    drive = plant_mapping()["axes"]["heave"]["drive"] | {"current_noise_a": 0.01}
    axes = {name: axis | {"drive": drive} for name, axis in plant_mapping()["axes"].items()}
    sensors = PLANT_SENSORS | {
        "pto_force": {"signal": "heave.force", "noise": 2.0, "offset": 4.0, "scale": 0.9},
        "spare": {"signal": "pitch.velocity"},
    }
    plant = plant_mapping(axes=axes, sensors=sensors, delay_s=0.003, wave_onset_s=2.0)
    limits = limits_mapping(heave=HEAVE_LIMITS, pitch=PITCH_LIMITS)
    return write_campaign(folder, rig, limits, plant, **TIMES | CASES[case])


@pytest.mark.slow  # if the loop is not compiled yet
@pytest.mark.sampled
@pytest.mark.parametrize(
    "case",
    [
        "regular",
        "tripped",
        "irregular, excited in pitch",
        "law of a file, nonlinear damping",
    ],
)
def test_every_stored_field_has_the_bits_of_a_rehearsal(case: str, tmp_path: Path) -> None:
    path = make_campaign(tmp_path, case)
    one, other = compiled(path), interpreted(path)
    assert not differing_fields(one, other)
    assert {"pto_force.value", "tare.pto_force", "pitch.command.force"} <= set(one.fields)
    if case == "tripped":
        assert one.reason == "POSITION"
        assert "POSITION" in one.incomplete_reason[-1]
    else:
        assert one.reason == "PLAN_END"
        assert set(one.incomplete_reason) == {""}
        assert len(one.kept) >= 5000 * len(CASES[case]["matrix"]["list"])


def test_cache_folder_depends_on_every_compiled_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An edit of any module of cycle, laws, plant or their types leads to another folder."""
    from test_house import imports

    path = make_campaign(tmp_path, "law of a file, nonlinear damping")
    modules = open_simulator(path)[0].source.modules
    written = [module for module in modules if not Path(str(module.__file__)).exists()]
    assert len(written) == 2  # tick and coupling
    assert any(module.__name__.startswith("wec_rig_law_") for module in modules)
    names = {module.__name__ for module in modules}
    assert {"sim_plant.modes.springs", "sim_plant.parts.spring", "sim_plant.stator_force"} <= names
    imported = {
        name
        for module in modules
        for name in imports(ast.parse(inspect.getsource(module)))
        if name.split(".")[0] in ("controllers", "rig", "sim_plant")
        and not name.startswith("rig.compilation")  # it writes the code: part of the text
    }
    passing = {"controllers", "controllers.law", "rig.realtime", "sim_plant", "sim_plant.modes",
               "sim_plant.parts", "sim_plant.units"}  # fmt: skip
    # They write or run the code; what they give is in its text.
    running = {"rig.realtime.loop", "rig.realtime.compiled_tick", "rig.realtime.object_code",
               "rig.realtime.live_setpoints", "rig.realtime.requests",
               "rig.realtime.tick", "rig.recording.row_layout"}  # fmt: skip
    assert imported - names <= passing | running
    now, getsource = code_folder("x", modules), inspect.getsource
    for edited in modules:

        def read(module: Any, edited: Any = edited) -> str:
            return getsource(module) + ("# edited" if module is edited else "")

        monkeypatch.setattr(inspect, "getsource", read)
        assert code_folder("x", modules) != now, edited.__name__
