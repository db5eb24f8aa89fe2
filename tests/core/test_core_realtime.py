"""Asking for privileges: a refusal is a word in a report, never an exception."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from core_process import output

from rig.realtime import scheduling
from rig.realtime.scheduling import Privileges

# Without any privilege: as nobody if we are root, and with every limit taken down before.
UNPRIVILEGED = """
import json, os, resource, gc
from rig.realtime import scheduling
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(limit, (0, 0))
if os.getuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
got = scheduling.acquire()
print(json.dumps({
    "got": got._asdict(),
    "refused": got.refused,
    "gc": gc.isenabled(),
    "frozen": gc.get_freeze_count() > 0,
    "cores": len(os.sched_getaffinity(0)),
    "latency": os.access("/dev/cpu_dma_latency", os.W_OK),
}))
"""


def test_without_privileges_each_refusal_is_reported() -> None:
    said = json.loads(output(UNPRIVILEGED))
    assert set(said["got"]) == set(Privileges._fields)
    assert said["got"]["fifo"]
    assert said["got"]["memory_lock"]
    assert said["latency"] or said["got"]["latency"]
    assert said["got"]["core"] or said["cores"] == 1
    refusals = [name for name, why in said["got"].items() if why]
    assert len(said["refused"]) == len(refusals)
    for name, words in zip(refusals, said["refused"], strict=True):
        assert words == f"{name.replace('_', ' ')}: {said['got'][name]}"
    assert said["gc"] is False
    assert said["frozen"] is True


# Whoever has given up root may not be able to read where the interpreter's modules lie: then
# nothing can be imported any more, a codec neither. Here nothing can be, whoever asks.
NO_IMPORT = """
import json, os, resource, sys
from rig.realtime import scheduling
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
others = sorted(os.sched_getaffinity(0))
read, write = os.pipe()
os.write(write, f"{others[0]}".encode())
os.close(write)
scheduling._ISOLATED = f"/proc/self/fd/{read}"
before = set(sys.modules)
sys.meta_path.clear()
sys.path_hooks.clear()
sys.path_importer_cache.clear()
core = scheduling.core()
told = [scheduling.acquire(), scheduling.beside_the_loop(), scheduling.at_its_service()]
print(json.dumps({"core": core, "first": others[0], "new": sorted(set(sys.modules) - before)}))
"""


def test_nothing_is_imported_when_privileges_are_asked_for() -> None:
    said = json.loads(output(NO_IMPORT))
    assert said["core"] == said["first"]  # the list was read
    assert said["new"] == []


def test_a_privilege_that_was_granted_is_no_refusal() -> None:
    assert Privileges("", "", "", "").refused == ()
    assert Privileges("", "x", "", "y z").refused == ("core: x", "latency: y z")


def test_every_refusal_of_the_host_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    monkeypatch.setattr(scheduling, "_LATENCY_FILE", "/nowhere/at/all")
    monkeypatch.setattr(scheduling, "quiet_memory", lambda: None)
    monkeypatch.setattr(scheduling, "_lock", refuse)
    got = scheduling.acquire()
    assert got[:3] == ("Operation not permitted",) * 3
    assert got.latency == "No such file or directory"
    assert len(got.refused) == 4


def test_an_isolated_core_is_the_loops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    last = max(os.sched_getaffinity(0))
    for text, core in (("", last), ("\n", last), ("9\n", 9), ("2,5-7\n", 7), ("no list", last)):
        (tmp_path / "isolated").write_text(text)
        monkeypatch.setattr(scheduling, "_ISOLATED", str(tmp_path / "isolated"))
        assert scheduling.core() == core
    monkeypatch.setattr(scheduling, "_ISOLATED", str(tmp_path / "none"))
    assert scheduling.core() == last


def test_a_core_that_may_not_be_used_is_none_of_the_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[set[int]] = []

    def some(pid: int, cores: set[int]) -> None:
        asked.append(cores)
        if cores == {999}:
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(scheduling, "core", lambda: 999)
    monkeypatch.setattr(os, "sched_setaffinity", some)
    scheduling._pin()
    assert asked == [{999}, {max(os.sched_getaffinity(0))}]
