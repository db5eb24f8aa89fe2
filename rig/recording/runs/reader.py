"""Rows of a run as arrays, selected by field and campaign row, with units from the file itself."""

import fnmatch
import os
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rig.recording.mcap_writer import CHUNK_BYTES, CLOCK_RECORD, START_KEY
from rig.recording.row_layout import Leaf
from rig.recording.runs import folder, mcap_file
from rig.recording.runs.mcap_records import RunError
from rig.recording.runs.state import (
    CHECKED_FIELDS,
    SKIPPED,
    RecordCheck,
    RecordState,
    TickAccount,
)

if TYPE_CHECKING:
    import xarray

ROW_FIELD = "plan.row"
_LABELS = ("index", "flag")  # units of row ids, phases, modes, flags: small labels, not quantities
Column = np.ndarray[tuple[int], np.dtype[Any]]


class Stage(NamedTuple):
    """The files of a run until it was resumed, or since.

    Each stage counts its ticks from 0. Readers count on through all stages: the ticks between two
    stages were never executed, and so are counted as skipped.
    """

    contents: tuple[mcap_file.FileContents, ...]  # in the order of time
    first_tick: int = 0  # tick of the run at which its own tick 0 is
    last_before: int = -1  # last tick that the stages before executed
    dt: float = 0.0  # s, length of a tick

    def shift(self, block: mcap_file.Records, skipped: int) -> mcap_file.Records:
        """Return rows with the ticks of the run; ``skipped``: ticks skipped before the stage."""
        shifted = block.copy()
        names = block.dtype.names or ()
        shifted["tick"] += self.first_tick
        if "time" in names:
            shifted["time"] = shifted["tick"] * self.dt
        if SKIPPED in names:
            shifted[SKIPPED] += skipped
        return shifted


class RunFiles(NamedTuple):
    """A run's scanned files and the fields of their rows."""

    stages: tuple[Stage, ...]  # one, or more of a run that was resumed
    leaves: tuple[Leaf, ...]
    damage: tuple[str, ...] = ()  # descriptions of unreadable files and of damaged places

    @property
    def contents(self) -> tuple[mcap_file.FileContents, ...]:
        """The files of all stages, in the order of time."""
        return tuple(each for stage in self.stages for each in stage.contents)

    @property
    def max_rows(self) -> int:
        """Upper bound of the number of rows, from chunk heads with a plausible size."""
        sizes = (c.size for each in self.contents for c in each.chunks)
        return sum(size for size in sizes if size <= 2 * CHUNK_BYTES) // self.contents[0].stride


def open_files(run: str | os.PathLike[str]) -> RunFiles:
    """Scan the files of a run folder (or one MCAP file); raise RunError if none can be read.

    A file of several that cannot be read at all is left out, and ``damage`` names it.
    """
    listed = folder.mcap_files(run)
    contents, damage = mcap_file.scan_all(listed)
    if not contents and Path(run).is_dir():  # parts that a recovery left beside its file
        spare = (path for path in folder.mcap_parts(Path(run)) if path not in listed)
        contents, unreadable = mcap_file.scan_all(spare)
        damage += unreadable
    if not contents:
        raise RunError(f"{'; '.join(damage)}; {mcap_file.UNREADABLE_HINT}")
    if any(c.schema != contents[0].schema for c in contents):
        raise RunError(f"{run}: its parts hold rows of different kinds")
    return RunFiles(_stages(contents), contents[0].leaves, tuple(damage))


def _stages(contents: list[mcap_file.FileContents]) -> tuple[Stage, ...]:
    """Return the stages of a run's files, given in the order of time."""
    earlier = [each for each in contents if folder.is_earlier(each.path)]
    latest = tuple(each for each in contents if not folder.is_earlier(each.path))
    groups = [*((each,) for each in earlier), *([latest] if latest else [])]
    start = _utc_of_zero(groups[0][0])
    stages = [Stage(groups[0])]
    for group in groups[1:]:
        plan = folder.parse_json(group[-1].attachments.get(folder.PLAN))
        resumed, dt = plan.get("resumed") or {}, float(plan.get("dt") or 0.0)
        last = int(resumed.get("last_tick", stages[-1].last_before))
        # On the virtual clock a stage may take less time than its ticks say.
        by_clock = round((_utc_of_zero(group[0]) - start) * 1e-9 / dt) if dt else 0
        stages.append(Stage(group, max(last + 1, by_clock), last, dt))
    return tuple(stages)


def stage_info(run: str | os.PathLike[str], stage: Stage) -> folder.RunInfo:
    """Return the description of a run as it was in a stage."""
    first = stage.contents[0].path
    return folder.run_info(first if folder.is_earlier(first) else run, stage.contents)


def _utc_of_zero(contents: mcap_file.FileContents) -> int:
    """Return the UTC of a stage's time zero, ns; 0 if its file lacks it."""
    text = contents.metadata.get(CLOCK_RECORD, {}).get(START_KEY, "")
    return int(text) if text.isdigit() else 0


def select_fields(leaves: tuple[Leaf, ...], fields: Iterable[str] | None) -> list[str]:
    """Return the names of the leaves that match names, prefixes or shell patterns.

    The names have storage order. A KeyError names the unknown field and similar ones.
    """
    names = [leaf.name for leaf in leaves]
    if fields is None:
        return names
    selected: set[str] = set()
    for field in [fields] if isinstance(fields, str) else fields:
        matches = [n for n in names if n == field or n.startswith(field + ".")]
        matches = matches or fnmatch.filter(names, field)
        if not matches:
            groups = {name.rsplit(".", i)[0] for name in names for i in (1, 2)}
            near = get_close_matches(field, [*names, *sorted(groups)], 3, 0.4)
            hint = f"; near: {', '.join(near)}" if near else ""
            raise KeyError(f"no field {field!r} in this run{hint}")
        selected.update(matches)
    return [name for name in names if name in selected]


def blocks(
    run: RunFiles, check: RecordCheck | None = None, fields: Iterable[str] | None = None
) -> Iterator[mcap_file.Records]:
    """Yield all rows as numpy records, block by block, each tick once even where files overlap.

    Damaged parts are left out and reported to ``check``, which also counts the ticks. Without
    ``fields``, other bytes may lie between the rows; with names of fields, the blocks have these
    and those that a check needs, in storage order.
    """
    damage = None if check is None else check.damage
    names = None if fields is None else [*fields, *CHECKED_FIELDS]
    last_skipped = 0
    for stage in run.stages:
        skipped = last_skipped + stage.first_tick - stage.last_before - 1
        if check is not None and stage.first_tick:
            check.begin_stage(stage.first_tick, skipped)
        for read in stage_blocks(stage, damage, names):
            block = stage.shift(read, skipped) if stage.first_tick else read
            if SKIPPED in (block.dtype.names or ()):
                last_skipped = int(block[SKIPPED][-1])
            if check is not None:
                check.add(block)
            yield block


def stage_blocks(
    stage: Stage, damage: list[str] | None = None, fields: list[str] | None = None
) -> Iterator[mcap_file.Records]:
    """Yield the rows of a stage, each tick once, with the stage's own ticks."""
    merged = mcap_file.merged_blocks(stage.contents, damage, packed=False, fields=fields)
    yield from mcap_file.unrepeated(merged)


def check_record(run: str | os.PathLike[str]) -> RecordState:
    """Return the state of a run's record after reading all of it."""
    return _read_all(run).state(run)


def account_of(run: str | os.PathLike[str]) -> TickAccount:
    """Return the account of a run's ticks after reading all of its record."""
    return _read_all(run).account(run)


def _read_all(run: str | os.PathLike[str]) -> RecordCheck:
    opened = open_files(run)
    check = RecordCheck(opened.contents, opened.damage)
    for _ in blocks(opened, check, ()):
        pass
    return check


def _column_dtype(leaf: Leaf) -> np.dtype[Any]:
    """Return the dtype of a column: as in the file, but 2 instead of 8 bytes for labels."""
    if leaf.code == "d":
        return np.dtype("<f8")
    return np.dtype("<i2" if leaf.unit in _LABELS else "<i8")


def _grow(column: Column, count: int, capacity: int, values: Column) -> Column:
    """Return the column, or a copy of its first ``count`` numbers with enough room and range."""
    kind = column.dtype
    if kind.itemsize < values.itemsize and len(values):
        limits = np.iinfo(kind)
        if values.min() < limits.min or values.max() > limits.max:
            kind = values.dtype
    if len(column) >= capacity and kind == column.dtype:
        return column
    # Excess capacity costs nothing: pages that are never written are never resident.
    grown = np.empty(capacity, kind)
    grown[:count] = column[:count]
    return grown


def _validated_row_ids(rows: Iterable[int]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return campaign row ids in order; raise TypeError for one that is no whole number."""
    ids = list(rows)
    for each in ids:
        if isinstance(each, bool) or not isinstance(each, int | np.integer):
            raise TypeError(f"row ids must be whole numbers, not {each!r}")
    return np.array(sorted(set(ids)), np.int64)


def columns(
    run: RunFiles,
    names: list[str],
    rows: Iterable[int] | None = None,
    check: RecordCheck | None = None,
) -> dict[str, Column]:
    """Return the named fields as contiguous arrays; with ``rows``, only of those campaign rows.

    Whole numbers that are labels (units `index` and `flag`) are int16 where they fit, others int64.
    Raise KeyError for an unknown row id, TypeError for one that is no whole number.
    """
    kinds = {leaf.name: _column_dtype(leaf) for leaf in run.leaves}
    if rows is not None and ROW_FIELD not in kinds:
        raise KeyError(f"this kind of run has no campaign rows ({ROW_FIELD})")
    selected = None if rows is None else _validated_row_ids(rows)
    seen: set[int] = set()
    capacity = run.max_rows  # an upper bound for files of our own
    out: dict[str, Column] = {name: np.empty(capacity, kinds[name]) for name in names}
    count = 0
    for read_block in blocks(run, check):
        block = read_block
        if selected is not None:
            ids = read_block[ROW_FIELD]
            seen.update(np.unique(ids).tolist())
            block = read_block[np.isin(ids, selected)]
        if count + len(block) > capacity:
            capacity = 2 * (count + len(block))
        for name in names:
            values = block[name]
            out[name] = column = _grow(out[name], count, capacity, values)
            column[count : count + len(block)] = values
        count += len(block)
    if selected is not None and (unknown := [i for i in selected.tolist() if i not in seen]):
        available = sorted(i for i in seen if i >= 0)
        span = f"{available[0]} to {available[-1]}" if available else "none"
        raise KeyError(f"no row {unknown[0]} in this run (rows: {span})")
    return {name: column[:count] for name, column in out.items()}


def open_run(
    run: str | os.PathLike[str],
    fields: Iterable[str] | None = None,
    rows: int | Iterable[int] | None = None,
) -> "xarray.Dataset":
    """Return a run as a Dataset over ``time`` (s from run start), variables named by dotted path.

    ``fields``: names, prefixes (``timing``) or shell patterns (``power.*``); default all.
    ``rows``: campaign row ids. Units come from the schema in the file, the dataset's attributes
    from its attachments. Row ids, phases, modes and flags are int16 where they fit.
    Finished files, files of a killed writer and damaged files are read alike: damaged parts are
    left out, and the attribute ``record`` states whether ticks are missing
    (``record_missing_ticks``: which ones, ``record_damage``: why).
    Raise KeyError for an unknown field or row, TypeError for a row that is no whole number,
    RunError for an unreadable file.
    """
    opened = open_files(run)
    names = select_fields(opened.leaves, fields)
    if isinstance(rows, int):
        rows = [rows]
    check = RecordCheck(opened.contents, opened.damage)
    data = columns(opened, list(dict.fromkeys(["time", *names])), rows, check)
    units = {leaf.name: leaf.unit for leaf in opened.leaves}
    # Imported late: it takes half a second, in memory that reading has released.
    import pandas  # noqa: PLC0415
    import xarray  # noqa: PLC0415

    index = pandas.Index(data["time"], copy=False)  # xarray itself would copy the array
    time = xarray.Variable("time", index, {"units": units["time"]})
    variables = {
        name: xarray.Variable("time", data[name], {"units": units[name]})
        for name in names
        if name != "time"
    }
    attributes = folder.run_info(run, opened.contents).attributes() | check.state(run).attributes()
    return xarray.Dataset(variables, {"time": time}, attributes)
