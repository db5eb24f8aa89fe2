"""How near `rig recommend` comes to the true optimum of DC power, and in how many rows.

The device is the nonlinear WaveBot with the custom drive, its sensors noisy. The true optimum is
the continuous minimum over Kp, Ki and spring rate of the same plant without noise, walked by the
compiled loop. A reference grid of 6 Kp x 6 Ki x 3 springs, walked alike, stands beside it. Rows
spent are those that were run and the whole identification run, counted in rows of that sea.
"""

import math
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ruamel.yaml import YAML
from scipy.optimize import minimize

from benchmarks.support.result import Figure, Result, figure
from rig.analysis.rows import COMPLETE, reduce_window
from rig.execution.campaign import run_campaign
from rig.kinds.wavebot.campaign import build_plan, check_campaign, open_campaign
from rig.kinds.wavebot.campaign.stability import largest_ki
from rig.kinds.wavebot.recommend import report
from rig.kinds.wavebot.recommend.recommendation import (
    Recommendation,
    RecommendOptions,
    recommend,
)
from rig.kinds.wavebot.recommend.set_points import Gains
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.kinds.wavebot.tasks import rehearsal_mode
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.planning.point import Point
from rig.planning.windows import repeat_period, row_windows
from rig.sweep.cases import single_row_campaign

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
RIG, PLANT = CONFIGS / "rigs" / "wavebot_custom.yaml", CONFIGS / "plants" / "wavebot_custom.yaml"
SEAS: dict[str, dict[str, Any]] = {
    "0.5 Hz, 0.127 m": {"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
    "Hs 0.254 m, 2.5 s": {"kind": "jonswap", "hs_m": 0.254, "tp_s": 2.5},
    "Hs 0.127 m, 3.45 s": {"kind": "jonswap", "hs_m": 0.127, "tp_s": 3.45},
}
SPRINGS = (490.9, -5715.0, -10013.0)
LEAD_IN = 15.0  # s, before a walked row
ROWS_BEFORE_SECOND = 10  # rows of each sea that are run before a second recommendation
MAX_ROWS = 36


class Silent:
    """A view of a run that draws nothing."""

    notice = ""

    def __call__(self, snapshot: Any) -> None:
        """Draw nothing."""


class TruePower:
    """The plant without noise in a sea: power of any settings, by the compiled loop."""

    def __init__(self, path: Path) -> None:
        self.campaign = open_campaign(path)
        whole = build_plan(self.campaign.file, self.campaign.rig, self.campaign.points)
        self._subject = CampaignSimulator(self.campaign, whole)
        period = repeat_period(self.campaign.file.sea)
        self._ticks = period / whole.dt if period else None
        self._at = self.campaign.points[0].locations
        self.results: dict[Gains, dict[str, float]] = {}

    def __call__(self, gains: Gains) -> dict[str, float]:
        """Mean power by station, W; infinite where the rig would trip."""
        if gains not in self.results:
            self.results[gains] = self._simulate(gains)
        return self.results[gains]

    def _simulate(self, gains: Gains) -> dict[str, float]:
        nothing = {"ac": math.inf, "dc": math.inf}
        if gains.ki > largest_ki(self.campaign.rig.stability, gains.spring_rate):
            return nothing
        point = Point({k: float(v) for k, v in gains._asdict().items()}, self._at)
        planned = build_plan(
            single_row_campaign(self.campaign.file, LEAD_IN), self.campaign.rig, (point,)
        )
        for window in self._subject.simulate(planned, stator=planned.rows[0].stator_position):
            row = reduce_window(window, self._ticks, STATIONS)
            if row["state"] == COMPLETE:
                return {"ac": row["power_ac"], "dc": row["power_dc"]}
        return nothing

    def find_minimum(self, start: Gains) -> Gains:
        """The continuous minimum of DC power that a search from ``start`` ends in."""
        scale = np.array([500.0, 1000.0, 1000.0])
        rates, _ = self.campaign.rig.spring.by_rate()

        def gains(place: Any) -> Gains:
            kp, ki, rate = (np.array(start) + place * scale).tolist()
            rate = min(max(rate, rates[0]), rates[-1])
            most = largest_ki(self.campaign.rig.stability, rate)
            return Gains(min(kp, -100.0), min(ki, most), rate)

        found = minimize(
            lambda place: min(self(gains(place))["dc"], 1e3), np.zeros(3), method="Nelder-Mead",
            options={"xatol": 0.02, "fatol": 0.01, "maxfev": 90, "initial_simplex": _simplex()},
        )  # fmt: skip
        return gains(found.x)


def _simplex() -> Any:
    return np.concatenate([np.zeros((1, 3)), np.eye(3)])


class SeaResult(NamedTuple):
    """What one sea gave."""

    sea: str
    first: Gains  # recommended from calm water alone
    second: Gains | None  # and from its rows besides
    optimum: Gains
    power: dict[str, float]  # true DC at these, of the grid's best row, and the best AC
    rows_used: tuple[float, float]  # rows, of the identification and of the recommended campaign


def measure(short: bool) -> Result:
    """Identify, recommend, and compare with the truth."""
    seas = dict(list(SEAS.items())[:1]) if short else SEAS
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        identified, seconds = _run_identification(folder, short)
        found = [
            _measure_sea(folder / f"sea_{i}", name, keys, identified, seconds, short)
            for i, (name, keys) in enumerate(seas.items())
        ]
    return Result(
        "recommend",
        "true DC power at recommended settings, against its continuous minimum",
        f"custom drive, {seconds:.0f} s of identification in calm water; "
        "reference grid 6 Kp x 6 Ki x 3 springs",
        tuple(each for one in found for each in _figures(one)),
    )


def _write_yaml(path: Path, keys: dict[str, Any]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        YAML(typ="safe").dump(keys, file)
    return path


def _rehearse(path: Path, runs: Path) -> tuple[Path, float]:
    """The run of a campaign, and how long it took in the basin's time, s."""
    told = check_campaign(path)
    if told.campaign is None or told.plan is None:
        raise RuntimeError(told.text())
    mode = rehearsal_mode(told.campaign, real_clock=False)
    ended = run_campaign(told.campaign, told.plan, runs, Silent(), mode)
    if ended.outcome.status != "complete":
        raise RuntimeError(f"{path.name}: {ended.outcome.reason}")
    return ended.folder, told.plan.duration


def _run_identification(folder: Path, short: bool) -> tuple[Path, float]:
    keys: dict[str, Any] = {
        "extends": str(CONFIGS / "campaigns" / "identification_short.yaml"),
        "rig": str(RIG),
    }
    if short:
        keys["matrix"] = {"grid": [{
            "spring_n_per_m": 490.9, "kp_n_s_per_m": 0, "ki_n_per_m": 0,
            "reference_scale": [1, 3],
        }]}  # fmt: skip
    return _rehearse(_write_yaml(folder / "identification.yaml", keys), folder / "runs")


def _measure_sea(
    folder: Path, name: str, sea: dict[str, Any], identified: Path, seconds: float, short: bool
) -> SeaResult:
    first_row = {"spring_n_per_m": 490.9, "kp_n_s_per_m": -2000, "ki_n_per_m": 0}
    keys = {"name": "sea", "rig": str(RIG), "sea": sea, "matrix": {"list": [first_row]}}
    base = _write_yaml(folder / "sea.yaml", keys)
    truth = TruePower(
        _write_yaml(folder / "truth.yaml", {**keys, "plant": str(_write_noiseless_plant(folder))})
    )
    timing = row_windows(truth.campaign.file.sea, truth.campaign.file.timing)
    asked = RecommendOptions(campaign=base, rows=ROWS_BEFORE_SECOND)
    advice = recommend([identified], asked, folder / "first")
    first, again, rows = _best_dc_gains(advice), None, 0
    if not short:
        path, _ = report.write(advice, folder / "first")
        run, _ = _rehearse(path, folder / "runs")
        rows = len(advice.rows)
        again = _best_dc_gains(recommend([identified, run], asked, folder / "again"))
    grid = [] if short else _reference_grid()
    watts = {"grid": min((truth(gains)["dc"] for gains in grid), default=math.nan)}
    starts = [first, *sorted(grid, key=lambda g: truth(g)["dc"])[:1]]
    true = min((truth.find_minimum(start) for start in starts), key=lambda g: truth(g)["dc"])
    watts |= {"first": truth(first)["dc"], "true": truth(true)["dc"]}
    watts["again"] = truth(again)["dc"] if again else math.nan
    watts["ac"] = min(each["ac"] for each in truth.results.values())
    return SeaResult(name, first, again, true, watts, (seconds / timing.interval, rows))


def _best_dc_gains(advice: Recommendation) -> Gains:
    return advice.rows[0].prediction.gains


def _reference_grid() -> list[Gains]:
    """The reference grid: Ki rises from what takes the spring's rate back."""
    return [
        Gains(kp, rate + above, rate)
        for rate in SPRINGS
        for kp in np.linspace(-1000.0, -3500.0, 6).tolist()
        for above in np.linspace(0.0, 10_000.0, 6).tolist()
    ]


def _write_noiseless_plant(folder: Path) -> Path:
    """The plant without sensor noise."""
    names = ("current", "string_pot", "lcb", "trs", "slew", "stator", "rotor", "probe")
    units = {"current": "A", "rotor": "rad", "string_pot": "m", "probe": "m"}
    silent = {
        f"{name}_noise": {"value": 0.0, "unit": units.get(name, "N"), "source": "none"}
        for name in names
    }
    return _write_yaml(folder / "quiet.yaml", {"extends": str(PLANT), "sensors": silent})


def _figures(one: SeaResult) -> list[Figure]:
    watts = one.power
    most = max(0.02 * abs(watts["ac"]), 0.5)
    gap = watts["first"] - watts["true"]
    name = one.sea
    made = [
        figure(f"{name}: gap in DC power, from calm water alone", "W", gap, at_most=most),
        figure("  allowed: 2 % of the best AC power, at least 0.5 W", "W", most),
        figure("  true least DC power", "W", watts["true"]),
        figure("  rows spent, identification included", "1", one.rows_used[0], at_most=MAX_ROWS),
    ]
    if one.second is not None:
        second = watts["again"] - watts["true"]
        spent = sum(one.rows_used)
        made += [
            figure("  gap after its rows were run", "W", second, at_most=most),
            figure("  rows spent by then", "1", spent, at_most=MAX_ROWS),
        ]
    if math.isfinite(watts["grid"]):
        worse = watts["grid"] - watts["true"]
        made.append(figure("  gap of the best of 108 grid rows", "W", worse))
    for label, gains in (("recommended", one.first), ("true", one.optimum)):
        told = zip(gains._fields, gains, ("N*s/m", "N/m", "N/m"), strict=True)
        made += [figure(f"  {label} {field}", unit, value) for field, value, unit in told]
    return made
