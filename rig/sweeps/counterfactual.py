"""Counterfactual rows: power of other gains, laws, springs or drives in the waves of a run.

The compiled loop simulates the campaign's rows on the campaign's plant and rig. It also simulates
the logged rows with their own gains: the difference between model and measurement is the error of
waves and model together. A row's error is expressed as a share of its gross power (power absorbed
from the body plus losses of the drive), because errors of damping and waves scale with it. The mean
share corrects the predictions; its scatter gives the prediction interval (Student's t).
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.analysis import intervals
from rig.analysis.rows import COMPLETE, row_table
from rig.campaign import AnyCampaign, build_plan
from rig.campaign.record import logged_campaign
from rig.campaign.simulated_rows import row_results
from rig.identification.incident_waves import RecoveredWaves, recover_waves, wave_maker_lines
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import Window, read_windows
from rig.row_contents import RowContents
from rig.spectra.periods import common_period_ticks
from rig.stations import station_names
from rig.sweeps.campaigns import LEAD_IN, single_row_campaign, single_row_plan
from rig.sweeps.simulator import simulation_of

MIN_GROSS_POWER = 0.5  # W, lower bound of the gross power that errors are divided by
AMPLITUDE_MARGIN = 1.1  # of the greatest logged amplitude; predictions beyond it are flagged
MAX_REPEAT_S = 3600  # of a simulated sea
AMPLITUDE_UNITS = {"velocity_rms": "m/s", "stroke": "m"}  # quantities of a row's amplitude

OnProgress = Callable[[int, int], None]  # finished rows, all rows


class RowPrediction(NamedTuple):
    """Prediction of one row; SI units, absorbed power is negative."""

    row: int
    setting: dict[str, float]  # with the names of the row table
    state: str
    incomplete_reason: str  # empty for a complete row
    power: dict[str, float]  # W, by station
    half_width: dict[str, float]  # W, 95 %; NaN for a single logged row, which has no scatter
    amplitude: dict[str, float]  # with the names of `AMPLITUDE_UNITS`
    beyond_logged: tuple[str, ...]  # amplitudes beyond the logged rows
    beyond_identified: tuple[str, ...]  # amplitudes beyond the rows that identified the twin


class RowComparison(NamedTuple):
    """Logged and modelled power of a row of the run."""

    row: int
    setting: dict[str, float]
    logged: dict[str, float]  # W, by station
    modelled: dict[str, float]  # W


class AmplitudeRange(NamedTuple):
    """Least and greatest amplitude of a set of rows."""

    least: float
    greatest: float
    unit: str


class ErrorShare(NamedTuple):
    """Error of one station as a share of gross power."""

    mean: float
    scatter: float  # standard deviation; NaN for fewer than two rows
    rows: int


class CounterfactualResult(NamedTuple):
    """Predictions of a campaign in the waves of a run, with their checks."""

    run: str
    campaign: str
    waves: RecoveredWaves
    comparisons: tuple[RowComparison, ...]  # logged rows: the error of waves and model
    shares: dict[str, ErrorShare]  # the same error by station; the mean corrects ``rows``
    logged_ranges: dict[str, AmplitudeRange]  # of the logged rows
    identified_ranges: dict[str, AmplitudeRange]  # of the twin's rows; empty without a twin
    rows: tuple[RowPrediction, ...]


class MeasuredRun(NamedTuple):
    """The measured rows of a run."""

    run: str
    rows: tuple[dict[str, Any], ...]  # complete rows, as in the row table
    windows: Iterable[Window]  # of ``rows``, with the fields from which waves are recovered


def counterfactual_for_run(
    run: str | os.PathLike[str],
    campaign: AnyCampaign,
    *,
    model: AnyCampaign | None = None,
    method: str | None = None,
    on_progress: OnProgress = lambda done, of: None,
) -> CounterfactualResult:
    """Predict the rows of ``campaign`` in the waves of ``run``.

    ``model`` is the campaign whose plant models the rig at the time of the run; default is
    ``campaign``. ``method`` selects the recovery of the waves
    (`rig.identification.incident_waves`). Raises RunError for a run with too little data,
    ValueError for a campaign in other waves.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    if "campaign" not in run_facts.config:
        raise RunError(f"{run_facts.run}: a run without a campaign; allowed runs of a campaign")
    fields = simulation_of(campaign).wave_device(campaign).sensors.fields
    if missing := sorted(set(fields) - {leaf.name for leaf in source.leaves}):
        raise RunError(f"{run_facts.run}: it did not log {', '.join(missing)}")
    logged_campaign = _logged_campaign(run_facts, model or campaign)
    for name, each in ((run_facts.run, logged_campaign), (campaign.file.name, campaign)):
        if len(each.file.seeds) > 1:
            raise RunError(f"{name}: rows in the seas of several seeds; allowed one sea")
    logged_campaign = logged_campaign._replace(elevation=campaign.elevation)  # the same sea
    logged_rows = row_table(run)
    names = [str(name) for name in logged_rows.variables]
    rows = tuple(
        {name: logged_rows[name].values[i].item() for name in names}
        for i, state in enumerate(logged_rows["state"].values)
        if state == COMPLETE
    )
    complete = {row["row"] for row in rows}
    measured = (w for w in read_windows(source, list(fields), run_facts.plan) if w.row in complete)
    return counterfactual_rows(
        MeasuredRun(run_facts.run, rows, measured),
        logged_campaign,
        campaign,
        method,
        on_progress,
    )


def counterfactual_rows(
    measured: MeasuredRun,
    logged_campaign: AnyCampaign,
    campaign: AnyCampaign,
    method: str | None = None,
    on_progress: OnProgress = lambda done, of: None,
) -> CounterfactualResult:
    """Predict the rows of ``campaign`` from measured rows.

    ``logged_campaign`` is the campaign of the measured run; its plant is the model. Other arguments
    and errors are those of `counterfactual_for_run`.
    """
    if logged_campaign.file.sea != campaign.file.sea:
        raise ValueError(
            f"the campaign's sea is not that of {measured.run}: {campaign.file.sea.description()}; "
            f"the run had {logged_campaign.file.sea.description()}"
        )
    if not measured.rows:
        raise RunError(f"{measured.run}: none of its rows is complete")
    simulation = simulation_of(logged_campaign)
    contents = simulation.row_contents(logged_campaign)
    stations = station_names(contents.stations)
    try:
        generated = wave_maker_lines(simulation.requested_sea(logged_campaign))
        device, dt = simulation.wave_device(logged_campaign), 1.0 / logged_campaign.rig.rate_hz
        waves = recover_waves(measured.windows, generated, device, dt, method)
    except ValueError as error:
        raise RunError(f"{measured.run}: {error}") from None
    sea = _on_whole_ticks(waves.description(), dt)
    total = len(logged_campaign.points) + len(campaign.points)
    modelled = {}
    for point, result in _simulate_points(logged_campaign, sea):
        modelled[point] = result
        on_progress(len(modelled), total)
    comparisons = tuple(
        RowComparison(
            row["row"],
            _setting(row, contents),
            {name: row[f"power_{name}"] for name in stations},
            _powers(modelled[row["point"]], stations),
        )
        for row in measured.rows
    )
    if any(math.isnan(value) for one in comparisons for value in one.modelled.values()):
        raise RunError(f"{measured.run}: the model does not complete a row that was measured")
    shares = error_shares(comparisons)
    logged_ranges, identified_ranges = {}, {}
    identified = simulation.identified_range(campaign)
    for name, unit in AMPLITUDE_UNITS.items():
        logged = [row[name] for row in measured.rows]
        logged_ranges[name] = AmplitudeRange(min(logged), max(logged), unit)
        if name in identified:
            identified_ranges[name] = AmplitudeRange(*identified[name], unit)
    rows, own_contents = [], simulation.row_contents(campaign)
    for point, result in _simulate_points(campaign, sea):
        power, half_width = correct_powers(_powers(result, shares), shares)
        amplitude = {name: float(result.get(name, math.nan)) for name in AMPLITUDE_UNITS}
        rows.append(
            RowPrediction(
                point,
                _setting(result, own_contents),
                result["state"],
                result["incomplete_reason"],
                power,
                half_width,
                amplitude,
                _beyond(amplitude, logged_ranges),
                _beyond(amplitude, identified_ranges),
            )
        )
        on_progress(len(modelled) + len(rows), total)
    return CounterfactualResult(
        measured.run,
        campaign.file.name,
        waves,
        comparisons,
        shares,
        logged_ranges,
        identified_ranges,
        tuple(rows),
    )


def _on_whole_ticks(sea: dict[str, Any], dt: float) -> dict[str, Any]:
    """Return a sea of components with as many of its repeat periods as end on a tick.

    A regular sea of 0.3 Hz, for example, ends on a tick of 1 ms after three periods only.
    """
    repeat = sea["repeat_s"]
    seconds = common_period_ticks([repeat], dt, round(MAX_REPEAT_S / dt)) * dt
    times = round(seconds / repeat)
    if times == 1:
        return sea
    return sea | {"repeat_s": seconds, "cycles": [times * n for n in sea["cycles"]]}


def error_shares(comparisons: Sequence[RowComparison]) -> dict[str, ErrorShare]:
    """Return the error of each station over the logged rows, as a share of gross power."""
    shares = {}
    for name in comparisons[0].logged:
        pairs = [(one.logged[name] - one.modelled[name], one.modelled) for one in comparisons]
        errors = np.array([error / gross_power(powers, name) for error, powers in pairs])
        scatter = float(np.std(errors, ddof=1)) if len(errors) > 1 else math.nan
        shares[name] = ErrorShare(float(errors.mean()), scatter, len(errors))
    return shares


def gross_power(powers: dict[str, float], name: str) -> float:
    """Return absorbed power plus power lost up to a station, W; at least `MIN_GROSS_POWER`.

    The first of the ``powers`` is that absorbed from the body.
    """
    absorbed = next(iter(powers.values()))
    return max(abs(absorbed) + abs(powers[name] - absorbed), MIN_GROSS_POWER)


def correct_powers(
    powers: dict[str, float], shares: dict[str, ErrorShare]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the corrected power of each station and the half width of its interval, W."""
    corrected, half_width = {}, {}
    for name, (mean, scatter, count) in shares.items():
        scale = gross_power(powers, name)
        corrected[name] = powers[name] + mean * scale
        error = scatter * math.sqrt(1.0 + 1.0 / count) * scale
        half_width[name] = intervals.half_width(error, count - 1)
    return corrected, half_width


def _beyond(amplitude: dict[str, float], ranges: dict[str, AmplitudeRange]) -> tuple[str, ...]:
    """Return the names of the amplitudes beyond their ranges."""
    return tuple(
        name
        for name, limits in ranges.items()
        if amplitude[name] > AMPLITUDE_MARGIN * limits.greatest
    )


def _powers(result: dict[str, Any], stations: Iterable[str]) -> dict[str, float]:
    if result["state"] != COMPLETE:
        return dict.fromkeys(stations, math.nan)
    return {name: float(result[f"power_{name}"]) for name in stations}


def _setting(row: dict[str, Any], contents: RowContents) -> dict[str, float]:
    """Return the settings of a row, without those that its drive does not have."""
    actuators_first = sorted(contents.settings, key=lambda column: column in contents.columns)
    values = {each.name: float(row[each.name]) for each in actuators_first if each.name in row}
    return {name: value for name, value in values.items() if not math.isnan(value)}


def _simulate_points(
    campaign: AnyCampaign, sea: dict[str, Any]
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield each point's number and its simulated results in a sea, with names of the row table."""
    simulation = simulation_of(campaign)
    whole = build_plan(single_row_campaign(campaign, LEAD_IN))
    simulator = simulation.open_simulator(campaign, whole, sea)
    for number, point in enumerate(campaign.points):
        planned = single_row_plan(campaign, LEAD_IN, point)
        rows = simulator.simulate(planned, place=planned.rows[0].place)
        (row,) = row_results(rows, campaign, planned, simulation.row_contents(campaign))
        yield number, row


def _logged_campaign(run_facts: RunInfo, model: AnyCampaign) -> AnyCampaign:
    """Return the campaign of a run from its record, with the model's plant."""
    recorded = logged_campaign(model.kind, run_facts)
    logged: AnyCampaign = model._replace(**recorded._asdict())
    simulation_of(model).check_model(run_facts.run, logged, model)
    return logged
