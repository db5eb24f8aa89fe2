"""The result of a sweep as a dataset: one dimension per parameter, then the campaign's rows."""

import json
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rig.analysis.rows import NOT_RUN, column_units, contents_attributes
from rig.campaign import AnyCampaign, CampaignRow, resolved_config
from rig.config import ranges
from rig.planning.windows import repeat_period
from rig.recording import provenance
from rig.sweep.cases import Cases, Outcome, single_row_campaign
from rig.sweep.parameters import parameter_unit
from rig.sweep.simulator import simulation_of

if TYPE_CHECKING:
    import xarray

FAILED = "failed"
_TEXT_COLUMNS = ("state", "incomplete_reason", "limits", "warned")
# Columns that are meaningless for a case.
_BOOKKEEPING = ("row", "attempt", "lost_ticks", "ticks_expected", "ticks_missing")

Array = npt.NDArray[Any]


def build_dataset(
    cases: Cases, campaign: AnyCampaign, outcomes: Iterable[Outcome], name: str
) -> "xarray.Dataset":
    """Return a dataset with every input as a coordinate and every result over parameters and rows.

    Both have units. Results of cases that did not run are NaN; ``state`` and ``incomplete_reason``
    give the state of each row and its reason.
    """
    import xarray  # noqa: PLC0415 - takes a second; a finished sweep does not need it

    rows = [row.row for row in cases.rows]
    columns = _fill_columns(cases, {row: i for i, row in enumerate(rows)}, outcomes)
    shape = (*cases.shape, len(rows))
    dims = (*(parameter.key for parameter in cases.request.parameters), "row")
    coords: dict[str, xarray.Variable] = {"row": xarray.Variable("row", rows)}
    for parameter in cases.request.parameters:
        unit = parameter_unit(parameter, campaign)
        coords[parameter.key] = xarray.Variable(
            parameter.key, _values(parameter.values), _units(unit)
        )
    request = cases.request
    run = campaign if request.sequential else single_row_campaign(campaign, request.lead_in)
    for key, value in _campaign_entries(run):
        if key not in coords:
            coords[key] = xarray.Variable(
                (), value, _units(ranges.unit_of_key(key.rpartition(".")[2]))
            )
    for key in ("point", "repetition"):
        coords[key] = xarray.Variable("row", [getattr(row, key) for row in cases.rows])
    contents = simulation_of(campaign).row_contents(campaign)
    data, units = {}, column_units(contents)
    settings = {column.name for column in contents.settings}
    for key, flat in columns.items():
        values = flat.reshape(shape)
        if key in settings and (planned := _planned_setting(values, key, cases.rows)) is not None:
            coords[key] = xarray.Variable("row", planned, _units(units[key]))
        else:
            data[key] = xarray.Variable(dims, values, _units(units.get(key, "")))
    return xarray.Dataset(data, coords, _attributes(cases, campaign, name))


def _fill_columns(
    cases: Cases, row_index: dict[int, int], outcomes: Iterable[Outcome]
) -> dict[str, Array]:
    """Return each result by name, one entry for each variant and row."""
    count = int(np.prod(cases.shape, dtype=int)) * len(row_index)
    columns: dict[str, Array] = {
        "state": np.full(count, NOT_RUN, object),
        "incomplete_reason": np.full(count, "", object),
    }
    by_number = list(cases) if cases.request.sequential else []
    for outcome in outcomes:
        variant, row_position = divmod(outcome.case, len(row_index))
        entries = [outcome.case]
        if by_number:
            variant = by_number[outcome.case].variant
            entries = [variant * len(row_index) + i for i in range(len(row_index))]
        if outcome.failed:
            columns["state"][entries], columns["incomplete_reason"][entries] = (
                FAILED,
                outcome.failed,
            )
        for row in outcome.rows:
            i = variant * len(row_index) + (row_index[row["row"]] if by_number else row_position)
            for key, value in row.items():
                if key in _BOOKKEEPING:
                    continue
                if key not in columns:
                    is_text = key in _TEXT_COLUMNS
                    columns[key] = np.full(count, "", object) if is_text else np.full(count, np.nan)
                columns[key][i] = value
    return columns


def _campaign_entries(campaign: AnyCampaign) -> Iterator[tuple[str, Any]]:
    """Yield keys and values of a campaign other than its rows; lists entry by entry."""
    contents = campaign.file.model_dump(mode="json", by_alias=True)

    def leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
        inside = value.items() if isinstance(value, dict) else enumerate(value)
        for name, each in inside:
            if isinstance(each, dict | list):
                yield from leaves(f"{key}.{name}", each)
            elif each is not None:
                yield f"{key}.{name}", each

    for key in campaign.kind.swept_keys:
        if isinstance(contents.get(key), dict):
            yield from leaves(key, contents[key])
        elif contents.get(key) is not None:
            yield key, contents[key]


def _planned_setting(values: Array, key: str, rows: tuple[CampaignRow[Any], ...]) -> Array | None:
    """Return a setting of the planned rows; None if a parameter of the sweep changes it."""
    # The position of the device that realises a set point is not itself one.
    planned = [getattr(row.setting, key, row.place) for row in rows]
    flat = values.reshape(-1, len(rows)).astype(float)
    unchanged = np.isnan(flat) | (flat == np.array(planned))
    return np.array(planned) if bool(unchanged.all()) else None


def _values(values: tuple[Any, ...]) -> Array:
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([str(value) for value in values], object)


def _units(text: str) -> dict[str, str]:
    return {"units": text} if text else {}


def _attributes(cases: Cases, campaign: AnyCampaign, name: str) -> dict[str, Any]:
    code = provenance.describe_code()
    period = repeat_period(campaign.file.sea)
    attributes: dict[str, Any] = {
        "run": name,
        "mode": "batch",
        "campaign": campaign.file.name,
        "sea": campaign.file.sea.description(),
        "sequential": int(cases.request.sequential),
        **contents_attributes(simulation_of(campaign).row_contents(campaign)),
        "config": resolved_config(campaign),
        "code_version": code["version"],
        "code_git": code["git"],
        "sweep_parameters": json.dumps(
            {parameter.key: parameter.values for parameter in cases.request.parameters}
        ),
    }
    if not cases.request.sequential:
        attributes["lead_in_s"] = cases.request.lead_in
    return attributes | ({"wave_period_s": period} if period else {})
