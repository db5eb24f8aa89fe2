"""A run's folder: its files, what is attached, what kind of run it was, and lists of runs.

Small JSON texts lie in the folder while a run goes on and inside its MCAP file for good; the MCAP
file alone (sent by mail, say) still tells everything.
"""

import contextlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig.recording import process_identity
from rig.recording.row_schema import CLOCK, START_KEY
from rig.recording.runs.mcap_file import Contents, RunError, scan
from rig.regular_file import MAX_TABLE_BYTES, read_regular

MCAP = "run.mcap"
RECOVERED = "run.recovered.mcap"  # in the place of a run.mcap that is torn
STATUS = "run.json"
CONFIG = "config.json"
_GONE = "its supervisor is gone and left no ending: `rig recover` finishes it"
_PART = re.compile(re.escape(MCAP) + r"\.part(\d+)")


def files(run: str | os.PathLike[str]) -> list[Path]:
    """The MCAP files of a run in the order of time; RunError if there are none.

    A folder holds ``run.mcap``, or the parts that a killed logger and its successors left; what
    was recovered stands before what it was recovered from.
    """
    path = Path(run)
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise RunError(f"{path}: no such run")
    for whole in (path / RECOVERED, path / MCAP):
        if whole.is_file():
            return [whole]
    found = parts(path)
    if not found:
        raise RunError(f"{path}: no {MCAP} and no part of one")
    return found


def parts(folder: Path) -> list[Path]:
    """The parts of a record that loggers left in a run's folder, in the order of time."""
    found = {int(m[1]): p for p in folder.iterdir() if (m := _PART.fullmatch(p.name))}
    return [found[number] for number in sorted(found)]


def attachments(run: str | os.PathLike[str]) -> dict[str, bytes]:
    """Everything attached to a run's MCAP file(s), by name; the latest counts."""
    found: dict[str, bytes] = {}
    for each in _scanned(run):
        found.update(each.attachments)
    return found


def _scanned(run: str | os.PathLike[str]) -> list[Contents]:
    """The run's files; RunError if none of them can be read at all."""
    found: list[Contents] = []
    refused: RunError | None = None
    for path in files(run):
        try:
            found.append(scan(path))
        except RunError as error:
            refused = error
    if refused is not None and not found:
        raise refused
    return found


class Facts(NamedTuple):
    """What a run was, as far as its files say; an empty text or dict where they do not."""

    run: str  # run id
    mode: str
    campaign: str
    status: dict[str, Any]
    config: dict[str, Any]
    plan: dict[str, Any]
    code: dict[str, Any]
    host: dict[str, Any]
    timing: dict[str, Any]
    metadata: dict[str, dict[str, str]]

    @property
    def started_utc(self) -> str:
        """When run time was zero, ISO 8601 in UTC; empty if nothing says it."""
        told = self.status.get("started_utc")
        nanoseconds = self.metadata.get(CLOCK, {}).get(START_KEY, "")
        if told or not nanoseconds.isdigit():
            return str(told or "")
        moment = datetime.fromtimestamp(int(nanoseconds) // 10**9, UTC)
        return moment.strftime("%Y-%m-%dT%H:%M:%SZ")

    def configured(self, *keys: str) -> float | None:
        """A number of the configuration by its keys, outermost first; None where there is none."""
        value: Any = self.config
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return float(value) if isinstance(value, int | float) else None

    def attributes(self) -> dict[str, Any]:
        """The same as flat attributes of a dataset."""
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


def _text(path: Path) -> dict[str, Any]:
    return _json(read_regular(path, MAX_TABLE_BYTES))


def _json(data: bytes | None) -> dict[str, Any]:
    if data is None:
        return {}
    try:
        value = json.loads(data)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def _campaign(config: dict[str, Any]) -> str:
    campaign = config.get("campaign")
    inner = campaign.get("name") if isinstance(campaign, dict) else None
    return str(config.get("name") or inner or "")


def facts(run: str | os.PathLike[str], contents: Iterable[Contents] | None = None) -> Facts:
    """What a run was; ``contents`` are its scanned files where the caller has them already."""
    path = Path(run)
    scanned = list(contents) if contents is not None else _scanned(run)
    inside: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    for each in scanned:
        inside.update(each.attachments)
        metadata.update(each.metadata)

    def read(*names: str) -> dict[str, Any]:
        for name in names:
            beside = path / name
            if path.is_dir() and beside.is_file() and (found := _text(beside)):
                return found
            if found := _json(inside.get(name)):
                return found
        return {}

    status, config = read(STATUS, "status.json"), read(CONFIG)
    told = metadata.get("run", {})
    folder = path if path.is_dir() else path.parent
    return Facts(
        run=str(told.get("run") or told.get("id") or folder.name),
        mode=_mode(status, told, config),
        campaign=str(status.get("campaign") or _campaign(config)),
        status=status,
        config=config,
        plan=read("plan.json"),
        code=read("code.json"),
        host=read("host.json"),
        timing=read("timing.json"),
        metadata=metadata,
    )


class Listed(NamedTuple):
    """One line of a list of runs."""

    run: str
    path: Path
    started_utc: str
    mode: str
    campaign: str
    rows_done: int | None
    rows_planned: int | None
    status: str  # running, complete, stopped, fault, crashed, refused, abandoned, unknown
    reason: str
    size: int  # bytes of its MCAP file(s)
    problem: str  # what is wrong with the folder; empty if nothing is
    record: str = ""  # the state of its record when it was closed; `rig show` looks at it


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) else None


def supervised(status: dict[str, Any]) -> bool | None:
    """Whether the supervisor named in a run's status still lives; None if none is named."""
    pid, started = status.get("pid"), status.get("pid_started")
    if not isinstance(pid, int) or not isinstance(started, int):
        return None
    return process_identity.started(pid) == started


def _abandoned(status: dict[str, Any], mcaps: list[Path]) -> bool:
    """Whether a run that is listed as running has nobody left to end it."""
    lives = supervised(status)
    if lives is not None:
        return not lives
    try:
        return bool(mcaps) and all(scan(p).finished for p in mcaps)
    except (RunError, OSError):
        return False


def _mode(*texts: Mapping[str, Any]) -> str:
    """The execution mode of a run; runs recorded before 2026-12 call it ``rung``."""
    found = (text.get(key) for text in texts for key in ("mode", "rung"))
    return str(next(filter(None, found), ""))


def _quick_facts(path: Path) -> Facts:
    """What the texts beside a record say of it; no MCAP file is opened."""
    status = _text(path / STATUS)
    return Facts(
        run=str(status.get("run") or path.name),
        mode=_mode(status),
        campaign=str(status.get("campaign") or _campaign(_text(path / CONFIG))),
        status=status,
        **{name: {} for name in ("config", "plan", "code", "host", "timing", "metadata")},
    )


def _listed(path: Path) -> Listed:
    found = Facts(path.name, "", "", {}, {}, {}, {}, {}, {}, {})
    problem, size = "", 0
    mcaps: list[Path] = []
    try:
        beside = path / STATUS
        quick = beside.is_file() and (path / CONFIG).is_file()
        if quick:
            found = _quick_facts(path)
        mcaps = files(path)
        size = sum(p.stat().st_size for p in mcaps)
        if not quick:
            found = facts(path)
        if beside.is_file() and not found.status:
            problem = f"{STATUS} is not readable"
        elif not beside.is_file():
            problem = f"no {STATUS}: the file was removed, or the run was killed before it began"
        elif size == 0:
            problem = "the MCAP file is empty"
    except (RunError, OSError) as error:
        problem = str(error)
    state = str(found.status.get("status") or "unknown")
    if state == "running" and _abandoned(found.status, mcaps):
        state = "abandoned"
        problem = "; ".join(filter(None, (_GONE, problem)))
    return Listed(
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
        record=str(found.status.get("record", "")),
    )


def _moment(run: Listed) -> tuple[datetime, str]:
    """When a run started, by its status or else by its folder's name; then the name."""
    for text in (run.started_utc, run.path.name.partition("_")[0]):
        with contextlib.suppress(ValueError):
            moment = datetime.fromisoformat(text)
            return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)), run.path.name
    return datetime.min.replace(tzinfo=UTC), run.path.name


def list_runs(folder: str | os.PathLike[str]) -> list[Listed]:
    """All runs in a folder, oldest first; a broken one is listed with what is wrong with it."""
    folder = Path(folder)
    if not folder.is_dir():
        return []
    found = [
        _listed(path)
        for path in sorted(folder.iterdir())
        if path.is_dir() and not path.name.startswith(".")
    ]
    return sorted(found, key=_moment)
