"""The rest of a campaign whose run ended early: rows and periods that it has not measured."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig.analysis.choices import choices_of
from rig.analysis.rows import COMPLETE, INTERRUPTED, row_table
from rig.campaign.kind import AnyCampaign, AnyPlan
from rig.campaign.plan import RESUMED, Measured, build_plan
from rig.campaign.record import resolved_config
from rig.config.differences import key_differences, value_text
from rig.config.tank import BEFORE_REFLECTION
from rig.recording.runs import RunError, RunInfo, run_info
from rig.recording.runs.reader import account_of
from rig.recording.runs.windows import keeps_periods


class Resumption(NamedTuple):
    """The rest of a campaign."""

    plan: AnyPlan  # its segments are those of the rest
    measured: Measured
    plan_record: dict[str, Any]  # what the plan in the run's folder says of the stages before


def resume_campaign(run: Path, campaign: AnyCampaign, *, accept_changes: bool) -> Resumption:
    """Return the rest of a campaign whose run ended before its last row.

    Rows of a complete window are done. Of a row that an interruption cut short, whole periods
    count, unless its phase matters: an open-loop reference or a hoist begins anew. A row in which
    the rig tripped is measured anew. With ``accept_changes`` keys of the files may have other
    values than in the run, and the record names them; the rows must be the same. Raises RunError
    for a run that cannot be resumed with these files.
    """
    info = run_info(run)
    if not info.plan.get("rows"):
        raise RunError(f"{info.run}: it has no rows of a gain matrix to go on with")
    file = campaign.file
    if file.tank is not None and file.tank.windows == BEFORE_REFLECTION:
        raise RunError(
            f"{info.run}: its rows end before reflected waves arrive, so waves that start anew "
            "give other windows; run the campaign from its begin"
        )
    config = json.loads(resolved_config(campaign))
    differences = [
        f"{key}: {value_text(old)} in the run, now {value_text(new)}"
        for key, old, new in key_differences(_without_files(info.config), _without_files(config))
    ]
    _require_same_rows(info, campaign)
    if differences and not accept_changes:
        listed = "\n".join(f"  {each}" for each in differences)
        raise RunError(
            f"{info.run}: the files have changed since its begin:\n{listed}\n"
            "--accept-changes goes on with them, and the record names them"
        )
    if file.adaptive is not None and (choices := choices_of(info)) and choices[-1].is_last:
        raise RunError(f"{info.run}: its rows were chosen to the end: {choices[-1].why}")
    measured = measured_so_far(run, keep_periods=_keeps_phase(campaign))
    if len(measured.rows) == len(info.plan["rows"]):
        raise RunError(f"{info.run}: all of its {len(measured.rows)} rows are measured")
    return _resumption(run, info, campaign, measured, differences)


def next_sea(run: Path, campaign: AnyCampaign, seed: int) -> Resumption | None:
    """Return the plan in the next sea of a run that has measured its rows in the sea of ``seed``.

    None after the last sea. Rows that people skipped in the seas before do not come again.
    """
    seeds = campaign.file.seeds
    before = seeds[: seeds.index(seed) + 1]
    measured = measured_so_far(run, keep_periods=False)
    passed = frozenset(row.row for row in build_plan(campaign).rows if row.seed in before)
    measured = measured._replace(rows=measured.rows | passed)
    info = run_info(run)
    if len(measured.rows) == len(info.plan["rows"]):
        return None
    return _resumption(run, info, campaign, measured)


def _resumption(
    run: Path,
    info: RunInfo,
    campaign: AnyCampaign,
    measured: Measured,
    differences: Sequence[str] = (),
) -> Resumption:
    before = info.plan.get(RESUMED) or {}
    record = measured.as_record() | {
        "stage": before.get("stage", 1) + 1,
        "last_tick": _last_tick(run),
        "differences": [*before.get("differences", []), *differences],
    }
    return Resumption(build_plan(campaign, measured), measured, {RESUMED: record})


def measured_so_far(run: Path, *, keep_periods: bool) -> Measured:
    """Return the rows that a run has measured, and whole periods of rows that were cut short."""
    table = row_table(run)
    rows, states, periods, reasons = (
        table[name].values.tolist() for name in ("row", "state", "periods", "incomplete_reason")
    )
    done = frozenset(row for row, state in zip(rows, states, strict=True) if state == COMPLETE)
    cut = {
        row: count
        for row, state, count, why in zip(rows, states, periods, reasons, strict=True)
        if state == INTERRUPTED and count and keeps_periods(why)
    }
    return Measured(done, cut if keep_periods else {})


def _last_tick(run: Path) -> int:
    """Return the last tick that a run is known to have executed; -1 for none."""
    known = account_of(run).last_known
    return -1 if known is None else known


def _keeps_phase(campaign: AnyCampaign) -> bool:
    """Return whether means over whole periods of two windows are those of one.

    A row that its power ends is assessed from its begin.
    """
    file = campaign.file
    fixed = file.reference is None and getattr(file, "hoist", None) is None
    return fixed and file.timing.end is None


def _require_same_rows(info: RunInfo, campaign: AnyCampaign) -> None:
    """Raise RunError unless the rows of the plan are those of the run."""
    names = [column.name for column in campaign.file.columns()]
    recorded = [[row.get(name) for name in names] for row in info.plan["rows"]]
    planned = [
        [row.setting._asdict().get(name) for name in names] for row in build_plan(campaign).rows
    ]
    if len(recorded) != len(planned):
        raise RunError(f"{info.run}: it has {len(recorded)} rows, the campaign {len(planned)}")
    for number, (before, now) in enumerate(zip(recorded, planned, strict=True)):
        for name, old, new in zip(names, before, now, strict=True):
            if old != new:
                raise RunError(
                    f"{info.run}: row {number} has {name} = {old}, in the campaign it is {new}; "
                    "only a campaign with the same rows can go on"
                )


def _without_files(config: dict[str, Any]) -> dict[str, Any]:
    """Return a configuration without the paths and sums of its files."""
    return {key: value for key, value in config.items() if key != "files"}
