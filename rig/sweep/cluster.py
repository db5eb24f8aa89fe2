"""Cases on a Dask cluster: the same seam as threads, on as many machines as the scheduler has.

Cases go out in chunks of about a second of work, so that what a task costs (some milliseconds) is
lost beside it. A worker that dies loses nothing: the scheduler gives its chunk to another one, and
a chunk's outcomes are taken once. A worker opens the campaign from the same path as the client and
refuses to run it with other files or other code: its numbers would be of something else.
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

from rig.sweep.cases import Case, Cases, Outcome, SweepRequest
from rig.sweep.executors import Executor, Work
from rig.sweep.sweep import same_cases

if TYPE_CHECKING:
    from distributed import Client, Future

CHUNK = 1.0  # s of work in a chunk
_MOST = 500  # cases of a chunk
_GROWTH = 4  # at most, from one chunk to the next: the first cases may be the quick ones
_AHEAD = 2  # chunks handed out for each thread of the cluster: none waits for the client
_PATIENCE = 30.0  # s for the scheduler to answer, and for a worker to be there
_LOOK = 5.0  # s between two looks at whether the scheduler is still there
_opening = Lock()


class ClusterError(OSError):
    """The cluster cannot run the cases; what is finished by then is kept."""


class Done(NamedTuple):
    """What a chunk gave."""

    outcomes: tuple[Outcome, ...]
    seconds: float  # that its cases took on the worker


def cluster(
    address: str, asked: SweepRequest, digest: str, see: Callable[[Done], None] = lambda done: None
) -> Executor:
    """The executor of a scheduler (``tcp://HOST:PORT``) for the cases of one sweep.

    ``digest`` is what the workers' files and code must have (`rig.sweep.sweep.Sweep.digest`);
    ``see`` is shown each chunk. Raises ClusterError, when the cases are asked for, where dask is
    not installed, nobody answers, or a worker refuses.
    """
    there = asked._replace(campaign=str(Path(asked.campaign).resolve()))

    def run(cases: Iterable[Case], work: Work) -> Iterator[Outcome]:
        with _client(address) as client:
            chunks = _Chunks(iter(cases))
            pending: dict[Future, tuple[Case, ...]] = {}
            try:
                while True:
                    room = _AHEAD * max(1, sum(client.nthreads().values())) - len(pending)
                    for chunk in islice(chunks, max(room, 0)):
                        future = client.submit(run_chunk, there, digest, chunk, pure=False)
                        pending[future] = chunk
                    if not pending:
                        return
                    for future in _first(client, pending, address):
                        done = _taken(future, pending.pop(future), chunks, address)
                        see(done)
                        chunks.took(len(done.outcomes), done.seconds)
                        yield from done.outcomes
            except KeyboardInterrupt:
                for future in [one for one in pending if one.status == "finished"]:
                    yield from _taken(future, pending.pop(future), chunks, address).outcomes
                raise
            finally:
                with suppress(Exception):  # of a scheduler that is gone
                    client.cancel(list(pending), force=True)

    return run


class _Chunks:
    """The cases that wait, cut into chunks as long as the last ones suggest."""

    def __init__(self, waiting: Iterator[Case]) -> None:
        self._waiting = waiting
        self._size = 1
        self.again: list[tuple[Case, ...]] = []  # to be run before the others

    def __iter__(self) -> Iterator[tuple[Case, ...]]:
        return self

    def __next__(self) -> tuple[Case, ...]:
        chunk = self.again.pop() if self.again else tuple(islice(self._waiting, self._size))
        if not chunk:
            raise StopIteration
        return chunk

    def took(self, cases: int, seconds: float) -> None:
        """So many cases took so long together."""
        if cases:
            fitting = CHUNK * cases / max(seconds, 1e-6)
            self._size = max(1, min(int(fitting), _GROWTH * self._size, _MOST))


def run_chunk(asked: SweepRequest, digest: str, chunk: tuple[Case, ...]) -> Done:
    """Run a chunk on a worker; opening the campaign and compiling the loop is not its work."""
    cases = _opened(asked, digest)
    began = time.perf_counter()
    outcomes = tuple(cases.run(case) for case in chunk)
    return Done(outcomes, time.perf_counter() - began)


def _opened(asked: SweepRequest, digest: str) -> Cases:
    """The cases of a sweep, opened and compiled once in a worker, whatever its threads."""
    with _opening:
        return _open(asked, digest)


@lru_cache(2)
def _open(asked: SweepRequest, digest: str) -> Cases:
    cases = same_cases(asked, digest)
    cases.prepare()
    return cases


def _client(address: str) -> "Client":
    try:
        from distributed import Client  # noqa: PLC0415  (an optional extra, and a second to import)
    except ImportError:
        raise ClusterError("--scheduler needs Dask: pip install 'wec-rig[dask]'") from None
    try:
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(f"{address}: no scheduler answers there ({error})") from None
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        client.close()
        message = f"{address}: the scheduler had no worker for {_PATIENCE:.0f} s"
        raise ClusterError(message) from None
    return client


def _first(client: "Client", pending: Iterable["Future"], address: str) -> Any:
    """The futures that are done, at least one; looks now and then whether the scheduler lives."""
    from distributed import wait  # noqa: PLC0415

    while client.status != "closed":
        try:
            with client.as_current():
                return wait(list(pending), timeout=_LOOK, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        except CancelledError:
            break
    raise ClusterError(f"{address}: the scheduler is gone")


def _taken(future: "Future", chunk: tuple[Case, ...], chunks: _Chunks, address: str) -> Done:
    """What a chunk gave; of one that kills its workers each case is tried alone."""
    from distributed import KilledWorker  # noqa: PLC0415

    try:
        done: Done = future.result()
    except KilledWorker as error:
        if len(chunk) == 1:
            return Done((Outcome(chunk[0].number, (), 0.0, f"killed its workers: {error}"),), 0.0)
        chunks.again += [(case,) for case in chunk]
        return Done((), 0.0)
    except (CancelledError, TimeoutError) as error:
        raise ClusterError(f"{address}: the scheduler is gone ({error})") from None
    except Exception as error:  # a worker's own: other code, no such file, no package
        raise ClusterError(f"a worker cannot run the cases: {error}") from error
    future.release()
    return done
