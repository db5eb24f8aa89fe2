"""Alarms of a run: conditions that may invalidate its results."""

from typing import Any

import numpy as np
import xarray

from rig.analysis.rows import INCOMPLETE, INTERRUPTED
from rig.presentation import phrases
from rig.recording.runs.folder import RunInfo


def format_rows(rows: Any) -> str:
    """Return row ids as short text: ``rows 1-5, 9``."""
    parts: list[list[int]] = []
    for row in sorted(int(r) for r in rows):
        if parts and row == parts[-1][1] + 1:
            parts[-1][1] = row
        else:
            parts.append([row, row])
    texts = [str(a) if a == b else f"{a}-{b}" for a, b in parts]
    if len(texts) > 12:
        texts = [*texts[:12], f"and {len(texts) - 12} more"]
    return ("row " if texts == [str(parts[0][0])] else "rows ") + ", ".join(texts)


def _flag_alarms(table: xarray.Dataset, name: str, template: str) -> list[str]:
    by_flag: dict[str, list[int]] = {}
    for row, text in zip(table["row"].values.tolist(), table[name].values.tolist(), strict=True):
        for flag in text.split():
            by_flag.setdefault(flag, []).append(row)
    return [
        f"{template.format(flag.lower().replace('_', ' '))} in {format_rows(rows)}"
        for flag, rows in by_flag.items()
    ]


def alarms(table: xarray.Dataset, run_facts: RunInfo, unfinished: str = "") -> list[str]:
    """Return one message for each condition that may invalidate results; empty without any.

    ``unfinished`` is the first message if the record has no proper end.
    """
    messages = [unfinished] if unfinished else []
    dropped = run_facts.timing.get("dropped_rows") or 0
    if dropped:
        messages.append(f"{dropped} log rows were dropped because the disk was too slow")
    if table.sizes.get("row", 0) == 0:
        if run_facts.plan.get("device") == "absent":
            return messages
        return [*messages, "no row was measured"]
    rows = table["row"].values
    for alarm in (str(name) for name in table.variables):
        if not alarm.endswith("position_alarm"):
            continue
        flagged = np.flatnonzero(table[alarm].values)
        if len(flagged) == 0:
            continue
        means = table[alarm.replace("_alarm", "_mean")].values
        name = f"mean {alarm.removesuffix('_alarm').replace('_', ' ')}"
        worst = flagged[np.argmax(np.abs(means[flagged]))]
        bound = 1e3 * table.attrs["mean_position_alarm_m"]
        messages.append(
            f"{name} beyond {bound:g} mm in {format_rows(rows[flagged])}: "
            f"{phrases.format_signed(1e3 * means[worst], 1)} mm in row {rows[worst]}; "
            "check the encoder zero"
        )
    messages += _flag_alarms(table, "limits", "force limited ({})")
    messages += _flag_alarms(table, "warned", "warning ({})")
    lost = table["lost_ticks"].values * (table["state"].values != INCOMPLETE)
    if lost.any():
        where = format_rows(rows[lost > 0])
        messages.append(f"{lost.sum()} ticks lost during measurement, in {where}")
    untared = (table["samples"].values > 0) & (table["tare_samples"].values == 0)
    if untared.any():
        where = format_rows(rows[untared])
        messages.append(
            f"no tare was taken before {where}: the values of the first tick serve as zeros"
        )
    repeated = table["attempt"].values > 0
    if repeated.any():
        messages.append(f"restarted after a hold: {format_rows(rows[repeated])}")
    reasons = table["incomplete_reason"].values
    for i in np.flatnonzero(table["state"].values == INCOMPLETE).tolist():
        hint = "--incomplete-rows shows its means"
        messages.append(f"row {rows[i]} is withheld: {reasons[i]} ({hint})")
    for i in np.flatnonzero(table["state"].values == INTERRUPTED).tolist():
        messages.append(f"row {rows[i]} was cut short ({reasons[i]})")
    return messages
