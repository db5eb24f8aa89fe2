"""Rows of a run as arrays: by field, by campaign row, with the units that the file itself gives."""

import fnmatch
import os
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rig.recording.mcap_writer import CHUNK_BYTES
from rig.recording.row_layout import Leaf
from rig.recording.runs import folder, mcap_file
from rig.recording.runs.state import Reading, RecordState

if TYPE_CHECKING:
    import xarray

ROW_FIELD = "plan.row"
_LABELS = ("index", "flag")  # units of row ids, phases, modes, flags: small, and not to count with
Column = np.ndarray[tuple[int], np.dtype[Any]]


class Source(NamedTuple):
    """A run's files and what their rows hold."""

    contents: tuple[mcap_file.Contents, ...]  # in the order of time
    leaves: tuple[Leaf, ...]
    damage: tuple[str, ...] = ()  # files of it that cannot be read at all

    @property
    def most_rows(self) -> int:
        """Rows that its chunks say they have; a size that no chunk of ours has is not believed."""
        sizes = (c.size for each in self.contents for c in each.chunks)
        return sum(size for size in sizes if size <= 2 * CHUNK_BYTES) // self.contents[0].stride


def source(run: str | os.PathLike[str]) -> Source:
    """The files of a run folder (or one MCAP file), scanned; RunError if none can be read.

    Of several files one that cannot be read at all is left out and named.
    """
    contents: list[mcap_file.Contents] = []
    damage: list[str] = []
    place, named = Path(run), folder.files(run)
    spare = [path for path in folder.parts(place) if path not in named] if place.is_dir() else []
    for path in (*named, *spare):
        if path in spare and contents:
            break
        try:
            contents.append(mcap_file.scan(path))
        except mcap_file.RunError as error:
            damage.append(str(error))
    if not contents:
        raise mcap_file.RunError(f"{'; '.join(damage)}; {mcap_file.HOPELESS}")
    if any(c.schema != contents[0].schema for c in contents):
        raise mcap_file.RunError(f"{run}: its parts hold rows of different kinds")
    return Source(tuple(contents), contents[0].leaves, tuple(damage))


def choose(leaves: tuple[Leaf, ...], fields: Iterable[str] | None) -> list[str]:
    """Names of the leaves asked for by name, by prefix or by shell pattern, in storage order.

    KeyError names the field that is not there and what comes near it.
    """
    names = [leaf.name for leaf in leaves]
    if fields is None:
        return names
    wanted: set[str] = set()
    for field in [fields] if isinstance(fields, str) else fields:
        hits = [n for n in names if n == field or n.startswith(field + ".")]
        hits = hits or fnmatch.filter(names, field)
        if not hits:
            groups = {name.rsplit(".", i)[0] for name in names for i in (1, 2)}
            near = get_close_matches(field, [*names, *sorted(groups)], 3, 0.4)
            hint = f"; near: {', '.join(near)}" if near else ""
            raise KeyError(f"no field {field!r} in this run{hint}")
        wanted.update(hits)
    return [name for name in names if name in wanted]


def blocks(run: Source, reading: Reading | None = None) -> Iterator[mcap_file.Records]:
    """All rows as numpy records, block by block, each tick once even where files overlap.

    What is damaged is left out; ``reading`` hears of it and counts the ticks. To pick fields from:
    other bytes may lie between the rows.
    """
    last = -1
    damage = None if reading is None else reading.damage
    for block in mcap_file.merged(run.contents, damage, packed=False):
        if len(block) == 0:
            continue
        ticks = block["tick"]
        fresh = block
        if ticks[0] <= last or (ticks[1:] <= ticks[:-1]).any():
            before = np.maximum.accumulate(np.concatenate(([last], ticks)))[:-1]
            fresh = block[ticks > before]
        if len(fresh):
            last = int(fresh["tick"][-1])
            if reading is not None:
                reading.add(fresh)
            yield fresh


def read_through(run: str | os.PathLike[str]) -> RecordState:
    """The state of a run's record; reads all of it."""
    opened = source(run)
    reading = Reading(opened.contents, opened.damage)
    for _ in blocks(opened, reading):
        pass
    return reading.state(run)


def _kind(leaf: Leaf) -> np.dtype[Any]:
    """As the file has it, but labels in two bytes: eight would be memory for nothing."""
    if leaf.code == "d":
        return np.dtype("<f8")
    return np.dtype("<i2" if leaf.unit in _LABELS else "<i8")


def _roomy(column: Column, count: int, room: int, values: Column) -> Column:
    """The column, or its first ``count`` numbers in one that is long and wide enough for more."""
    kind = column.dtype
    if kind.itemsize < values.itemsize and len(values):
        limits = np.iinfo(kind)
        if values.min() < limits.min or values.max() > limits.max:
            kind = values.dtype
    if len(column) >= room and kind == column.dtype:
        return column
    # Too much room costs nothing: pages that are never written are never resident.
    grown = np.empty(room, kind)
    grown[:count] = column[:count]
    return grown


def _ids(rows: Iterable[int]) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Campaign row ids in order; TypeError names the first that is none."""
    whole = list(rows)
    for each in whole:
        if isinstance(each, bool) or not isinstance(each, int | np.integer):
            raise TypeError(f"rows are asked for by their ids, whole numbers; {each!r} is none")
    return np.array(sorted(set(whole)), np.int64)


def columns(
    run: Source,
    names: list[str],
    rows: Iterable[int] | None = None,
    reading: Reading | None = None,
) -> dict[str, Column]:
    """The named fields as contiguous arrays; with ``rows``, only ticks of those campaign rows.

    Whole numbers that are labels (units `index` and `flag`) are int16 where they fit, others int64.
    KeyError if a row id is not in the run, TypeError if it is no whole number.
    """
    kinds = {leaf.name: _kind(leaf) for leaf in run.leaves}
    if rows is not None and ROW_FIELD not in kinds:
        raise KeyError(f"this kind of run has no campaign rows ({ROW_FIELD})")
    wanted = None if rows is None else _ids(rows)
    seen: set[int] = set()
    room = run.most_rows  # an upper bound for files of our own
    out: dict[str, Column] = {name: np.empty(room, kinds[name]) for name in names}
    count = 0
    for whole in blocks(run, reading):
        block = whole
        if wanted is not None:
            ids = whole[ROW_FIELD]
            seen.update(np.unique(ids).tolist())
            block = whole[np.isin(ids, wanted)]
        if count + len(block) > room:
            room = 2 * (count + len(block))
        for name in names:
            values = block[name]
            out[name] = column = _roomy(out[name], count, room, values)
            column[count : count + len(block)] = values
        count += len(block)
    if wanted is not None and (absent := [i for i in wanted.tolist() if i not in seen]):
        there = sorted(i for i in seen if i >= 0)
        span = f"{there[0]} to {there[-1]}" if there else "none"
        raise KeyError(f"no row {absent[0]} in this run (rows: {span})")
    return {name: column[:count] for name, column in out.items()}


def open_run(
    run: str | os.PathLike[str],
    fields: Iterable[str] | None = None,
    rows: int | Iterable[int] | None = None,
) -> "xarray.Dataset":
    """A run as a Dataset over ``time`` (s from run start), variables named by dotted path.

    ``fields``: names, prefixes (``heave.estimate``) or shell patterns (``power.*``); all if not
    given. ``rows``: campaign row ids. Units come from the schema in the file, the dataset's
    attributes from its attachments. Row ids, phases, modes and flags are int16 where they fit.
    Finished files, those of a killed writer and damaged ones are read alike: what is damaged is
    left out, and the attribute ``record`` says whether ticks are missing (``record_missing_ticks``
    which, ``record_damage`` why).
    KeyError for an unknown field or row, TypeError for a row that is no whole number, RunError for
    a file of which nothing can be read.
    """
    opened = source(run)
    names = choose(opened.leaves, fields)
    if isinstance(rows, int):
        rows = [rows]
    reading = Reading(opened.contents, opened.damage)
    data = columns(opened, list(dict.fromkeys(["time", *names])), rows, reading)
    units = {leaf.name: leaf.unit for leaf in opened.leaves}
    # Half a second that listing runs need not pay, in the memory that reading has given back.
    import pandas  # noqa: PLC0415
    import xarray  # noqa: PLC0415

    index = pandas.Index(data["time"], copy=False)  # xarray itself would copy the array
    time = xarray.Variable("time", index, {"units": units["time"]})
    variables = {
        name: xarray.Variable("time", data[name], {"units": units[name]})
        for name in names
        if name != "time"
    }
    attributes = folder.facts(run, opened.contents).attributes() | reading.state(run).attributes()
    return xarray.Dataset(variables, {"time": time}, attributes)
