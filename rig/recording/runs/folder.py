"""A run's folder: its files and attachments, the description of the run, and lists of runs.

Small JSON files lie in the folder during a run and inside its MCAP file for good; the MCAP file
alone (sent by mail, say) still contains everything.
"""

import contextlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from rig import module_process, row_contents
from rig.realtime import reasons
from rig.realtime.reasons import ReasonTable
from rig.recording.journal import JOURNAL
from rig.recording.mcap_writer import CLOCK_RECORD, START_KEY
from rig.recording.runs.mcap_file import FileContents, merge_descriptions, scan, scan_all
from rig.recording.runs.mcap_records import RunError
from rig.regular_file import MAX_TABLE_BYTES, read_regular
from rig.row_contents import RowContents
from rig.stations import Station

MCAP = "run.mcap"
RECOVERED = "run.recovered.mcap"  # replaces a damaged run.mcap
STATUS = "run.json"
FAULTS = "faults.json"  # in the folder of a rehearsal of faults, which holds its runs
SOCKET = "requests.sock"  # of a run that runs, for the requests of people
CONFIG = "config.json"
PLAN = "plan.json"
LAW_SOURCE = "law.py"  # of a law that was given by its file
REFUSED = "refused"  # status of a run that did not begin
_ABANDONED = "its supervisor is gone and wrote no end status: `rig recover` finishes it"
_PART = re.compile(re.escape(MCAP) + r"\.part(\d+)")
_EARLIER = re.compile(r"earlier-(\d+)\.mcap")


def mcap_files(run: str | os.PathLike[str]) -> list[Path]:
    """Return the MCAP files of a run in the order of time; raise RunError if there are none.

    A folder holds ``run.mcap``, or the parts that a killed logger and its successors left; a
    recovered file replaces the files from which it was recovered. In front of them are the records
    of the stages before the run was resumed.
    """
    path = Path(run)
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise RunError(f"{path}: no such run")
    earlier = earlier_records(path)
    for file in (path / RECOVERED, path / MCAP):
        if file.is_file():
            return [*earlier, file]
    found = [*earlier, *mcap_parts(path)]
    if not found:
        raise RunError(no_record_text(path))
    return found


def no_record_text(folder: Path) -> str:
    """Return why a run's folder has no record: a refused run never began one."""
    status = _read_json(folder / STATUS)
    if status.get("status") == REFUSED:
        return f"{folder}: the run was refused and has no record: {status.get('reason', 'unknown')}"
    return f"{folder}: no {MCAP} and no part of one"


def mcap_parts(folder: Path) -> list[Path]:
    """Return the parts of a record that loggers left in a run's folder, in the order of time."""
    return _numbered(folder, _PART)


def earlier_records(folder: Path) -> list[Path]:
    """Return the records of a run's stages before it was resumed, in the order of time."""
    return _numbered(folder, _EARLIER)


def is_earlier(record: Path) -> bool:
    """Return whether a file is the record of a stage before the run was resumed."""
    return _EARLIER.fullmatch(record.name) is not None


def _numbered(folder: Path, names: re.Pattern[str]) -> list[Path]:
    found = {int(m[1]): p for p in folder.iterdir() if (m := names.fullmatch(p.name))}
    return [found[number] for number in sorted(found)]


def attachments(run: str | os.PathLike[str]) -> dict[str, bytes]:
    """Return all attachments of a run's MCAP file(s) by name; the latest of a name counts."""
    return merge_descriptions(_scanned(run))[0]


def _scanned(run: str | os.PathLike[str]) -> list[FileContents]:
    """Scan the run's files; raise RunError if none of them can be read."""
    contents, damage = scan_all(mcap_files(run))
    if not contents:
        raise RunError("; ".join(damage))
    return contents


class RunInfo(NamedTuple):
    """Description of a run from its files; an empty text or dict where they lack it."""

    run: str  # run id
    mode: str = ""
    campaign: str = ""
    status: dict[str, Any] = {}  # noqa: RUF012
    config: dict[str, Any] = {}  # noqa: RUF012
    plan: dict[str, Any] = {}  # noqa: RUF012
    code: dict[str, Any] = {}  # noqa: RUF012
    host: dict[str, Any] = {}  # noqa: RUF012
    timing: dict[str, Any] = {}  # noqa: RUF012
    metadata: dict[str, dict[str, str]] = {}  # noqa: RUF012
    law_source: bytes = b""  # of a law that was given by its file
    journal: bytes = b""  # of the requests of people (`rig.recording.journal`)
    earlier_journals: bytes = b""  # of the stages before the run was resumed

    @property
    def started_utc(self) -> str:
        """UTC of run time zero, ISO 8601; empty if unknown."""
        recorded = self.status.get("started_utc")
        nanoseconds = self.metadata.get(CLOCK_RECORD, {}).get(START_KEY, "")
        if recorded or not nanoseconds.isdigit():
            return str(recorded or "")
        moment = datetime.fromtimestamp(int(nanoseconds) // 10**9, UTC)
        return moment.strftime("%Y-%m-%dT%H:%M:%SZ")

    @property
    def kind(self) -> str:
        """The kind of rig (`rig.kinds.registry`); empty if the record does not name it."""
        rig = self.config.get("rig")
        recorded = rig.get("kind") if isinstance(rig, dict) else None
        return str(recorded or self.status.get("kind") or "")

    @property
    def stations(self) -> tuple[Station, ...]:
        """The power stations in the plan, in the order of the flow of power."""
        return self.row_contents.stations

    @property
    def row_contents(self) -> RowContents:
        """The contents of the row table in the plan."""
        return row_contents.from_records(self.plan, earlier_contents())

    def requested_sea(self, row: dict[str, Any]) -> dict[str, Any] | None:
        """Return the lines that the wave maker was to make in a row of the plan; None if calm."""
        seas: dict[str, Any] = self.plan.get("requested_seas") or {}
        sea: dict[str, Any] | None = seas.get(str(row.get("seed"))) or self.plan.get(
            "requested_sea"
        )
        return sea

    @property
    def reasons(self) -> ReasonTable:
        """The reasons of a stop in the plan."""
        return recorded_reasons(self.plan)

    def config_number(self, *keys: str) -> float | None:
        """Return a number of the configuration by its keys, outermost first; None without one."""
        value: Any = self.config
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) else None

    def axis_number(self, axis: str, key: str) -> float | None:
        """Return a number of an axis's settings in the rig file; None without one.

        A kind with fixed axes has a section for each, others a section `axes`.
        """
        own = self.config_number("rig", axis, key)
        return self.config_number("rig", "axes", axis, key) if own is None else own

    def attributes(self) -> dict[str, Any]:
        """Return the description as flat attributes of a dataset."""
        flat = {"run": self.run, "mode": self.mode, "campaign": self.campaign}
        flat["started_utc"] = self.started_utc
        for key in ("status", "reason", "ended_utc"):
            if self.status.get(key) is not None:
                flat[key] = str(self.status[key])
        for key in ("version", "git"):
            if self.code.get(key) is not None:
                flat[f"code_{key}"] = str(self.code[key])
        for name, pairs in self.metadata.items():
            flat.update({f"{name}.{key}": value for key, value in pairs.items()})
        return {key: value for key, value in flat.items() if value}


def parse_json(data: bytes | None) -> dict[str, Any]:
    """Return a JSON file as a mapping; empty if it is missing or no mapping."""
    with contextlib.suppress(ValueError):
        value = json.loads(data or b"")
        return value if isinstance(value, dict) else {}
    return {}


def _read_json(path: Path) -> dict[str, Any]:
    """Return a small JSON file; empty if it does not exist or is no mapping."""
    return parse_json(_read_bytes(path))


def _read_bytes(path: Path) -> bytes:
    """Return the bytes of a file; none if there is no such file."""
    return read_regular(path, MAX_TABLE_BYTES) if path.is_file() else b""


def _campaign(config: dict[str, Any]) -> str:
    campaign = config.get("campaign")
    inner = campaign.get("name") if isinstance(campaign, dict) else None
    return str(config.get("name") or inner or "")


def _with_current_keys(plan: dict[str, Any]) -> dict[str, Any]:
    """Return a plan with the keys of today; runs before 2027 have ``asked_sea``."""
    return {{"asked_sea": "requested_sea"}.get(key, key): value for key, value in plan.items()}


def run_info(
    run: str | os.PathLike[str], contents: Iterable[FileContents] | None = None
) -> RunInfo:
    """Return the description of a run; ``contents``: its scanned files if they exist already."""
    path = Path(run)
    attached, metadata = merge_descriptions(_scanned(run) if contents is None else contents)

    def read(*names: str) -> dict[str, Any]:
        for name in names:
            found = _read_json(path / name) or parse_json(attached.get(name))
            if found:
                return found
        return {}

    status, config = read(STATUS, "status.json"), read(CONFIG)
    recorded = metadata.get("run", {})
    folder = path if path.is_dir() else path.parent
    return RunInfo(
        run=str(recorded.get("run") or recorded.get("id") or folder.name),
        mode=_mode(status, recorded, config),
        campaign=str(status.get("campaign") or _campaign(config)),
        status=status,
        config=config,
        plan=_with_current_keys(read(PLAN)),
        code=read("code.json"),
        host=read("host.json"),
        timing=read("timing.json"),
        metadata=metadata,
        law_source=attached.get(LAW_SOURCE) or _read_bytes(path / LAW_SOURCE),
        journal=_read_bytes(_journal(path)) or attached.get(JOURNAL, b""),
        earlier_journals=b"\n".join(
            _read_bytes(_journal(each)) for each in (earlier_records(path) if path.is_dir() else ())
        ),
    )


def _journal(path: Path) -> Path:
    return path.with_suffix(f".{JOURNAL}") if is_earlier(path) else path / JOURNAL


class RunListEntry(NamedTuple):
    """One entry in a list of runs."""

    run: str
    path: Path
    started_utc: str
    mode: str
    campaign: str
    rows_done: int | None
    rows_planned: int | None
    status: str  # running, complete, stopped, fault, crashed, refused, abandoned, unknown
    reason: str
    size: int  # size of its MCAP file(s), bytes
    problem: str  # problem with the folder; empty without one
    record: str = ""  # state of its record when the run was closed; `rig show` checks it

    @property
    def never_began(self) -> bool:
        """Whether the run was refused before its record began."""
        return self.status == REFUSED and self.size == 0


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) else None


def is_supervised(status: dict[str, Any]) -> bool | None:
    """Return whether the supervisor named in a run's status is alive; None if none is named."""
    pid, started = status.get("pid"), status.get("pid_started")
    if not isinstance(pid, int) or not isinstance(started, int):
        return None
    return module_process.start_ticks(pid) == started


def _is_abandoned(status: dict[str, Any], mcaps: list[Path]) -> bool:
    """Return whether a run with status "running" has no process left to end it."""
    lives = is_supervised(status)
    if lives is not None:
        return not lives
    try:
        return bool(mcaps) and all(scan(p).finished for p in mcaps)
    except (RunError, OSError):
        return False


def _mode(*texts: Mapping[str, Any]) -> str:
    """Return the execution mode of a run; runs recorded before 2026-12 call it ``rung``."""
    found = (text.get(key) for text in texts for key in ("mode", "rung"))
    return str(next(filter(None, found), ""))


def _quick_info(path: Path) -> RunInfo:
    """Return the description from the JSON files alone; no MCAP file is opened."""
    status = _read_json(path / STATUS)
    return RunInfo(
        run=str(status.get("run") or path.name),
        mode=_mode(status),
        campaign=str(status.get("campaign") or _campaign(_read_json(path / CONFIG))),
        status=status,
    )


def _list_entry(path: Path) -> RunListEntry:
    found = RunInfo(path.name)
    problem, size = "", 0
    mcaps: list[Path] = []
    try:
        file = path / STATUS
        quick = file.is_file() and (path / CONFIG).is_file()
        if quick:
            found = _quick_info(path)
        mcaps = mcap_files(path)
        size = sum(p.stat().st_size for p in mcaps)
        if not quick:
            found = run_info(path)
        if file.is_file() and not found.status:
            problem = f"{STATUS} is not readable"
        elif not file.is_file():
            problem = f"no {STATUS}: the file was removed, or the run was killed before it began"
        elif size == 0:
            problem = "the MCAP file is empty"
    except (RunError, OSError) as error:
        problem = str(error)
    state = str(found.status.get("status") or "unknown")
    record = str(found.status.get("record", ""))
    if state == REFUSED and not mcaps:  # it never began: the reason of its status counts
        problem = record = ""
    if state == "running" and _is_abandoned(found.status, mcaps):
        state = "abandoned"
        problem = "; ".join(filter(None, (_ABANDONED, problem)))
    return RunListEntry(
        run=found.run,
        path=path,
        started_utc=found.started_utc,
        mode=found.mode,
        campaign=found.campaign,
        rows_done=_count(found.status.get("rows_done")),
        rows_planned=_count(found.status.get("rows_planned")),
        status=state,
        reason=str(found.status.get("reason", "")),
        size=size,
        problem=problem,
        record=record,
    )


def _sort_key(run: RunListEntry) -> tuple[datetime, str]:
    """Return the start of a run, by its status or else its folder's name; then the name."""
    for text in (run.started_utc, run.path.name.partition("_")[0]):
        with contextlib.suppress(ValueError):
            moment = datetime.fromisoformat(text)
            return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)), run.path.name
    return datetime.min.replace(tzinfo=UTC), run.path.name


def list_runs(folder: str | os.PathLike[str]) -> list[RunListEntry]:
    """Return all runs in a folder, oldest first; a broken run is listed with its problem."""
    folder = Path(folder)
    if not folder.is_dir():
        return []
    found = [
        _list_entry(path)
        for path in sorted(folder.iterdir())
        if path.is_dir() and not path.name.startswith(".") and not (path / FAULTS).is_file()
    ]
    return sorted(found, key=_sort_key)


def recorded_reasons(plan: Mapping[str, Any]) -> ReasonTable:
    """Return the reasons of a stop in a run's plan; runs before 2027 do not list them."""
    listed = plan.get("reasons")
    return earlier_reasons() if listed is None else reasons.from_records(listed)


@cache
def earlier_reasons() -> ReasonTable:
    """Return the reasons of runs recorded before 2027."""
    return reasons.from_records(_earlier("reasons"))


@cache
def earlier_contents() -> RowContents:
    """Return the contents of the row table of runs recorded before 2027; plans list a part."""
    return row_contents.from_records(_earlier("row_contents"))


def _earlier(name: str) -> Any:
    return json.loads(resources.files(__package__).joinpath(f"earlier_{name}.json").read_text())
