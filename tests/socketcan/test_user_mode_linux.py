"""The launcher: when a run counts as passed, as failed, and as unavailable."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import user_mode_linux
from uml_guest import MODULES, STATUS, UP
from user_mode_linux import NoKernelError, kernel_in, relay_output


def guest(*lines: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", f"print({chr(10).join(lines)!r})"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_the_status_is_the_commands_and_what_it_printed_is_shown(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with guest("booting", f"{UP}, Linux 6", "1 failed", f"{STATUS} 1", "halted") as process:
        assert relay_output(process) == 1
    assert capsys.readouterr().out == f"{UP}, Linux 6\n1 failed\n"
    with guest(UP, f"{STATUS} 0") as process:
        assert relay_output(process) == 0


def test_a_guest_that_dies_during_its_command_has_failed() -> None:
    with guest(UP, "panic") as process:
        assert relay_output(process) == 1


def test_a_guest_that_fails_before_it_is_up_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    with guest("OSError: mount", f"{STATUS} 1") as process:
        assert relay_output(process) == 1
    assert "OSError: mount" in capsys.readouterr().out


def test_a_kernel_that_does_not_boot_is_unavailable() -> None:
    with guest("no memory") as process, pytest.raises(NoKernelError, match="no memory"):
        relay_output(process)


def test_a_kernel_without_its_modules_is_unavailable(tmp_path: Path) -> None:
    program = tmp_path / "linux.uml"
    program.touch()
    assert kernel_in(program, tmp_path) is None
    for name in MODULES:
        module = tmp_path / "6.1" / "kernel" / name
        module.parent.mkdir(parents=True, exist_ok=True)
        module.touch()
    kernel = kernel_in(program, tmp_path)
    assert kernel is not None
    assert kernel.modules == tmp_path / "6.1" / "kernel"
    assert kernel_in(tmp_path / "other", tmp_path) is None


def test_a_skipped_run_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(user_mode_linux, "CACHE", tmp_path)
    monkeypatch.setattr(sys, "argv", ["user_mode_linux.py"])
    assert user_mode_linux.main() == user_mode_linux.NOT_RUN
    assert "DID NOT RUN: linux.uml is not on the PATH" in capsys.readouterr().out
