"""`rig recover RUN`."""

import errno
import json
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from rig import cli
from rig.cli.command_error import fail
from rig.cli.find_run import find_run
from rig.recording.runs import RunError, create
from rig.recording.runs.recover import Recovery, recover

_SHOWN = 12  # gaps and rows named one by one


class Row(NamedTuple):
    """A row of the gain matrix in the recovered record."""

    row: int
    state: str  # complete, cut short, not run
    why: str  # it is cut short
    missing: int  # ticks absent from its measured window


def main(named: Path, runs: Path, output: Path | None, *, as_json: bool) -> int:
    """Recover and say what there is; gives the exit code."""
    try:
        run = find_run(named, runs)
        made = recover(run, output, datetime.now(UTC))
    except create.BusyError as error:
        return fail("recover", error, as_json=as_json, code=cli.FAILED)
    except FileNotFoundError as error:
        return fail("recover", error, as_json=as_json)
    except OSError as error:
        return fail("recover", _with_advice(error), as_json=as_json, code=cli.FAILED)
    except RunError as error:
        return fail("recover", error, as_json=as_json)
    rows = _rows(made.output)
    if rows is not None and output is None and run.is_dir():
        with suppress(OSError, ValueError):  # the record is there; a status may be missing
            create.note_rows(run, sum(row.state == "complete" for row in rows))
    print(json.dumps(_data(made, rows)) if as_json else "\n".join(_lines(made, rows)))
    return cli.OK if made.whole else cli.LOST


def _with_advice(error: OSError) -> Exception:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES):
        told = "nothing was changed; --output writes to another disk"
        return OSError(f"{error.strerror}; {told}")
    return error


def _rows(record: Path) -> list[Row] | None:
    """The row table; None for a kind of rig that has no rows."""
    from rig.analysis.rows import row_table

    try:
        table = row_table(record)
    except KeyError:
        return None
    if table.sizes.get("row", 0) == 0:
        return []
    names = ("row", "state", "incomplete_reason", "lost_ticks")
    return [Row(*values) for values in zip(*(table[n].values.tolist() for n in names), strict=True)]


def _data(made: Recovery, rows: list[Row] | None) -> dict[str, Any]:
    told = made.account
    return {
        "status": "whole" if made.whole else "incomplete",
        "ending": made.ending,
        "output": str(made.output),
        "written": made.written,
        "sources": [str(path) for path in made.sources],
        "rows_saved": told.rows,
        "first_tick": told.first_tick,
        "last_tick": told.last_tick,
        "period_s": told.period,
        "seconds_saved": None if told.period is None else told.rows * told.period,
        "missing_ticks": [[gap.first, gap.last] for gap in told.gaps if gap.lost],
        "skipped_ticks": [[gap.first, gap.last] for gap in told.gaps if gap.skipped],
        "lost": told.lost,
        "lost_at_least": told.ending is None or not told.ending.final,
        "lost_after_the_end": told.beyond,
        "seconds_lost": None if told.period is None else told.lost * told.period,
        "skipped": told.skipped,
        "last_tick_known": told.last_known,
        "end_seen_by": told.ending.witness if told.ending and told.ending.final else None,
        "duplicates": made.duplicates,
        "unread_bytes": made.unread,
        "damage": list(made.damage),
        "verified": made.seen._asdict(),
        "campaign_rows": None if rows is None else [row._asdict() for row in rows],
    }


def _lines(made: Recovery, rows: list[Row] | None) -> list[str]:
    told = made.account
    lines = [f"{'ended':<10}{made.ending}"]
    if told.first_tick is None:
        lines.append(f"{'saved':<10}no row: it ended before its first tick was on the disk")
    else:
        lines.append(
            f"{'saved':<10}{told.rows} rows{_seconds(told.rows, told.period)}, "
            f"ticks {told.first_tick} to {told.last_tick}"
        )
    lines += [
        f"{name:<10}{text}"
        for name, text in (*_missing(made), *_row_words(rows, lost=told.lost > 0))
    ]
    damage = [*made.damage, *([f"{made.unread} torn bytes"] if made.unread else [])] or ["none"]
    lines += [f"{'' if i else 'damage':<10}{text}" for i, text in enumerate(damage)]
    seen = made.seen
    size = made.output.stat().st_size / 1e6
    lines.append(
        f"{'record':<10}{made.output}, {size:.1f} MB, "
        + ("written" if made.written else "was there already")
    )
    lines.append(
        f"{'':<10}read back with the mcap library: {seen.rows} messages in {seen.chunks} chunks, "
        "all check sums right"
    )
    if made.sources:
        names = ", ".join(path.name for path in made.sources)
        rest = "not needed any more" if made.whole else "keep it: another copy may hold the rest"
        lines.append(f"{'':<10}{names} untouched; {rest}")
    return lines


def _seconds(ticks: int, period: float | None) -> str:
    return "" if period is None else f" ({ticks * period:.3f} s)"


def _missing(made: Recovery) -> list[tuple[str, str]]:
    told = made.account
    gaps = [gap for gap in told.gaps if gap.lost]
    lines = [
        f"ticks {gap.first} to {gap.last}: {gap.lost} lost{_seconds(gap.lost, told.period)}"
        + (f", {gap.skipped} skipped by the loop" if gap.skipped else "")
        for gap in gaps[:_SHOWN]
    ]
    if len(gaps) > _SHOWN:
        rest = sum(gap.lost for gap in gaps[_SHOWN:])
        lines.append(f"and {len(gaps) - _SHOWN} more gaps with {rest} ticks (--json has them all)")
    if told.beyond:
        lines.append(f"{told.beyond} executed ticks at the end whose rows were dropped")
    if told.ending is None or not told.ending.final:
        after = "" if told.last_known is None else f" after tick {told.last_known}"
        least = f"in all at least {told.lost} rows"
        lines.append(f"{least}: what the loop did{after}, nobody lived to write down")
    else:
        said = f"by {told.ending.witness}: {told.ending.ticks} ticks executed"
        lines.append(f"{'in all ' + str(told.lost) if lines else 'nothing'} (end seen {said})")
    found = [("missing" if i == 0 else "", line) for i, line in enumerate(lines)]
    if told.skipped:
        places = sum(1 for gap in told.gaps if gap.skipped)
        found.append(
            ("skipped", f"{told.skipped} periods in {places} places: the loop woke late; counted")
        )
    return found


def _row_words(rows: list[Row] | None, *, lost: bool) -> list[tuple[str, str]]:
    from rig.analysis.alarms import row_list
    from rig.analysis.rows import COMPLETE, NOT_RUN

    if rows is None:
        return []
    if not rows:
        return [("rows", "none begun")]
    clean = [row.row for row in rows if row.state == COMPLETE and not row.missing]
    gappy = [row for row in rows if row.state == COMPLETE and row.missing]
    cut = [row for row in rows if row.state not in (COMPLETE, NOT_RUN)]
    never = [row.row for row in rows if row.state == NOT_RUN]
    lines = [f"{len(clean)} of {len(rows)} complete" + (f": {row_list(clean)}" if clean else "")]
    lines += [f"row {r.row} complete but for {r.missing} ticks" for r in gappy[:_SHOWN]]
    if len(gappy) > _SHOWN:
        lines.append(f"and {len(gappy) - _SHOWN} more rows with ticks missing")
    lines += [f"row {row.row} incomplete: {row.why}" for row in cut]
    absent = "lost or not run" if lost else "not run"
    lines += [f"{absent}: {row_list(never)}"] if never else []
    return [("rows" if i == 0 else "", line) for i, line in enumerate(lines)]
