"""Which surge damping to hold the device with: MASK4 report (Sandia), 3.2.1.2.

In regular waves near the surge resonance, with the damping stepped from row to row: surge shall
stay within a stroke, heave shall keep its power, and of the dampings that do both the one counts
whose drive force is the least. Between rows all three are interpolated over the logarithm of the
damping, monotone from row to row, so that nothing is invented.
"""

import csv
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from rig.analysis.rows import period_means, standard_error
from rig.analysis.windows import LeftOut, Window, windows
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import Facts, facts
from rig.recording.runs.state import Reading

KEPT = 0.98
"""Share of the best row's heave power that counts as kept."""

SHARE = 0.5
"""Of the rig's least surge bound, the stroke allowed: surge is linear in the wave, and the crests
of the largest sea of the test (Hs 0.254 m) are twice the 0.127 m of this one."""

_STEP = 50.0  # N s/m: nobody sets a damping finer
_SETTLED = 0.02  # of the amplitude: a window whose halves differ by more was no steady state
_FIELDS = (
    "surge.estimate.position", "surge.command.force", "power.mechanical_1", "power.mechanical_2",
)  # fmt: skip
Floats = npt.NDArray[np.float64]


class Row(NamedTuple):
    """One damping as it was measured."""

    row: int
    damping: float  # N s/m, > 0: minus the surge Kp
    stroke: float  # m, farthest from the zero, either way
    force: float  # N, amplitude of the surge drive's force at the wave's frequency
    force_se: float
    power: float  # W, heave by the column load cell; negative is absorbed
    power_se: float
    guide: float  # W, lost between column load cell and shaft: drivetrain and lateral guide
    settled: bool


class Measured(NamedTuple):
    """The rows of a run."""

    rows: tuple[Row, ...]  # by rising damping
    notes: tuple[str, ...]  # rows that are left out, and why


class Choice(NamedTuple):
    """What the rows say."""

    rows: tuple[Row, ...]  # by rising damping
    stroke: float  # m, allowed either way
    kept: float  # share of the heave power
    damping: float  # N s/m; NaN where no damping of the range does both
    predicted: tuple[float, float, float]  # there: stroke m, force N, heave power W
    bound: str  # what keeps it from being less: stroke, power, or the end of the range
    notes: tuple[str, ...] = ()  # rows that are left out, and why

    @property
    def kp(self) -> float:
        """Surge Kp in the recorded sign, N s/m."""
        return -self.damping


def measured(run: str | os.PathLike[str], *, incomplete_rows: bool = False) -> Measured:
    """The rows of a run by rising damping.

    ``incomplete_rows``: also those of which the record lacks ticks. RunError unless the sea is
    regular, heave's set point is one and the surge damping varies.
    """
    source = reader.source(run)
    known = facts(run, source.contents)
    frequency = (known.plan.get("sea") or {}).get("frequency_hz")
    period = (known.plan.get("sea") or {}).get("period_s")
    frequency = frequency or (1.0 / period if period else None)
    if not frequency:
        raise RunError(f"{run}: no surge damping campaign (its sea is not regular)")
    planned = {row["row"]: row for row in known.plan["rows"]}
    _one_heave(planned, run)
    ticks = 1.0 / (float(frequency) * float(known.plan["dt"]))
    found: dict[float, Row] = {}
    seen, left = Reading(source.contents, source.damage), LeftOut()
    for window in windows(
        source, list(_FIELDS), known.plan, incomplete_rows=incomplete_rows, reading=seen
    ):
        damping = -float(planned[window.row]["surge_kp"])
        if left.whole(window) and damping > 0.0:
            found[damping] = _row(window, damping, ticks)
    notes = left.notes(known.plan, seen.state(run))
    if len(found) < 3:
        said = f"{len(found)} surge dampings were measured whole; at least 3 needed"
        raise RunError(f"{run}: {'; '.join([said, *notes])}")
    return Measured(tuple(found[damping] for damping in sorted(found)), notes)


def _one_heave(planned: dict[int, dict[str, Any]], run: object) -> None:
    for name in ("spring_rate", "kp", "ki", "surge_ki"):
        values = {row[name] for row in planned.values()}
        if len(values) > 1:
            raise RunError(f"{run}: {name} varies, too; only the surge damping may")


def _row(window: Window, damping: float, period: float) -> Row:
    data = window.data
    ticks = data["tick"] - data["tick"][0]
    turn = np.exp(-2j * math.pi * ticks / period)
    force, position = data["surge.command.force"], data["surge.estimate.position"]
    by_period = 2.0 * np.abs(period_means(force * turn, data["tick"], period))
    power = period_means(data["power.mechanical_1"], data["tick"], period)
    shaft = period_means(data["power.mechanical_2"], data["tick"], period)
    moved = 2.0 * np.abs(period_means(position * turn, data["tick"], period))
    half = max(1, len(moved) // 2)
    drift = abs(float(moved[:half].mean() - moved[-half:].mean()))
    return Row(
        window.row,
        damping,
        float(np.abs(position).max()),
        float(by_period.mean()),
        standard_error(by_period),
        float(power.mean()),
        standard_error(power),
        float(shaft.mean() - power.mean()),
        drift <= _SETTLED * float(moved.mean()),
    )


def allowed_stroke(known: Facts) -> float:
    """Stroke (m, either way) from the run's own rig and limits: `SHARE` of the least bound."""
    bounds = [
        bound
        for keys in (
            ("rig", "station_keeping", "reach_m"),
            ("limits", "surge", "position_warn_m"),
            ("limits", "surge", "position_stop_m"),
        )
        if (bound := known.configured(*keys)) is not None
    ]
    if not bounds:
        raise RunError(f"{known.run}: its configuration bounds no surge; give --stroke-m")
    return SHARE * min(bounds)


def curve(rows: Sequence[Row], name: str) -> Any:
    """A column of the rows as a function of the logarithm of the damping, monotone between two."""
    return PchipInterpolator(
        np.log([row.damping for row in rows]), [getattr(row, name) for row in rows]
    )


def choose(rows: Sequence[Row], stroke: float, kept: float = KEPT) -> Choice:
    """The damping of least drive force that keeps surge within ``stroke`` (m) and heave's power.

    It is looked for within the range that was measured, on multiples of 50 N s/m.
    """
    rows = tuple(sorted(rows, key=lambda row: row.damping))
    damping = [row.damping for row in rows]
    first, last = math.ceil(damping[0] / _STEP), math.floor(damping[-1] / _STEP)
    tried = np.unique([*(_STEP * np.arange(first, last + 1)), damping[0], damping[-1]])
    travel, force, power = (
        curve(rows, name)(np.log(tried)) for name in ("stroke", "force", "power")
    )
    held = travel <= stroke
    enough = power <= kept * min(row.power for row in rows)
    both = held & enough
    if not both.any():
        reason = "stroke" if not held.any() else "heave power"
        return Choice(rows, stroke, kept, math.nan, (math.nan,) * 3, f"{reason} nowhere kept")
    i = int(np.flatnonzero(both)[np.argmin(force[both])])
    told = float(travel[i]), float(force[i]), float(power[i])
    return Choice(rows, stroke, kept, float(tried[i]), told, _bound(i, held, enough, force))


def _bound(i: int, held: Any, enough: Any, force: Floats) -> str:
    beside = [j for j in (i - 1, i + 1) if 0 <= j < len(force) and force[j] < force[i]]
    if any(not held[j] for j in beside):
        return "stroke"
    if any(not enough[j] for j in beside):
        return "heave power"
    return "end of the range" if i in (0, len(force) - 1) else "least force"


def as_text(choice: Choice) -> str:
    """The rows, and the answer beneath them."""
    lines = ["surge Kp   stroke m   force N         heave W         guide and drivetrain W"]
    for row in choice.rows:
        over = " over" if row.stroke > choice.stroke else ""
        still = "" if row.settled else "  not settled"
        lines.append(
            f"{-row.damping:8.0f} {row.stroke:9.3f}{over:5} {row.force:6.1f} ± {row.force_se:<7.2g}"
            f" {row.power:7.2f} ± {row.power_se:<6.2g} {row.guide:7.2f}{still}"
        )
    lines += [f"note: {note}" for note in choice.notes]
    return "\n".join([*lines, "", answer(choice)])


def answer(choice: Choice) -> str:
    """What to set, in a sentence."""
    asked = f"a stroke of {choice.stroke:.3f} m and {100.0 * choice.kept:.0f} % of heave's power"
    if math.isnan(choice.damping):
        return f"no damping of this range keeps {asked}: {choice.bound}"
    stroke, force, power = choice.predicted
    text = (
        f"surge Kp {choice.kp:.0f} N*s/m: least drive force ({force:.0f} N) that keeps {asked}; "
        f"stroke {stroke:.3f} m, heave {power:.1f} W; bound by: {choice.bound}"
    )
    if choice.bound == "end of the range":
        text += " (what lies beyond it was not measured)"
    return text


def as_dict(choice: Choice) -> dict[str, Any]:
    """The same for programs; NaN is null."""
    stroke, force, power = choice.predicted

    def plain(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "surge_kp_n_s_per_m": plain(choice.kp),
        "bound_by": choice.bound,
        "allowed_stroke_m": choice.stroke,
        "kept_share": choice.kept,
        "predicted": {
            "stroke_m": plain(stroke), "force_n": plain(force), "heave_power_w": plain(power),
        },
        "rows": [
            {name: plain(value) if isinstance(value, float) else value
             for name, value in row._asdict().items()}
            for row in choice.rows
        ],
        "notes": list(choice.notes),
    }  # fmt: skip


def write(choice: Choice, folder: Path) -> list[Path]:
    """``surge_damping.csv`` with a line a row and ``surge_damping.json``."""
    text, data = folder / "surge_damping.csv", folder / "surge_damping.json"
    units = ("1", "N*s/m", "m", "N", "N", "W", "W", "W", "1")
    with text.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([f"{n} [{u}]" for n, u in zip(Row._fields, units, strict=True)])
        writer.writerows([*row[:-1], int(row.settled)] for row in choice.rows)
    data.write_text(json.dumps(as_dict(choice), indent=2), encoding="utf-8")
    return [text, data]
