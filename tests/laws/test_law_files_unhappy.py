"""Laws that cannot be used: every reason is reported with file, line and key, before a run."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rehearsing import CONFIGS
from rig_command import rig_here
from test_adding_a_law import PAGE, check, write_example

from rig import laws, plug_ins
from rig.campaign import law_checks
from rig.kinds.wavebot.tick import KIND, find_kind
from tests.docs.blocks import file_of

GOOD = file_of(PAGE, "growing_damping.py")
Write = Callable[..., Path]


@pytest.fixture(name="write")
def of_write(tmp_path: Path) -> Write:
    """Write the example with an edited law, and return the campaign's path."""

    def write(old: str = "", new: str = "", law: str = "") -> Path:
        path = write_example(tmp_path)
        assert old in GOOD
        text = law or GOOD.replace(old, new, 1) if old or law else GOOD
        (tmp_path / "growing_damping.py").write_text(text)
        return path

    return write


def only_problem(path: Path) -> dict[str, Any]:
    code, report = check(path)
    assert code == 2, report
    (problem,) = report["problems"]
    assert problem["line"] == 7
    assert problem["key"] in ("law", "law.use")
    assert isinstance(problem, dict)
    return problem


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("def start(", "def begin(", "the function start is missing"),
        ("def start(params)", "def start()", "the function start takes 0 arguments, not 1"),
        ("class State(", "class Memory(", "the NamedTuple State is missing"),
        ('"c1", "N*s/m^2"', '"c2", "N*s/m^2"', "COLUMNS have the names c0, c2, but SetPoint"),
        ("    max_force: float", "    max_force: str", "Params.max_force is of type str"),
        ("    c1: Ramp", "    c1: list[float]", "State.c1 is of type list"),
        ("    c1: float", "    c1: int", "SetPoint.c1 is not a float"),
        ("0.0, 20_000.0", "1.0, -1.0", "the range of c0_n_s_per_m is 1 .. -1"),
        ("c1_n_s_per_m2", "c0_n_s_per_m", "COLUMNS has the key c0_n_s_per_m twice"),
        ("COLUMNS = (", "COLUMNS = [", "cannot be imported"),
        ("from controllers.law import", "from controllers.lore import", "ModuleNotFoundError"),
    ],
)
def test_module_that_is_no_law(write: Write, old: str, new: str, message: str) -> None:
    assert message in only_problem(write(old, new))["message"]


def test_every_fault_of_the_interface_is_reported_at_once(write: Write) -> None:
    message = only_problem(write(law='"""Nothing."""\n'))["message"]
    for part in ("function params", "function start", "function step", "COLUMNS", "PARAMETERS"):
        assert part in message
    assert "linear" not in message


def test_syntax_error_is_reported_with_its_line(write: Write) -> None:
    message = only_problem(write("    damping = ", "    damping == = "))["message"]
    line = GOOD[: GOOD.index("    damping = ")].count("\n") + 1
    assert f"growing_damping.py:{line}: SyntaxError" in message


def test_missing_file_and_unknown_name(write: Write) -> None:
    path = write()
    (path.parent / "growing_damping.py").unlink()
    assert "cannot be read: No such file" in only_problem(path)["message"]
    path.write_text(path.read_text().replace("./growing_damping.py", "latchin"))
    message = only_problem(path)["message"]
    assert "no law 'latchin' is registered; allowed impedance, velocity table" in message


def test_column_with_the_name_of_another_is_refused(write: Write) -> None:
    path = write("c1_n_s_per_m2", "bus_voltage_v")
    assert "has the name of another column" in only_problem(path)["message"]


def test_all_invalid_parameters_are_reported_at_once(write: Write) -> None:
    path = write()
    keys = "hold_stiffness_n_per_m: 0, arming_speed_m_per_s: fast, stiffness: 1"
    text = path.read_text().replace("./growing_damping.py, max_force_n: 3000", f"latching, {keys}")
    text = text.replace("c0_n_s_per_m: [1000, 2000], c1_n_s_per_m2: [0, 5000, 10000]", "kp: 1")
    path.write_text(text)
    code, report = check(path)
    assert code == 2
    messages = {problem["key"]: problem["message"] for problem in report["problems"]}
    assert messages["law.hold_stiffness_n_per_m"] == "0 is out of range; allowed 1 .. 10000000 N/m"
    assert messages["law.hold_damping_n_s_per_m"].startswith("missing; allowed 0 .. 1000000")
    assert messages["law.arming_speed_m_per_s"].startswith("'fast' is not a number")
    assert messages["law.stiffness"].startswith("unknown key")
    assert messages["matrix.grid[0].latch_s"].startswith("missing; allowed 0 .. 10 s")
    assert messages["matrix.grid[0].kp"] == "unknown key; did you mean kp_n_s_per_m?"


def test_unknown_column_names_those_of_the_law(write: Write) -> None:
    path = write()
    path.write_text(path.read_text().replace("c1_n_s_per_m2: [0", "ki_n_per_m: 0, quick: [0"))
    _, report = check(path)
    messages = {problem["key"]: problem["message"] for problem in report["problems"]}
    known = "unknown key; known are spring_n_per_m, c0_n_s_per_m, c1_n_s_per_m2, reference_scale"
    assert messages["matrix.grid[0].quick"].startswith(known)
    assert "matrix.grid[0].ki_n_per_m" in messages


def test_settings_that_do_not_fit_together(write: Write) -> None:
    path = write()
    text = path.read_text().replace(
        "./growing_damping.py, max_force_n: 3000",
        "velocity table, velocity_m_per_s: [-1, 1], force_n: [-500, -500]",
    )
    text = text.replace(
        "c0_n_s_per_m: [1000, 2000], c1_n_s_per_m2: [0, 5000, 10000]",
        "table_scale: 1, retract_factor: 1",
    )
    path.write_text(text)
    message = only_problem(path)["message"]
    assert message.startswith("force_n is -500 where velocity_m_per_s is -1")


def test_set_point_of_the_lead_in_is_of_the_impedance_law(write: Write) -> None:
    path = write()
    start = "start: {set_point: {kp_n_s_per_m: -1, ki_n_per_m: 0}, set_point_s: 1"
    path.write_text(path.read_text().replace("start: {set_point_s: 1", start))
    _, report = check(path)
    (problem,) = report["problems"]
    assert problem["key"] == "start.set_point"
    assert problem["message"].startswith("only the impedance law has these gains")


# --- the trial


def test_exception_in_a_trial_is_reported_with_the_laws_line(write: Write) -> None:
    path = write(
        "    damping = c0.value", "    distance = 1.0 / setpoint.c1\n    damping = c0.value"
    )
    message = only_problem(path)["message"]
    line = GOOD[: GOOD.index("    damping = ")].count("\n") + 1
    assert "raised an exception in tick 0 of a trial" in message
    assert f"growing_damping.py:{line}: ZeroDivisionError" in message
    assert message.endswith("(row 0: c0 1000 N*s/m, c1 0 N*s/m^2)")


def test_force_that_is_not_a_number(write: Write) -> None:
    path = write("force + reference", "force * (1e308 * damping)")
    assert "demands -inf in tick" in only_problem(path)["message"]


def test_hidden_memory_is_found(write: Write) -> None:
    law = GOOD.replace("class SetPoint", "CALLS = [0]\n\n\nclass SetPoint", 1)
    law = law.replace("    distance =", "    CALLS[0] += 1\n    distance =", 1)
    law = law.replace("force + reference", "force + reference + 0.001 * CALLS[0]", 1)
    message = only_problem(write(law=law))["message"]
    assert "keeps memory outside its State: two equal trials differ first in tick 0" in message
    assert "-0.627319 and 1.37268" in message


@pytest.mark.parametrize(
    ("code", "finding"),
    [
        ("x = motion.velocity**2", "**, whose bits differ compiled: multiply in step"),
        ("x = {1: 2.0}", "a dict in step"),
        ("x = [motion.velocity]", "a list in step"),
        ("print(motion.velocity)", "print, which delays the tick in step"),
        ("state = state._replace()", "_replace: write all fields in step"),
        ("x = math.hypot(1.0, 2.0)", "hypot, whose bits differ compiled in step"),
        ("x = helper(1.0)", "a text in helper"),
    ],
)
def test_broken_rules_are_named_with_their_line(code: str, finding: str, write: Write) -> None:
    """A rehearsal does not print what the law prints."""
    helper = 'def helper(x: float) -> float:\n    return x if "a" else 0.0\n\n\n'
    law = GOOD.replace("    distance = motion", f"    {code}\n    distance = motion", 1)
    law = law.replace("def step(", f"{helper}def step(", 1)
    law = law.replace("\nfrom typing", "\nimport math\nfrom typing", 1)
    part = 'x if "a"' if "helper" in finding else code
    line = law.partition(part)[0].count("\n") + 1
    _, out, _ = rig_here("check", write(law=law))
    assert f"growing_damping.py:{line}: {finding}; " in out


def test_a_law_that_drives_the_body_is_a_warning(write: Write) -> None:
    good = check(write())[1]["warnings"]
    assert not any("drives the body" in each["message"] for each in good)
    found = check(write("force + reference", "-force + reference"))[1]["warnings"]
    (text,) = [each["message"] for each in found if "drives the body" in each["message"]]
    assert "force times velocity is +" in text


def test_each_set_point_is_tried_twice(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """Problems and warnings come from the same two trials."""
    path, tried = write(), list[Any]()
    swing = law_checks._swing
    monkeypatch.setattr(law_checks, "_swing", lambda *given: tried.append(given) or swing(*given))
    report = check(path)[1]
    assert report["ok"]
    assert len(tried) == 2 * report["rows"] > 0


def test_a_unit_that_contradicts_its_key_is_refused(write: Write) -> None:
    message = only_problem(write('"N*s/m"', '"N*s"'))["message"]
    assert message == "the key c0_n_s_per_m ends with the unit N*s/m, but its unit is 'N*s'"


@pytest.mark.parametrize("key", ["c0_n_s_per_m", "c0_kn_s_per_m", "c0"])
def test_a_multiple_of_an_si_unit_is_refused_with_its_factor(key: str, write: Write) -> None:
    law = GOOD.replace('"c0_n_s_per_m", "c0", "N*s/m"', f'"{key}", "c0", "kN*s/m"')
    path = write(law=law)
    path.write_text(path.read_text().replace("c0_n_s_per_m", key))
    assert only_problem(path)["message"] == (
        f"the unit of {key} is 'kN*s/m', and laws have SI units: "
        "write the value in N*s/m, 1 kN*s/m = 1000 N*s/m"
    )
    law = GOOD.replace('"c0_n_s_per_m"', '"c0_kn_s_per_m"')
    path = write(law=law)
    path.write_text(path.read_text().replace("c0_n_s_per_m", "c0_kn_s_per_m"))
    assert only_problem(path)["message"] == (
        "the key c0_kn_s_per_m ends with the unit kN*s/m, but its unit is 'N*s/m': "
        "write the value in N*s/m, 1 kN*s/m = 1000 N*s/m"
    )


def test_any_exception_of_params_is_named_with_its_line(write: Write) -> None:
    message = only_problem(write('settings["max_force_n"]', 'settings["force"]'))["message"]
    assert "params of the law growing_damping raised an exception: " in message
    assert message.endswith("growing_damping.py:33: KeyError: 'force'")


def test_law_that_cannot_be_compiled_runs_but_is_not_swept(write: Write) -> None:
    path = write(
        "    distance = motion", '    unit = float(f"{1.0}")\n    distance = unit * motion'
    )
    code, out, _ = rig_here("check", path)
    assert code == 0
    rule, warning = [line for line in out.splitlines() if line.startswith("warning: ")]
    line = path.with_name("growing_damping.py").read_text().split("unit = float")[0].count("\n") + 1
    assert f"growing_damping.py:{line}: a text in step" in rule
    assert "the law cannot be compiled, so it runs interpreted and no sweep has it: " in warning
    code, _, err = rig_here("sweep", path, "--sweeps", path.parent / "sweeps")
    assert code == 2
    assert "a sweep runs compiled code, but the law cannot be compiled: " in err


# --- processes and the registry


def test_loop_process_refuses_a_changed_file(write: Write) -> None:
    law = laws.load_file(write().parent / "growing_damping.py")
    request = laws.to_request(law)
    assert find_kind(request) is not KIND
    assert find_kind("") is KIND
    Path(law.path).write_text(GOOD + "\n# edited\n")
    with pytest.raises(laws.LawError, match="changed after the check: sha256"):
        find_kind(request)


def test_equal_sources_are_one_law(write: Write, tmp_path: Path) -> None:
    first = laws.load_file(write().parent / "growing_damping.py")
    (tmp_path / "copy.py").write_text(GOOD)
    second = laws.load_file(tmp_path / "copy.py")
    assert first.module is second.module
    assert (first.name, second.name) == ("growing_damping", "copy")
    assert laws.source_text(first) == GOOD


@pytest.fixture(name="install")
def of_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Put a distribution with one entry point on the path, as an installer does."""

    def install(distribution: str, name: str, module: str, source: str) -> None:
        folder = tmp_path / distribution
        info = folder / f"{distribution.replace('-', '_')}-2.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Name: {distribution}\nVersion: 2.0\n")
        (info / "entry_points.txt").write_text(f"[{laws.GROUP}]\n{name} = {module}\n")
        (folder / f"{module}.py").write_text(source)
        monkeypatch.syspath_prepend(str(folder))
        plug_ins._entries.cache_clear()

    yield install
    plug_ins._entries.cache_clear()


def test_registered_law_of_another_distribution(install: Any, write: Write) -> None:
    install("growing-laws", "growing damping", "growing_law_module", GOOD)
    law = laws.find("growing damping")
    assert (law.origin, law.is_file) == ("growing-laws 2.0", False)
    path = write()
    path.write_text(path.read_text().replace("./growing_damping.py", "growing damping"))
    code, out, _ = rig_here("check", path)
    assert code == 0
    assert "law       growing damping (growing-laws 2.0, sha256 " in out


def test_two_distributions_with_one_name(install: Any) -> None:
    install("laws-one", "twofold", "twofold_module_one", GOOD)
    install("laws-two", "twofold", "twofold_module_two", GOOD)
    with pytest.raises(
        laws.LawError, match="two distributions register the law 'twofold'"
    ) as error:
        laws.find("twofold")
    assert "laws-one 2.0 (twofold_module_one)" in str(error.value)
    assert "laws-two 2.0 (twofold_module_two)" in str(error.value)
    assert laws.find("latching").name == "latching"


def test_broken_plug_in_is_an_error_only_where_it_is_used(install: Any) -> None:
    install("broken-laws", "broken", "broken_law_module", "import nothing_of_this_name\n")
    assert laws.find("latching").name == "latching"
    with pytest.raises(laws.LawError, match=r"broken_law_module\.py:1: ModuleNotFoundError"):
        laws.find("broken")
    code, out, _ = rig_here("laws", "--json")
    assert code == 0
    by_name = {entry["name"]: entry for entry in json.loads(out)["laws"]}
    assert "broken_law_module.py:1" in by_name["broken"]["problem"]
    assert by_name["broken"]["origin"] == "broken-laws 2.0"
    assert [column["key"] for column in by_name["latching"]["columns"]] == [
        "kp_n_s_per_m", "latch_s",
    ]  # fmt: skip


def test_entry_points_are_the_table_of_own_laws() -> None:
    project = tomllib.loads((CONFIGS.parent / "pyproject.toml").read_text())["project"]
    assert project["entry-points"][laws.GROUP] == laws.OWN_MODULES


def test_list_of_laws_shows_columns_and_parameters(write: Write) -> None:
    code, out, _ = rig_here("laws")
    assert code == 0
    assert "latch_s                    0 .. 10 s\n" in out
    assert "velocity_m_per_s           -20 .. 20 m/s, a list; required" in out
    path = write().parent / "growing_damping.py"
    code, out, _ = rig_here("laws", path)
    assert code == 0
    assert out.startswith("growing_damping   (")
    path.write_text("")
    assert rig_here("laws", path)[0] == 2
    code, out, _ = rig_here("laws", "latching", "impedance")
    assert code == 0
    assert out.startswith("latching   (wec-rig ")
    assert "\nimpedance   (wec-rig " in out
    code, out, _ = rig_here("laws", "latch")
    assert code == 2
    assert "no law 'latch' is registered; allowed impedance, " in out
