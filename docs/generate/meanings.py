"""Meanings of fields, read from the source of their classes.

A field of a model or of a log row has its meaning in a comment on its line, in the docstring below
it or in a comment above it, or its type has one. Pages, and readers of the code, see the same text.
"""

import ast
import importlib
import inspect
import io
import sys
import tokenize
from collections.abc import Mapping
from functools import cache
from itertools import zip_longest
from typing import NamedTuple


class _Source(NamedTuple):
    tree: ast.Module
    comments: dict[int, str]  # text by line, for comments after code
    alone: dict[int, str]  # by line, for lines that are comments only


@cache
def _source(module: str) -> _Source:
    text = inspect.getsource(sys.modules[module])
    after, alone = {}, {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            body = token.string.lstrip("# ").strip()
            where = alone if not token.line[: token.start[1]].strip() else after
            if not body.startswith(("type:", "fmt:", "noqa")):
                where[token.start[0]] = body
    return _Source(ast.parse(text), after, alone)


def meanings(owner: type) -> dict[str, str]:
    """Return the meaning of each field of a class by its name; fields without one are absent."""
    found: dict[str, str] = {}
    for base in reversed(owner.__mro__):
        if base.__module__ in sys.modules and "__annotations__" in vars(base):
            found.update(_of_class(base))
    return found


@cache
def _of_class(owner: type) -> dict[str, str]:
    try:
        source = _source(owner.__module__)
    except (OSError, TypeError):  # built in, or a class that a function has built
        return {}
    body = next(
        (
            node.body
            for node in ast.walk(source.tree)
            if isinstance(node, ast.ClassDef) and node.name == owner.__name__
        ),
        [],
    )
    found = {}
    for node, after in zip_longest(body, body[1:]):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            text = (
                _docstring(after)
                or _comment(source, node)
                or _comment_above(source, node)
                or _of_alias(owner.__module__, node.annotation)
            )
            if text:
                found[node.target.id] = text
    return found


def type_meanings(module: str, types: Mapping[str, object]) -> dict[str, str]:
    """Return the docstrings of a module's named types, by the keys that have these types."""
    names = {id(value): name for name, value in vars(sys.modules[module]).items()}
    return {key: _alias_docstring(module, names[id(each)]) for key, each in types.items()}


def _comment(source: _Source, node: ast.AnnAssign) -> str:
    lines = range(node.lineno, (node.end_lineno or node.lineno) + 1)
    return " ".join(source.comments[line] for line in lines if line in source.comments)


def _comment_above(source: _Source, node: ast.AnnAssign) -> str:
    """Return the comment in the lines above a field, up to the next line of code."""
    lines: list[str] = []
    while (line := node.lineno - 1 - len(lines)) in source.alone:
        lines.insert(0, source.alone[line])
    return " ".join(lines)


def _docstring(node: ast.AST | None) -> str:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return inspect.cleandoc(str(node.value.value)).replace("\n\n", " ").replace("\n", " ")
    return ""


def _of_alias(module: str, annotation: ast.expr) -> str:
    """Return the docstring of a type's name, such as `Height`, where it is defined."""
    names = [node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)]
    return next((text for name in names if (text := _alias_docstring(module, name))), "")


@cache
def _alias_docstring(module: str, name: str) -> str:
    body = _source(module).tree.body
    for node, after in zip_longest(body, body[1:]):
        if isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(isinstance(each, ast.Name) and each.id == name for each in targets):
                return _docstring(after)
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                if name == (alias.asname or alias.name):
                    return _imported(node.module, alias.name)
    return ""


def _imported(module: str, name: str) -> str:
    if module == "rig.config.model" or not module.startswith(("controllers", "rig", "sim_plant")):
        return ""  # the former has plain types, whose text describes no field
    importlib.import_module(module)
    return _alias_docstring(module, name)
