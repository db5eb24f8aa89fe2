"""Sessions of the flap from file to report, and their results compared with the closed form.

The runs are short. Most are on a flap without dry and quadratic friction, which has a closed form.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flap_files import SMOOTH, changed
from plant_files import mapping
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.config.pydantic_errors import load
from rig.kinds.oswec_bench.config.constants_file import ConstantsFile
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions.check import check_session
from sim_plant.bem import excitation_at
from sim_plant.flap import hydrodynamics

STIFF = {
    **SMOOTH,
    "transmission__half_gap": 0.0,
    "transmission__soft_deflection": 0.0,
    "transmission__gearbox_stiffness": 1.0e6,
    "transmission__coupling_stiffness": 1.0e7,
}


def plant_file(folder: Path, name: str, values: dict[str, Any]) -> Path:
    """Write a shipped plant with some values replaced."""
    content = mapping(f"{name}.yaml")
    for path, value in values.items():
        *sections, field = path.split("__")
        inner = content
        for section in sections:
            inner = inner[section]
        if value is None:
            inner[field] = {key: {**entry, "value": 0.0} for key, entry in inner[field].items()}
        else:
            inner[field] = {**inner[field], "value": value}
    return write_yaml(folder / f"{name}.yaml", content)


def session(folder: Path, kind: str, *, free: bool, **keys: Any) -> Path:
    """Write a session on the shipped flap at half its rate; ``free``: without its coupling."""
    shipped = CONFIGS / "rigs" / ("oswec_flap_free.yaml" if free else "oswec_flap.yaml")
    rig = {"extends": str(shipped), "name": "flap at 500 Hz", "rate_hz": 500}
    content = {
        "name": kind,
        "session": kind,
        "rig": str(write_yaml(folder / f"rig_{free}.yaml", rig)),
        "tare": {"duration_s": 0.5},
        **keys,
    }
    return write_yaml(folder / f"{kind}.yaml", content)


def run_session(path: Path, runs: Path) -> tuple[dict[str, Any], Path]:
    """Run a session with `rig bench`; return its results and its folder."""
    code, out, _ = rig_here("bench", path, "--runs", runs, "--json")
    assert code == 0, out
    printed = json.loads(out)
    assert (printed["status"], printed["reason"], printed["trouble"]) == (
        "complete",
        "PLAN_END",
        "",
    )
    folder = Path(printed["folder"])
    for product in ("session.html", "session.json"):
        assert (folder / product).is_file()
    assert list(folder.glob("flap_*.png"))
    if printed["results"]["constants"]:
        load(folder / "calibration.yaml", ConstantsFile)
    return printed["results"], folder


def load_columns(folder: Path, table: str) -> dict[str, Any]:
    """Return the columns of a run's table by name."""
    columns = json.loads((folder / "session.json").read_text())["tables"][table]["columns"]
    return {column["name"]: np.array(column["values"]) for column in columns}


def test_stiffness_and_free_decay(tmp_path: Path) -> None:
    """The shipped flap, with all its friction; the decay uses the stiffness of the first run."""
    slow = session(
        tmp_path, "flap_hydrostatic", free=False, position_feedback_per_s=1,
        grid=[{"amplitude_deg": 20, "period_s": [15, 40]}],
        timing={"rise_s": 2, "settle_periods": 0, "periods": 2},
    )  # fmt: skip
    found, _ = run_session(slow, tmp_path)
    spring = found["constants"]["flap_stiffness"]
    assert spring["value"] == pytest.approx(90.0, rel=0.01)
    assert abs(spring["value"] - 90.0) <= 2.0 * spring["uncertainty"]
    free = session(
        tmp_path, "flap_free_decay", free=True,
        rows=[{"release_deg": a, "period_s": 3.5} for a in (6, -10, 15, -20)],
        timing={"rise_s": 0.5, "settle_periods": 0, "periods": 2},
    )  # fmt: skip
    found, _ = run_session(free, tmp_path)
    constants = found["constants"]
    # Slow root of the shipped flap, with the viscous friction of seals and bearing.
    assert constants["flap_natural_period"]["value"] == pytest.approx(3.5679, rel=5e-3)
    assert constants["flap_decay_rate"]["value"] == pytest.approx(0.2102, rel=0.02)
    assert constants["flap_quadratic_damping"]["value"] == pytest.approx(7.0, rel=0.05)
    assert constants["flap_dry_friction"]["value"] == pytest.approx(1.64, rel=0.02)


def test_the_response_to_regular_waves(tmp_path: Path) -> None:
    """The points agree with X / (i omega Z); the analysis corrects the age of the angle."""
    values = {**SMOOTH, "flap__viscous_linear": 25.0}
    plant = plant_file(tmp_path, "oswec_flap_free", values)
    path = session(
        tmp_path, "flap_rao", free=True, plant=str(plant),
        grid=[{"wave_amplitude_m": 0.02, "period_s": [1, 1.6, 2.5]}],
        timing={"rise_s": 12, "settle_periods": 0, "periods": 2},
    )  # fmt: skip
    found, folder = run_session(path, tmp_path)
    assert found["constants"] == {}  # too few periods for a fit
    rao = load_columns(folder, "flap_rao")
    model = changed("oswec_flap_free", **values)
    excitation = np.conj(excitation_at(model.coefficients(), rao["frequency"]))
    impedance = hydrodynamics.impedance(model.build_flap().body, rao["frequency"])
    expected = excitation / (2j * math.pi * rao["frequency"] * impedance)
    np.testing.assert_allclose(rao["response"], np.abs(expected), rtol=5e-3)
    off = (rao["phase"] - np.degrees(np.angle(expected)) + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(off, 0.0, atol=0.3)


def test_the_response_to_an_irregular_sea(tmp_path: Path) -> None:
    """Every line of one sea agrees with the closed form; the fit goes through the lines."""
    values = {**SMOOTH, "flap__viscous_linear": 25.0}
    plant = plant_file(tmp_path, "oswec_flap_free", values)
    path = session(
        tmp_path, "flap_rao", free=True, plant=str(plant), rows=[{"wave_amplitude_m": 0.03}],
        irregular={"low_hz": 0.3, "high_hz": 1.0, "repeat_s": 10, "seed": 3},
        timing={"rise_s": 12, "settle_periods": 0, "periods": 2},
    )  # fmt: skip
    found, folder = run_session(path, tmp_path)
    rao = load_columns(folder, "flap_rao")
    assert len(rao["response"]) == 8
    model = changed("oswec_flap_free", **values)
    excitation = excitation_at(model.coefficients(), rao["frequency"])
    impedance = hydrodynamics.impedance(model.build_flap().body, rao["frequency"])
    expected = np.abs(excitation / (2j * math.pi * rao["frequency"] * impedance))
    np.testing.assert_allclose(rao["response"], expected, rtol=0.01)
    top = found["constants"]["flap_rao_top"]
    assert top["value"] == pytest.approx(expected.max(), rel=0.03)


def test_the_best_damping_in_a_one_second_sea(tmp_path: Path) -> None:
    """Eq. 2.2 with omega; powers by F² R / (2 |Z + R + i X|²), X as measured by the load cell.

    X is the motor's inertia and the effect of its loop's delay on R.
    """
    plant = plant_file(tmp_path, "oswec_flap", STIFF)
    path = session(
        tmp_path, "flap_pto_sweep", free=False, plant=str(plant), calibrations=[],
        grid=[{
            "wave_amplitude_m": 0.05, "period_s": 1,
            "pto_damping_n_m_s_per_rad": [30, 60, 90, 120, 170],
        }],
        timing={"rise_s": 8, "settle_periods": 0, "periods": 3},
    )  # fmt: skip
    found, folder = run_session(path, tmp_path)
    model = changed(**STIFF)
    params = model.build_flap()
    impedance = complex(hydrodynamics.impedance(params.body, 1.0))
    moment = 0.05 * abs(complex(excitation_at(model.coefficients(), np.array([1.0]))[0]))
    power = load_columns(folder, "flap_power")
    measured_damping = power["measured damping"]
    # The motor constant in use is not the plant's: measured and set damping differ.
    assert np.all(np.diff(measured_damping) > 0.0)
    reactance = np.polyfit(measured_damping, power["reactance"], 1)

    def closed_form(damping: Any) -> Any:
        load = damping + 1j * np.polyval(reactance, damping)
        return 0.5 * moment**2 * damping / np.abs(impedance + load) ** 2

    closed = closed_form(measured_damping)
    fine = np.linspace(30.0, 200.0, 20000)
    top = int(np.argmax(closed_form(fine)))
    constants = found["constants"]
    assert constants["flap_best_damping"]["value"] == pytest.approx(fine[top], rel=0.01)
    assert constants["flap_best_damping"]["value"] == pytest.approx(abs(impedance), rel=0.02)
    assert constants["flap_best_power"]["value"] == pytest.approx(closed_form(fine[top]), rel=0.01)
    np.testing.assert_allclose(power["power of the flap"], closed, rtol=0.01)


def problems_of(path: Path) -> list[tuple[str, str]]:
    report = check_session(path, further_check=problems)
    return [(problem.key, problem.message) for problem in report.problems]


SHORT = {"rise_s": 1, "settle_periods": 0, "periods": 1}
WAVES = {"wave_amplitude_m": 0.02, "period_s": 1.5}


@pytest.mark.parametrize(
    ("kind", "free", "row", "key", "message"),
    [
        ("flap_rao", False, WAVES, "session", "has its coupling in"),
        ("flap_free_decay", False, {"release_deg": 1, "period_s": 3}, "session", "coupling out"),
        ("flap_hydrostatic", True, {"amplitude_deg": 5, "period_s": 20}, "session", "coupling in"),
        ("flap_rao", True, {**WAVES, "period_s": 1.0005}, "rows[0].period_s", "no whole number"),
        ("flap_rao", True, {**WAVES, "period_s": 0.4}, "rows[0].period_s", "too short for waves"),
        ("flap_free_decay", True, {"release_deg": 0.05, "period_s": 3}, "rows[0].release_deg",
         "0.05 is the rest position; allowed angles from 0.1 deg"),
        ("flap_free_decay", True, {"release_deg": -41, "period_s": 3}, "rows[0].release_deg",
         "-41 is more than limits and rig allow; allowed below 40 deg"),
        ("flap_pto_sweep", False, WAVES, "rows[0]", "pto_damping_n_m_s_per_rad missing"),
    ],
)  # fmt: skip
def test_impossible_flap_session_is_refused(
    tmp_path: Path, kind: str, free: bool, row: dict[str, float], key: str, message: str
) -> None:
    problems = problems_of(session(tmp_path, kind, free=free, rows=[row], timing=SHORT))
    assert [problem[0] for problem in problems] == [key], problems
    assert message in problems[0][1]


def test_a_bench_has_no_flap(tmp_path: Path) -> None:
    path = session(tmp_path, "flap_rao", free=True, rows=[WAVES], timing=SHORT)
    rig = tmp_path / "rig_True.yaml"
    rig.write_text(rig.read_text().replace("oswec_flap_free", "oswec_bench"))
    ((key, message),) = problems_of(path)
    assert key == "session"
    assert "has no flap" in message
