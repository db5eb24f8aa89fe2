"""Sweeps on a Dask cluster: a real scheduler and real workers on loopback, one killed midway."""

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

from rig.sweep import cluster, sweep
from rig.sweep.cases import Case, Outcome
from rig.sweep.executors import threads

pytest.importorskip("distributed")  # an optional extra; the developers' installation has it

ROOT = Path(__file__).resolve().parents[2]
DASK = [sys.executable, "-W", "ignore", "-m", "distributed.cli.dask_"]
STARTED = 60.0  # s in which a scheduler or worker says where it is, on a busy host


class Node:
    """A scheduler or a worker, in a process of its own."""

    def __init__(self, what: str, *words: str) -> None:
        command = [*DASK[:-1], DASK[-1] + what, *words]
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        self.address = ""
        self._told = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            found = re.search(r"(?:Scheduler|worker) at: *(tcp://\S+)", line)
            if found and not self.address:
                self.address = found[1]
                self._told.set()

    def there(self) -> str:
        """Its address, once it says it."""
        assert self._told.wait(STARTED), "it did not come up"
        return self.address

    def end(self, how: int = signal.SIGTERM) -> None:
        self.process.send_signal(how)
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


def worker(scheduler: Node) -> Node:
    """One thread, and nobody who would start it again."""
    return Node(
        "worker", scheduler.there(), "--nthreads", "1", "--no-nanny", "--no-dashboard",
        "--host", "127.0.0.1",
    )  # fmt: skip


@pytest.fixture(scope="module")
def scheduler() -> Iterator[Node]:
    node = Node("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    yield node
    node.end()


@pytest.fixture(scope="module")
def first(scheduler: Node) -> Iterator[Node]:
    node = worker(scheduler)
    node.there()
    yield node
    node.end()


def campaign(folder: Path, rows: int) -> Path:
    """Rows of 6 s of waves; all differ."""
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


def opened(path: Path, sweeps: Path) -> sweep.Sweep:
    return sweep.open_sweep(path, [], sweeps, sequential=False, lead_in=15.0)


def journal(folder: Path) -> list[int]:
    """Numbers of the cases in the journal, as often as they stand there."""
    lines = (folder / "cases.jsonl").read_text().splitlines()
    return [json.loads(line)["case"] for line in lines]


@pytest.mark.slow
def test_a_cluster_gives_what_threads_give_though_a_worker_is_killed(
    scheduler: Node, first: Node, tmp_path: Path
) -> None:
    """Two workers; one is killed (SIGKILL) after the first quarter of the outcomes: every case
    stands in the journal exactly once, and the result is that of threads to the last bit."""
    path = campaign(tmp_path, 60)
    second = worker(scheduler)
    second.there()
    swept = opened(path, tmp_path / "cluster")
    gone: list[int] = []
    chunks: list[cluster.Done] = []

    def see(outcome: Outcome) -> None:
        if len(chunks) and sum(len(c.outcomes) for c in chunks) >= 15 and not gone:
            gone.append(outcome.case)
            second.end(signal.SIGKILL)

    executor = cluster.cluster(scheduler.there(), swept.cases.asked, swept.digest, chunks.append)
    try:
        table = sweep.run(swept, executor, see)
    finally:
        if not gone:
            second.end()
    assert gone
    assert gone[0] < 59  # there was work left
    assert sorted(journal(swept.folder)) == list(range(60))
    assert max(len(done.outcomes) for done in chunks) > 1  # they came in chunks
    alone = opened(path, tmp_path / "threads")
    expected = sweep.run(alone, threads(2), lambda outcome: None)
    xarray.testing.assert_identical(
        table.drop_attrs().drop_vars("incomplete_reason"),
        expected.drop_attrs().drop_vars("incomplete_reason"),
    )
    assert (table["state"] == "complete").all()


@pytest.mark.slow
@pytest.mark.usefixtures("first")
def test_the_command_runs_on_a_cluster(scheduler: Node, tmp_path: Path) -> None:
    words = ("sweep", campaign(tmp_path, 3), "--sweeps", tmp_path / "s", "--json")
    code, said, err = rig_here(*words, "--scheduler", scheduler.there())
    assert code == 0, err
    told = json.loads(said)
    assert (told["status"], told["run_now"]) == ("complete", 3)
    _, again, _ = rig_here(*words, "--scheduler", scheduler.there())
    assert json.loads(again)["run_now"] == 0  # what is finished is not run again
    with xarray.open_dataset(told["result"]) as table:
        assert np.isfinite(table["power_dc"].values).all()


@pytest.mark.slow
@pytest.mark.usefixtures("first")
def test_a_worker_with_other_files_refuses(scheduler: Node, tmp_path: Path) -> None:
    """What it would compute is of something else, so it says so and the sweep ends."""
    swept = opened(campaign(tmp_path, 2), tmp_path / "s")
    executor = cluster.cluster(scheduler.there(), swept.cases.asked, "another digest")
    with pytest.raises(cluster.ClusterError, match="has other files for"):
        sweep.run(swept, executor, lambda outcome: None)
    assert journal(swept.folder) == []


def test_nobody_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_PATIENCE", 0.5)
    code, _, err = rig_here(
        "sweep", campaign(tmp_path, 1), "--sweeps", tmp_path / "s", "--scheduler",
        "tcp://127.0.0.1:9",
    )  # fmt: skip
    assert code == 1
    assert "no scheduler answers there" in err
    code, _, err = rig_here(
        "sweep", campaign(tmp_path, 1), "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"
    )
    assert code == 2


def test_chunks_become_as_long_as_a_second() -> None:
    """They grow at most fourfold at a time, and what a killed worker left goes first."""
    chunks: Any = cluster._Chunks(Case(i, 0, i) for i in range(1000))
    sizes = []
    for seconds in (0.01, 0.04, 0.16, 0.64, 1.0):
        chunk = next(chunks)
        sizes.append(len(chunk))
        chunks.took(len(chunk), seconds)
    assert sizes == [1, 4, 16, 64, 100]  # 10 ms a case
    chunks.again.append((Case(7, 0, 7),))
    assert next(chunks) == (Case(7, 0, 7),)
    assert next(chunks)[0] == Case(185, 0, 185)
