"""A choice among laws: the law of the set point acts alone, and a change of law makes no jump."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsing import CONFIGS
from rig_command import rig_here

from controllers import impedance, latching, nonlinear_damping
from controllers.signals import Estimate
from rig import laws
from rig import open as open_in_python
from rig.analysis.rows import NOT_RUN, row_table
from rig.campaign.simulated_rows import SimulatedRows
from rig.kinds.rig_file import kind_of_task
from rig.kinds.wavebot.display import plan_position
from rig.kinds.wavebot.row_contents import row_contents
from rig.realtime.sequence import Phase

DT = 1e-3  # s
RAMP = 0.2  # s
SETTINGS = {
    "hold_stiffness_n_per_m": (1e6,),
    "hold_damping_n_s_per_m": (1e4,),
    "arming_speed_m_per_s": (0.02,),
    "smoothing_m_per_s": (0.01,),
}
GAINS = {
    "kp": -2000.0,
    "ki": 500.0,
    "km": 20.0,
    "latch": 0.3,
    "quadratic": 3000.0,
    "coulomb": 100.0,
}


def motions(count: int) -> Iterator[Estimate]:
    """A motion of 0.2 m and 0.5 Hz, with a third harmonic."""
    for tick in range(count):
        a = math.pi * tick * DT
        yield Estimate(
            0.2 * math.sin(a) + 0.02 * math.sin(3 * a),
            math.pi * (0.2 * math.cos(a) + 0.06 * math.cos(3 * a)),
            -(math.pi**2) * (0.2 * math.sin(a) + 0.18 * math.sin(3 * a)),
        )


def chosen(*names: str) -> Any:
    return laws.choice([laws.find(name) for name in names])


def forces(law: Any, numbers: Sequence[float], reference: float = 0.0) -> np.ndarray[Any, Any]:
    """Force of a choice in each tick, with the law of these numbers."""
    module = law.module
    params = module.params(SETTINGS, RAMP, DT)
    state, found = module.start(params), []
    for number, motion in zip(numbers, motions(len(numbers)), strict=True):
        values = GAINS | {"law": number}
        set_point = module.SetPoint(*(values[name] for name in module.SetPoint._fields))
        state, demand = module.step(params, state, set_point, motion, reference, 0.0, DT)
        found.append(demand.force)
    return np.array(found)


def alone(module: Any, count: int, since: int = 0, reference: float = 0.0) -> np.ndarray[Any, Any]:
    """Force of a law that starts in a tick."""
    params = module.params(SETTINGS, RAMP, DT)
    state, found = module.start(params), []
    set_point = module.SetPoint(*(GAINS[name] for name in module.SetPoint._fields))
    for motion in list(motions(count))[since:]:
        state, demand = module.step(params, state, set_point, motion, reference, 0.0, DT)
        found.append(demand.force)
    return np.array(found)


@pytest.mark.parametrize(
    ("number", "module"), list(enumerate([impedance, nonlinear_damping, latching]))
)
def test_each_law_of_a_choice_acts_as_it_does_alone(number: int, module: Any) -> None:
    law = chosen("impedance", "nonlinear damping", "latching")
    assert (forces(law, [float(number)] * 4000, 30.0) == alone(module, 4000, 0, 30.0)).all()


def test_the_force_fades_from_one_law_to_the_next() -> None:
    law, at, count = chosen("impedance", "nonlinear damping"), 1300, 3000
    found = forces(law, [0.0] * at + [1.0] * (count - at), 30.0)
    before, after = alone(impedance, count, 0, 30.0), alone(nonlinear_damping, count, at, 30.0)
    assert (found[:at] == before[:at]).all()
    share = np.maximum(0.0, 1.0 - DT / RAMP * np.arange(1, count - at + 1))
    blended = share * before[at - 1] + (1.0 - share) * after
    # The share is a sum of 200 steps: rounding of about 1e-14 of a force of some hundred newtons.
    assert found[at:] == pytest.approx(blended, abs=1e-9)
    ended = at + round(RAMP / DT) + 1
    assert (found[ended:] == after[ended - at :]).all()
    largest = np.abs(np.diff(np.concatenate([before, after]))).max()
    assert abs(found[at] - found[at - 1]) < DT / RAMP * np.abs(found).max() + largest


def test_laws_share_a_column_of_one_meaning() -> None:
    law = chosen("impedance", "latching", "declutching")
    keys = [column.key for column in law.columns]
    assert keys == ["kp_n_s_per_m", "ki_n_per_m", "km_kg", "latch_s", "declutch_s", "law"]
    assert law.columns[-1].choices == ("impedance", "latching", "declutching")
    defaults = {column.key: column.default for column in law.columns}
    assert defaults["kp_n_s_per_m"] is None  # of the first law: every matrix has it
    assert defaults["latch_s"] == defaults["law"] == 0.0
    assert [parameter.key for parameter in law.parameters].count("arming_speed_m_per_s") == 1


def test_a_column_of_two_meanings_is_refused(tmp_path: Path) -> None:
    text = Path(str(nonlinear_damping.__file__)).read_text()
    other = tmp_path / "other.py"
    other.write_text(text.replace("0.0, 1e6,", "0.0, 2e6,", 1))
    with pytest.raises(laws.LawError, match=r"quadratic_n_s2_per_m2 of two laws differs in name"):
        laws.choice([laws.find("nonlinear damping"), laws.load_file(other)])
    with pytest.raises(laws.LawError, match="each law of a choice must have a name of its own"):
        chosen("latching", "latching")


def test_a_choice_finds_its_laws_in_another_process(tmp_path: Path) -> None:
    other = tmp_path / "other.py"
    other.write_text(Path(str(nonlinear_damping.__file__)).read_text())
    law = laws.choice([laws.find("impedance"), laws.load_file(other)])
    assert laws.from_request(laws.to_request(law)) == law
    text = laws.to_request(law)
    other.write_text(other.read_text() + "\n# edited\n")
    with pytest.raises(laws.LawError, match="changed after the check"):
        laws.from_request(text)


CAMPAIGN = """
extends: {quick}
name: choice
law:
  use: [impedance, {file}, nonlinear damping]
  hold_stiffness_n_per_m: 1e6
  hold_damping_n_s_per_m: 1e4
matrix:
  grid: null
  list:
    - {{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0}}
    - {{spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0, law: own, latch_s: 0.3}}
    - {{spring_n_per_m: 490.9, kp_n_s_per_m: 0, ki_n_per_m: 0, law: 2,
       quadratic_n_s2_per_m2: 3000, coulomb_n: 0}}
"""


def write_campaign(folder: Path) -> Path:
    (folder / "own.py").write_text(Path(str(latching.__file__)).read_text())
    path = folder / "choice.yaml"
    path.write_text(CAMPAIGN.format(quick=CONFIGS / "campaigns" / "quick.yaml", file="./own.py"))
    return path


def test_rows_choose_their_law(tmp_path: Path) -> None:
    path = write_campaign(tmp_path)
    code, out, _ = rig_here("check", path)
    assert code == 0, out
    for line in ("0 impedance (wec-rig", "1 own (", "2 nonlinear damping (wec-rig"):
        assert f"law       {line}" in out
    code, out, err = rig_here("run", path, "--runs", tmp_path / "runs", "--json", "--interpreted")
    assert code == 0, out + err
    (run,) = (tmp_path / "runs").iterdir()
    table = row_table(run)
    assert table["law"].values.tolist() == [0.0, 1.0, 2.0]
    power = table["power_mechanical_1"].values
    # Each law absorbs its own power; a damper of 3000 N s2/m2 that of about 8/(3 pi) 3000 |v|.
    assert len({round(float(each)) for each in power}) == 3
    assert (power < -20.0).all()
    # A choice is recorded with the source of its law from a file, so a replay needs no file.
    (tmp_path / "own.py").unlink()
    code, out, err = rig_here("replay", run)
    assert code == 0, out + err
    assert out.startswith("no diff: ")
    recorded = json.loads((run / "config.json").read_text())["law"]["choices"]
    assert [each["name"] for each in recorded] == ["impedance", "own", "nonlinear damping"]
    _, out, _ = rig_here("show", run)
    # The first row has its law's columns alone; so have the tables of Python.
    assert "law impedance" in out
    assert "latching time -" not in out
    assert "latching time 0 s" not in out
    rows = open_in_python(run).rows
    assert rows.latch.isna().tolist() == [True, False, True]
    assert rows.kp.isna().tolist() == [False, False, True]
    assert rows.quadratic.isna().tolist() == [True, True, False]


DAMPER = """
from typing import NamedTuple
from controllers import impedance
from controllers.law import Column
from controllers.signals import Demand

COLUMNS = (Column("c_n_s_per_m", "c", "N*s/m", "c", 0.0, 20_000.0, "Damping."),)
PARAMETERS = ()

class SetPoint(NamedTuple):
    c: float

Params, State, params, start = impedance.Params, impedance.State, impedance.params, impedance.start

def step(params, state, setpoint, motion, reference, deficit, dt):
    gains = impedance.SetPoint(-setpoint.c, 0.0, 0.0)
    return impedance.step(params, state, gains, motion, reference, deficit, dt)

def linear(params, setpoint, omega):
    return complex(-setpoint.c)
"""


def test_a_check_shows_the_columns_of_all_laws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each row has its own law's values, and none of the others; so has the panel of a run."""
    (tmp_path / "damper.py").write_text(DAMPER)
    path = tmp_path / "laws.yaml"
    row = "spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 0"
    path.write_text(
        f"extends: {CONFIGS / 'campaigns' / 'quick.yaml'}\nname: laws\n"
        "law: {use: [impedance, ./damper.py, latching], hold_stiffness_n_per_m: 1e5, "
        "hold_damping_n_s_per_m: 1e4}\nmatrix:\n  grid: null\n  list:\n"
        f"    - {{{row}}}\n    - {{{row}, law: damper, c_n_s_per_m: 1500}}\n"
    )
    code, out, _ = rig_here("check", path, "--rows")
    assert code == 0, out

    def cells(text: str) -> dict[str, list[str]]:
        return {line.split()[0]: line.split()[1:6] for line in text.splitlines() if line.strip()}

    settings = {
        "row": ["spring", "Kp", "Ki", "c", "law"],  # no row is latched
        "0": ["490.9", "-2000", "0", "-", "impedance"],
        "1": ["490.9", "-", "-", "1500", "damper"],
    }
    predicted = cells(out[out.index("All 2 rows") :])
    assert {key: predicted[key] for key in settings} == settings
    report = kind_of_task(path).room("tasks").examine(path)
    contents = row_contents(report.campaign.file.law_columns())
    results = {"state": NOT_RUN, "incomplete_reason": "", "warned": "", "limits": "", "flags": ""}
    found = tuple({"row": i, **each.row.setting._asdict(), **results}
                  for i, each in enumerate(report.prediction.rows))  # fmt: skip
    units = dict.fromkeys(SimulatedRows(report.campaign, 2, found, "", contents, {}).numbers, "m")
    SimulatedRows(report.campaign, 2, found, "PLAN_END", contents, units).show(every_row=True)
    simulated = cells(capsys.readouterr().out)
    assert {key: simulated[key] for key in settings} == settings
    for peak, digits in ((0.00123, ".3g"), (0.123, ".3f")):  # m
        measured = (*found, found[0] | {"state": "complete", "position_peak": peak})
        shown = SimulatedRows(report.campaign, 3, measured, "", contents, {})
        assert shown.numbers["position_peak"] == digits
    _, text = plan_position(report.plan, {"plan.row": 1, "plan.phase": int(Phase.MEASURE)})
    assert text.endswith("c 1500 N·s/m   law damper   spring rate 490.9 N/m")


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("law: own, latch_s: 0.3", "law: own", "choice.yaml:12: matrix.list[1].law: point 1: the "
         "law own needs latch_s"),
        ("law: own", "law: owm", "'owm' is none of the names; allowed impedance, own, nonlinear "
         "damping, or 0 .. 2 in this order"),
        ("law: 2", "law: 1.5", "matrix.list[2].law: 1.5 is none of the names"),
        ("law: 2", "law: 3", "matrix.list[2].law: 3 is none of the names"),
        ("law: 2", "law: true", "matrix.list[2].law: true is none of the names"),
        ("use: [impedance,", "use: [impedanse,", "law.use[0]: no law 'impedanse' is registered"),
        ("use: [impedance, ./own.py, nonlinear damping]", "use: [impedance]", "law.use"),
        ("  hold_stiffness_n_per_m: 1e6\n", "", "law.hold_stiffness_n_per_m: missing"),
    ],
)  # fmt: skip
def test_mistakes_in_a_choice(old: str, new: str, part: str, tmp_path: Path) -> None:
    path = write_campaign(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    code, out, err = rig_here("check", path)
    assert code == 2, out + err
    assert part in out + err


def test_a_matrix_file_names_laws(tmp_path: Path) -> None:
    path = write_campaign(tmp_path)
    text = path.read_text()
    path.write_text(text[: text.index("  grid: null")] + "  list: null\n  csv: rows.csv\n")
    header = "spring_n_per_m,kp_n_s_per_m,ki_n_per_m,latch_s,law\n"
    rows = tmp_path / "rows.csv"
    rows.write_text(header + "490.9,-2000,0,0.3,own\n490.9,-2000,0,0.3,0\n")
    code, out, err = rig_here("check", path)
    assert code == 0, out + err
    rows.write_text(header + "490.9,-2000,0,0.3,owm\n490.9,-2000,0,0.3,0.5\n")
    code, out, err = rig_here("check", path)
    assert code == 2
    assert "rows.csv:2:19: law: 'owm' is not a number; allowed 0 .. 2, impedance, own" in out + err
    assert "rows.csv:3:19: law: 0.5 is not a whole number" in out + err


def planned_ki(folder: Path, law: str) -> list[float]:
    """Ki of each set point of a plan whose stator moves from a soft to a stiff spring and back."""
    path = folder / "moves.yaml"
    path.write_text(
        f"extends: {CONFIGS / 'campaigns' / 'quick.yaml'}\nname: moves\nlaw: {law}\n"
        "matrix:\n  list:\n"
        "    - {spring_n_per_m: -10013, kp_n_s_per_m: -2000, ki_n_per_m: 9141}\n"
        "    - {spring_n_per_m: 8340, kp_n_s_per_m: -2000, ki_n_per_m: 30000}\n"
        "    - {spring_n_per_m: -10013, kp_n_s_per_m: -2000, ki_n_per_m: 9141}\n"
    )
    tasks = kind_of_task(path).room("tasks")
    report = tasks.examine(path, predict=False)
    assert report.ok, report.text()
    names = report.checked.file.heave_law.module.SetPoint._fields
    return list(report.plan.setpoints.law[names.index("ki")])


def test_ki_is_limited_while_the_stator_moves_whatever_other_laws_there_are(
    tmp_path: Path,
) -> None:
    alone = planned_ki(tmp_path, "impedance")
    assert min(alone) == 0.0  # of the lead-in and the end
    assert len(set(alone)) > 3
    assert planned_ki(tmp_path, "[impedance, nonlinear damping]") == alone


def test_a_row_that_lacks_a_column_of_its_law_is_reported(tmp_path: Path) -> None:
    """Also where the missing one is that of the equilibrium's check."""
    path = tmp_path / "missing.yaml"
    path.write_text(
        f"extends: {CONFIGS / 'campaigns' / 'quick.yaml'}\nname: missing\n"
        "law: [nonlinear damping, impedance]\nmatrix:\n  list:\n"
        "    - {spring_n_per_m: 490.9, quadratic_n_s2_per_m2: 10, coulomb_n: 0, law: impedance}\n"
    )
    code, out, err = rig_here("check", path)
    assert code == 2
    assert "the law impedance needs kp_n_s_per_m, ki_n_per_m" in out + err


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("DAMPING = 1.0", "DAMPING = 2.0"),
        ('choices=("off", "on")', 'choices=("on", "off")'),
        ("(4000.0,)", "(100.0,)"),
    ],
)
def test_laws_with_different_defaults_are_no_choice(old: str, new: str, tmp_path: Path) -> None:
    """A default or a name of one law must not hold for the other."""
    text = LAW_WITH_DEFAULTS
    assert old in text
    found = []
    for name, source in (("one", text), ("two", text.replace(old, new))):
        path = tmp_path / f"{name}.py"
        path.write_text(source)
        found.append(laws.load_file(path))
    with pytest.raises(laws.LawError, match="differs in name, unit, range, default or names"):
        laws.choice(found)


LAW_WITH_DEFAULTS = """
from typing import NamedTuple
from controllers.law import Column, Parameter
from controllers.signals import Demand

DAMPING = 1.0
COLUMNS = (
    Column("c_n_s_per_m", "c", "N*s/m", "c", 0.0, 10.0, "Damping.", default=DAMPING),
    Column("mode", "mode", "1", "mode", 0.0, 1.0, "Mode.", default=0.0, choices=("off", "on")),
)
PARAMETERS = (Parameter("max_force_n", "N", 1.0, 1e5, "Greatest force.", (4000.0,)),)

class SetPoint(NamedTuple):
    c: float
    mode: float

class Params(NamedTuple):
    max_force: float

class State(NamedTuple):
    last: float

def params(settings, ramp, dt):
    return Params(settings["max_force_n"][0])

def start(params):
    return State(0.0)

def step(params, state, setpoint, motion, reference, deficit, dt):
    return state, Demand(0.0, 0.0, 0.0, reference - setpoint.c * motion.velocity)
"""
