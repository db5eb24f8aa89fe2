"""`import rig` is light, and its names are those that it declares."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import rig

PROGRAM = """
import sys
import rig
print(sorted({name.partition(".")[0] for name in sys.modules}
    & {"numpy", "pandas", "xarray", "pydantic", "numba", "matplotlib", "typer", "ruamel"}),
    [name for name in sys.modules if name.startswith("rig.")])
"""


def test_import_loads_nothing_else() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[] []\n"


def test_every_name_is_there_and_documented() -> None:
    for name in rig.__all__:
        assert getattr(rig, name).__doc__, name
        assert name in dir(rig)
    with pytest.raises(AttributeError, match="no attribute 'reherse'"):
        _ = rig.reherse  # type: ignore[attr-defined]


def test_names_for_type_checkers_are_those_at_run_time() -> None:
    assert rig.__file__ is not None
    tree = ast.parse(Path(rig.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    declared = {
        alias.name: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(declared) == sorted(rig.__all__)
    assert declared == {name: f"rig.api.{module}" for name, module in rig._MODULES.items()}


def test_the_package_of_sweeps_does_not_hide_the_function() -> None:
    program = "import rig.sweeps.sweep, rig.api.sweeps, rig; print(callable(rig.sweep))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "True\n"
