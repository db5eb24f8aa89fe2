"""A sweep from its options to its dataset: check, resume, run, write."""

import hashlib
import itertools
import json
import math
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.rows import NOT_RUN
from rig.kinds.rig_file import kind_of_task
from rig.recording import provenance
from rig.recording.runs.create import BusyError, lock_run, write_json
from rig.regular_file import replacing
from rig.sweeps.campaigns import CampaignTasks
from rig.sweeps.cases import Cases, Outcome, SweepRequest
from rig.sweeps.executors import Executor
from rig.sweeps.parameters import (
    TaskFiles,
    check_values,
    parameter_unit,
    parse_parameters,
    unit_of_path,
)
from rig.sweeps.result_cache import Journal
from rig.sweeps.sessions import SessionTasks
from rig.sweeps.simulator import campaign_kind, session_simulation
from rig.sweeps.task import FAILED, SweepTask, TaskType

if TYPE_CHECKING:
    import xarray


# Entries of a row's results that are no results of a case.
_BOOKKEEPING = ("row", "attempt", "lost_ticks", "ticks_expected", "ticks_missing", "units")

Array = npt.NDArray[Any]


def build_dataset(
    cases: Cases, tasks: TaskType, outcomes: Iterable[Outcome], name: str
) -> "xarray.Dataset":
    """Return a dataset with every input as a coordinate and every result over parameters and rows.

    Both have units. Results of cases that did not run are NaN; ``state`` and ``incomplete_reason``
    give the state of each row and its reason. A session has no dimension of rows.
    """
    import xarray  # noqa: PLC0415 - takes a second; a finished sweep does not need it

    task, parameters = cases.base, cases.request.parameters
    contents = tasks.contents(task)
    columns, units = _fill_columns(cases, outcomes)
    units |= contents.units
    row_dims = ("row",) if contents.row_settings else ()
    shape = (*cases.shape, *(len(task.rows) for _ in row_dims))
    dims = (*(parameter.key for parameter in parameters), *row_dims)
    coords: dict[str, xarray.Variable] = {}
    if row_dims:
        coords["row"] = xarray.Variable("row", task.rows)
    for parameter in parameters:
        unit = parameter_unit(parameter, task)
        coords[parameter.key] = xarray.Variable(
            parameter.key, _values(parameter.values), _units(unit)
        )
    for key, value in contents.settings.items():
        if not any(f"{key}.".startswith(f"{each.key}.") for each in parameters):
            coords[key] = xarray.Variable((), value, _units(unit_of_path(key.split("."))))
    for key, values in contents.row_settings.items():
        coords[key] = xarray.Variable("row", values)
    data = {}
    for key, flat in columns.items():
        filled = flat.reshape(shape)
        planned = contents.planned.get(key)
        if planned is not None and _is_unchanged(filled, planned):
            coords[key] = xarray.Variable("row", np.array(planned), _units(units[key]))
        else:
            data[key] = xarray.Variable(dims, filled, _units(units.get(key, "")))
    code = provenance.describe_code()
    attributes = {
        "run": name,
        "mode": "batch",
        "campaign": task.name,
        **contents.attributes,
        "code_version": code["version"],
        "code_git": code["git"],
        "sweep_parameters": json.dumps({each.key: each.values for each in parameters}),
    }
    return xarray.Dataset(data, coords, attributes)


def _fill_columns(
    cases: Cases, outcomes: Iterable[Outcome]
) -> tuple[dict[str, Array], dict[str, str]]:
    """Return each result by name, one entry for each variant and row; and units of results."""
    row_index = {row: i for i, row in enumerate(cases.base.rows)}
    row_count, cases_per_variant = len(row_index), len(cases.base.case_rows)
    rows_per_case = row_count // cases_per_variant
    count = math.prod(cases.shape) * row_count
    columns: dict[str, Array] = {
        "state": np.full(count, NOT_RUN, object),
        "incomplete_reason": np.full(count, "", object),
    }
    units: dict[str, str] = {}
    for outcome in outcomes:
        if outcome.failed:
            failed = slice(outcome.case * rows_per_case, (outcome.case + 1) * rows_per_case)
            columns["state"][failed] = FAILED
            columns["incomplete_reason"][failed] = outcome.failed
        for row in outcome.rows:
            i = outcome.case // cases_per_variant * row_count + row_index[row["row"]]
            units |= row.get("units", {})
            for key, value in row.items():
                if key in _BOOKKEEPING:
                    continue
                if key not in columns:
                    is_text = isinstance(value, str)
                    columns[key] = np.full(count, "", object) if is_text else np.full(count, np.nan)
                columns[key][i] = value
    return columns, units


def _is_unchanged(values: Array, planned: Sequence[float]) -> bool:
    """Return whether a setting is that of the planned rows: no parameter changes it."""
    flat = values.reshape(-1, len(planned)).astype(float)
    return bool((np.isnan(flat) | (flat == np.array(planned))).all())


def _values(values: tuple[Any, ...]) -> Array:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([str(value) for value in values], object)


def _units(text: str) -> dict[str, str]:
    return {"units": text} if text else {}


_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("controllers", "sim_plant", "rig")
_UNHASHED = ("rig/api/", "rig/cli/")  # display code changes no number
_NUMERIC_PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "filterpy")
"""Third-party packages whose versions may change a number."""
RESULT_FILE = "sweep.nc"


class Sweep(NamedTuple):
    """A checked sweep and its folder."""

    folder: Path
    tasks: TaskType
    task: SweepTask  # without parameter values
    cases: Cases
    digest: str  # of files and code, checked by workers of a cluster
    swept: tuple[tuple[SweepTask, ...], ...]  # for each parameter, one task per value


def open_tasks(path: Path, *, sequential: bool, lead_in: float) -> TaskType:
    """Return the type of the task in a file: the campaigns or sessions of its kind of rig.

    Raises KindError if the kind has neither, `ConfigError` if the file names no usable kind.
    """
    kind = kind_of_task(path)
    if (sessions := session_simulation(kind)) is not None:
        return SessionTasks(sessions)
    return CampaignTasks(campaign_kind(kind), sequential=sequential, lead_in=lead_in)


def open_sweep(
    path: Path,
    options: list[str],
    sweeps: Path,
    *,
    sequential: bool,
    lead_in: float,
    given: Sequence[str] = (),
) -> Sweep:
    """Check a sweep and create its folder, which is named by a digest of all its inputs.

    ``given``: further options of the command line, which a task may have no use for. Raises
    `ConfigError` with every problem of the task, of every parameter value and of these options.
    """
    tasks = open_tasks(path, sequential=sequential, lead_in=lead_in)
    files = TaskFiles(path, tasks)
    parsed = parse_parameters(options, tasks)
    problems = (*tasks.option_problems(given), *parsed.problems)
    base, swept = check_values(files, parsed._replace(problems=problems))
    tasks.check(base, parsed.parameters)
    request = SweepRequest(str(path), parsed.parameters, sequential, lead_in)
    digest = _digest(request, (base, *itertools.chain(*swept)))
    folder = sweeps / f"{base.name}_{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    cases = Cases(request, base, files)
    return Sweep(folder, tasks, base, cases, _workers_digest(request, base, files), swept)


def reopen_cases(request: SweepRequest, digest: str) -> Cases:
    """Return the cases of a sweep in another process with the same files and code.

    Raises ValueError if files or code differ from those of ``digest``, `ConfigError` if the task
    cannot be opened.
    """
    path = Path(request.campaign)
    tasks = open_tasks(path, sequential=request.sequential, lead_in=request.lead_in)
    files = TaskFiles(path, tasks)
    base = files.open()
    if _workers_digest(request, base, files) != digest:
        raise ValueError(
            f"{platform.node()} has other files for {request.campaign}, or other code, "
            "than the client"
        )
    return Cases(request, base, files)


def _workers_digest(request: SweepRequest, base: SweepTask, files: TaskFiles) -> str:
    """Return the digest of the files that a worker reads, and of the code."""
    named_tasks = (  # a text value may be the name of a file
        files.open(((parameter, value),))
        for parameter in request.parameters
        for value in parameter.values
        if isinstance(value, str)
    )
    return _digest(request, (base, *named_tasks))


@contextmanager
def lock_folder(sweep: Sweep) -> Iterator[None]:
    """Lock the sweep's folder; raise BusyError if another process runs the same sweep."""
    with ExitStack() as stack:
        try:
            stack.enter_context(lock_run(sweep.folder))
        except BusyError:
            raise BusyError(
                f"{sweep.folder}: another process runs the same sweep; wait for it or end it: "
                "finished cases are kept"
            ) from None
        yield


def count_remaining(sweep: Sweep) -> tuple[int, int]:
    """Return the number of unfinished cases, and of bytes cut off the journal's damaged end."""
    with Journal(sweep.folder) as journal:
        return len(sweep.cases) - len(journal.finished), journal.damaged_bytes


def run(
    sweep: Sweep,
    executor: Executor,
    on_outcome: Callable[[Outcome], None],
    on_start: Callable[[int], None] = lambda before: None,
) -> "xarray.Dataset":
    """Run the unfinished cases and return the dataset of all cases.

    The function calls ``on_start`` with the number of cases finished before, and ``on_outcome``
    with each outcome. Raises KeyboardInterrupt when interrupted; finished cases are kept.
    """
    write_json(sweep.folder, "sweep.json", sweep.cases.request._asdict())
    with Journal(sweep.folder) as journal:
        finished = frozenset(journal.finished)
        on_start(len(finished))
        waiting = (case for case in sweep.cases if case.number not in finished)
        for outcome in executor(waiting, sweep.cases.run):
            journal.add(outcome)
            on_outcome(outcome)
        return build_dataset(sweep.cases, sweep.tasks, journal.outcomes(), sweep.folder.name)


def write_dataset(table: "xarray.Dataset", path: Path) -> Path:
    """Write the dataset as NetCDF, atomically; return the path.

    Raises OSError with the file's name if it cannot be written.
    """
    with replacing(path) as part:
        # In memory first: HDF5 crashes the process if its disk is full.
        part.write_bytes(table.to_netcdf(engine="h5netcdf"))
    return path


def _digest(request: SweepRequest, tasks: Iterable[SweepTask]) -> str:
    """Return a digest of the files of tasks, the parameters and the code."""
    digest = hashlib.sha256(
        json.dumps([request.parameters, request.sequential, request.lead_in]).encode()
    )
    for task in tasks:  # separately: two files may have been swapped
        digest.update(json.dumps(task.inputs).encode())
    digest.update(_code_digest())
    return digest.hexdigest()[:12]


@cache
def _code_digest() -> bytes:
    """Return a digest of all sources and numeric packages; computed once per process."""
    versions = [platform.python_version(), *(metadata.version(name) for name in _NUMERIC_PACKAGES)]
    digest = hashlib.sha256(json.dumps(versions).encode())
    for package in _PACKAGES:
        for source in sorted((_ROOT / package).rglob("*.py")):
            name = source.relative_to(_ROOT).as_posix()
            if not name.startswith(_UNHASHED):
                digest.update(name.encode() + b"\0" + source.read_bytes())
    return digest.digest()
