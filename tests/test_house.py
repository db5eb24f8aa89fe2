"""Rules of the house that no linter knows."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("controllers", "drivers", "rig", "sim_plant")
SOURCES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
LAWS = sorted((ROOT / "controllers").rglob("*.py"))

# Who may ask what time it is, or sleep, and why. Turning a date into words is not asking.
TIME = {
    "rig/realtime/clock.py": "the loop's clock",
    "rig/processes/loop_process.py": "the age of the supervisor's heartbeat; real clock only",
    "rig/realtime/loop.py": "how long a tick took; real clock only",
    "rig/recording/ring.py": "a full ring is waited for on the virtual clock",
    "rig/recording/logger.py": "flushes by the second, retries a stalled disk",
    "rig/processes/last_logger.py": "how long no row was saved, once the loop has ended",
    "rig/processes/supervisor.py": "looks at its children now and then; ties a run to UTC",
    "rig/execution/task.py": "dates the run and names its folder",
    "rig/processes/child.py": "how long a child has stood still",
    "rig/processes/io_processes.py": "a companion must be ready in time",
    "rig/sweep/cluster.py": "how long a chunk of cases took, so that the next is long enough",
    "rig/execution/hardware/": "when a value was asked for; processes beside the loop, first SYNCs",
    "rig/cli/": "progress for people",
    "rig/host/": "measures clocks and disk; no loop lives there",
    "drivers/": "the deadline of a conversation; links and their processes only",
}
ENUMS = {"IntEnum", "IntFlag"}
NOT_IN_A_LAW = (
    *(ast.Try, ast.TryStar, ast.With, ast.Global, ast.Nonlocal, ast.Lambda, ast.Yield),
    *(ast.ListComp, ast.DictComp, ast.SetComp, ast.GeneratorExp, ast.AsyncFunctionDef),
)
PURE = {"math", "typing", "enum", "controllers"}
VAGUE = re.compile(r"(^|_)(utils?|helpers?|common|misc)(_|$)")
PRETENCE = re.compile(r"simulat|mock|debug|replay", re.IGNORECASE)

# What runs in the loop process: a branch on being in a simulation would be one untested on the rig.
LOOP = [
    *LAWS,
    *(ROOT / "drivers").rglob("*.py"),
    *(ROOT / "rig" / "realtime").rglob("*.py"),
    *(path for path in (ROOT / "rig" / "kinds").rglob("*.py") if path.name != "build.py"),
    *(ROOT / "rig" / "processes" / f"{name}.py" for name in ("loop_process", "mailbox")),
    *(ROOT / "rig" / "recording" / f"{name}.py" for name in ("ring", "row_layout")),
]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), name_of(path))


def imports(tree: ast.AST) -> Iterator[str]:
    """Full names of all modules that are imported, anywhere in a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""


def test_the_house_is_there() -> None:
    assert len(LAWS) >= 6
    assert len(SOURCES) > 50
    assert all(path.exists() for path in LOOP)


@pytest.mark.parametrize("path", LAWS, ids=name_of)
def test_a_law_is_functions_over_named_tuples(path: Path) -> None:
    tree = tree_of(path)
    roots = {module.split(".")[0] for module in imports(tree)}
    assert roots <= PURE, f"imports {roots - PURE}"
    for node in ast.walk(tree):
        where = f"{name_of(path)}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.ClassDef):
            bases = {ast.unparse(base) for base in node.bases}
            assert bases == {"NamedTuple"} or bases <= ENUMS, f"{where}: class {node.name}"
            assert bases, f"{where}: class {node.name} has no base"
            assert not node.decorator_list, f"{where}: decorated"
            methods = [item for item in node.body if isinstance(item, ast.FunctionDef)]
            assert not methods, f"{where}: {node.name} has methods"
        if isinstance(node, ast.FunctionDef):
            assert not node.decorator_list, f"{where}: decorated"
        assert not isinstance(node, ast.Pow), f"{name_of(path)}: ** is not the same compiled"
        forbidden = (
            ast.Try,
            ast.TryStar,
            ast.Global,
            ast.Nonlocal,
            ast.Lambda,
            ast.Yield,
            ast.With,
        )
        assert not isinstance(node, (*forbidden, ast.AsyncFunctionDef, ast.ListComp)), where
        if isinstance(node, ast.Attribute):
            assert node.attr not in ("_replace", "pow", "hypot", "fmod"), f"{where}: {node.attr}"


def test_every_word_in_signals_has_a_unit() -> None:
    tree = tree_of(ROOT / "controllers" / "signals.py")
    units = {
        node.targets[0].id: ast.unparse(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    assert all(re.fullmatch(r"Annotated\[(float|int), '[^']+'\]", u) for u in units.values())
    words = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    named = {word.name for word in words}  # a word may be made of words
    assert len(words) >= 7
    for word in words:
        for field in word.body:
            if isinstance(field, ast.AnnAssign):
                hint = ast.unparse(field.annotation)
                assert hint in units or hint in named, (
                    f"{word.name}.{ast.unparse(field.target)}: {hint}"
                )


def test_the_fields_of_a_laws_parameters_say_their_unit() -> None:
    """In a comment or by a type of signals, beside every float of a NamedTuple."""
    for path in LAWS:
        lines = path.read_text().splitlines()
        for word in (node for node in ast.walk(tree_of(path)) if isinstance(node, ast.ClassDef)):
            for field in word.body:
                if isinstance(field, ast.AnnAssign) and "float" in ast.unparse(field.annotation):
                    line = lines[field.lineno - 1]
                    said = "#" in line or word.name == "Ramp"  # a ramp is of any unit
                    assert said, f"{name_of(path)}:{field.lineno}: {line.strip()}"


def asks_the_time(tree: ast.AST) -> bool:
    """Imports `time`, or calls the `now` or `today` of datetime's classes."""
    dated = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node.value).split(".")[-1] == "datetime"
    }
    roots = {module.split(".")[0] for module in imports(tree)}
    return bool(roots & {"time", "sched"} or dated & {"now", "today", "utcnow"})


def test_only_who_may_asks_the_time() -> None:
    found = {name_of(path) for path in SOURCES if asks_the_time(tree_of(path))}
    assert {name for name in found if not name.startswith(tuple(TIME))} == set()
    for name in found:
        if name.startswith("drivers/"):
            assert "codec" not in name
    for allowed in TIME:  # no permission outlives its use
        assert allowed == "drivers/" or any(name.startswith(allowed) for name in found), allowed


def test_the_loop_reads_no_clock_but_for_the_work_figure() -> None:
    tree = tree_of(ROOT / "rig" / "realtime" / "loop.py")
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "time"
    }
    assert used == {"perf_counter"}


def test_rooms_can_be_held_in_the_head() -> None:
    """A subject stays in one file as long as one can read it at one sitting."""
    for path in (*SOURCES, *TESTS):
        assert len(path.read_text().splitlines()) <= 600, name_of(path)
    for name in ("loop", "cycle"):
        assert len((ROOT / "rig" / "realtime" / f"{name}.py").read_text().splitlines()) <= 160


def test_no_room_has_a_name_that_says_nothing() -> None:
    for path in (*SOURCES, *TESTS):
        for part in path.relative_to(ROOT).with_suffix("").parts:
            assert not VAGUE.search(part), name_of(path)


def test_test_files_have_different_names() -> None:
    """There are no packages among the tests, so two of one name would hide each other."""
    names = [path.name for path in TESTS if path.name != "conftest.py"]
    assert sorted({name for name in names if names.count(name) > 1}) == []


@pytest.mark.parametrize("path", LOOP, ids=name_of)
def test_nothing_in_the_loop_asks_whether_it_is_real(path: Path) -> None:
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.If | ast.IfExp | ast.While | ast.comprehension):
            tests = node.ifs if isinstance(node, ast.comprehension) else [node.test]
            for test in tests:
                text = ast.unparse(test)
                assert not PRETENCE.search(text), f"{name_of(path)}:{test.lineno}: {text}"


@pytest.mark.parametrize(
    ("text", "bad"),
    [("if simulating: pass", True), ("x = 1 if self.mock else 2", True), ("if held: pass", False)],
)
def test_the_word_list_finds_its_words(text: str, bad: bool) -> None:
    found = [
        PRETENCE.search(ast.unparse(node.test))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.If | ast.IfExp)
    ]
    assert bool(found[0]) is bad


def test_codecs_are_pure() -> None:
    """A codec turns bytes to words and back: nothing it could wait for is in reach."""
    for path in (ROOT / "drivers").rglob("*codec*.py"):
        roots = {module.split(".")[0] for module in imports(tree_of(path))}
        assert roots <= {"struct", "enum", "typing", "math", "drivers", "collections"}, path


def test_import_contracts_stand_in_the_project_file() -> None:
    """`make lint` runs them; here only that none was dropped."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    linter = settings["importlinter"]
    assert set(linter["root_packages"]) == set(PACKAGES)
    forbidden: dict[str, set[str]] = {}
    for contract in linter["contracts"]:
        if contract["type"] == "forbidden":
            for source in contract["source_modules"]:  # may stand in several
                forbidden.setdefault(source, set()).update(contract["forbidden_modules"])
    assert forbidden["controllers"] >= {"drivers", "rig", "sim_plant", "numpy"}
    assert forbidden["drivers"] >= {"controllers", "rig", "sim_plant"}
    assert forbidden["sim_plant"] >= {"controllers", "drivers", "rig"}
    assert settings["pytest"]["ini_options"]["filterwarnings"][0] == "error"


def test_only_a_few_doors_lead_to_the_simulated_plant() -> None:
    doors = ("rig/execution/rehearsal/", "rig/sweep/", "rig/design/predictions/")
    for path in SOURCES:
        name = name_of(path)
        if name.startswith(("sim_plant/", *doors)):
            continue
        roots = {module.split(".")[0] for module in imports(tree_of(path))}
        assert "sim_plant" not in roots, name
