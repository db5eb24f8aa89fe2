"""The rules for the code of a law that runs compiled, by its source text.

A law's `step` must give the same bits interpreted and compiled, so it computes with floats and
NamedTuples (docs/reference/laws.md, Rules of the code). Its source is searched for what breaks a
rule: the message then names the line, where the compiler would name a part of itself.
"""

import ast
from collections.abc import Iterator
from typing import Any

from rig import laws

_CONTAINERS = {
    ast.Dict: "a dict", ast.DictComp: "a dict", ast.Set: "a set", ast.SetComp: "a set",
    ast.List: "a list", ast.ListComp: "a list", ast.JoinedStr: "a text",
    ast.Try: "an exception handler", ast.Raise: "an exception", ast.Lambda: "a lambda",
    ast.Global: "a global variable", ast.Nonlocal: "a variable of another function",
    ast.With: "a with statement", ast.While: "a while loop, which may never end",
}  # fmt: skip
_CALLS = {
    "print": "print, which delays the tick", "hypot": "hypot, whose bits differ compiled",
    "fmod": "fmod, whose bits differ compiled", "_replace": "_replace: write all fields",
    "dict": "a dict", "list": "a list", "set": "a set", "str": "a text", "open": "a file",
}  # fmt: skip
_ALLOWED_IMPORTS = ("controllers", "math", "cmath", "typing", "__future__", "collections", "enum")


def rule_findings(law: laws.Law) -> Iterator[str]:
    """Yield where the code of a law breaks a rule, as `law.py:12: text`, in the order of lines.

    Searched are its `step`, the functions of the file that `step` calls, and the imports.
    """
    tree = ast.parse(laws.source_text(law))
    name = law.path.rpartition("/")[2]
    functions = {each.name: each for each in tree.body if isinstance(each, ast.FunctionDef)}
    found = [*_import_findings(tree)]
    for function in _reached(functions):
        found += _code_findings(function)
    for line, text in sorted(set(found)):
        yield f"{name}:{line}: {text}"


def _reached(functions: dict[str, ast.FunctionDef]) -> list[ast.FunctionDef]:
    """Return `step` and the functions of the file that it calls, also through others."""
    names, open_names = set[str](), {"step"} & functions.keys()
    while open_names:
        name = open_names.pop()
        names.add(name)
        calls = (each.func for each in ast.walk(functions[name]) if isinstance(each, ast.Call))
        called = {each.id for each in calls if isinstance(each, ast.Name)}
        open_names |= (called & functions.keys()) - names
    return [functions[name] for name in sorted(names)]


def _code_findings(function: ast.FunctionDef) -> Iterator[tuple[int, str]]:
    """Yield line and text of what breaks a rule in the body of a function."""
    for statement in function.body:
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue  # the docstring
        for node in ast.walk(statement):
            if text := _broken_rule(node):
                yield getattr(node, "lineno", function.lineno), f"{text} in {function.name}"


def _broken_rule(node: Any) -> str:
    """Return what a part of the code is that a rule forbids; empty for allowed code."""
    if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Pow):
        return "**, whose bits differ compiled: multiply"
    if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes):
        return "a text"
    if isinstance(node, ast.Call):
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        return _CALLS.get(name, "")
    return _CONTAINERS.get(type(node), "")


def _import_findings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    for node in tree.body:
        modules = [each.name for each in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and not node.level:
            modules = [node.module or ""]
        for module in modules:
            if module.partition(".")[0] not in _ALLOWED_IMPORTS:
                yield node.lineno, f"import of {module}: a law uses controllers and math only"
