"""`rig recover`: one finished record out of what a crash left, and an exact account of it.

What the crash left is never changed. The recovered file has its name only once it is whole, on the
disk and read back by the stock MCAP library. Doing it again finds it done.
"""

from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig.realtime.safety import Reason
from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import create, folder, mcap_file
from rig.recording.runs.account import Account, Ending, account
from rig.recording.runs.join import join
from rig.recording.runs.mcap_file import Contents, RunError
from rig.recording.runs.state import LOOP, ending_of, logged, text_of
from rig.recording.runs.verify import Seen, read_back

KILLED = "its processes were killed"
LOOP_KILLED = "its loop was killed"
_ELSEWHERE = "`rig recover RUN --output FILE` writes elsewhere"


class Recovery(NamedTuple):
    """What became of a run."""

    sources: tuple[Path, ...]  # what the crash left; empty if the record was whole
    output: Path  # the finished record
    written: bool  # False: it was there already
    account: Account
    duplicates: int  # rows that came twice, kept once; counted when it is written
    unread: int  # bytes of the sources that are no whole record
    damage: tuple[str, ...]
    seen: Seen  # by the stock MCAP library
    ending: str  # how the run ended, as far as is known

    @property
    def record(self) -> str:
        """The state of the record in words."""
        counted = self.account
        if not counted.lost and not self.damage:
            return "recovered" if self.whole else "recovered: rows may be missing at its end"
        final = counted.ending is not None and counted.ending.final
        count = f"{'' if final else 'at least '}{counted.lost} of {counted.rows + counted.lost}"
        return f"recovered: {count} ticks missing"

    @property
    def whole(self) -> bool:
        """Nothing is lost, and that is known."""
        return self.account.whole and not self.damage


def recover(run: Path, output: Path | None, now: datetime) -> Recovery:
    """Recover a run folder, or one MCAP file, and account for every tick of it.

    Writes ``output``; if not given, ``run.mcap`` in the folder from its parts, or
    ``NAME.recovered.mcap`` beside a torn file. The folder's status says afterwards how the run
    ended. Raises BusyError while the run is being written, RunError if nothing in it is readable or
    another file has the output's name, OSError if the output cannot be written.
    """
    place = run if run.is_dir() else run.parent
    with create.hold_run(place):
        status = text_of(place / folder.STATUS) if run.is_dir() else {}
        progress = text_of(place / PROGRESS) if run.is_dir() else {}
        if status.get("status") == "running" and folder.supervised(status):
            raise create.BusyError(f"{run}: its supervisor, process {status['pid']}, still runs")
        sources, target = _plan(run)
        if output is not None and output.resolve() != target.resolve():
            sources, target = sources or (target,), output
        made = _recovered(sources, target, status, progress)
        if output is None and run.is_dir() and status:
            _close(run, status, made, now)
        return made


def _plan(run: Path) -> tuple[tuple[Path, ...], Path]:
    """What to recover from, and into which file; from nothing if that file is whole as it is."""
    if not run.is_dir():
        if _intact(run):
            return (), run
        return (run,), run.with_name(f"{run.name.removesuffix('.mcap')}.recovered.mcap")
    whole = run / folder.MCAP
    if whole.is_file():
        # A file of that name has been finished; if it is not, disk or copy lost or changed some.
        if _intact(whole):
            return tuple(folder.parts(run)), whole
        return (whole, *folder.parts(run)), run / folder.RECOVERED
    parts = tuple(folder.parts(run))
    if not parts:
        raise RunError(f"{run}: no {folder.MCAP} and no part of one: nothing was written")
    return parts, whole


def _intact(path: Path) -> bool:
    """Whether a file is as its writer finished it, for us and for the stock MCAP library."""
    try:
        found = mcap_file.scan(path)
        if not found.finished or found.damage:
            return False
        read_back(path, 8 * len(found.leaves))
    except RunError:
        return False
    return True


def _recovered(
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
            raise RunError(f"{target} is in the way, and it is no finished record: {_ELSEWHERE}")
        unread, damage = _same(sources, contents)
        damage += contents.damage
    told = ending_of(status, progress, contents.attachments)
    counted = account(mcap_file.blocks(contents, damage), told)
    seen = read_back(target, 8 * len(contents.leaves))
    if seen.rows != counted.rows:
        raise RunError(f"{target}: read back {seen.rows} rows where {counted.rows} are counted")
    how = _how(status, progress, contents, told)
    return Recovery(sources, target, written, counted, duplicates, unread, tuple(damage), seen, how)


def _same(sources: tuple[Path, ...], done: Contents) -> tuple[int, list[str]]:
    """Unread bytes and damage of the sources of a file recovered before; RunError if of others."""
    unread, damage = 0, list[str]()
    ticks = set[int]()
    for path in sources:
        try:
            part = mcap_file.scan(path)
        except RunError as error:
            damage.append(str(error))
            continue
        unread += part.unread
        damage += part.damage
        for block in mcap_file.blocks(part, damage):
            ticks.update(block["tick"][[0, -1]].tolist() if len(block) else ())
        if part.metadata.get("run") != done.metadata.get("run"):
            raise RunError(f"{done.path} is in the way: it is of another run: {_ELSEWHERE}")
    there = set[int]()
    for block in mcap_file.blocks(done):
        there.update(ticks.intersection(block["tick"].tolist()))
    if there != ticks:
        raise RunError(
            f"{done.path} is in the way: it lacks rows that {sources[0].parent} holds: {_ELSEWHERE}"
        )
    return unread, damage


def _how(
    status: dict[str, Any], progress: dict[str, Any], contents: Contents, told: Ending | None
) -> str:
    known = (
        status if status.get("status") not in (None, "running") else logged(contents.attachments)
    )
    word, reason = str(known.get("status") or "crashed"), str(known.get("reason") or KILLED)
    noted = str(progress.get("reason"))
    if told is not None and told.witness == LOOP and noted in Reason.__members__:
        return f"{create.ending(Reason[noted])}: {noted}"
    if (told is None or not told.final) and known is not status:
        return f"crashed: {KILLED}"
    return f"{word}: {LOOP_KILLED if reason == 'NONE' else reason}"


def _close(run: Path, status: dict[str, Any], made: Recovery, now: datetime) -> None:
    """Say in the run's status how it ended, where nobody was left to say it."""
    if status.get("status") != "running" and (not made.sources or "recovered_utc" in status):
        return
    changed = {**status, "record": made.record}
    if status.get("status") == "running":
        word, _, reason = made.ending.partition(": ")
        changed |= {"status": word, "reason": reason}
        if (ending := made.account.ending) is not None and ending.final:
            changed |= {"ticks": ending.ticks, "witness": ending.witness}
    create.write_json(run, folder.STATUS, changed | {"recovered_utc": now.isoformat()})
