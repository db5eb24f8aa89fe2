"""A sweep from its options to its dataset: check, resume, run, write."""

import errno
import hashlib
import itertools
import json
import os
import platform
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rig.analysis.rows import NOT_RUN, column_units, contents_attributes
from rig.campaign import AnyCampaign, AnyPlan, CampaignRow, build_plan, resolved_config
from rig.campaign.law_checks import compilation_problems, trial_problems
from rig.config import ranges
from rig.config.problems import ConfigError, Problem, format_value
from rig.planning.windows import repeat_period
from rig.recording import provenance
from rig.recording.runs.create import BusyError, lock_run, write_json
from rig.sweep.cases import Cases, Outcome, SweepRequest, single_row_campaign
from rig.sweep.executors import Executor
from rig.sweep.parameters import (
    OPTION,
    CampaignFiles,
    check_values,
    parameter_unit,
    parse_parameters,
)
from rig.sweep.result_cache import Journal
from rig.sweep.simulator import simulation_of

if TYPE_CHECKING:
    import xarray


FAILED = "failed"
_TEXT_COLUMNS = ("state", "incomplete_reason", "limits", "warned")
# Columns that are meaningless for a case.
_BOOKKEEPING = ("row", "attempt", "lost_ticks", "ticks_expected", "ticks_missing")

Array = npt.NDArray[Any]


def build_dataset(
    cases: Cases, campaign: AnyCampaign, outcomes: Iterable[Outcome], name: str
) -> "xarray.Dataset":
    """Return a dataset with every input as a coordinate and every result over parameters and rows.

    Both have units. Results of cases that did not run are NaN; ``state`` and ``incomplete_reason``
    give the state of each row and its reason.
    """
    import xarray  # noqa: PLC0415 - takes a second; a finished sweep does not need it

    rows = [row.row for row in cases.rows]
    columns = _fill_columns(cases, {row: i for i, row in enumerate(rows)}, outcomes)
    shape = (*cases.shape, len(rows))
    dims = (*(parameter.key for parameter in cases.request.parameters), "row")
    coords: dict[str, xarray.Variable] = {"row": xarray.Variable("row", rows)}
    for parameter in cases.request.parameters:
        unit = parameter_unit(parameter, campaign)
        coords[parameter.key] = xarray.Variable(
            parameter.key, _values(parameter.values), _units(unit)
        )
    request = cases.request
    run = campaign if request.sequential else single_row_campaign(campaign, request.lead_in)
    for key, value in _campaign_entries(run):
        if key not in coords:
            coords[key] = xarray.Variable(
                (), value, _units(ranges.unit_of_key(key.rpartition(".")[2]))
            )
    for key in ("point", "repetition"):
        coords[key] = xarray.Variable("row", [getattr(row, key) for row in cases.rows])
    contents = simulation_of(campaign).row_contents(campaign)
    data, units = {}, column_units(contents)
    settings = {column.name for column in contents.settings}
    for key, flat in columns.items():
        values = flat.reshape(shape)
        if key in settings and (planned := _planned_setting(values, key, cases.rows)) is not None:
            coords[key] = xarray.Variable("row", planned, _units(units[key]))
        else:
            data[key] = xarray.Variable(dims, values, _units(units.get(key, "")))
    return xarray.Dataset(data, coords, _attributes(cases, campaign, name))


def _fill_columns(
    cases: Cases, row_index: dict[int, int], outcomes: Iterable[Outcome]
) -> dict[str, Array]:
    """Return each result by name, one entry for each variant and row."""
    count = int(np.prod(cases.shape, dtype=int)) * len(row_index)
    columns: dict[str, Array] = {
        "state": np.full(count, NOT_RUN, object),
        "incomplete_reason": np.full(count, "", object),
    }
    by_number = list(cases) if cases.request.sequential else []
    for outcome in outcomes:
        variant, row_position = divmod(outcome.case, len(row_index))
        entries = [outcome.case]
        if by_number:
            variant = by_number[outcome.case].variant
            entries = [variant * len(row_index) + i for i in range(len(row_index))]
        if outcome.failed:
            columns["state"][entries], columns["incomplete_reason"][entries] = (
                FAILED,
                outcome.failed,
            )
        for row in outcome.rows:
            i = variant * len(row_index) + (row_index[row["row"]] if by_number else row_position)
            for key, value in row.items():
                if key in _BOOKKEEPING:
                    continue
                if key not in columns:
                    is_text = key in _TEXT_COLUMNS
                    columns[key] = np.full(count, "", object) if is_text else np.full(count, np.nan)
                columns[key][i] = value
    return columns


def _campaign_entries(campaign: AnyCampaign) -> Iterator[tuple[str, Any]]:
    """Yield keys and values of a campaign other than its rows; lists entry by entry."""
    contents = campaign.file.model_dump(mode="json", by_alias=True)

    def leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
        inside = value.items() if isinstance(value, dict) else enumerate(value)
        for name, each in inside:
            if isinstance(each, dict | list):
                yield from leaves(f"{key}.{name}", each)
            elif each is not None:
                yield f"{key}.{name}", each

    for key in campaign.kind.swept_keys:
        if isinstance(contents.get(key), dict):
            yield from leaves(key, contents[key])
        elif contents.get(key) is not None:
            yield key, contents[key]


def _planned_setting(values: Array, key: str, rows: tuple[CampaignRow[Any], ...]) -> Array | None:
    """Return a setting of the planned rows; None if a parameter of the sweep changes it."""
    # The position of the device that realises a set point is not itself one.
    planned = [getattr(row.setting, key, row.place) for row in rows]
    flat = values.reshape(-1, len(rows)).astype(float)
    unchanged = np.isnan(flat) | (flat == np.array(planned))
    return np.array(planned) if bool(unchanged.all()) else None


def _values(values: tuple[Any, ...]) -> Array:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([str(value) for value in values], object)


def _units(text: str) -> dict[str, str]:
    return {"units": text} if text else {}


def _attributes(cases: Cases, campaign: AnyCampaign, name: str) -> dict[str, Any]:
    code = provenance.describe_code()
    period = repeat_period(campaign.file.sea)
    attributes: dict[str, Any] = {
        "run": name,
        "mode": "batch",
        "campaign": campaign.file.name,
        "sea": campaign.file.sea.description(),
        "sequential": int(cases.request.sequential),
        **contents_attributes(simulation_of(campaign).row_contents(campaign)),
        "config": resolved_config(campaign),
        "code_version": code["version"],
        "code_git": code["git"],
        "sweep_parameters": json.dumps(
            {parameter.key: parameter.values for parameter in cases.request.parameters}
        ),
    }
    if not cases.request.sequential:
        attributes["lead_in_s"] = cases.request.lead_in
    return attributes | ({"wave_period_s": period} if period else {})


_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("controllers", "sim_plant", "rig")
_UNHASHED = "rig/cli/"  # display code changes no number
_NUMERIC_PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "filterpy")
"""Third-party packages whose versions may change a number."""
_NOT_COMPILED = "a sweep runs compiled code, but the law cannot be compiled"
RESULT_FILE = "sweep.nc"


class Sweep(NamedTuple):
    """A checked sweep and its folder."""

    folder: Path
    campaign: AnyCampaign  # without parameter values
    cases: Cases
    digest: str  # of files and code, checked by workers of a cluster
    swept: tuple[tuple[AnyCampaign, ...], ...]  # for each parameter, one campaign per value


def open_sweep(
    path: Path, options: list[str], sweeps: Path, *, sequential: bool, lead_in: float
) -> Sweep:
    """Check a sweep and create its folder, which is named by a digest of all its inputs.

    Raises `ConfigError` with every problem of the campaign and of every parameter value.
    """
    files = CampaignFiles(path)
    parsed = parse_parameters(options, files.kind.swept_keys)
    base, swept = check_values(files, parsed)
    if not_simulated := tuple(simulation_of(base).sweep_problems(base)):
        raise ConfigError(not_simulated)
    for parameter in parsed.parameters:
        if parameter.key == "start.lead_in_s" and not sequential:
            message = "rows that run alone have --lead-in instead; allowed with --sequential"
            raise ConfigError([Problem(OPTION, parameter.number, parameter.key, None, message)])
        longest = max((v for v in parameter.values if isinstance(v, int | float)), default=0.0)
        if parameter.key == "start.set_point_s" and not sequential and longest > lead_in:
            message = f"{format_value(longest)} is longer than the lead-in; allowed up to --lead-in"
            raise ConfigError([Problem(OPTION, parameter.number, parameter.key, longest, message)])
    planned = build_plan(base)
    _check_law(base, planned)
    request = SweepRequest(str(path), parsed.parameters, sequential, lead_in)
    digest = _digest(request, (base, *itertools.chain(*swept)))
    folder = sweeps / f"{base.file.name}_{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    cases = Cases(request, planned.rows, files)
    return Sweep(folder, base, cases, _workers_digest(request, base, files), swept)


def _check_law(campaign: AnyCampaign, planned: AnyPlan) -> None:
    """Raise `ConfigError` for a law that fails its trial or cannot be compiled."""
    problems = list(trial_problems(campaign, planned))
    if not problems:
        problems += compilation_problems(campaign, planned.dt, _NOT_COMPILED)
    if problems:
        raise ConfigError(problems)


def reopen_cases(request: SweepRequest, digest: str) -> Cases:
    """Return the cases of a sweep in another process with the same campaign files and code.

    Raises ValueError if files or code differ from those of ``digest``, `ConfigError` if the
    campaign cannot be opened.
    """
    files = CampaignFiles(Path(request.campaign))
    base = files.open()
    if _workers_digest(request, base, files) != digest:
        raise ValueError(
            f"{platform.node()} has other files for {request.campaign}, or other code, "
            "than the client"
        )
    return Cases(request, build_plan(base).rows, files)


def _workers_digest(request: SweepRequest, base: AnyCampaign, files: CampaignFiles) -> str:
    """Return the digest of the files that a worker reads, and of the code."""
    named_campaigns = (  # a text value may be the name of a file
        files.open(((parameter, value),))
        for parameter in request.parameters
        for value in parameter.values
        if isinstance(value, str)
    )
    return _digest(request, (base, *named_campaigns))


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
        return build_dataset(sweep.cases, sweep.campaign, journal.outcomes(), sweep.folder.name)


def write_dataset(table: "xarray.Dataset", path: Path) -> Path:
    """Write the dataset as NetCDF, atomically; return the path.

    Raises OSError with the file's name if it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.new")
    try:
        table.to_netcdf(temporary, engine="h5netcdf")
        temporary.replace(path)
    except OSError as error:  # HDF5 reports the system's error inside its own message
        temporary.unlink(missing_ok=True)
        match = re.search(r"errno = (\d+)", str(error))
        number = int(match[1]) if match else error.errno or errno.EIO
        raise OSError(number, os.strerror(number), str(path)) from error
    return path


def _digest(request: SweepRequest, campaigns: Iterable[AnyCampaign]) -> str:
    """Return a digest of the campaign's files, the parameters and the code."""
    digest = hashlib.sha256(
        json.dumps([request.parameters, request.sequential, request.lead_in]).encode()
    )
    for campaign in campaigns:  # separately: two files may have been swapped
        laws = [(each.law.name, each.law.sha256) for each in campaign.axis_laws.values()]
        inputs = (*campaign.files, *simulation_of(campaign).plant_data(campaign))
        files = [(file.role, file.sha256) for file in inputs]
        digest.update(json.dumps([files, *laws]).encode())
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
