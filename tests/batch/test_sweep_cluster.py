"""Sweeps on a Dask cluster: a real scheduler and workers on loopback, one of them killed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from rehearsing import CONFIGS, write_yaml
from rig_command import rig_here

from rig.sweeps import cluster, sweep
from rig.sweeps.cases import Case, Outcome
from rig.sweeps.executors import thread_executor

pytest.importorskip("distributed")  # optional extra, part of the developers' installation

ROOT = Path(__file__).resolve().parents[2]
DASK = [sys.executable, "-W", "ignore", "-m", "distributed.cli.dask_"]
START_TIMEOUT = 60.0  # s, for the address of a scheduler or worker on a busy host


class Node:
    """A process with a scheduler or a worker."""

    def __init__(self, role: str, *arguments: str) -> None:
        command = [*DASK[:-1], DASK[-1] + role, *arguments]
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        self.address = ""
        self._has_address = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            found = re.search(r"(?:Scheduler|worker) at: *(tcp://\S+)", line)
            if found and not self.address:
                self.address = found[1]
                self._has_address.set()

    def wait_for_address(self) -> str:
        """Wait for the address of the process and return it."""
        assert self._has_address.wait(START_TIMEOUT), "the process printed no address"
        return self.address

    def end(self, how: int = signal.SIGTERM) -> None:
        self.process.send_signal(how)
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


def start_worker(scheduler: Node) -> Node:
    """Start a worker with one thread and without a nanny, which would restart it."""
    return Node(
        "worker", scheduler.wait_for_address(), "--nthreads", "1", "--no-nanny", "--no-dashboard",
        "--host", "127.0.0.1",
    )  # fmt: skip


@pytest.fixture(scope="module")
def scheduler() -> Iterator[Node]:
    node = Node("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    yield node
    node.end()


@pytest.fixture(scope="module")
def first(scheduler: Node) -> Iterator[Node]:
    node = start_worker(scheduler)
    node.wait_for_address()
    yield node
    node.end()


def write_campaign(folder: Path, rows: int) -> Path:
    """Write a campaign of different rows with 6 s of waves each."""
    return write_yaml(
        folder / "campaign.yaml",
        {
            "name": "clustered",
            "rig": str(CONFIGS / "rigs" / "wavebot.yaml"),
            "sea": {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
            "tare": {"duration_s": 1},
            "timing": {"settle_s": 2, "interval_s": 6},
            "matrix": {
                "list": [
                    {"spring_n_per_m": 490.9, "kp_n_s_per_m": -1000 - 10 * i, "ki_n_per_m": 0}
                    for i in range(rows)
                ]
            },
        },
    )


def open_test_sweep(path: Path, sweeps: Path) -> sweep.Sweep:
    return sweep.open_sweep(path, [], sweeps, sequential=False, lead_in=15.0)


def journal_cases(folder: Path) -> list[int]:
    """Return the numbers of all cases in the journal, with repetitions."""
    lines = (folder / "cases.jsonl").read_text().splitlines()
    return [json.loads(line)["case"] for line in lines]


@pytest.mark.slow
def test_cluster_equals_threads_even_if_a_worker_is_killed(
    scheduler: Node, first: Node, tmp_path: Path
) -> None:
    """One of two workers is killed (SIGKILL) after the first quarter of the outcomes.

    The journal has every case exactly once, and the result equals that of threads to the bit.
    """
    path = write_campaign(tmp_path, 60)
    second = start_worker(scheduler)
    second.wait_for_address()
    swept = open_test_sweep(path, tmp_path / "cluster")
    killed_after: list[int] = []
    chunks: list[cluster.ChunkResult] = []

    def kill_second(outcome: Outcome) -> None:
        if len(chunks) and sum(len(c.outcomes) for c in chunks) >= 15 and not killed_after:
            killed_after.append(outcome.case)
            second.end(signal.SIGKILL)

    executor = cluster.cluster_executor(
        scheduler.wait_for_address(), swept.cases.request, swept.digest, chunks.append
    )
    try:
        table = sweep.run(swept, executor, kill_second)
    finally:
        if not killed_after:
            second.end()
    assert killed_after
    assert killed_after[0] < 59  # there was work left
    assert sorted(journal_cases(swept.folder)) == list(range(60))
    assert max(len(done.outcomes) for done in chunks) > 1  # at least one chunk has several cases
    by_threads = open_test_sweep(path, tmp_path / "threads")
    expected = sweep.run(by_threads, thread_executor(2), lambda outcome: None)
    xarray.testing.assert_identical(
        table.drop_attrs().drop_vars("incomplete_reason"),
        expected.drop_attrs().drop_vars("incomplete_reason"),
    )
    assert (table["state"] == "complete").all()


@pytest.mark.slow
@pytest.mark.usefixtures("first")
def test_the_command_runs_on_a_cluster(scheduler: Node, tmp_path: Path) -> None:
    arguments = ("sweep", write_campaign(tmp_path, 3), "--sweeps", tmp_path / "s", "--json")
    code, out, err = rig_here(*arguments, "--scheduler", scheduler.wait_for_address())
    assert code == 0, err
    report = json.loads(out)
    assert (report["status"], report["run_now"]) == ("complete", 3)
    _, second_output, _ = rig_here(*arguments, "--scheduler", scheduler.wait_for_address())
    assert json.loads(second_output)["run_now"] == 0  # finished cases do not run again
    with xarray.open_dataset(report["result"]) as table:
        assert np.isfinite(table["power_dc"].values).all()


@pytest.mark.slow
@pytest.mark.usefixtures("first")
def test_worker_with_other_files_refuses(scheduler: Node, tmp_path: Path) -> None:
    """Its numbers would belong to another sweep, so it raises an error and the sweep ends."""
    swept = open_test_sweep(write_campaign(tmp_path, 2), tmp_path / "s")
    executor = cluster.cluster_executor(
        scheduler.wait_for_address(), swept.cases.request, "another digest"
    )
    with pytest.raises(cluster.ClusterError, match="has other files for"):
        sweep.run(swept, executor, lambda outcome: None)
    assert journal_cases(swept.folder) == []


def test_missing_scheduler_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_TIMEOUT", 0.5)
    code, _, err = rig_here(
        "sweep", write_campaign(tmp_path, 1), "--sweeps", tmp_path / "s", "--scheduler",
        "tcp://127.0.0.1:9",
    )  # fmt: skip
    assert code == 1
    assert "no scheduler answers there" in err
    code, _, err = rig_here(
        "sweep", write_campaign(tmp_path, 1), "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"
    )
    assert code == 2


def test_chunks_grow_to_one_second() -> None:
    """Chunks grow at most fourfold at a time; cases of a killed worker run first."""
    chunks: Any = cluster._Chunks(Case(i, 0, i) for i in range(1000))
    sizes = []
    for seconds in (0.01, 0.04, 0.16, 0.64, 1.0):
        chunk = next(chunks)
        sizes.append(len(chunk))
        chunks.record_time(len(chunk), seconds)
    assert sizes == [1, 4, 16, 64, 100]  # 10 ms a case
    chunks.retries.append((Case(7, 0, 7),))
    assert next(chunks) == (Case(7, 0, 7),)
    assert next(chunks)[0] == Case(185, 0, 185)
