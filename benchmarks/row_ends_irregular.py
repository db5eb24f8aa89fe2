"""Rows that end as measured in irregular seas, against rows of a repeat period: hours, errors."""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.support.campaigns import write_yaml
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Figure, Result, figure
from rig.campaign.plan import stage_plans
from rig.campaign.simulated_rows import row_results
from rig.kinds.wavebot.campaign import Campaign, open_campaign
from rig.kinds.wavebot.heave_loop import heave_law, transients
from rig.kinds.wavebot.predictions.model import build_model
from rig.kinds.wavebot.predictions.motion import Batch, predict_heave, predict_surge
from rig.realtime import paired_rows, sequence
from rig.realtime.paired_rows import BINS, PER_BATCH, estimated
from rig.realtime.sequence import MEASURE
from rig.sweeps.simulator import simulation_of

CAMPAIGN = ROOT / "configs" / "campaigns" / "default.yaml"
SEAS = ("jonswap_0p127m_1p58s", "jonswap_0p127m_2p5s", "jonswap_0p127m_3p45s")
HIGH_SEA = "jonswap_0p254m_2p5s"
TIMING = {"settle": "measured", "end": {"worse_rows": True}}
MAX_SHARE = 0.3  # of the basin time of the fixed rows
SEEDS = (1, 2, 3)
DRAWN_SEEDS, SHORT_SEEDS = 67, 3  # of each sea: 201 campaigns
SCATTER_W = 0.2  # standard deviation of the mean power of a bin besides that of the sea
NEAR_W = 1.0
BEFORE_ROWS_S, SETTLE_S = 125.0, 10.0  # tare and lead-in; fixed settling
PARAMS = paired_rows.Params(1.0, paired_rows.LEAST_BATCHES, 0.0, 0.0, 1)  # a tick is a bin

Floats = NDArray[np.float64]


class Drawn(NamedTuple):
    """A campaign in the sea of a seed, executed on powers of bins."""

    share: float  # basin time, of that of fixed rows
    powers: Floats  # W, of each row over the repeat period, as estimated
    covered: int  # rows that ended early whose 95 % interval has the true power
    early: int  # rows that ended early
    dropped: bool  # the row with the least true power ended early


def measure(short: bool = False) -> Result:
    """Simulate three seas of three seeds each in the loop; then many seeds on predicted powers."""
    with tempfile.TemporaryDirectory() as folder:
        campaigns = {sea: _open(Path(folder), sea) for sea in (*SEAS, HIGH_SEA)}
    figures = _simulated(campaigns, SEEDS[:1] if short else SEEDS)
    seeds = range(1, 1 + (SHORT_SEEDS if short else DRAWN_SEEDS))
    for sea in SEAS:
        figures += _drawn(sea, campaigns[sea], seeds)
    return Result(
        "row_ends_irregular",
        "Rows that settle and end as measured in irregular seas, against rows of a repeat period.",
        f"{CAMPAIGN.name} in three seas of 300 s, {len(SEEDS)} seeds of each, in the compiled loop "
        f"with the plant; {len(seeds)} seeds of each on predicted powers",
        tuple(figures),
        (
            "A row ends once it cannot be the best any more, after a sixth of the repeat period to "
            "all of it.",
            "True powers are those predicted for the whole repeat period. The power given away by "
            "three seeds is that of the row with the least mean, in the mean over all seeds.",
            f"Scatter: each bin of 5 s has a normal error of {SCATTER_W:g} W of its own.",
        ),
    )


def _open(folder: Path, sea: str) -> Campaign:
    keys = {"name": sea, "sea": str(ROOT / "configs" / "seas" / f"{sea}.yaml"), "timing": TIMING}
    return open_campaign(
        write_yaml(folder / f"{sea}.yaml", {"extends": str(CAMPAIGN), "seed": list(SEEDS), **keys})
    )


def _simulated(campaigns: dict[str, Campaign], seeds: Sequence[int]) -> list[Figure]:
    """Return basin times and errors of campaigns in the compiled loop."""
    seconds, fixed_seconds, errors, regrets = [], [], list[float](), list[float]()
    figures = []
    for sea, campaign in campaigns.items():
        shares = []
        powers, true = [], []
        for seed in seeds:
            plan = next(plan for plan in stage_plans(campaign) if plan.seed == seed)
            simulation, in_sea = simulation_of(campaign), campaign._replace(seed=seed)
            simulator = simulation.open_simulator(in_sea, plan)
            simulator.prepare()
            run = simulator.simulate(plan)
            rows = row_results(run, in_sea, plan, simulation.row_contents(in_sea))
            fixed = plan.phases.tare + plan.phases.lead_in + plan.phases.moving
            fixed += len(plan.rows) * (SETTLE_S + campaign.file.sea.repeat)
            shares.append(run.seconds / fixed)
            powers.append([row["power_dc"] for row in rows])
            true.append(predicted_powers(campaign, seed).mean(axis=1))
            if sea in SEAS:
                seconds.append(run.seconds)
                fixed_seconds.append(fixed)
        best = int(np.argmin(np.mean(powers, axis=0)))
        mean = np.mean(true, axis=0)
        if sea in SEAS:
            near = mean < mean.min() + NEAR_W
            errors += np.subtract(powers, true)[:, near].ravel().tolist()
            regrets.append(float(mean[best] - mean.min()))
        figures.append(figure(f"{sea}: measured / fixed, in the loop", "ratio", shares))
    return [
        figure("basin time, fixed rows", "h", sum(fixed_seconds) / 3600.0),
        figure("basin time, rows that end as measured", "h", sum(seconds) / 3600.0),
        figure("measured / fixed", "ratio", sum(seconds) / sum(fixed_seconds), at_most=MAX_SHARE),
        *figures,
        figure(
            f"error of the DC power of rows within {NEAR_W:g} W of the best, rms",
            "W",
            float(np.sqrt(np.mean(np.square(errors)))),
        ),
        figure("DC power given away at the best row of a sea", "W", regrets),
    ]


def predicted_powers(campaign: Campaign, seed: int) -> Floats:
    """Return the predicted DC power of each row in the sea of a seed, W; rows by samples."""
    model = build_model(campaign._replace(seed=seed))
    rows = stage_plans(campaign)[0].rows
    settings = [row.setting for row in rows]
    law = heave_law(campaign, settings, model.heave.timing.dt)
    lateral_force = predict_surge(model, settings).lateral_force
    batch = Batch(settings, [row.place for row in rows], law, {}, lateral_force)
    return predict_heave(model, batch, np.zeros(len(rows))).dc_power


def _drawn(sea: str, campaign: Campaign, seeds: Sequence[int]) -> list[Figure]:
    """Return coverage and errors of the campaigns of many seeds."""
    rows = stage_plans(campaign)[0].rows
    bin_s = campaign.file.sea.repeat / BINS
    settle = [math.ceil(each / bin_s) for each in transients(campaign, rows)]
    bins = [_bin_means(predicted_powers(campaign, seed)) for seed in seeds]
    true = np.array([each.mean(axis=1) for each in bins])
    figures = []
    for scatter in (0.0, SCATTER_W):
        drawn = [
            draw_campaign(each, settle, scatter, np.random.default_rng([seed, 11]))
            for seed, each in zip(seeds, bins, strict=True)
        ]
        noise = np.random.default_rng(12).normal(0.0, scatter / math.sqrt(BINS), true.shape)
        name = sea if scatter == 0.0 else f"{sea}, scatter {scatter:g} W"
        early = sum(each.early for each in drawn)
        coverage = 100.0 * sum(each.covered for each in drawn) / early
        dropped = 100.0 * sum(each.dropped for each in drawn) / len(drawn)
        figures += [
            figure(f"{name}: measured / fixed", "ratio", [each.share for each in drawn]),
            figure(f"{name}: rows within their 95 % interval", "%", coverage,
                   at_least=93.0, at_most=97.0),
            figure(f"{name}: best row ended early", "%", dropped),
            figure(f"{name}: power given away in one sea, rms", "W",
                   _given_away(np.array([each.powers for each in drawn]), true, 1)),
            figure(f"{name}: by three seeds, rms", "W",
                   _given_away(np.array([each.powers for each in drawn]), true, 3)),
            figure(f"{name}: the same by fixed rows", "W", _given_away(true + noise, true, 3)),
        ]  # fmt: skip
    return figures


def _bin_means(powers: Floats) -> Floats:
    means: Floats = powers.reshape(len(powers), BINS, -1).mean(axis=2)
    return means


def draw_campaign(
    bins: Floats, settle: Sequence[int], scatter: float, dice: np.random.Generator
) -> Drawn:
    """Return a campaign whose rows end as the loop ends them.

    ``bins``: true power of each row (W) and bin of the repeat period; ``settle``: bins of settling
    of each row; ``scatter``: standard deviation of a bin's power in addition, W.
    """
    true = bins.mean(axis=1)
    state, tick = paired_rows.start(), int(dice.integers(BINS))
    begin, powers, covered, early, dropped = tick, list[float](), 0, 0, False
    for row, power in enumerate(bins):
        tick = tick + settle[row]
        for settling in range(settle[row], 0, -1):  # the ring of the reference follows the waves
            plan = sequence.State(2 * row, tick - settle[row], 0, 0)
            state = paired_rows.step(PARAMS, state, plan, sequence.SETTLE, tick - settling, 0.0)
        plan, flags = sequence.State(2 * row + 1, tick, 0, 0), 0
        while flags == 0:
            value = float(power[tick % BINS] + scatter * dice.standard_normal())
            state = paired_rows.step(PARAMS, state, plan, MEASURE, tick, value)
            tick, flags = tick + 1, state.flags
        count = state.row.bins
        if count == BINS:
            powers.append(float(np.mean(state.own)))
            continue
        estimate = estimated(state.own, state.reference, state.reference_mean, count)
        powers.append(estimate.power)
        half = stats.t.ppf(0.975, count // PER_BATCH - 2) * math.sqrt(estimate.variance)
        early, covered = early + 1, covered + (abs(estimate.power - true[row]) <= half)
        dropped |= row == np.argmin(true)
    seconds = BEFORE_ROWS_S + (tick - begin) * 300.0 / BINS
    fixed = BEFORE_ROWS_S + len(bins) * (SETTLE_S + 300.0)
    return Drawn(seconds / fixed, np.array(powers), covered, early, dropped)


def _given_away(measured: Floats, true: Floats, seas: int) -> float:
    """Return the power above the least one of the row with the least mean over some seas, W, rms.

    Of a single sea the true powers are those in it, of several those in the mean over all.
    """
    given = []
    for first in range(0, len(measured) - seas + 1, seas):
        best = int(np.argmin(measured[first : first + seas].mean(axis=0)))
        truth = true[first] if seas == 1 else true.mean(axis=0)
        given.append(float(truth[best] - truth.min()))
    return float(np.sqrt(np.mean(np.square(given))))
