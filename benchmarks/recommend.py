"""Gap of `rig recommend` to the true optimum of DC power, and the number of rows it needs.

The device is the nonlinear WaveBot with the custom drive and noisy sensors. The true optimum is
the continuous minimum over Kp, Ki and spring rate of the same plant without noise, simulated by the
compiled loop, as is a reference grid of 6 Kp x 6 Ki x 3 springs. The rows used are the rows of the
recommended campaign and the whole identification run, counted in rows of that sea.
"""

import math
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from benchmarks.support.campaigns import rehearse, write_yaml
from benchmarks.support.result import Figure, Result, figure
from controllers.impedance import COLUMNS as LAW_COLUMNS
from rig.analysis.rows import COMPLETE, reduce_window
from rig.campaign import build_plan
from rig.kinds.wavebot.campaign import open_campaign
from rig.kinds.wavebot.campaign.stability import largest_ki
from rig.kinds.wavebot.recommend import report
from rig.kinds.wavebot.recommend.recommendation import (
    Recommendation,
    RecommendOptions,
    recommend,
)
from rig.kinds.wavebot.recommend.set_points import Gains
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.planning.point import Point
from rig.planning.windows import repeat_period, row_windows
from rig.sweeps.campaigns import single_row_plan

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
RIG, PLANT = CONFIGS / "rigs" / "wavebot_custom.yaml", CONFIGS / "plants" / "wavebot_custom.yaml"
SEAS: dict[str, dict[str, Any]] = {
    "0.5 Hz, 0.127 m": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "Hs 0.254 m, 2.5 s": {"kind": "jonswap", "hs_m": 0.254, "tp_s": 2.5},
    "Hs 0.127 m, 3.45 s": {"kind": "jonswap", "hs_m": 0.127, "tp_s": 3.45},
}
SPRINGS = (490.9, -5715.0, -10013.0)
LEAD_IN = 15.0  # s, before a simulated row
ROWS_BEFORE_SECOND = 10  # rows of each sea that are run before a second recommendation
MAX_ROWS = 36


class TruePower:
    """True power at any gains: the plant without noise in a sea, simulated by the compiled loop."""

    def __init__(self, path: Path) -> None:
        self.campaign = open_campaign(path)
        plan = build_plan(self.campaign)
        self._simulator = CampaignSimulator(self.campaign, plan)
        period = repeat_period(self.campaign.file.sea)
        self._ticks = period / plan.dt if period else None
        self._locations = self.campaign.points[0].locations
        self.results: dict[Gains, dict[str, float]] = {}

    def __call__(self, gains: Gains) -> dict[str, float]:
        """Return the mean power (W) by station; infinite where the rig would trip."""
        if gains not in self.results:
            self.results[gains] = self._simulate(gains)
        return self.results[gains]

    def _simulate(self, gains: Gains) -> dict[str, float]:
        tripped = {"ac": math.inf, "dc": math.inf}
        if gains.ki > largest_ki(self.campaign.rig.stability, gains.spring_rate):
            return tripped
        point = Point({k: float(v) for k, v in gains._asdict().items()}, self._locations)
        plan = single_row_plan(self.campaign, LEAD_IN, point)
        for window in self._simulator.simulate(plan, place=plan.rows[0].place):
            row = reduce_window(window, self._ticks, row_contents(LAW_COLUMNS))
            if row["state"] == COMPLETE:
                return {"ac": row["power_ac"], "dc": row["power_dc"]}
        return tripped

    def find_minimum(self, start: Gains) -> Gains:
        """Return the gains of minimum DC power of a continuous search from ``start``."""
        scale = np.array([500.0, 1000.0, 1000.0])
        rates, _ = self.campaign.rig.spring.by_rate()

        def gains(step: Any) -> Gains:
            kp, ki, rate = (np.array(start) + step * scale).tolist()
            rate = min(max(rate, rates[0]), rates[-1])
            max_ki = largest_ki(self.campaign.rig.stability, rate)
            return Gains(min(kp, -100.0), min(ki, max_ki), rate)

        minimum = minimize(
            lambda step: min(self(gains(step))["dc"], 1e3), np.zeros(3), method="Nelder-Mead",
            options={"xatol": 0.02, "fatol": 0.01, "maxfev": 90, "initial_simplex": _simplex()},
        )  # fmt: skip
        return gains(minimum.x)


def _simplex() -> Any:
    return np.concatenate([np.zeros((1, 3)), np.eye(3)])


class SeaResult(NamedTuple):
    """Recommendations and true optimum in one sea."""

    sea: str
    first: Gains  # recommended from calm water alone
    second: Gains | None  # recommended with the rows of the first recommendation
    optimum: Gains
    power: dict[str, float]  # W: true DC at these and of the grid's best row; the best AC
    rows_used: tuple[float, float]  # of the identification, of the recommended campaign


def measure(short: bool) -> Result:
    """Identify, recommend, and compare with the truth."""
    seas = dict(list(SEAS.items())[:1]) if short else SEAS
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        identified, seconds = _run_identification(folder, short)
        results = [
            _measure_sea(folder / f"sea_{i}", name, keys, identified, seconds, short)
            for i, (name, keys) in enumerate(seas.items())
        ]
    return Result(
        "recommend",
        "true DC power at recommended settings, against its continuous minimum",
        f"custom drive, {seconds:.0f} s of identification in calm water; "
        "reference grid 6 Kp x 6 Ki x 3 springs",
        tuple(each for result in results for each in _figures(result)),
    )


def _run_identification(folder: Path, short: bool) -> tuple[Path, float]:
    """Return the identification run in calm water, and its duration (s) in a basin."""
    keys: dict[str, Any] = {
        "extends": str(CONFIGS / "campaigns" / "identification_short.yaml"),
        "rig": str(RIG),
    }
    if short:
        keys["matrix"] = {"grid": [{
            "spring_n_per_m": 490.9, "kp_n_s_per_m": 0, "ki_n_per_m": 0,
            "reference_scale": [1, 3],
        }]}  # fmt: skip
    path = write_yaml(folder / "identification.yaml", keys)
    run, plan = rehearse(path, folder / "runs")
    return run, plan.duration


def _measure_sea(
    folder: Path, name: str, sea: dict[str, Any], identified: Path, seconds: float, short: bool
) -> SeaResult:
    first_row = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    keys = {"name": "sea", "rig": str(RIG), "sea": sea, "matrix": {"list": [first_row]}}
    base = write_yaml(folder / "sea.yaml", keys)
    noiseless = {**keys, "plant": str(_write_noiseless_plant(folder))}
    truth = TruePower(write_yaml(folder / "truth.yaml", noiseless))
    timing = row_windows(truth.campaign.file.sea, truth.campaign.file.timing)
    options = RecommendOptions(campaign=base, rows=ROWS_BEFORE_SECOND)
    advice = recommend([identified], options, folder / "first")
    first, second, rows = _best_dc_gains(advice), None, 0
    if not short:
        path, _ = report.write(advice, folder / "first")
        run, _ = rehearse(path, folder / "runs")
        rows = len(advice.rows)
        second = _best_dc_gains(recommend([identified, run], options, folder / "again"))
    grid = [] if short else _reference_grid()
    power = {"grid": min((truth(gains)["dc"] for gains in grid), default=math.nan)}
    starts = [first, *sorted(grid, key=lambda g: truth(g)["dc"])[:1]]
    optimum = min((truth.find_minimum(start) for start in starts), key=lambda g: truth(g)["dc"])
    power |= {"first": truth(first)["dc"], "optimum": truth(optimum)["dc"]}
    power["second"] = truth(second)["dc"] if second else math.nan
    power["ac"] = min(each["ac"] for each in truth.results.values())
    return SeaResult(name, first, second, optimum, power, (seconds / timing.interval, rows))


def _best_dc_gains(advice: Recommendation) -> Gains:
    return advice.rows[0].prediction.gains


def _reference_grid() -> list[Gains]:
    """Return the reference grid; its Ki starts at the value that cancels the spring rate."""
    return [
        Gains(kp, rate + above, rate)
        for rate in SPRINGS
        for kp in np.linspace(-1000.0, -3500.0, 6).tolist()
        for above in np.linspace(0.0, 10_000.0, 6).tolist()
    ]


def _write_noiseless_plant(folder: Path) -> Path:
    """Write the plant without sensor noise; return its path."""
    names = ("current", "string_pot", "lcb", "trs", "slew", "stator", "rotor", "probe")
    units = {"current": "A", "rotor": "rad", "string_pot": "m", "probe": "m"}
    sensors = {
        f"{name}_noise": {"value": 0.0, "unit": units.get(name, "N"), "source": "none"}
        for name in names
    }
    return write_yaml(folder / "quiet.yaml", {"extends": str(PLANT), "sensors": sensors})


def _figures(result: SeaResult) -> list[Figure]:
    gaps = {name: power - result.power["optimum"] for name, power in result.power.items()}
    max_gap = max(0.02 * abs(result.power["ac"]), 0.5)
    label = f"{result.sea}: gap in DC power, from calm water alone"
    rows = result.rows_used[0]
    figures = [
        figure(label, "W", gaps["first"], at_most=max_gap),
        figure("  allowed: 2 % of the best AC power, at least 0.5 W", "W", max_gap),
        figure("  true least DC power", "W", result.power["optimum"]),
        figure("  rows used, identification included", "1", rows, at_most=MAX_ROWS),
    ]
    if result.second is not None:
        figures += [
            figure("  gap after its rows were run", "W", gaps["second"], at_most=max_gap),
            figure("  rows used by then", "1", sum(result.rows_used), at_most=MAX_ROWS),
        ]
    if math.isfinite(gaps["grid"]):
        figures.append(figure("  gap of the best of 108 grid rows", "W", gaps["grid"]))
    for label, gains in (("recommended", result.first), ("true", result.optimum)):
        columns = zip(gains._fields, gains, ("N*s/m", "N/m", "N/m"), strict=True)
        figures += [figure(f"  {label} {field}", unit, value) for field, value, unit in columns]
    return figures
