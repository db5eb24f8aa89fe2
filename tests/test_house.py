"""Rules of this project that no linter checks."""

from __future__ import annotations

import ast
import re
import subprocess
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from costly_tests import COSTLY_PARTS, costly_parts, part_of
from ruamel.yaml import YAML

from rig.kinds.registry import OWN_PACKAGES

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("controllers", "drivers", "rig", "sim_plant")
SOURCES = sorted(path for name in PACKAGES for path in (ROOT / name).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
LAWS = sorted((ROOT / "controllers").rglob("*.py"))

# Files that may read a clock or sleep, each with the reason. Formatting a date does not count.
CLOCK_USERS = {
    "rig/realtime/clock.py": "the loop's clock",
    "rig/processes/loop_process.py": "the age of the supervisor's heartbeat; real clock only",
    "rig/realtime/loop.py": "duration of a tick; real clock only",
    "rig/compilation/cache_folder.py": "age of compiled code that nothing uses",
    "rig/recording/ring.py": "the writer waits for a full ring on the virtual clock",
    "rig/processes/logger.py": "flushes by the second, retries a stalled disk",
    "rig/processes/last_logger.py": "time without a saved row after the end of the loop",
    "rig/processes/supervisor.py": "polls its children; ties a run to UTC",
    "rig/campaign/choosing.py": "looks at the run for the next choice; no loop runs there",
    "rig/execution/choosing_process.py": "asks for the end again until the run takes it",
    "rig/execution/fault_runs.py": "the time from a fault until no motor has power",
    "rig/execution/process_faults.py": "the time at which a process was killed",
    "rig/execution/task.py": "dates the run and names its folder; time between two Ctrl-C",
    "rig/people/orders.py": "the seat's lease, arming, and the dead man's time",
    "rig/people/request_socket.py": "rate of the requests of a client",
    "rig/processes/tick_compiler.py": "looks whether its run still goes on",
    "rig/processes/child.py": "time since the last progress of a child",
    "rig/processes/io_processes.py": "timeout for an I/O process to become ready",
    "rig/sweeps/cluster.py": "duration of a chunk of cases, which sets the size of the next",
    "rig/wires/": "time of a request; I/O processes, first SYNCs",
    "rig/kinds/oswec_bench/hardware/": "ages of received values",
    "rig/kinds/modular/from_bem.py": "the duration of a fit, for its report",
    "rig/api/": "progress for people; the day of a run",
    "rig/cli/": "progress for people",
    "rig/page/": "when to ask and to send; the speed of a replay; no loop runs there",
    "rig/host/": "measures clocks and disk; no loop runs there",
    "sim_plant/emulators/ethercat/wire.py": "frames and time of the emulated segment",
    "drivers/": "the deadline of a conversation; links and their processes only",
}
ENUMS = {"IntEnum", "IntFlag"}
FORBIDDEN_IN_LAWS = (
    *(ast.Try, ast.TryStar, ast.With, ast.Global, ast.Nonlocal, ast.Lambda, ast.Yield),
    *(ast.ListComp, ast.DictComp, ast.SetComp, ast.GeneratorExp, ast.AsyncFunctionDef),
)
PURE = {"math", "cmath", "typing", "enum", "controllers"}
VAGUE = re.compile(r"(^|_)(utils?|helpers?|common|misc)(_|$)")
SIMULATION_BRANCH = re.compile(r"simulat|mock|debug|replay", re.IGNORECASE)

# Files of the loop process: a branch that only a simulation takes is untested on the rig.
LOOP_SOURCES = [
    *LAWS,
    *(ROOT / "drivers").rglob("*.py"),
    *(ROOT / "rig" / "realtime").rglob("*.py"),
    *(path for path in (ROOT / "rig" / "kinds").rglob("*.py") if path.name != "build.py"),
    *(ROOT / "rig" / "processes" / f"{name}.py" for name in ("loop_process", "mailbox")),
    *(ROOT / "rig" / "recording" / f"{name}.py" for name in ("ring", "row_layout")),
]


def relative_name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def parse_file(path: Path) -> ast.Module:
    return ast.parse(path.read_text(), relative_name(path))


def imports(tree: ast.AST) -> Iterator[str]:
    """Yield the full names of all modules imported anywhere in a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""


def test_source_lists_are_complete() -> None:
    assert len(LAWS) >= 6
    assert len(SOURCES) > 50
    assert all(path.exists() for path in LOOP_SOURCES)


@pytest.mark.parametrize("path", LAWS, ids=relative_name)
def test_a_law_is_functions_over_named_tuples(path: Path) -> None:
    tree = parse_file(path)
    roots = {module.split(".")[0] for module in imports(tree)}
    assert roots <= PURE, f"imports {roots - PURE}"
    for node in ast.walk(tree):
        where = f"{relative_name(path)}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.ClassDef):
            bases = {ast.unparse(base) for base in node.bases}
            assert bases == {"NamedTuple"} or bases <= ENUMS, f"{where}: class {node.name}"
            assert bases, f"{where}: class {node.name} has no base"
            assert not node.decorator_list, f"{where}: decorated"
            methods = [item for item in node.body if isinstance(item, ast.FunctionDef)]
            assert not methods, f"{where}: {node.name} has methods"
        if isinstance(node, ast.FunctionDef):
            assert not node.decorator_list, f"{where}: decorated"
        assert not isinstance(node, ast.Pow), f"{relative_name(path)}: ** is not the same compiled"
        assert not isinstance(node, FORBIDDEN_IN_LAWS), where
        if isinstance(node, ast.Attribute):
            assert node.attr not in ("_replace", "pow", "hypot", "fmod"), f"{where}: {node.attr}"


def test_every_field_of_signals_has_a_unit() -> None:
    tree = parse_file(ROOT / "controllers" / "signals.py")
    units = {
        node.targets[0].id: ast.unparse(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    assert all(re.fullmatch(r"Annotated\[(float|int), '[^']+'\]", u) for u in units.values())
    signals = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    signal_names = {signal.name for signal in signals}  # a signal may contain signals
    assert len(signals) >= 7
    for signal in signals:
        for field in signal.body:
            if isinstance(field, ast.AnnAssign):
                hint = ast.unparse(field.annotation)
                assert hint in units or hint in signal_names, (
                    f"{signal.name}.{ast.unparse(field.target)}: {hint}"
                )


def test_parameters_of_laws_have_units() -> None:
    """Every float of a NamedTuple has a unit, in a comment or by a type of signals."""
    for path in LAWS:
        lines = path.read_text().splitlines()
        for node in (node for node in ast.walk(parse_file(path)) if isinstance(node, ast.ClassDef)):
            for field in node.body:
                if isinstance(field, ast.AnnAssign) and "float" in ast.unparse(field.annotation):
                    line = lines[field.lineno - 1]
                    has_unit = "#" in line or node.name == "Ramp"  # a ramp may have any unit
                    assert has_unit, f"{relative_name(path)}:{field.lineno}: {line.strip()}"


def reads_clock(tree: ast.AST) -> bool:
    """Return True if code imports `time`, or uses `now` or `today` of datetime's classes."""
    calls = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node.value).split(".")[-1] == "datetime"
    }
    roots = {module.split(".")[0] for module in imports(tree)}
    return bool(roots & {"time", "sched"} or calls & {"now", "today", "utcnow"})


def test_only_listed_files_read_a_clock() -> None:
    found = {relative_name(path) for path in SOURCES if reads_clock(parse_file(path))}
    assert {name for name in found if not name.startswith(tuple(CLOCK_USERS))} == set()
    for name in found:
        if name.startswith("drivers/"):
            assert "codec" not in name
    for allowed in CLOCK_USERS:  # every permission is still needed
        assert allowed == "drivers/" or any(name.startswith(allowed) for name in found), allowed


def test_loop_reads_the_clock_only_to_measure_its_work() -> None:
    tree = parse_file(ROOT / "rig" / "realtime" / "loop.py")
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "time"
    }
    assert used == {"perf_counter"}


def test_files_are_short() -> None:
    """A file must be readable at one sitting."""
    for path in (*SOURCES, *TESTS):
        assert len(path.read_text().splitlines()) <= 600, relative_name(path)
    for name, lines in (("loop", 160), ("cycle", 180)):
        assert len((ROOT / "rig" / "realtime" / f"{name}.py").read_text().splitlines()) <= lines


def test_file_names_are_specific() -> None:
    for path in (*SOURCES, *TESTS):
        for part in path.relative_to(ROOT).with_suffix("").parts:
            assert not VAGUE.search(part), relative_name(path)


def test_test_files_have_different_names() -> None:
    """The tests are not packages, so two files of one name would hide each other."""
    excluded = ("conftest.py", "__init__.py")  # the latter of packages that tests install
    names = [path.name for path in TESTS if path.name not in excluded]
    assert sorted({name for name in names if names.count(name) > 1}) == []


@pytest.mark.parametrize("path", LOOP_SOURCES, ids=relative_name)
def test_loop_has_no_branch_for_simulation(path: Path) -> None:
    for node in ast.walk(parse_file(path)):
        if isinstance(node, ast.If | ast.IfExp | ast.While | ast.comprehension):
            tests = node.ifs if isinstance(node, ast.comprehension) else [node.test]
            for test in tests:
                text = ast.unparse(test)
                assert not SIMULATION_BRANCH.search(text), (
                    f"{relative_name(path)}:{test.lineno}: {text}"
                )


@pytest.mark.parametrize(
    ("text", "bad"),
    [
        ("if simulating: pass", True),
        ("x = 1 if self.mock else 2", True),
        ("if stopped: pass", False),
    ],
)
def test_simulation_branches_are_found(text: str, bad: bool) -> None:
    found = [
        SIMULATION_BRANCH.search(ast.unparse(node.test))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.If | ast.IfExp)
    ]
    assert bool(found[0]) is bad


def test_codecs_are_pure() -> None:
    """A codec converts bytes to messages and back; it imports nothing that can block."""
    for path in (ROOT / "drivers").rglob("*codec*.py"):
        roots = {module.split(".")[0] for module in imports(parse_file(path))}
        assert roots <= {"struct", "enum", "typing", "math", "drivers", "collections"}, path


def test_import_contracts_are_complete() -> None:
    """`make lint` runs the contracts; this test asserts that none was removed."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    linter = settings["importlinter"]
    assert set(linter["root_packages"]) == set(PACKAGES)
    forbidden: dict[str, set[str]] = {}
    for contract in linter["contracts"]:
        if contract["type"] == "forbidden":
            for source in contract["source_modules"]:  # may be in several contracts
                forbidden.setdefault(source, set()).update(contract["forbidden_modules"])
    assert forbidden["controllers"] >= {"drivers", "rig", "sim_plant", "numpy"}
    assert forbidden["drivers"] >= {"controllers", "rig", "sim_plant"}
    assert forbidden["sim_plant"] >= {"controllers", "drivers", "rig"}
    own = set(OWN_PACKAGES.values())
    assert {name for name in forbidden["rig.sweeps"] if name.startswith("rig.kinds")} == own
    (kinds,) = (each for each in linter["contracts"] if each["name"].startswith("Kinds of rig"))
    assert set(kinds["modules"]) == own
    assert settings["pytest"]["ini_options"]["filterwarnings"][0] == "error"


def test_the_long_form_of_the_tests_leaves_none_out() -> None:
    """The recipe's variables are expanded with the goal's own value of `LONG`."""
    recipe = (ROOT / "Makefile").read_text().partition("\ntest: setup\n")[2].partition("\n\n")[0]
    names = sorted({*re.findall(r"\$\(([A-Z_]+)\)", recipe)})
    shown = "\n".join(f"$(info $({name}))" for name in names if name != "MAKE")
    text = f"include Makefile\nshown: LONG := all\nshown: ; {shown.replace(chr(10), '')}@:\n"
    done = subprocess.run(
        ["make", "--no-print-directory", "--file", "-", "shown"],
        check=True, cwd=ROOT, input=text, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.count("--long all") == 3
    assert "--long part" not in done.stdout


def test_each_costly_test_is_in_a_part_of_its_own_entry() -> None:
    """One listed beside its file is drawn with its own part, whatever that of its file is."""
    parts = costly_parts(ROOT)
    own = [name for name, _ in parts if "::" in name]
    assert any((name.partition("::")[0], False) in parts for name in own)
    for name in own:
        for in_real_time in (False, True):
            part = part_of(parts, name, in_real_time=in_real_time)
            assert part == parts[name, in_real_time]
            assert part in range(COSTLY_PARTS)
    assert part_of(parts, "tests/test_house.py::test", in_real_time=False) is None


def test_git_hooks_run_the_commands_of_lint() -> None:
    hooks = YAML(typ="safe").load(ROOT / ".pre-commit-config.yaml")["repos"][0]["hooks"]
    lint = (ROOT / "Makefile").read_text().partition("\nlint: setup\n")[2].partition("\n\n")[0]
    commands = {re.sub(r" (\.|--check)(?= |$)", "", line) for line in lint.split("\n\t$(BIN)/")}
    assert {hook["entry"].removeprefix(".venv/bin/").removesuffix(" --fix") for hook in hooks} == {
        command.strip().removeprefix("$(BIN)/") for command in commands
    }


def module_name(path: Path, root: Path) -> str:
    """Return the dotted name of a module or package from its file."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def import_graph(files: Iterable[Path], root: Path) -> dict[str, set[str]]:
    """Return the modules that each module imports anywhere: in functions and for types, too.

    An import from a package is one of the submodule, if the name is one.
    """
    modules = {module_name(path, root): path for path in files}
    graph: dict[str, set[str]] = {}
    for module, path in modules.items():
        names: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                parent = node.module or ""
                several = {f"{parent}.{alias.name}" for alias in node.names}
                names |= {name if name in modules else parent for name in several}
        graph[module] = (names & modules.keys()) - {module}
    return graph


def import_cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the sets of modules that import each other, by Tarjan's algorithm."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    cycles: list[list[str]] = []

    def visit(module: str) -> None:
        number[module] = lowest[module] = len(number)
        stack.append(module)
        for imported in sorted(graph[module]):
            if imported not in number:
                visit(imported)
                lowest[module] = min(lowest[module], lowest[imported])
            elif imported in stack:
                lowest[module] = min(lowest[module], number[imported])
        if lowest[module] == number[module]:
            component = stack[stack.index(module) :]
            del stack[-len(component) :]
            if len(component) > 1:
                cycles.append(sorted(component))

    for module in sorted(graph):
        if module not in number:
            visit(module)
    return cycles


def test_no_modules_import_each_other() -> None:
    graph = import_graph(SOURCES, ROOT)
    assert graph["rig.campaign.plan"] >= {"rig.campaign.kind", "rig.campaign.set_points"}
    assert import_cycles(graph) == []


def test_import_cycles_are_found(tmp_path: Path) -> None:
    """One over three modules, of which two imports are in a function and for types only."""
    texts = {
        "made/__init__.py": "from made.first import a\n",
        "made/first.py": "from made import second\na = 1\n",
        "made/second.py": "def f():\n    from made.part.third import b\n    return b\n",
        "made/part/__init__.py": "",
        "made/part/third.py": "if TYPE_CHECKING:\n    import made.first\nb = 2\n",
        "made/fourth.py": "import made.first, made.second, json\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    cycles = import_cycles(import_graph(sorted(tmp_path.rglob("*.py")), tmp_path))
    assert cycles == [["made.first", "made.part.third", "made.second"]]


def test_only_listed_packages_import_the_simulated_plant() -> None:
    users = ("rig/kinds/", "rig/emulation/", "rig/templates/kind/")
    for path in SOURCES:
        name = relative_name(path)
        if name.startswith(("sim_plant/", *users)):
            continue
        roots = {module.split(".")[0] for module in imports(parse_file(path))}
        assert "sim_plant" not in roots, name


# Names of kinds, of their tests, axes and sensors, which belong to the packages in rig/kinds.
KIND_NAMES = re.compile(
    r"(wavebot|oswec|modular|mask_?4"
    r"|(?<![a-z])(?:heave|surge|stator|flap|pitch|lcb|trs|string_pot|load_cell)(?=s?(?![a-z])))",
    re.IGNORECASE,
)
_OWN_KINDS = "the list of the kinds of this distribution"
_DEVICE = "a type of device, which drivers name as well"
_SCHEDULE = "the name of a published schedule of rows, for rigs of every kind"
# Such names in the core, each with the reason: "file: name".
CORE_TERMS = {
    "rig/kinds/registry.py: wavebot": _OWN_KINDS,
    "rig/kinds/registry.py: oswec": _OWN_KINDS,
    "rig/kinds/registry.py: modular": _OWN_KINDS,
    "rig/config/limits_file.py: load_cell": _DEVICE,
    "rig/config/wiring.py: load_cell": _DEVICE,
    "rig/emulation/devices.py: load_cell": _DEVICE,
    "rig/wires/streams.py: load_cell": _DEVICE,
    "rig/wires/survey.py: load_cell": _DEVICE,
    "rig/config/task_file.py: mask4": _SCHEDULE,
    "rig/planning/windows.py: mask4": _SCHEDULE,
}
# Axes and parts of single rigs, which comments and docstrings of the core do not name either.
AXIS_NAMES = re.compile(
    r"(?<![a-z])(heave|surge|stator|flap|lcb|trs|string_pot)(?=s?(?![a-z]))", re.IGNORECASE
)
CORE_EXAMPLES = {
    "rig/api/run.py: heave": "an example of a log field",
    "rig/api/section.py: heave": "an example of a key",
    "rig/emulation/control.py: heave": "an example of a request",
}


def names_in_code(text: str) -> str:
    """Return a source without its comments and docstrings, camel case as snake case."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            value = body[0].value
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                body[0] = ast.Pass()
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", ast.unparse(tree))


def core_files() -> Iterator[tuple[str, str]]:
    """Yield name and text of the sources outside the packages of kinds.

    Files of earlier rigs' formats (rig/interop/legacy) are theirs by name.
    """
    for path in SOURCES:
        name = relative_name(path)
        if name.startswith("rig/") and not re.match(r"rig/(kinds/.+/|interop/legacy/)", name):
            yield name, path.read_text()


def test_the_core_names_no_kind_no_axis_no_sensor() -> None:
    found = {
        f"{name}: {term.lower()}"
        for name, text in core_files()
        for term in KIND_NAMES.findall(f"{name} {names_in_code(text)}")
    }
    assert sorted(found - CORE_TERMS.keys()) == []
    assert sorted(CORE_TERMS.keys() - found) == [], "take them off the list"


def test_comments_of_the_core_name_no_axis() -> None:
    found = {
        f"{name}: {term.lower()}"
        for name, text in core_files()
        for term in AXIS_NAMES.findall(text)
    }
    assert sorted(found - CORE_EXAMPLES.keys()) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('f"{run}.heave.{name}"', True),
        ('x = {"lcb": 1.0}', True),
        ("f(surge=1)", True),
        ("class SurgeHold: pass", True),
        ("def onHeave(): pass", True),
        ("from rig.kinds.wavebot import tick", True),
        ("STATORS = 2  # positions", True),
        ("kind = 'modular'", True),
        ("class LoadCells: pass", True),
        ("def pitch(): pass", True),
        ("x = 'MASK4 structure'", True),
        ("pitched = 1", False),
        ('def f():\n    """Return the heave."""\n    return withheld.attrs', False),
        ("x = 1  # of surge", False),
    ],
)
def test_names_of_kinds_are_found(source: str, *, found: bool) -> None:
    assert bool(KIND_NAMES.search(names_in_code(source))) is found


# The first word of a docstring names a thing or an action. Two packages are under change.
QUESTION = re.compile(r"\s*(What|How|Who|Which|Where|When|Why|Whose|Whoever|Whatever)\b")


def questions(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line and first line of docstrings, also of attributes, that begin with a question."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            text = node.value.value
            if isinstance(text, str) and QUESTION.match(text):
                yield node.lineno, text.strip().splitlines()[0]


@pytest.mark.parametrize("folder", [*PACKAGES, "tests", "benchmarks"])
def test_docstrings_begin_with_a_thing_or_an_action(folder: str) -> None:
    found = [
        f"{relative_name(path)}:{line}: {text}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, text in questions(parse_file(path))
    ]
    assert found == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('"""What a rig is."""', True),
        ('class A:\n    """How it ends."""', True),
        ('def f():\n    """\n    Who asks."""', True),
        ('X = 1\n"""Which one."""', True),
        ('"""Whatsoever."""', False),
        ('def f():\n    """Return what a rig is."""\n    return "What?"', False),
    ],
)
def test_questions_in_docstrings_are_found(source: str, *, found: bool) -> None:
    assert bool(list(questions(ast.parse(source)))) is found


MAX_UNPACKED = 6


def own_names(tree: ast.Module) -> set[str]:
    """Return the classes, functions and module-level names that a file defines."""
    kinds = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    names = {node.name for node in ast.walk(tree) if isinstance(node, kinds)}
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        names |= {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return names


def long_unpackings(
    node: ast.AST, own: set[str], hints: dict[str, str] | None = None
) -> Iterator[str]:
    """Yield the values that are unpacked into more than `MAX_UNPACKED` names and are not a file's.

    A value is a file's if its first name, or the annotation of that parameter, is one of ``own``.
    """
    hints = hints or {}
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
        hints = hints | {each.arg: ast.unparse(each.annotation or each) for each in arguments}
    pairs: list[tuple[ast.expr, ast.expr]] = []
    if isinstance(node, ast.Assign):
        pairs = [(target, node.value) for target in node.targets]
    if isinstance(node, ast.For | ast.comprehension):
        pairs = [(node.target, node.iter)]
    for target, value in pairs:
        if isinstance(target, ast.Tuple | ast.List) and len(target.elts) > MAX_UNPACKED:
            source = value.generators[0].iter if isinstance(value, ast.GeneratorExp) else value
            first = ast.unparse(source)  # of a field, the type is unknown
            if isinstance(source, ast.Call):
                first = ast.unparse(source.func).partition(".")[0]
            if hints.get(first, first) not in own:
                yield ast.unparse(value)
    for child in ast.iter_child_nodes(node):
        yield from long_unpackings(child, own, hints)


def test_long_types_of_other_modules_are_read_by_name() -> None:
    found = {
        f"{relative_name(path)}: {value}"
        for path in SOURCES
        for tree in [parse_file(path)]
        for value in long_unpackings(tree, own_names(tree))
    }
    assert sorted(found) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("class State: ...\ndef f(x: State): a, b, c, d, e, g, h = x", []),
        ("from m import State\ndef f(x: State): a, b, c, d, e, g, h = x", ["x"]),
        ("from m import State\ndef f(x: State): a, b, c, d, e, g = x", []),
        ("FORM = Struct('<7d')\na, b, c, d, e, g, h = FORM.unpack(data)", []),
        ("def f(self): a, b, c, d, e, g, h = self.world.sense()", ["self.world.sense()"]),
        ("def f(p: Params): a, b, c, d, e, g, h = p.limits", ["p.limits"]),
        ("for a, b, c, d, e, g, h in config['blocks']: pass", ["config['blocks']"]),
        ("from m import Phase\na, b, c, d, e, g, h = (int(x) for x in Phase)",
         ["(int(x) for x in Phase)"]),
    ],
)  # fmt: skip
def test_long_unpackings_are_found(source: str, found: list[str]) -> None:
    tree = ast.parse(source)
    assert list(long_unpackings(tree, own_names(tree))) == found
