"""Mutation tests of limits, safety and power checks: every branch taken, every mutant killed."""

from __future__ import annotations

import ast
import copy
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from core_checks import check_limits, check_safety
from core_stations import check_motor_power, check_wavebot_power_checks

RIG = Path(__file__).parents[2] / "rig"
CHECKS: dict[str, Callable[[Any], None]] = {
    "realtime/limits": check_limits,
    "realtime/safety": check_safety,
    "kinds/wavebot/tick/power_checks": check_wavebot_power_checks,
    "realtime/motor_power": check_motor_power,
}
MINIMUM = {  # mutants, branches
    "realtime/limits": (150, 10),
    "realtime/safety": (150, 10),
    "kinds/wavebot/tick/power_checks": (50, 3),
    "realtime/motor_power": (25, 3),
}

# Equivalent mutants: source line and change, with the reason why both behave alike.
EQUIVALENT = {
    "realtime/limits.py": {
        "total = current + encoder_age + drive_age + position + velocity + acceleration": {
            "+ -> -": "a difference is finite exactly when the sum is: no term is lost",
        },
        "force = ceiling if force > 0.0 else -ceiling": {
            "force > 0.0 -> force >= 0.0": "a force beyond its ceiling is not zero",
            "0.0 -> 1.0": "a force beyond its ceiling is not below 1 N in any rig file",
        },
    },
    "realtime/safety.py": {
        "if request != REQUEST_NONE:": {
            "request != REQUEST_NONE -> True": "no request carries no reason, only time is saved",
        },
        "elif trip != NO_REASON:": {
            "trip != NO_REASON -> False": "TRIP_1 and STOP have the same column in the table",
        },
    },
}


class Mutant(NamedTuple):
    line: int
    change: str
    operator: str  # "+ -> -" if only the operator changed
    code: ast.Module


COMPARE: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.BitOr: ast.BitAnd,
}
CELLS = ("_OFF", "_ENA", "_RUN", "_ST2", "_ST1", "_ST0")


def replacements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the replacements of one expression."""
    new = copy.deepcopy(node)
    match new:
        case ast.Compare(ops=ops):
            for i, op in enumerate(ops):
                for other in COMPARE[type(op)]:
                    mutated = copy.deepcopy(new)
                    mutated.ops[i] = other()
                    yield mutated
        case ast.BinOp():
            new.op = ARITHMETIC[type(new.op)]()
            yield new
        case ast.BoolOp(op=op):
            new.op = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield new
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield new.operand
        case ast.IfExp():
            new.body, new.orelse = new.orelse, new.body
            yield new
        case ast.Constant(value=bool() | str()):
            pass
        case ast.Constant(value=int() | float() as value):
            yield ast.Constant(value + 1)
            if value:
                yield ast.Constant(type(value)(0))
        case ast.Name(id=name) if name in CELLS and isinstance(new.ctx, ast.Load):
            yield ast.Name(CELLS[(CELLS.index(name) + 1) % len(CELLS)], ast.Load())
        case ast.Attribute(value=ast.Name(id="Reason")):
            other = "DRIVE_FAULT" if new.attr != "DRIVE_FAULT" else "VELOCITY"
            yield ast.Attribute(new.value, other, ast.Load())
        case ast.Attribute(value=ast.Name(id="LimitFlag")):
            other = "MODE" if new.attr != "MODE" else "SLEW"
            yield ast.Attribute(new.value, other, ast.Load())


def expressions(tree: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST]]:
    """Yield every expression with its parent and field; annotations are no code."""
    for parent in ast.walk(tree):
        for field, value in ast.iter_fields(parent):
            if field in ("annotation", "returns"):
                continue
            if isinstance(value, ast.expr):
                yield parent, field, None, value
            elif isinstance(value, list):
                for i, item in enumerate(value):
                    if isinstance(item, ast.expr):
                        yield parent, field, i, item


def put(parent: Any, field: str, i: int | None, node: Any) -> None:
    if i is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[i] = node


def mutants(source: str) -> Iterator[Mutant]:
    """Yield all single changes of a module; the tree is restored after each."""
    tree = ast.parse(source)
    annotated = {
        id(part)
        for node in ast.walk(tree)
        for hint in (getattr(node, "annotation", None), getattr(node, "returns", None))
        if hint is not None
        for part in ast.walk(hint)
    }
    for parent, field, i, node in list(expressions(tree)):
        if id(node) in annotated:
            continue
        news = list(replacements(node))
        if isinstance(parent, ast.If | ast.IfExp) and field == "test":
            news += [ast.Constant(True), ast.Constant(False)]
        for new in news:
            ast.copy_location(new, node)
            put(parent, field, i, new)
            change = f"{ast.unparse(node)} -> {ast.unparse(new)}"
            minus = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)
            operator = "+ -> -" if minus else ""
            yield Mutant(node.lineno, change, operator, ast.fix_missing_locations(tree))
            put(parent, field, i, node)


def execute(code: Any, filename: str) -> types.ModuleType:
    module = types.ModuleType("mutant")
    exec(compile(code, filename, "exec"), module.__dict__)
    return module


def survives(mutant: Mutant, check: Callable[[Any], None]) -> bool:
    try:
        check(execute(mutant.code, "<mutant>"))
    except Exception:  # noqa: BLE001  any exception kills the mutant
        return False
    return True


@pytest.mark.parametrize("name", CHECKS)
def test_the_module_itself_passes(name: str) -> None:
    path = RIG / f"{name}.py"
    CHECKS[name](execute(path.read_text(), str(path)))


@pytest.mark.parametrize("name", CHECKS)
def test_every_mutant_is_killed(name: str) -> None:
    source = (RIG / f"{name}.py").read_text()
    lines, alive, equivalent, total = source.splitlines(), [], set(), 0
    for mutant in mutants(source):
        total += 1
        if survives(mutant, CHECKS[name]):
            line = lines[mutant.line - 1].strip()
            known = EQUIVALENT.get(f"{name}.py", {}).get(line, {})
            if mutant.change in known or mutant.operator in known:
                equivalent.add(line)
            else:
                alive.append(f"{name}.py:{mutant.line}: {mutant.change}")
    assert total > MINIMUM[name][0]
    assert alive == []
    assert equivalent == set(
        EQUIVALENT.get(f"{name}.py", {})
    )  # every listed equivalent still exists


@pytest.mark.parametrize("name", CHECKS)
def test_every_branch_is_taken_both_ways(name: str) -> None:
    path = RIG / f"{name}.py"
    source = path.read_text()
    module = execute(source, str(path))
    transitions: set[tuple[int, int]] = set()

    def trace(frame: Any, event: str, _: Any) -> Any:
        if frame.f_code.co_filename != str(path):
            return None
        last = frame.f_lineno

        def lines(inner: Any, kind: str, _: Any) -> Any:
            nonlocal last
            if kind in ("line", "return"):
                transitions.add((last, inner.f_lineno if kind == "line" else -1))
                last = inner.f_lineno
            return lines

        return lines

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        CHECKS[name](module)
    finally:
        sys.settrace(before)
    tree = ast.parse(source)
    branches = [node for node in ast.walk(tree) if isinstance(node, ast.If)]
    assert len(branches) >= MINIMUM[name][1]
    for branch in branches:
        assert branch.test.end_lineno is not None
        inside = range(branch.test.lineno, branch.test.end_lineno + 1)
        after = {to for at, to in transitions if at in inside and to not in inside}
        into = branch.body[0].lineno
        assert into in after, f"{name}.py:{branch.lineno} is never true"
        assert after - {into}, f"{name}.py:{branch.lineno} is never false"
    reached = {to for _, to in transitions}
    for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            if isinstance(node, ast.Return | ast.Assign | ast.AugAssign):
                assert node.lineno in reached, f"{name}.py:{node.lineno} is never reached"
