"""A sweep from what is asked to its dataset: checked, resumed, run, written."""

import errno
import hashlib
import itertools
import json
import os
import platform
import re
from collections.abc import Callable, Iterable
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rig.config.problems import ConfigError, Problem, format_value
from rig.planning.campaign import Campaign, build_plan
from rig.recording.runs.create import BusyError, RunLock, lock_run, write_json
from rig.sweep.cases import Cases, Outcome, SweepRequest
from rig.sweep.executors import Executor
from rig.sweep.inputs import inputs
from rig.sweep.journal import Journal
from rig.sweep.parameters import OPTION, Files, checked, sweep_parameters
from rig.sweep.result import dataset

if TYPE_CHECKING:
    import xarray

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGES = ("controllers", "sim_plant", "rig")
_SAYS_NOTHING = "rig/cli/"  # what a person sees while it runs changes no number
_RECKON = ("numpy", "scipy", "numba", "llvmlite", "filterpy")
"""Packages of others whose versions may change a number."""
RESULT = "sweep.nc"


class Sweep(NamedTuple):
    """A sweep that was checked and has its folder."""

    folder: Path
    campaign: Campaign  # as its file has it
    cases: Cases
    digest: str  # of files and code, for who runs its cases elsewhere
    swept: tuple[tuple[Campaign, ...], ...]  # for each parameter, with each of its values


def open_sweep(
    path: Path, words: list[str], sweeps: Path, *, sequential: bool, lead_in: float
) -> Sweep:
    """Check a sweep and give it the folder that is named by all that goes into it.

    Raises `ConfigError` with every problem of the campaign and of every value asked for.
    """
    read, files = sweep_parameters(words), Files(path)
    base, swept = checked(files, read)
    if base.file.device == "absent":
        problem = base.locate.problem(("device",), "absent", "a wave calibration has no rows")
        raise ConfigError([problem])
    if base.file.hoist is not None:
        problem = base.locate.problem(("hoist",), None, "a hoist moves no body in a sweep")
        raise ConfigError([problem])
    for over in read.parameters:
        if over.key == "start.lead_in_s" and not sequential:
            message = "rows alone have one of their own, --lead-in; allowed with --sequential"
            raise ConfigError([Problem(OPTION, over.number, over.key, None, message)])
        most = max((v for v in over.values if isinstance(v, int | float)), default=0.0)
        if over.key == "start.set_point_s" and not sequential and most > lead_in:
            message = f"{format_value(most)} is longer than the lead-in; allowed up to --lead-in"
            raise ConfigError([Problem(OPTION, over.number, over.key, most, message)])
    planned = build_plan(base.file, base.rig, base.points)
    asked = SweepRequest(str(path), read.parameters, sequential, lead_in)
    digest = _digest(asked, (base, *itertools.chain(*swept)))
    folder = sweeps / f"{base.file.name}_{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    cases = Cases(asked, planned.rows, files)
    named = (
        campaign
        for over, each in zip(read.parameters, swept, strict=True)
        for value, campaign in zip(over.values, each, strict=True)
        if isinstance(value, str)
    )
    return Sweep(folder, base, cases, _digest(asked, (base, *named)), swept)


def same_cases(asked: SweepRequest, digest: str) -> Cases:
    """The cases of a sweep in another process, to which its campaign and code must be the same.

    Raises ValueError where files or code differ from those of ``digest``, `ConfigError` where the
    campaign cannot be opened.
    """
    files = Files(Path(asked.campaign))
    base = files.opened()
    named = (  # a word may be the name of a file
        files.opened(((over, value),))
        for over in asked.parameters
        for value in over.values
        if isinstance(value, str)
    )
    if _digest(asked, (base, *named)) != digest:
        raise ValueError(
            f"{platform.node()} has other files for {asked.campaign}, or other code, than who asks"
        )
    return Cases(asked, build_plan(base.file, base.rig, base.points).rows, files)


def hold(sweep: Sweep) -> RunLock:
    """Lock the folder; raises BusyError where the same sweep goes on already."""
    try:
        return lock_run(sweep.folder)
    except BusyError:
        raise BusyError(
            f"{sweep.folder}: the same sweep is being run by another process; wait for it, or end "
            "it: what it has finished is kept"
        ) from None


class Left(NamedTuple):
    """What a sweep's journal says before it is run."""

    cases: int  # not finished
    damaged: int  # bytes of it that could not be read


def left(sweep: Sweep) -> Left:
    """How many cases are not finished; what is damaged in the journal is cut off."""
    with Journal(sweep.folder) as journal:
        return Left(len(sweep.cases) - len(journal.finished), journal.damaged)


def run(
    sweep: Sweep,
    executor: Executor,
    see: Callable[[Outcome], None],
    begin: Callable[[int], None] = lambda before: None,
) -> "xarray.Dataset":
    """Run what is not finished yet and give all of it.

    ``begin`` is told how many cases were finished before, ``see`` is shown each outcome.

    Raises KeyboardInterrupt when interrupted; what was finished by then is kept.
    """
    write_json(sweep.folder, "sweep.json", sweep.cases.asked._asdict())
    with Journal(sweep.folder) as journal:
        finished = frozenset(journal.finished)
        begin(len(finished))
        waiting = (case for case in sweep.cases if case.number not in finished)
        for outcome in executor(waiting, sweep.cases.run):
            journal.add(outcome)
            see(outcome)
        return dataset(sweep.cases, sweep.campaign, journal.outcomes(), sweep.folder.name)


def write(table: "xarray.Dataset", path: Path) -> Path:
    """The dataset as NetCDF: the old file or the new one, never half of it.

    Raises OSError, with the file's name, where it cannot be written.
    """
    part = path.with_name(f".{path.name}.new")
    try:
        table.to_netcdf(part, engine="h5netcdf")
        part.replace(path)
    except OSError as error:  # HDF5 tells the system's error within a text of its own
        part.unlink(missing_ok=True)
        told = re.search(r"errno = (\d+)", str(error))
        number = int(told[1]) if told else error.errno or errno.EIO
        raise OSError(number, os.strerror(number), str(path)) from error
    return path


def _digest(asked: SweepRequest, campaigns: Iterable[Campaign]) -> str:
    """A word for the campaign's files, the parameters and the code."""
    whole = hashlib.sha256(json.dumps([asked.parameters, asked.sequential, asked.lead_in]).encode())
    for campaign in campaigns:  # each with its own: two files may have changed places
        read = [(file.role, file.sha256) for file in inputs(campaign)]
        whole.update(json.dumps(read).encode())
    whole.update(_code())
    return whole.hexdigest()[:12]


@cache
def _code() -> bytes:
    """A word for all sources and what makes numbers of them; those of a process do not change."""
    versions = [platform.python_version(), *(metadata.version(name) for name in _RECKON)]
    whole = hashlib.sha256(json.dumps(versions).encode())
    for package in _PACKAGES:
        for source in sorted((_ROOT / package).rglob("*.py")):
            name = source.relative_to(_ROOT).as_posix()
            if not name.startswith(_SAYS_NOTHING):
                whole.update(name.encode() + b"\0" + source.read_bytes())
    return whole.digest()
