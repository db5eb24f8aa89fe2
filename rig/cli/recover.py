"""`rig recover RUN`."""

import errno
import json
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from rig.cli.input_files import find_run
from rig.cli.options import RUNS, Json, Runs
from rig.cli.output import FAILED, LOST, OK, fail
from rig.recording.runs import RunError, create
from rig.recording.runs.recover import Recovery, recover

EXIT_CODES = """\
Exit codes: 0 the record is finished and holds every executed tick; 5 it is finished, but ticks \
are lost or damaged, or no process recorded whether more ticks followed; 1 not done: the run is \
still being written, the disk is full, or the new file could not be read back; 2 no such run, or \
no readable data in it."""
_MAX_LISTED = 12  # gaps, and rows


class RecoveredRow(NamedTuple):
    """A row of the gain matrix in the recovered record."""

    row: int
    state: str  # complete, cut short, not run
    reason: str  # why the row is cut short
    missing_ticks: int  # of the measured window


def command(
    run_name: Annotated[
        Path,
        typer.Argument(metavar="RUN", help="A run's folder or MCAP file, its id, or 'last'."),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write (default: run.mcap in the run)."),
    ] = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Finish the record of a run that was killed, and list exactly which ticks are missing.

    The files that the crash left stay unchanged. The command reads the new
    file back with the stock MCAP library.
    """
    try:
        run = find_run(run_name, runs)
        recovery = recover(run, output, datetime.now(UTC))
    except create.BusyError as error:
        return fail("recover", error, as_json=as_json, code=FAILED)
    except (FileNotFoundError, RunError) as error:
        return fail("recover", error, as_json=as_json)
    except OSError as error:
        return fail("recover", _with_advice(error), as_json=as_json, code=FAILED)
    rows = _read_rows(recovery.output)
    if rows is not None and output is None and run.is_dir():
        # The record is complete; only the status may be missing.
        with suppress(OSError, ValueError):
            create.write_rows_done(run, sum(row.state == "complete" for row in rows))
    print(json.dumps(_as_dict(recovery, rows)) if as_json else "\n".join(_lines(recovery, rows)))
    return OK if recovery.complete else LOST


def _with_advice(error: OSError) -> Exception:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES):
        advice = "no file was changed; give --output to write to another disk"
        return OSError(f"{error.strerror}; {advice}")
    return error


def _read_rows(record: Path) -> list[RecoveredRow] | None:
    """Return the row table; None for a kind of rig without rows."""
    from rig.analysis.rows import row_table

    try:
        table = row_table(record)
    except KeyError:
        return None
    if table.sizes.get("row", 0) == 0:
        return []
    names = ("row", "state", "incomplete_reason", "lost_ticks")
    return [
        RecoveredRow(*values)
        for values in zip(*(table[n].values.tolist() for n in names), strict=True)
    ]


def _as_dict(recovery: Recovery, rows: list[RecoveredRow] | None) -> dict[str, Any]:
    account = recovery.account
    return {
        "status": "whole" if recovery.complete else "incomplete",
        "ending": recovery.outcome,
        "output": str(recovery.output),
        "written": recovery.written,
        "sources": [str(path) for path in recovery.sources],
        "rows_saved": account.rows,
        "first_tick": account.first_tick,
        "last_tick": account.last_tick,
        "period_s": account.period,
        "seconds_saved": None if account.period is None else account.rows * account.period,
        "missing_ticks": [[gap.first, gap.last] for gap in account.gaps if gap.lost],
        "skipped_ticks": [[gap.first, gap.last] for gap in account.gaps if gap.skipped],
        "lost": account.lost,
        "lost_at_least": account.end_report is None or not account.end_report.final,
        "lost_after_the_end": account.lost_at_end,
        "seconds_lost": None if account.period is None else account.lost * account.period,
        "skipped": account.skipped,
        "last_tick_known": account.last_known,
        "end_seen_by": account.end_report.source
        if account.end_report and account.end_report.final
        else None,
        "duplicates": recovery.duplicates,
        "unread_bytes": recovery.unread,
        "damage": list(recovery.damage),
        "verified": recovery.read_back._asdict(),
        "campaign_rows": None if rows is None else [row._asdict() for row in rows],
    }


def _lines(recovery: Recovery, rows: list[RecoveredRow] | None) -> list[str]:
    """Return the report as lines, each group of them with its label in front of the first."""
    account, verified = recovery.account, recovery.read_back
    saved = "no row: the run ended before its first tick was on the disk"
    if account.first_tick is not None:
        saved = (
            f"{account.rows} rows{_duration_text(account.rows, account.period)}, "
            f"ticks {account.first_tick} to {account.last_tick}"
        )
    skips = sum(1 for gap in account.gaps if gap.skipped)
    skipped = f"{account.skipped} periods in {skips} places: the loop woke late; counted"
    torn = [f"{recovery.unread} torn bytes"] if recovery.unread else []
    size = recovery.output.stat().st_size / 1e6
    record = [
        f"{recovery.output}, {size:.1f} MB, "
        + ("written" if recovery.written else "existed already"),
        f"read back with the mcap library: {verified.rows} messages in {verified.chunks} chunks, "
        "all checksums correct",
    ]
    if recovery.sources:
        names = ", ".join(path.name for path in recovery.sources)
        keep = "keep it: another copy may hold the rest"
        record.append(f"{names} unchanged; {'no longer needed' if recovery.complete else keep}")
    groups = {
        "ended": [recovery.outcome],
        "saved": [saved],
        "missing": _missing_lines(recovery),
        "skipped": [skipped] if account.skipped else [],
        "rows": _row_lines(rows, lost=account.lost > 0),
        "damage": [*recovery.damage, *torn] or ["none"],
        "record": record,
    }
    return [
        f"{'' if i else label:<10}{text}"
        for label, texts in groups.items()
        for i, text in enumerate(texts)
    ]


def _duration_text(ticks: int, period: float | None) -> str:
    return "" if period is None else f" ({ticks * period:.3f} s)"


def _missing_lines(recovery: Recovery) -> list[str]:
    account = recovery.account
    gaps = [gap for gap in account.gaps if gap.lost]
    lines = [
        f"ticks {gap.first} to {gap.last}: {gap.lost} lost"
        f"{_duration_text(gap.lost, account.period)}"
        + (f", {gap.skipped} skipped by the loop" if gap.skipped else "")
        for gap in gaps[:_MAX_LISTED]
    ]
    if len(gaps) > _MAX_LISTED:
        rest = sum(gap.lost for gap in gaps[_MAX_LISTED:])
        lines.append(
            f"and {len(gaps) - _MAX_LISTED} more gaps with {rest} ticks (--json has them all)"
        )
    if account.lost_at_end:
        lines.append(f"{account.lost_at_end} executed ticks at the end: their rows were dropped")
    if account.end_report is None or not account.end_report.final:
        after = "" if account.last_known is None else f" after tick {account.last_known}"
        lower_bound = f"in all at least {account.lost} rows"
        lines.append(f"{lower_bound}: no process recorded what the loop did{after}")
    else:
        witness = f"by {account.end_report.source}: {account.end_report.ticks} ticks executed"
        total = f"in all {account.lost}" if lines else "nothing"
        lines.append(f"{total} (end recorded {witness})")
    return lines


def _row_lines(rows: list[RecoveredRow] | None, *, lost: bool) -> list[str]:
    from rig.analysis.rows import COMPLETE, NOT_RUN
    from rig.config.problems import format_rows

    if rows is None:
        return []
    if not rows:
        return ["none started"]
    clean = [row.row for row in rows if row.state == COMPLETE and not row.missing_ticks]
    with_gaps = [row for row in rows if row.state == COMPLETE and row.missing_ticks]
    incomplete = [row for row in rows if row.state not in (COMPLETE, NOT_RUN)]
    absent_rows = [row.row for row in rows if row.state == NOT_RUN]
    lines = [f"{len(clean)} of {len(rows)} complete" + (f": {format_rows(clean)}" if clean else "")]
    lines += [
        f"row {r.row} complete but for {r.missing_ticks} ticks" for r in with_gaps[:_MAX_LISTED]
    ]
    if len(with_gaps) > _MAX_LISTED:
        lines.append(f"and {len(with_gaps) - _MAX_LISTED} more rows with ticks missing")
    lines += [f"row {row.row} incomplete: {row.reason}" for row in incomplete]
    label = "lost or not run" if lost else "not run"
    lines += [f"{label}: {format_rows(absent_rows)}"] if absent_rows else []
    return lines
