"""The log of a run as a tree of xarray: grouped as its fields are named, with labels and units."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from xarray.backends import BackendArray
from xarray.core import indexing

from rig.log_fields import from_record, label_of
from rig.presentation.value_labels import ValueLabels, is_switch, value_labels
from rig.realtime.sequence import Phase
from rig.recording.row_layout import Leaf
from rig.recording.runs import RunInfo, open_run, reader

PHASE = "plan.phase"
_TIME = "time"


class LogFields:
    """The fields of a run's log: their units, labels and the names of their values."""

    def __init__(self, run: RunInfo, leaves: Iterable[Leaf]) -> None:
        self.leaves = {leaf.name: leaf for leaf in leaves}
        self._reasons, self._recorded = run.reasons, from_record(run.plan.get("log_fields"))

    def value_labels(self, field: str) -> ValueLabels | None:
        """Return the names of the values of a field; None of a quantity."""
        return value_labels(field, self.leaves[field].unit, self._reasons, self._recorded)

    def attributes(self, field: str) -> dict[str, str]:
        """Return `long_name` and, of a quantity, `units` of a field."""
        leaf = self.leaves[field]
        found = {"long_name": label_of(field, self._recorded.labels)}
        return found if leaf.unit in ("index", "flag") else found | {"units": leaf.unit}

    def decode(self, field: str, values: Any) -> Any:
        """Return the values of a field: names of labels, bools of flags, numbers otherwise."""
        if (labels := self.value_labels(field)) is not None:
            return labels.apply(values)
        return values.astype(bool) if is_switch(field, self.leaves[field].unit) else values

    def dtype(self, field: str) -> np.dtype[Any]:
        """Return the type of the decoded values of a field."""
        kind = np.float64 if self.leaves[field].code == "d" else np.int64
        return np.asarray(self.decode(field, np.zeros(1, kind))).dtype


def read_tree(
    path: Path, fields: LogFields, names: Iterable[str] | None, rows: Iterable[int], phase: str
) -> xarray.DataTree:
    """Return log fields of some rows (empty: all ticks), in a phase (empty: all), as a tree.

    Raises KeyError for an unknown field, row or phase.
    """
    only_phase = _phase(phase)
    listed = reader.select_fields(tuple(fields.leaves.values()), names)
    extra = [PHASE] if only_phase is not None and PHASE not in listed else []
    data = open_run(path, [*listed, *extra], list(rows) or None)
    if only_phase is not None:
        data = data.isel(time=np.flatnonzero(data[PHASE].values == int(only_phase)))
    variables = {
        name: xarray.Variable(
            _TIME, fields.decode(name, data[name].values), fields.attributes(name)
        )
        for name in listed
        if name != _TIME
    }
    return _tree(variables, data[_TIME].variable, data.attrs)


def _phase(name: str) -> Phase | None:
    if not name:
        return None
    if name.upper() not in Phase.__members__:
        raise KeyError(f"phase {name!r}: allowed {', '.join(Phase.__members__)}")
    return Phase[name.upper()]


def lazy_tree(path: Path, fields: LogFields) -> xarray.DataTree:
    """Return the whole log as a tree whose fields are read from the file when they are used."""
    data = open_run(path, [_TIME])
    columns = _Columns(path, fields)
    variables = {
        name: xarray.Variable(
            _TIME,
            indexing.LazilyIndexedArray(_Column(columns, name, data.sizes[_TIME])),
            fields.attributes(name),
        )
        for name in fields.leaves
        if name != _TIME
    }
    return _tree(variables, data[_TIME].variable, data.attrs)


class _Columns:
    """The fields of a run that were read so far; a field is read once."""

    def __init__(self, path: Path, fields: LogFields) -> None:
        self._path, self.fields = path, fields
        self._read: dict[str, Any] = {}

    def __call__(self, name: str) -> Any:
        if name not in self._read:
            values = reader.columns(reader.open_files(self._path), [name])[name]
            decoded = self.fields.decode(name, values)
            self._read[name] = decoded.astype(self.fields.dtype(name), copy=False)
        return self._read[name]


class _Column(BackendArray):  # type: ignore[misc,unused-ignore]
    """A field of a log as an array that is read when it is used."""

    def __init__(self, columns: _Columns, name: str, size: int) -> None:
        self._columns, self._name = columns, name
        self.shape = (size,)
        self.dtype = columns.fields.dtype(name)

    def __getitem__(self, key: Any) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER_1VECTOR, self._take
        )

    def _take(self, key: Any) -> Any:
        # A run that goes on has more ticks now than when the tree was built.
        return self._columns(self._name)[: self.shape[0]][key]


def _tree(
    variables: Mapping[str, xarray.Variable], time: xarray.Variable, attributes: Mapping[str, Any]
) -> xarray.DataTree:
    groups: dict[str, dict[str, xarray.Variable]] = {"": {}}
    for name, variable in variables.items():
        group, _, leaf = name.rpartition(".")
        groups.setdefault(group, {})[leaf] = variable
    root = xarray.Dataset(groups.pop(""), {_TIME: time}, dict(attributes))
    nodes = {
        f"/{group.replace('.', '/')}": xarray.Dataset(found) for group, found in groups.items()
    }
    return xarray.DataTree.from_dict({"/": root, **nodes}, name="log")
