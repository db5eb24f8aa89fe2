"""Requests for privileges: a refusal is a text in the report, never an exception."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from core_process import output

from rig.realtime import scheduling
from rig.realtime.scheduling import Privileges

# Without any privilege: as user nobody if we are root, with every limit lowered before.
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
    report = json.loads(output(UNPRIVILEGED))
    assert set(report["got"]) == set(Privileges._fields)
    assert report["got"]["fifo"]
    assert report["got"]["memory_lock"]
    assert report["latency"] or report["got"]["latency"]
    assert report["got"]["core"] or report["cores"] == 1
    refusals = [name for name, why in report["got"].items() if why]
    assert len(report["refused"]) == len(refusals)
    for name, reasons in zip(refusals, report["refused"], strict=True):
        assert reasons == f"{name.replace('_', ' ')}: {report['got'][name]}"
    assert report["gc"] is False
    assert report["frozen"] is True


# A process that gave up root may be unable to read the interpreter's modules: then
# nothing can be imported any more, not even a codec. Here imports are disabled altogether.
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
core = scheduling.loop_core()
scheduling.acquire(), scheduling.acquire_for_emulator(), scheduling.acquire_for_io()
print(json.dumps({"core": core, "first": others[0], "new": sorted(set(sys.modules) - before)}))
"""


def test_requesting_privileges_imports_nothing() -> None:
    report = json.loads(output(NO_IMPORT))
    assert report["core"] == report["first"]  # the list was read
    assert report["new"] == []


def test_a_granted_privilege_is_no_refusal() -> None:
    assert Privileges("", "", "", "").refused == ()
    assert Privileges("", "x", "", "y z").refused == ("core: x", "latency: y z")


def test_every_refusal_of_the_host_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    monkeypatch.setattr(scheduling, "_LATENCY_FILE", "/nowhere/at/all")
    monkeypatch.setattr(scheduling, "freeze_garbage_collector", lambda: None)
    monkeypatch.setattr(scheduling, "_lock", refuse)
    got = scheduling.acquire()
    assert got[:3] == ("Operation not permitted",) * 3
    assert got.latency == "No such file or directory"
    assert len(got.refused) == 4


def test_an_isolated_core_is_the_loop_core(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    last = max(os.sched_getaffinity(0))
    for text, core in (("", last), ("\n", last), ("9\n", 9), ("2,5-7\n", 7), ("no list", last)):
        (tmp_path / "isolated").write_text(text)
        monkeypatch.setattr(scheduling, "_ISOLATED", str(tmp_path / "isolated"))
        assert scheduling.loop_core() == core
    monkeypatch.setattr(scheduling, "_ISOLATED", str(tmp_path / "none"))
    assert scheduling.loop_core() == last


def test_a_forbidden_core_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    requests: list[set[int]] = []

    def some(pid: int, cores: set[int]) -> None:
        requests.append(cores)
        if cores == {999}:
            raise OSError(22, "Invalid argument")

    monkeypatch.setattr(scheduling, "loop_core", lambda: 999)
    monkeypatch.setattr(os, "sched_setaffinity", some)
    scheduling._pin()
    assert requests == [{999}, {max(os.sched_getaffinity(0))}]
