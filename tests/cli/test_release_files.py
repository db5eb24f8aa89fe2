"""The files of a release: citation, licences and the makefile's names agree with the project."""

from __future__ import annotations

import importlib.util
import platform
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from command_here import rig as command_here
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def licences() -> ModuleType:
    """The program `.ci/licences.py` as a module; an sdist does not contain it."""
    if not (ROOT / ".ci").is_dir():
        pytest.skip("no .ci in this tree")
    spec = importlib.util.spec_from_file_location("licences", ROOT / ".ci" / "licences.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_citation_names_this_version_and_licence() -> None:
    """`cffconvert --validate` was run once; its schema is not installed with the tests."""
    citation = YAML(typ="safe", pure=True).load(ROOT / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()  # required by 1.2.0
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert citation["repository-code"] == PROJECT["urls"]["Homepage"]


def test_the_program_prints_its_version_commit_and_python() -> None:
    done = command_here("--version")
    assert done.returncode == 0, done.stderr
    expected = (
        rf"wec-rig {re.escape(PROJECT['version'])}( \([0-9a-f]{{12}}(, with local changes)?\))?, "
    )
    assert re.fullmatch(expected + re.escape(f"Python {platform.python_version()}\n"), done.stdout)


def test_every_dependency_has_an_allowed_licence(
    licences: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert licences.main([]) == 0, capsys.readouterr().out
    listed = capsys.readouterr().out
    for name in PROJECT["dependencies"]:
        plain = name.partition(">")[0].replace(".", "-").lower()
        assert f" {plain} " in listed, name


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("MIT", True), ("BSD-3-Clause AND Zlib", True), ("LGPL-3.0-only", True),
        ("GPL-3.0-only", False), ("AGPL-3.0-only", False), ("not stated", False),
        ("GNU General Public License v2 (GPLv2)", False), ("MIT AND GPL-2.0-only", False),
    ],
)  # fmt: skip
def test_licences_are_distinguished(licences: ModuleType, text: str, allowed: bool) -> None:
    found = bool(licences.ALLOWED.search(text)) and not licences.REFUSED.search(text)
    assert found is allowed


def test_gpl_is_never_a_dependency(licences: ModuleType) -> None:
    required = " ".join(PROJECT["dependencies"])
    assert not any(name in required for name in licences.OPTIONAL_GPL)
    assert "pysoem" in str(PROJECT["optional-dependencies"]["ethercat"])
