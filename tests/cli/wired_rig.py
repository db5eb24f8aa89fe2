"""A wired rig file on free ports of this host, and its emulated devices, run by `rig sim`."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


class Ports(NamedTuple):
    can: int
    analyser: int
    io: int


def free_ports() -> Ports:
    """Return free ports; another program may still take one before the test uses it."""
    servers = [socket.create_server(("127.0.0.1", 0)) for _ in Ports._fields]
    ports = Ports(*(server.getsockname()[1] for server in servers))
    for server in servers:
        server.close()
    return ports


def rig_file(folder: Path, ports: Ports, name: str = "rig", **changed: Any) -> Path:
    """Write a rig file of the wired WaveBot on these ports; ``changed`` updates its wiring."""
    wiring: dict[str, Any] = {
        "can": {"options": {"host": "127.0.0.1", "port": ports.can, "tcp_tune": True}},
        "lines": {
            "analyser": {"port": ports.analyser, "timeout_s": 0.5},
            "io": {"port": ports.io, "timeout_s": 0.5},
            "amplifiers": {"port": str(folder / "amplifiers")},
        },
    }
    for key, value in changed.items():
        wiring[key] = {**wiring.get(key, {}), **value}
    path = folder / f"{name}.yaml"
    with path.open("w") as file:
        YAML(typ="safe").dump(
            {
                "extends": str(CONFIGS / "rigs" / "wavebot_hil.yaml"),
                "name": "Wires of a test",
                "limits": str(CONFIGS / "limits" / "wavebot_hil.yaml"),
                "wiring": wiring,
            },
            file,
        )
    return path


def rig(*arguments: str | Path) -> subprocess.Popen[str]:
    """Start `rig ARGUMENTS` in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "rig", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ready(process: subprocess.Popen[str]) -> dict[str, Any]:
    """Return the message of `rig sim --json` when its devices are ready."""
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise AssertionError(process.communicate()[1])
    message: dict[str, Any] = json.loads(line)
    return message


def ended(process: subprocess.Popen[str], number: int = signal.SIGINT) -> tuple[int, str, str]:
    """Send a signal to the process; return its exit code, output and errors."""
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


@contextmanager
def running(path: Path, *arguments: str | Path) -> Iterator[dict[str, Any]]:
    """Run `rig sim` of a rig file, and yield its message when ready."""
    process = rig("sim", path, "--json", *arguments)
    try:
        yield ready(process)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
