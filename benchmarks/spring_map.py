"""The spring-map campaign on eight hidden springs, each drawn from a seed: are they found."""

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.execution.campaign import run_campaign
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.spring_map.result import spring_map
from rig.kinds.wavebot.tasks import rehearsal_mode
from rig.processes.run_types import Snapshot

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


class Nobody:
    """A view that looks at nothing."""

    notice = ""

    def __call__(self, snapshot: Snapshot) -> None:
        """Nothing to see."""


def draw_rates(seed: int) -> list[float]:
    """Rates (N/m) that fall by 500 to 3500 from station to station, none nearer to zero than
    300: a share of nothing says nothing."""
    random = np.random.default_rng(seed)
    while True:
        steps = random.uniform(500.0, 3500.0, len(STATIONS) - 1)
        rates = random.uniform(5000.0, 12000.0) - np.concatenate([[0.0], np.cumsum(steps)])
        if np.abs(rates).min() > 300.0:
            return [round(float(rate), 1) for rate in rates]


def map_errors(folder: Path, seed: int, stations: tuple[float, ...]) -> tuple[float, float]:
    """Largest error (%) of the rates by the slew cell and by the column cell."""
    rates = draw_rates(seed)
    (folder / "plant.yaml").write_text(_PLANT.format(root=ROOT, rates=rates))
    path = folder / "campaign.yaml"
    path.write_text(_CAMPAIGN.format(root=ROOT, seed=seed, stations=list(stations)))
    report = check_campaign(path)
    if report.campaign is None or report.plan is None:
        raise RuntimeError(report.text())
    mode = rehearsal_mode(report.campaign, real_clock=False)
    ended = run_campaign(report.campaign, report.plan, folder / "runs", Nobody(), mode)
    table = spring_map(ended.folder)
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
            one, other = map_errors(Path(scratch), seed, stations)
        slew.append(one)
        column.append(other)
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
