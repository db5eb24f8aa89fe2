"""What a sweep found as one dataset: a dimension for each parameter, then the campaign's rows."""

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rig.analysis.rows import COMPLETE, INTERRUPTED, NOT_RUN, SETTINGS, UNITS
from rig.config import ranges
from rig.config.campaign_file import CampaignFile
from rig.planning.campaign import Campaign, CampaignRow, resolved_config
from rig.planning.campaign.windows import repeat_period
from rig.recording import provenance
from rig.sweep.cases import Cases, Outcome, alone
from rig.sweep.parameters import OWN, unit

if TYPE_CHECKING:
    import xarray

FAILED = "failed"
_STATES = {COMPLETE, INTERRUPTED, NOT_RUN, FAILED}
_WORDS = ("state", "incomplete_reason", "limits", "warned")
_NO_RESULT = (
    "row",
    "attempt",
    "lost_ticks",
    "ticks_expected",
    "ticks_missing",
)  # of a case they say nothing

Array = npt.NDArray[Any]


def dataset(
    cases: Cases, campaign: Campaign, outcomes: Iterable[Outcome], name: str
) -> "xarray.Dataset":
    """Every input as a coordinate with its unit, every result over parameters and rows.

    What was not run is NaN; ``state`` and ``incomplete_reason`` say what became of each row and why.
    """
    import xarray  # noqa: PLC0415 - a second, which who finds everything done need not wait

    rows = [row.row for row in cases.rows]
    columns = _filled(cases, {row: i for i, row in enumerate(rows)}, outcomes)
    shape = (*cases.shape, len(rows))
    dims = (*(over.key for over in cases.asked.parameters), "row")
    coords: dict[str, xarray.Variable] = {"row": xarray.Variable("row", rows)}
    for over in cases.asked.parameters:
        said = unit(over, campaign)
        coords[over.key] = xarray.Variable(over.key, _values(over.values), _units(said))
    asked = cases.asked
    file = campaign.file if asked.sequential else alone(campaign.file, asked.lead_in)
    for key, value in _as_walked(file):
        if key not in coords:
            coords[key] = xarray.Variable(
                (), value, _units(ranges.unit_of_key(key.rpartition(".")[2]))
            )
    for key in ("point", "repetition"):
        coords[key] = xarray.Variable("row", [getattr(row, key) for row in cases.rows])
    data = {}
    for key, flat in columns.items():
        values = flat.reshape(shape)
        if key in SETTINGS and (same := _of_rows(values, key, cases.rows)) is not None:
            coords[key] = xarray.Variable("row", same, _units(SETTINGS[key]))
        else:
            data[key] = xarray.Variable(dims, values, _units(UNITS.get(key, "")))
    return xarray.Dataset(data, coords, _attributes(cases, campaign, name))


def _filled(cases: Cases, place: dict[int, int], outcomes: Iterable[Outcome]) -> dict[str, Array]:
    """Each result by its name, one entry for each variant and row."""
    count = int(np.prod(cases.shape, dtype=int)) * len(place)
    columns: dict[str, Array] = {
        "state": np.full(count, NOT_RUN, object),
        "incomplete_reason": np.full(count, "", object),
    }
    by_number = list(cases) if cases.asked.sequential else []
    for outcome in outcomes:
        variant, nth = divmod(outcome.case, len(place))
        at = [outcome.case]
        if by_number:
            variant = by_number[outcome.case].variant
            at = [variant * len(place) + i for i in range(len(place))]
        if outcome.failed:
            columns["state"][at], columns["incomplete_reason"][at] = FAILED, outcome.failed
        for row in outcome.rows:
            i = variant * len(place) + (place[row["row"]] if by_number else nth)
            for key, value in row.items():
                if key in _NO_RESULT:
                    continue
                if key not in columns:
                    words = key in _WORDS
                    columns[key] = np.full(count, "", object) if words else np.full(count, np.nan)
                columns[key][i] = value
    return columns


def _as_walked(file: CampaignFile) -> Iterator[tuple[str, Any]]:
    """Keys and values of what a campaign says beside its rows; lists by their entries."""
    told = file.model_dump(mode="json", by_alias=True)

    def leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
        inside = value.items() if isinstance(value, dict) else enumerate(value)
        for name, each in inside:
            if isinstance(each, dict | list):
                yield from leaves(f"{key}.{name}", each)
            elif each is not None:
                yield f"{key}.{name}", each

    for key in OWN:
        if isinstance(told.get(key), dict):
            yield from leaves(key, told[key])
        elif told.get(key) is not None:
            yield key, told[key]


def _of_rows(values: Array, key: str, rows: tuple[CampaignRow, ...]) -> Array | None:
    """A setting of the rows, where no parameter of the sweep changes it."""
    name = "stator_position" if key == "stator" else key
    told = [
        getattr(row, name) if hasattr(row, name) else getattr(row.setting, name) for row in rows
    ]
    flat = values.reshape(-1, len(rows)).astype(float)
    same = np.isnan(flat) | (flat == np.array(told))
    return np.array(told) if bool(same.all()) else None


def _values(values: tuple[Any, ...]) -> Array:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([str(value) for value in values], object)


def _units(text: str) -> dict[str, str]:
    return {"units": text} if text else {}


def _attributes(cases: Cases, campaign: Campaign, name: str) -> dict[str, Any]:
    code = provenance.describe_code()
    period = repeat_period(campaign.file.sea)
    told: dict[str, Any] = {
        "run": name,
        "mode": "batch",
        "campaign": campaign.file.name,
        "sea": campaign.file.sea.description(),
        "sequential": int(cases.asked.sequential),
        "config": resolved_config(campaign),
        "code_version": code["version"],
        "code_git": code["git"],
        "overs": json.dumps({over.key: over.values for over in cases.asked.parameters}),
    }
    if not cases.asked.sequential:
        told["lead_in_s"] = cases.asked.lead_in
    return told | ({"wave_period_s": period} if period else {})
