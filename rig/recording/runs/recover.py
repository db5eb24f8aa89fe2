"""`rig recover`: one finished record from the remains of a crash, and an exact account of it.

The files that the crash left are never changed. The recovered file gets its name only once it is
whole, on disk and read back by the stock MCAP library. A second recovery finds the work done.
"""

from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig.realtime.reasons import ReasonTable
from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import create, folder, mcap_file
from rig.recording.runs.join import join
from rig.recording.runs.mcap_file import FileContents
from rig.recording.runs.mcap_records import RunError
from rig.recording.runs.state import (
    LOOP,
    EndReport,
    TickAccount,
    account_ticks,
    end_report,
    logger_status,
    read_json,
)
from rig.recording.runs.verify import ReadBack, read_back

KILLED = "its processes were killed"
LOOP_KILLED = "its loop was killed"
_OUTPUT_HINT = "use `rig recover RUN --output FILE` to write to another file"


class Recovery(NamedTuple):
    """Result of a recovery."""

    sources: tuple[Path, ...]  # files that the crash left; empty if the record was whole
    output: Path  # the finished record
    written: bool  # False: it existed already
    account: TickAccount
    duplicates: int  # duplicate rows removed; counted when the file is written
    unread: int  # bytes of the sources outside whole records
    damage: tuple[str, ...]
    read_back: ReadBack  # result of reading with the stock MCAP library
    outcome: str  # end of the run, as far as known

    @property
    def record(self) -> str:
        """The state of the record as text."""
        account = self.account
        if not account.lost and not self.damage:
            return "recovered" if self.complete else "recovered: rows may be missing at its end"
        final = account.end_report is not None and account.end_report.final
        count = f"{'' if final else 'at least '}{account.lost} of {account.rows + account.lost}"
        return f"recovered: {count} ticks missing"

    @property
    def complete(self) -> bool:
        """Whether nothing is lost, and this is certain."""
        return self.account.complete and not self.damage


def recover(run: Path, output: Path | None, now: datetime) -> Recovery:
    """Recover a run folder, or one MCAP file, and account for every tick of it.

    Write ``output``; by default ``run.mcap`` in the folder from its parts, or
    ``NAME.recovered.mcap`` next to a damaged file. The folder's status then states how the run
    ended. Raise BusyError while the run is being written, RunError if nothing in it is readable or
    another file has the output's name, OSError if the output cannot be written.
    """
    place = run if run.is_dir() else run.parent
    with create.lock_run(place):
        status = read_json(place / folder.STATUS) if run.is_dir() else {}
        progress = read_json(place / PROGRESS) if run.is_dir() else {}
        if status.get("status") == "running" and folder.is_supervised(status):
            raise create.BusyError(f"{run}: its supervisor, process {status['pid']}, still runs")
        sources, target = _sources_and_target(run)
        if output is not None and output.resolve() != target.resolve():
            sources, target = sources or (target,), output
        recovery = _recover_sources(sources, target, status, progress)
        if output is None and run.is_dir() and status:
            _update_status(run, status, recovery, now)
        return recovery


def _sources_and_target(run: Path) -> tuple[tuple[Path, ...], Path]:
    """Return the files to recover from and the target; no files if the target is whole."""
    if not run.is_dir():
        if _is_intact(run):
            return (), run
        return (run,), run.with_name(f"{run.name.removesuffix('.mcap')}.recovered.mcap")
    record = run / folder.MCAP
    if record.is_file():
        # A file of this name was finished once; if it is not now, disk or copy have damaged it.
        if _is_intact(record):
            return tuple(folder.mcap_parts(run)), record
        return (record, *folder.mcap_parts(run)), run / folder.RECOVERED
    parts = tuple(folder.mcap_parts(run))
    if not parts:
        raise RunError(f"{run}: no {folder.MCAP} and no part of one: nothing was written")
    return parts, record


def _is_intact(path: Path) -> bool:
    """Return whether a file is as its writer finished it, for us and the stock MCAP library."""
    try:
        found = mcap_file.scan(path)
        if not found.finished or found.damage:
            return False
        read_back(path, 8 * len(found.leaves))
    except RunError:
        return False
    return True


def _recover_sources(
    sources: tuple[Path, ...], target: Path, status: dict[str, Any], progress: dict[str, Any]
) -> Recovery:
    duplicates = unread = 0
    damage: list[str] = []
    written = not target.exists()
    if written:
        joined = join(sources, target)
        duplicates, unread, damage = joined.duplicates, joined.unread, list(joined.damage)
        contents = mcap_file.scan(target)
    else:
        contents = mcap_file.scan(target)
        if not contents.finished:
            raise RunError(f"{target} exists and is not a finished record: {_OUTPUT_HINT}")
        unread, damage = _compare_with_sources(sources, contents)
        damage += contents.damage
    report = end_report(status, progress, contents.attachments)
    account = account_ticks(mcap_file.blocks(contents, damage), report)
    verified = read_back(target, 8 * len(contents.leaves))
    if verified.rows != account.rows:
        raise RunError(f"{target}: read back {verified.rows} rows where {account.rows} are counted")
    reasons = folder.recorded_reasons(folder.parse_json(contents.attachments.get("plan.json")))
    outcome = _outcome(status, progress, contents, report, reasons)
    return Recovery(
        sources, target, written, account, duplicates, unread, tuple(damage), verified, outcome
    )


def _compare_with_sources(sources: tuple[Path, ...], done: FileContents) -> tuple[int, list[str]]:
    """Return unread bytes and damage of the sources; raise RunError if ``done`` is not of them."""
    parts, damage = mcap_file.scan_all(sources)
    ticks = set[int]()
    for part in parts:
        for block in mcap_file.blocks(part, damage):
            ticks.update(block["tick"][[0, -1]].tolist() if len(block) else ())
        if part.metadata.get("run") != done.metadata.get("run"):
            raise RunError(f"{done.path} exists and belongs to another run: {_OUTPUT_HINT}")
    found_ticks = set[int]()
    for block in mcap_file.blocks(done):
        found_ticks.update(ticks.intersection(block["tick"].tolist()))
    if found_ticks != ticks:
        raise RunError(f"{done.path} exists and lacks rows of {sources[0].parent}: {_OUTPUT_HINT}")
    return sum(part.unread for part in parts), damage


def _outcome(
    status: dict[str, Any],
    progress: dict[str, Any],
    contents: FileContents,
    report: EndReport | None,
    reasons: ReasonTable,
) -> str:
    last_status = (
        status
        if status.get("status") not in (None, "running")
        else logger_status(contents.attachments)
    )
    status_text = str(last_status.get("status") or "crashed")
    reason = str(last_status.get("reason") or KILLED)
    loop_reason = _loop_reason(progress, reasons)
    if report is not None and report.source == LOOP and loop_reason is not None:
        return f"{create.end_status(loop_reason)}: {reasons.name(loop_reason)}"
    if (report is None or not report.final) and last_status is not status:
        return f"crashed: {KILLED}"
    return f"{status_text}: {LOOP_KILLED if reason == 'NONE' else reason}"


def _loop_reason(progress: dict[str, Any], reasons: ReasonTable) -> int | None:
    """Return the number of the loop's last reason; loops before 2027 wrote its name."""
    reason = progress.get("reason")
    return reason if isinstance(reason, int) else reasons.number(str(reason))


def _update_status(run: Path, status: dict[str, Any], recovery: Recovery, now: datetime) -> None:
    """Write into the run's status how it ended, where no process was left to do so."""
    if status.get("status") != "running" and (not recovery.sources or "recovered_utc" in status):
        return
    changed = {**status, "record": recovery.record}
    if status.get("status") == "running":
        status_text, _, reason = recovery.outcome.partition(": ")
        changed |= {"status": status_text, "reason": reason}
        if (report := recovery.account.end_report) is not None and report.final:
            changed |= {"ticks": report.ticks, "witness": report.source}
    create.write_json(run, folder.STATUS, changed | {"recovered_utc": now.isoformat()})
