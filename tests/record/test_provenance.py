"""Code version in a run's record: of a checkout, and of an installed package."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rig import module_process
from rig.recording import provenance

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def git(folder: Path, *arguments: str) -> str:
    identity = ("-c", "user.name=Test", "-c", "user.email=test@example.org")
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A git repository that a user keeps, with one commit."""
    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "first")
    return tmp_path


def test_checkout_reports_its_commit_and_changes(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (repository / "pyproject.toml").write_text("[project]\n")
    git(repository, "add", ".")
    git(repository, "commit", "-q", "-m", "second")
    monkeypatch.setattr(provenance, "_ROOT", repository)
    code = provenance.describe_code()
    assert code["git"] == git(repository, "rev-parse", "HEAD")
    assert (code["dirty"], code["installed"]) == (False, False)
    (repository / "pyproject.toml").write_text("[project] # changed\n")
    assert provenance.describe_code()["dirty"]


def test_installed_package_reports_the_commit_of_its_build(
    repository: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The virtual environment may lie in a repository of the user: its commit is none of ours."""
    site = repository / ".venv" / "site-packages"
    (site / "rig").mkdir(parents=True)
    monkeypatch.setattr(provenance, "_ROOT", site)
    monkeypatch.setattr(provenance, "_BUILD_SOURCE", site / "rig" / "source.json")
    code = provenance.describe_code()
    assert (code["git"], code["dirty"], code["installed"]) == ("", False, True)
    assert code["version"]
    (site / "rig" / "source.json").write_text(f'{{"git": "{COMMIT}", "dirty": true}}\n')
    code = provenance.describe_code()
    assert (code["git"], code["dirty"], code["installed"]) == (COMMIT, True, True)


def test_processes_ignore_modules_of_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A person's folder may hold a `signal.py`; the source tree's own folder counts."""
    (tmp_path / "signal.py").write_text("raise SystemExit(7)\n")
    monkeypatch.chdir(tmp_path)
    command = module_process.module_command("rig.host.wake")
    assert command == [sys.executable, "-P", "-m", "rig.host.wake"]
    environment = os.environ | {"PYTHONPATH": str(Path(module_process.__file__).parents[1])}
    done = subprocess.run(
        module_process.module_command("rig", "--help"),
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    monkeypatch.chdir(Path(module_process.__file__).parents[1])
    assert module_process.module_command("rig") == [sys.executable, "-m", "rig"]
