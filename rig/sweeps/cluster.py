"""Executor that runs cases on a Dask cluster, on as many machines as the scheduler has.

Cases are sent in chunks of about one second of work, so that the overhead of a task (some
milliseconds) is negligible. A worker that dies loses nothing: the scheduler gives its chunk to
another worker, and a chunk's outcomes are taken once. A worker opens the campaign from the same
path as the client and refuses to run it if its files or code differ, because its numbers would
belong to another sweep.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import lru_cache
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

from rig.sweeps.cases import Case, Cases, Outcome, SweepRequest
from rig.sweeps.executors import Executor, RunCase
from rig.sweeps.sweep import reopen_cases

if TYPE_CHECKING:
    from distributed import Client, Future

CHUNK = 1.0  # s, work in a chunk
_MAX_CASES = 500  # in a chunk
_MAX_GROWTH = 4  # of the chunk size from one chunk to the next: the first cases may be fast ones
_CHUNKS_PER_THREAD = 2  # submitted per thread of the cluster, so that none waits for the client
_TIMEOUT = 30.0  # s, for an answer of the scheduler and for a first worker
_CHECK_INTERVAL = 5.0  # s, between two checks of the connection to the scheduler
_open_lock = Lock()


class ClusterError(OSError):
    """The cluster cannot run the cases; finished cases are kept."""


class ChunkResult(NamedTuple):
    """The outcomes of a chunk."""

    outcomes: tuple[Outcome, ...]
    seconds: float  # run time of its cases on the worker


def cluster_executor(
    address: str,
    request: SweepRequest,
    digest: str,
    on_chunk: Callable[[ChunkResult], None] = lambda done: None,
) -> Executor:
    """Return the executor of a scheduler (``tcp://HOST:PORT``) for the cases of one sweep.

    ``digest`` is the digest that the workers' files and code must have
    (`rig.sweeps.sweep.Sweep.digest`). The executor calls ``on_chunk`` with each result. When
    iterated, it raises ClusterError if Dask is not installed, the scheduler does not answer, or a
    worker refuses.
    """
    resolved = request._replace(campaign=str(Path(request.campaign).resolve()))

    def run(cases: Iterable[Case], run_case: RunCase) -> Iterator[Outcome]:
        with _connect(address) as client:
            chunks = _Chunks(iter(cases))
            pending: dict[Future, tuple[Case, ...]] = {}
            try:
                while True:
                    free = _CHUNKS_PER_THREAD * max(1, sum(client.nthreads().values())) - len(
                        pending
                    )
                    for chunk in islice(chunks, max(free, 0)):
                        future = client.submit(run_chunk, resolved, digest, chunk, pure=False)
                        pending[future] = chunk
                    if not pending:
                        return
                    for future in _wait_first(client, pending, address):
                        result = _chunk_result(future, pending.pop(future), chunks, address)
                        on_chunk(result)
                        chunks.record_time(len(result.outcomes), result.seconds)
                        yield from result.outcomes
            except KeyboardInterrupt:
                for future in [one for one in pending if one.status == "finished"]:
                    yield from _chunk_result(future, pending.pop(future), chunks, address).outcomes
                raise
            finally:
                with suppress(Exception):  # the scheduler may be gone
                    client.cancel(list(pending), force=True)

    return run


class _Chunks:
    """Iterator over the waiting cases in chunks, sized by the run time of earlier chunks."""

    def __init__(self, waiting: Iterator[Case]) -> None:
        self._waiting = waiting
        self._size = 1
        self.retries: list[tuple[Case, ...]] = []  # run before the waiting cases

    def __iter__(self) -> Iterator[tuple[Case, ...]]:
        return self

    def __next__(self) -> tuple[Case, ...]:
        chunk = self.retries.pop() if self.retries else tuple(islice(self._waiting, self._size))
        if not chunk:
            raise StopIteration
        return chunk

    def record_time(self, cases: int, seconds: float) -> None:
        """Adapt the chunk size to the run time of so many cases."""
        if cases:
            fitting = CHUNK * cases / max(seconds, 1e-6)
            self._size = max(1, min(int(fitting), _MAX_GROWTH * self._size, _MAX_CASES))


def run_chunk(request: SweepRequest, digest: str, chunk: tuple[Case, ...]) -> ChunkResult:
    """Run a chunk on a worker; its time excludes opening the campaign and compiling the loop."""
    cases = _open_cases(request, digest)
    start = time.perf_counter()
    outcomes = tuple(cases.run(case) for case in chunk)
    return ChunkResult(outcomes, time.perf_counter() - start)


def _open_cases(request: SweepRequest, digest: str) -> Cases:
    """Return the cases of a sweep, opened and compiled once per worker for all its threads."""
    with _open_lock:
        return _open_cached(request, digest)


@lru_cache(2)
def _open_cached(request: SweepRequest, digest: str) -> Cases:
    cases = reopen_cases(request, digest)
    cases.simulator().prepare()
    return cases


def _connect(address: str) -> "Client":
    try:
        from distributed import Client  # noqa: PLC0415  (an optional extra, and a second to import)
    except ImportError:
        raise ClusterError("--scheduler needs Dask: pip install 'wec-rig[dask]'") from None
    try:
        client = Client(address, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(f"{address}: no scheduler answers there ({error})") from None
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT)
    except TimeoutError:
        client.close()
        message = f"{address}: the scheduler had no worker for {_TIMEOUT:.0f} s"
        raise ClusterError(message) from None
    return client


def _wait_first(client: "Client", pending: Iterable["Future"], address: str) -> Any:
    """Wait for the first futures to finish and return them; check the scheduler meanwhile."""
    from distributed import wait  # noqa: PLC0415

    while client.status != "closed":
        try:
            with client.as_current():
                return wait(
                    list(pending), timeout=_CHECK_INTERVAL, return_when="FIRST_COMPLETED"
                ).done
        except TimeoutError:
            continue
        except CancelledError:
            break
    raise ClusterError(f"{address}: the scheduler is gone")


def _chunk_result(
    future: "Future", chunk: tuple[Case, ...], chunks: _Chunks, address: str
) -> ChunkResult:
    """Return the result of a chunk; a chunk that kills its workers is retried case by case."""
    from distributed import KilledWorker  # noqa: PLC0415

    try:
        result: ChunkResult = future.result()
    except KilledWorker as error:
        if len(chunk) == 1:
            return ChunkResult(
                (Outcome(chunk[0].number, (), 0.0, f"killed its workers: {error}"),), 0.0
            )
        chunks.retries += [(case,) for case in chunk]
        return ChunkResult((), 0.0)
    except (CancelledError, TimeoutError) as error:
        raise ClusterError(f"{address}: the scheduler is gone ({error})") from None
    except Exception as error:  # raised on the worker: other code, missing file or package
        raise ClusterError(f"a worker cannot run the cases: {error}") from error
    future.release()
    return result
