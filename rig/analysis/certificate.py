"""The certificate of a rehearsal: what was rehearsed of a campaign, and how near each limit came.

A complete rehearsal writes it into its folder. Its hash covers all of its contents, so a changed
file is no certificate. A run on a rig's devices looks for the certificate of its campaign (same
rows, sea, timing, laws), names in which values rig and limits differ, and keeps a copy. Its rows
then stand beside the rehearsed ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.analysis.limits import Bound, BoundedValues, find_bounds
from rig.analysis.rehearsed_faults import RehearsedFaults, find_rehearsed_faults
from rig.analysis.rows import COMPLETE, columns_of, stations_of
from rig.analysis.stored_rows import current_table
from rig.config.differences import key_differences, value_text
from rig.log_fields import from_record
from rig.presentation.json_values import json_value
from rig.recording import hashed_json
from rig.recording.hashed_json import digest
from rig.recording.runs import run_info
from rig.recording.runs.folder import RunInfo
from rig.recording.runs.reader import RunFiles, blocks, open_files
from rig.recording.table_file import write_table

CERTIFICATE = "certificate.json"
REHEARSAL = "rehearsal.json"  # copy in the run that it was found for
NO_FAULTS = "faults: none rehearsed on this rig (`rig faults`)"
Z_SHOWN = 3.0  # standard errors from which a difference is counted
_VERSION = 1
_OWN_KEYS = {
    "campaign": ("name", "rig", "plant", "adaptive"),
    "rig": ("name", "limits", "plant", "wiring"),
}
"""Keys of the files that name a run or a place, or that only a rig on wires has.

A rehearsal of all rows of a matrix is one of the campaign that chooses among them.
"""
_SUBJECT = ("campaign", "points", "law")  # parts of a configuration that a certificate is for
_RIG = ("rig", "limits")  # parts that may differ in named values


class Found(NamedTuple):
    """A certificate of the campaign that is to run, and the faults rehearsed on its rig."""

    content: dict[str, Any]
    differences: tuple[str, ...]  # values of rig and limits that are not those rehearsed
    faults: RehearsedFaults | None = None

    def write(self, run: Path) -> None:
        """Write a copy into the folder of the run that the certificate was found for."""
        hashed_json.write(run, REHEARSAL, self.content)

    def text(self) -> str:
        """Return two lines for people: of the campaign, and of faults."""
        nearest = self.content["nearest"]
        near = f"; nearest limit {_nearest_text(nearest)}" if nearest else ""
        rows = len(self.content["rows"])
        line = f"rehearsed: all {rows} rows in {self.content['run']} ({self.content['mode']}){near}"
        if self.differences:
            line += f"; other values than rehearsed: {', '.join(self.differences)}"
        return f"{line}\n{NO_FAULTS if self.faults is None else self.faults.text()}"


def _nearest_text(nearest: Mapping[str, Any]) -> str:
    return f"{nearest['label']} at {100.0 * nearest['share']:.0f} % in row {nearest['row']}"


def certify(run: Path) -> Path | None:
    """Write the certificate of a complete rehearsal of a campaign; None for another run.

    Raises RunError or OSError if the run cannot be read or the file not be written.
    """
    source = open_files(run)
    info = run_info(run, source.contents)
    if info.status.get("status") != "complete" or not info.plan.get("rows"):
        return None
    table = current_table(run)
    if set(table["state"].values.tolist()) != {COMPLETE}:
        return None
    bounds = find_bounds(source.leaves, info.config, from_record(info.plan.get("log_fields")))
    shares = _used_shares(source, [each for each in bounds if not each.is_age], info.plan)
    settings = [each.name for each in columns_of(table) if each.name in table]
    numbers = {str(name): table[name].values.tolist() for name in table.variables}
    rows = [
        json_value(
            {
                "row": row,
                **{name: numbers[name][i] for name in settings},
                "powers": {
                    each.name: [numbers[f"power_{each.name}{part}"][i] for part in ("", "_se")]
                    for each in stations_of(table)
                },
                "limits": shares.get(row, {}),
            }
        )
        for i, row in enumerate(numbers["row"])
    ]
    faults = find_rehearsed_faults(run.parent, info.config)
    content = {
        "certificate": _VERSION,
        "run": info.run,
        "mode": info.mode,
        "campaign": info.campaign,
        "rehearsed_utc": info.started_utc,
        "code": info.code,
        "subject": digest(_parts(info.config, _SUBJECT)),
        "rig": _parts(info.config, _RIG),
        "checked": _checked(info, faults),
        "faults": None if faults is None else faults.as_record(),
        "nearest": _nearest(shares, bounds),
        "rows": rows,
    }
    hashed_json.write(run, CERTIFICATE, content)
    return run / CERTIFICATE


def _checked(info: RunInfo, faults: RehearsedFaults | None) -> list[str]:
    """Return what the run shows to have been checked, for people."""
    wired = info.config.get("rig", {}).get("wiring") is not None
    place = "emulated devices on the rig's wires" if wired else "the simulated plant"
    return [
        "before the run: all files of the campaign, the predictions of its rows, all limits",
        f"all rows of the plan, with the loop, laws and limits of the rig, on {place}",
        NO_FAULTS if faults is None else faults.text(),
    ]


def _parts(config: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return parts of a configuration without the keys of a single run or place."""
    found = {}
    for name in names:
        part = config.get(name)
        if isinstance(part, dict):
            part = {k: v for k, v in part.items() if k not in _OWN_KEYS.get(name, ())}
        found[name] = _without_paths(part) if name == "law" else part
    return found


def _without_paths(law: Any) -> Any:
    """Return the record of laws without the places of their files, which have a hash."""
    if isinstance(law, dict):
        return {key: _without_paths(value) for key, value in law.items() if key != "path"}
    return [_without_paths(each) for each in law] if isinstance(law, list) else law


def _used_shares(
    source: RunFiles, bounds: Sequence[Bound], plan: Mapping[str, Any]
) -> dict[int, dict[str, float]]:
    """Return the largest used share of each limit in each row, by row and key of the limit."""
    fields = {"tick", "plan.row"}
    for each in bounds:
        limit = each.limit
        fields |= {limit.field, *limit.less, *(name for name, _ in limit.where)}
        fields |= {limit.commanded} if limit.commanded else set()
    leaves = [leaf for leaf in source.leaves if leaf.name in fields]
    at = [leaf.name for leaf in leaves].index("plan.row")
    values = BoundedValues(bounds, leaves, float(plan["dt"]))
    sizes = np.array([max(abs(each.low), abs(each.high)) for each in bounds])
    largest: dict[int, Any] = {}
    for block in blocks(source, None, [leaf.name for leaf in leaves]):
        rows = np.stack([block[leaf.name].astype(float) for leaf in leaves], axis=1)
        used = np.nan_to_num(np.abs(values.columns(rows)) / sizes)
        numbers = rows[:, at]
        edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist()]
        for number, found in zip(
            numbers[edges].astype(int).tolist(), np.maximum.reduceat(used, edges), strict=True
        ):
            largest[number] = np.maximum(largest.get(number, 0.0), found)
    keys = [each.limit.key for each in bounds]
    return {
        row: dict(zip(keys, np.round(found, 4).tolist(), strict=True))
        for row, found in largest.items()
        if row >= 0
    }


def _nearest(
    shares: Mapping[int, Mapping[str, float]], bounds: Sequence[Bound]
) -> dict[str, Any] | None:
    """Return the limit that stops the rig and came nearest in any row."""
    stops = {each.limit.key: each.label for each in bounds if each.limit.stops}
    found = [
        (share, row, key)
        for row, of_row in shares.items()
        for key, share in of_row.items()
        if key in stops
    ]
    if not found:
        return None
    share, row, key = max(found)
    return {"key": key, "label": stops[key], "row": row, "share": share}


def find_certificate(runs: Path, config: Mapping[str, Any]) -> Found | None:
    """Return the newest certificate in a folder of runs for a campaign that is to run.

    ``config``: that of `rig.campaign.resolved_config`. Files that are damaged or were changed are
    passed over.
    """
    subject = digest(_parts(config, _SUBJECT))
    for path in sorted(runs.glob(f"*/{CERTIFICATE}"), reverse=True):
        content = read_certificate(path)
        if content is None or content["subject"] != subject:
            continue
        differences = key_differences(content["rig"], _parts(config, _RIG))
        changes = (f"{key} {value_text(new)} ({value_text(old)})" for key, old, new in differences)
        return Found(content, tuple(changes), find_rehearsed_faults(runs, config))
    return None


def read_certificate(path: Path) -> dict[str, Any] | None:
    """Return the contents of a certificate; None for a file that is none, or was changed."""
    content = hashed_json.read(path)
    return content if content is not None and content.get("certificate") == _VERSION else None


class Deviation(NamedTuple):
    """The power of a row at a station, beside the rehearsed one."""

    row: int
    station: str
    measured: float  # W
    rehearsed: float  # W
    z: float  # the difference over its standard error; NaN without one

    @property
    def difference(self) -> float:
        """W."""
        return self.measured - self.rehearsed


def deviations(run: Path) -> tuple[Deviation, ...]:
    """Return the complete rows of a run beside those of its rehearsal; none without one.

    The standard errors are those of the scatter of periods: z tells a difference from chance, not
    from an error of the simulated plant.
    """
    content = read_certificate(run / REHEARSAL)
    if content is None:
        return ()
    return tuple(_deviations(current_table(run), {row["row"]: row for row in content["rows"]}))


def deviation_texts(run: Path) -> tuple[str, ...]:
    """Return the rows of a run beside its rehearsal as text, a line a station; none without one."""
    content = read_certificate(run / REHEARSAL)
    found = () if content is None else deviations(run)
    if content is None or not found:
        return ()
    lines = [f"beside the rehearsal {content['run']}, measured less rehearsed"]
    for name in dict.fromkeys(each.station for each in found):
        rows = [each for each in found if each.station == name]
        largest = max(rows, key=lambda each: abs(each.difference))
        mean = float(np.mean([each.difference for each in rows]))
        beyond = sum(abs(each.z) > Z_SHOWN for each in rows)
        lines.append(
            f"{name}: {mean:+.3g} W on average, {largest.difference:+.3g} W in row {largest.row}; "
            f"{beyond} of {len(rows)} rows by more than {Z_SHOWN:g} standard errors"
        )
    return tuple(lines)


def write_deviations(run: Path, folder: Path) -> list[Path]:
    """Write ``rehearsed.csv`` with the rows of a run beside its rehearsal; nothing without one."""
    found = deviations(run)
    if not found:
        return []
    columns: dict[str, list[Any]] = {
        "row": [each.row for each in found],
        "station": [each.station for each in found],
        "measured [W]": [each.measured for each in found],
        "rehearsed [W]": [each.rehearsed for each in found],
        "difference [W]": [each.difference for each in found],
        "z": [each.z for each in found],
    }
    return [write_table(columns, folder / "rehearsed.csv")]


def _deviations(table: Any, rehearsed: Mapping[int, Mapping[str, Any]]) -> Iterator[Deviation]:
    names = [station.name for station in stations_of(table)]
    for i, row in enumerate(table["row"].values.tolist()):
        powers = rehearsed.get(int(row), {}).get("powers", {})
        if table["state"].values[i] != COMPLETE:
            continue
        for name in (each for each in names if each in powers):
            value, error = (np.nan if number is None else float(number) for number in powers[name])
            measured = float(table[f"power_{name}"].values[i])
            scatter = np.hypot(np.nan_to_num(error), table[f"power_{name}_se"].values[i])
            z = (measured - value) / scatter if scatter > 0.0 else np.nan
            yield Deviation(int(row), name, measured, value, float(z))
