"""Errors of the spring-map campaign on eight hidden springs, each drawn from a seed."""

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.support.campaigns import rehearse
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.kinds.wavebot.spring_map.result import spring_map

SPRINGS, MAX_ERROR = 8, 2.0  # %
STATIONS = (-93.0, -73.0, -53.0, -33.0, -13.0, 7.0, 27.0, 47.0, 67.0)
_PLANT = """\
extends: {root}/configs/plants/wavebot.yaml
bem: {root}/configs/plants/wavebot_bem.npz
spring:
  spring_rates: {{value: {rates}, unit: N/m, source: drawn from a seed}}
pto:
  drivetrain_coulomb: {{value: 20.0, unit: N, source: a benchmark}}
"""
_CAMPAIGN = """\
name: hidden_spring
rig: {root}/configs/rigs/wavebot_hoist.yaml
plant: plant.yaml
seed: {seed}
sea: {{kind: calm}}
surge: {{use: "off"}}
tare: {{duration_s: 2}}
start: {{lead_in_s: 3, set_point_s: 3}}
hoist:
  stations_percent: {stations}
  low_m: -0.26
  high_m: 0.26
  speed_m_per_s: 0.1
  cycles: 1
"""


def draw_rates(seed: int) -> list[float]:
    """Return rates (N/m) that fall by 500 to 3500 from station to station.

    No rate is below 300 in magnitude, because errors are relative to the rate.
    """
    random = np.random.default_rng(seed)
    while True:
        steps = random.uniform(500.0, 3500.0, len(STATIONS) - 1)
        rates = random.uniform(5000.0, 12000.0) - np.concatenate([[0.0], np.cumsum(steps)])
        if np.abs(rates).min() > 300.0:
            return [round(float(rate), 1) for rate in rates]


def map_errors(folder: Path, seed: int, stations: tuple[float, ...]) -> tuple[float, float]:
    """Return the largest error (%) of the rates by the slew cell and by the column cell."""
    rates = draw_rates(seed)
    (folder / "plant.yaml").write_text(_PLANT.format(root=ROOT, rates=rates))
    path = folder / "campaign.yaml"
    path.write_text(_CAMPAIGN.format(root=ROOT, seed=seed, stations=list(stations)))
    run, _ = rehearse(path, folder / "runs")
    table = spring_map(run)
    true = np.interp(stations, STATIONS, rates)
    errors = [
        100.0 * float(np.abs(table[name].values / true - 1.0).max())
        for name in ("rate", "rate_column")
    ]
    return errors[0], errors[1]


def measure(short: bool) -> Result:
    """Rehearse the campaign on each spring and compare its map with the drawn constants."""
    springs, stations = (1, STATIONS[::4]) if short else (SPRINGS, STATIONS)
    slew, column = [], []
    for seed in range(springs):
        with tempfile.TemporaryDirectory() as scratch:
            slew_error, column_error = map_errors(Path(scratch), seed, stations)
        slew.append(slew_error)
        column.append(column_error)
    return Result(
        "spring_map",
        "spring rates of a hidden spring by the hoist campaign, against the drawn ones",
        f"{springs} springs, {len(stations)} stator positions each, raised and lowered once",
        (
            figure("largest error, slew cell", "%", slew, at_most=MAX_ERROR, criterion="worst"),
            figure("largest error, column cell", "%", column, at_most=MAX_ERROR, criterion="worst"),
        ),
        ("noise of the plant file, 20 N Coulomb and 400 N s/m in the drivetrain, 0.1 m/s",),
    )
