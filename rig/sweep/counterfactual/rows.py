"""Rows of a campaign in the recovered waves of a run, with an uncertainty.

The campaign's rows run in the compiled loop on its own plant and rig. So do the rows that were
logged, with their own gains: what the model gives for them, against what was measured, is the error
of waves and model together. A row's error is told as a share of its gross powers (what the body
gave, and what the drive lost), because errors of damping and of waves scale with them; the mean
share corrects, its scatter makes the interval of one more row of the same kind (Student's t).
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student

from rig.analysis.rows import COMPLETE, POWERS, SETTINGS, row_table
from rig.analysis.windows import Window, read_windows
from rig.design.predictions.device import model_of
from rig.execution.rehearsal import job
from rig.execution.replay import logged_campaign
from rig.identification.twin.plant_file import identified_up_to
from rig.planning.campaign import Campaign, Plan, build_plan
from rig.planning.campaign.windows import repeat_period
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import RunInfo, run_info
from rig.sweep.cases import LEAD_IN, alone, table
from rig.sweep.counterfactual.waves import FIELDS, Waves, asked_of, recovered
from rig.sweep.simulation import Subject

CONFIDENCE = 0.95
FLOOR = 0.5  # W, gross power below which an error is no share any more
MARGIN = 1.1  # times the greatest amplitude that was logged: the model is not asked further
RANGES = {"velocity_rms": "m/s", "stroke": "m"}  # what an amplitude is judged by

See = Callable[[int, int], None]  # rows that ran, of how many


class Row(NamedTuple):
    """One row as it would have been; SI, power negative when absorbed."""

    row: int
    setting: dict[str, float]  # by the names of the row table
    state: str
    why: str  # it is not complete
    power: dict[str, float]  # W, by station
    half_width: dict[str, float]  # W, 95 %; NaN: one logged row tells no scatter
    amplitude: dict[str, float]  # by the names of `RANGES`
    outside: tuple[str, ...]  # amplitudes beyond what was logged
    unidentified: tuple[str, ...]  # those beyond what the twin was identified with


class Logged(NamedTuple):
    """A row of the run beside the model with the same gains."""

    row: int
    setting: dict[str, float]
    logged: dict[str, float]  # W, by station
    modelled: dict[str, float]  # W


class Span(NamedTuple):
    """Least and greatest amplitude among some rows."""

    least: float
    greatest: float
    unit: str


class Share(NamedTuple):
    """Error of one station as a share of gross power."""

    mean: float
    scatter: float  # standard deviation; NaN for fewer than two rows
    rows: int


class CounterfactualRow(NamedTuple):
    """A campaign in the waves of a run."""

    run: str
    campaign: str
    waves: Waves
    checked: tuple[Logged, ...]  # the error of waves and model, to be looked at first
    shares: dict[str, Share]  # the same by station: the mean corrects ``rows``
    spans: dict[str, Span]  # of the logged rows
    identified: dict[str, Span]  # of the rows that the model is a twin of; none if it is no twin
    rows: tuple[Row, ...]


class Measured(NamedTuple):
    """What a run measured."""

    run: str
    rows: tuple[dict[str, Any], ...]  # the complete ones, as in the row table
    windows: Iterable[
        Window
    ]  # of these, with the fields of `rig.sweep.counterfactual.waves.FIELDS`


def foretell(
    run: str | os.PathLike[str],
    campaign: Campaign,
    *,
    model: Campaign | None = None,
    by: str | None = None,
    lead_in: float = LEAD_IN,
    see: See = lambda done, of: None,
) -> CounterfactualRow:
    """What the rows of ``campaign`` would have given in the waves of ``run``.

    ``model``: the campaign whose plant stands for the rig as it was when the run was logged; None:
    that of ``campaign``. ``by``: how the waves are recovered (`rig.sweep.counterfactual.waves`).
    Raises RunError for a run that does not tell enough, ValueError for a campaign in other waves.
    """
    source = reader.open_files(run)
    known = run_info(run, source.contents)
    if "session" in known.config:
        raise RunError(f"{known.run}: a run of a bench; only those of a WaveBot had waves")
    there = {leaf.name for leaf in source.leaves}
    if missing := sorted(set(FIELDS) - there):
        raise RunError(f"{known.run}: it did not log {', '.join(missing)}")
    was = _on_model(known, model or campaign)._replace(elevation=campaign.elevation)  # one sea
    known_rows = row_table(run)
    names = [str(name) for name in known_rows.variables]
    rows = tuple(
        {name: known_rows[name].values[i].item() for name in names}
        for i, state in enumerate(known_rows["state"].values)
        if state == COMPLETE
    )
    kept = {row["row"] for row in rows}
    measured = (w for w in read_windows(source, list(FIELDS), known.plan) if w.row in kept)
    return counterfactual_rows(Measured(known.run, rows, measured), was, campaign, by, lead_in, see)


def counterfactual_rows(
    measured: Measured,
    was: Campaign,
    campaign: Campaign,
    by: str | None = None,
    lead_in: float = LEAD_IN,
    see: See = lambda done, of: None,
) -> CounterfactualRow:
    """As `foretell`, of what was measured with the campaign ``was``, its plant being the model."""
    if was.file.sea != campaign.file.sea:
        raise ValueError(
            f"the campaign's sea is not that of {measured.run}: {campaign.file.sea.description()}; the "
            f"run had {was.file.sea.description()}"
        )
    if not measured.rows:
        raise RunError(f"{measured.run}: none of its rows is complete")
    try:
        asked = asked_of(job.requested_sea(was))
        dt = 1.0 / was.rig.rate_hz
        waves = recovered(measured.windows, asked, model_of(was), dt, by)
    except ValueError as error:
        raise RunError(f"{measured.run}: {error}") from None
    sea = waves.description()
    of = len(was.points) + len(campaign.points)
    again = {}
    for i, (point, found) in enumerate(_run(was, sea, lead_in), 1):
        again[point] = found
        see(i, of)
    checked = tuple(
        Logged(
            row["row"],
            _setting(row),
            {name: row[f"power_{name}"] for name in POWERS},
            _powers(again[row["point"]]),
        )
        for row in measured.rows
    )
    if any(math.isnan(value) for one in checked for value in one.modelled.values()):
        raise RunError(f"{measured.run}: the model does not get through a row that was measured")
    shares = shares_of(checked)
    spans = {
        name: Span(min(each), max(each), unit)
        for name, unit in RANGES.items()
        for each in ([row[name] for row in measured.rows],)
    }
    plant = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    known = identified_up_to(plant).items()
    identified = {name: Span(*each, RANGES[name]) for name, each in known if name in RANGES}
    rows = []
    for i, (point, found) in enumerate(_run(campaign, sea, lead_in), len(was.points) + 1):
        rows.append(_row(point, found, shares, spans, identified))
        see(i, of)
    return CounterfactualRow(
        measured.run, campaign.file.name, waves, checked, shares, spans, identified, tuple(rows)
    )


def shares_of(checked: Sequence[Logged]) -> dict[str, Share]:
    """The error of each station over the rows that were logged, as a share of gross power."""
    shares = {}
    for name in POWERS:
        each = np.array(
            [(one.logged[name] - one.modelled[name]) / gross(one.modelled, name) for one in checked]
        )
        scatter = float(np.std(each, ddof=1)) if len(each) > 1 else math.nan
        shares[name] = Share(float(each.mean()), scatter, len(each))
    return shares


def gross(powers: dict[str, float], name: str) -> float:
    """Power that went in and power that was lost on the way to a station, both counted; W."""
    given = powers["mechanical_1"]
    return max(abs(given) + abs(powers[name] - given), FLOOR)


def corrected(
    powers: dict[str, float], shares: dict[str, Share]
) -> tuple[dict[str, float], dict[str, float]]:
    """Power of each station and half its interval (W)."""
    value, half = {}, {}
    for name, (mean, scatter, count) in shares.items():
        size = gross(powers, name)
        value[name] = powers[name] + mean * size
        factor = student.ppf(0.5 + 0.5 * CONFIDENCE, count - 1) if count > 1 else math.nan
        half[name] = float(factor * scatter * math.sqrt(1.0 + 1.0 / count) * size)
    return value, half


def _row(
    point: int,
    found: dict[str, Any],
    shares: dict[str, Share],
    spans: dict[str, Span],
    identified: dict[str, Span],
) -> Row:
    value, half = corrected(_powers(found), shares)
    amplitude = {name: float(found.get(name, math.nan)) for name in RANGES}

    def beyond(known: dict[str, Span]) -> tuple[str, ...]:
        return tuple(n for n, span in known.items() if amplitude[n] > MARGIN * span.greatest)

    return Row(
        point, _setting(found), found["state"], found["incomplete_reason"], value, half, amplitude,
        beyond(spans), beyond(identified),
    )  # fmt: skip


def _powers(found: dict[str, Any]) -> dict[str, float]:
    if found["state"] != COMPLETE:
        return dict.fromkeys(POWERS, math.nan)
    return {name: float(found[f"power_{name}"]) for name in POWERS}


def _setting(row: dict[str, Any]) -> dict[str, float]:
    """What is set at all: a drive of another kind has none of these."""
    values = {name: float(row[name]) for name in SETTINGS}
    return {name: value for name, value in values.items() if not math.isnan(value)}


def _run(
    campaign: Campaign, sea: dict[str, Any], lead_in: float
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Each point of a campaign and what it gives in a sea, in the words of the row table."""
    file = alone(campaign.file, lead_in)
    period = repeat_period(file.sea)
    subject = Subject(campaign, build_plan(file, campaign.rig, campaign.points), sea)
    for number, point in enumerate(campaign.points):
        planned: Plan = build_plan(file, campaign.rig, (point,))
        walk = subject.walk(planned, stator=planned.rows[0].stator_position)
        (row,) = table(walk, planned, period / planned.dt if period else None)
        yield number, row


def _on_model(known: RunInfo, model: Campaign) -> Campaign:
    """The campaign of a run as its record has it, on the model's plant."""
    was = logged_campaign(known)
    if was.rig.drive.kind != model.rig.drive.kind:
        raise ValueError(
            f"{known.run} was run with a {was.rig.drive.kind} drive, the model has a "
            f"{model.rig.drive.kind} one; name the campaign of the run as its model"
        )
    return model._replace(**was._asdict())
