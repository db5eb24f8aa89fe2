"""What a reader of a run's results must know of before believing them."""

from typing import Any

import numpy as np
import xarray

from rig.analysis import phrases
from rig.analysis.rows import INCOMPLETE, INTERRUPTED
from rig.recording.runs.folder import Facts


def row_list(rows: Any) -> str:
    """Row ids as short text: ``1-5, 9``."""
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


def _flagged(table: xarray.Dataset, name: str, said: str) -> list[str]:
    by_flag: dict[str, list[int]] = {}
    for row, text in zip(table["row"].values.tolist(), table[name].values.tolist(), strict=True):
        for flag in text.split():
            by_flag.setdefault(flag, []).append(row)
    return [
        f"{said.format(flag.lower().replace('_', ' '))} in {row_list(rows)}"
        for flag, rows in by_flag.items()
    ]


def alarms(table: xarray.Dataset, known: Facts, unfinished: str = "") -> list[str]:
    """Everything a reader of the results must know of, a sentence each; none if all is well."""
    found = [unfinished] if unfinished else []
    dropped = known.timing.get("dropped_rows") or 0
    if dropped:
        found.append(f"{dropped} log rows were dropped because the disk was too slow")
    if table.sizes.get("row", 0) == 0:
        if known.plan.get("device") == "absent":
            return found
        return [*found, "no row was measured"]
    rows = table["row"].values
    for axis, called in (("", "mean position"), ("surge_", "mean surge position")):
        off = np.flatnonzero(table[f"{axis}position_alarm"].values)
        if len(off) == 0:
            continue
        means = table[f"{axis}position_mean"].values
        worst = off[np.argmax(np.abs(means[off]))]
        bound = 1e3 * table.attrs["mean_position_alarm_m"]
        found.append(
            f"{called} beyond {bound:g} mm in {row_list(rows[off])}: "
            f"{phrases.signed(1e3 * means[worst], 1)} mm in row {rows[worst]}; "
            "check the encoder zero"
        )
    found += _flagged(table, "limits", "force limited ({})")
    found += _flagged(table, "warned", "warning ({})")
    lost = table["lost_ticks"].values * (table["state"].values != INCOMPLETE)
    if lost.any():
        found.append(f"{lost.sum()} ticks lost while measuring, in {row_list(rows[lost > 0])}")
    bare = (table["samples"].values > 0) & (table["tare_samples"].values == 0)
    if bare.any():
        found.append(
            f"no tare was taken before {row_list(rows[bare])}: zeros are the first tick's values"
        )
    again = table["attempt"].values > 0
    if again.any():
        found.append(f"started over after a hold: {row_list(rows[again])}")
    for row in np.flatnonzero(table["state"].values == INCOMPLETE).tolist():
        why = table["incomplete_reason"].values[row]
        found.append(f"row {rows[row]} is withheld: {why} (--incomplete-rows shows its means)")
    for row in np.flatnonzero(table["state"].values == INTERRUPTED).tolist():
        found.append(f"row {rows[row]} is not whole ({table['incomplete_reason'].values[row]})")
    return found
