"""Share of counterfactual rows whose interval contains the true power, over hidden plants.

The run is that of a plant whose constants are drawn from a seed; the model keeps the constants of
the plant file. The waves are recovered from measured forces, because only a simulated basin knows
the elevation.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ruamel.yaml import YAML

from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from controllers.impedance import COLUMNS as LAW_COLUMNS
from rig.analysis.rows import reduce_window
from rig.identification.incident_waves import FORCES
from rig.kinds.wavebot.campaign import Campaign, open_campaign
from rig.kinds.wavebot.rehearsal.job import problems
from rig.kinds.wavebot.row_contents import row_contents
from rig.kinds.wavebot.simulation.simulation import CampaignSimulator
from rig.kinds.wavebot.tick.stations import STATIONS
from rig.planning.windows import repeat_period
from rig.recording.runs.windows import Window
from rig.stations import station_names
from rig.sweeps.campaigns import LEAD_IN, single_row_plan
from rig.sweeps.counterfactual import MeasuredRun, counterfactual_rows

MAX_RELATIVE_ERROR, MIN_ALLOWED_ERROR = 0.05, 0.5  # of the power, W: allowed error of a prediction
MIN_INSIDE, MAX_INSIDE = 90.0, 98.0  # %, of intervals of 95 %
MIN_NEAR = 99.0  # % of the rows
PLANT_DEVIATIONS = {  # key of the plant file: standard deviation of the factor
    "body.mass": 0.01,
    "body.viscous_linear": 0.1,
    "body.viscous_quadratic": 0.2,
    "pto.drivetrain_coulomb": 0.2,
    "pto.torque_constant": 0.005,
}
LOGGED_ROWS, PREDICTED_ROWS = 6, 3  # rows
SPRINGS = (490.9, -2763.0)  # N/m
KP, KI = (-4000.0, -1000.0), (0.0, 4000.0)
SEAS: tuple[dict[str, Any], ...] = (
    {"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
    {"kind": "jonswap", "hs_m": 0.2, "tp_s": 2.5, "gamma": 3.3, "repeat_s": 30, "seed": 1},
)

_POWERS = station_names(STATIONS)


class Case(NamedTuple):
    """Predicted and true powers (W) of one hidden plant; arrays of rows by stations."""

    predicted: np.ndarray[Any, Any]
    half_width: np.ndarray[Any, Any]
    truth: np.ndarray[Any, Any]


def create_campaign(folder: Path, name: str, sea: dict[str, Any], points: list[Any]) -> Campaign:
    """Write and open a campaign of these points in a sea."""
    keys = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")
    content = {
        "name": name,
        "rig": str(ROOT / "configs" / "rigs" / "wavebot.yaml"),
        "sea": sea,
        "tare": {"duration_s": 1},
        "start": {"set_point_s": 1, "lead_in_s": LEAD_IN},
        "timing": {"settle_s": 3, "interval_s": 15 if sea["kind"] == "regular" else 34},
        "matrix": {"list": [dict(zip(keys, point, strict=True)) for point in points]},
    }
    path = folder / f"{name}.yaml"
    YAML(typ="safe", pure=True).dump(content, path)
    return open_campaign(path, problems)


def draw_points(rng: np.random.Generator, count: int) -> list[tuple[float, float, float]]:
    """Draw points of the matrix: spring rate (N/m), Kp (N s/m), Ki (N/m)."""
    return [
        (
            float(rng.choice(SPRINGS)),
            round(float(rng.uniform(*KP))),
            round(float(rng.uniform(*KI))),
        )
        for _ in range(count)
    ]


def draw_plant(campaign: Campaign, rng: np.random.Generator) -> Campaign:
    """Return the campaign on a plant with constants drawn around those of its file."""
    plant = {**campaign.plant}
    for key, deviation in PLANT_DEVIATIONS.items():
        head, name = key.split(".")
        entry = dict(plant[head][name])
        entry["value"] = entry["value"] * float(np.clip(1.0 + deviation * rng.normal(), 0.5, 1.5))
        plant[head] = {**plant[head], name: entry}
    return campaign._replace(plant=plant, file=campaign.file.model_copy(
        update={"seed": int(rng.integers(1, 2**31))}
    ))  # fmt: skip


def simulate_rows(campaign: Campaign) -> Iterator[tuple[dict[str, Any], Window]]:
    """Simulate each point of a campaign alone; yield its table row and its measured window."""
    period = repeat_period(campaign.file.sea)
    contents = row_contents(LAW_COLUMNS)
    simulator = None
    for number, point in enumerate(campaign.points):
        planned = single_row_plan(campaign, LEAD_IN, point)
        simulator = simulator or CampaignSimulator(campaign, planned)
        row = planned.rows[0]
        for window in simulator.simulate(planned, place=row.place):
            means = reduce_window(window, period / planned.dt if period else None, contents)
            settings = {**row.setting._asdict(), "stator": row.place}
            # A copy, because the simulator overwrites the columns in its next row.
            data: Any = window.data.copy()
            yield (
                {**means, **settings, "row": number, "point": number},
                window._replace(row=number, data=data),
            )


def predict_case(folder: Path, seed: int) -> Case:
    """Simulate a hidden plant and predict rows with other gains in its waves."""
    rng = np.random.default_rng(seed)
    sea = SEAS[seed % len(SEAS)]
    logged = create_campaign(folder, "logged", sea, draw_points(rng, LOGGED_ROWS))
    other = create_campaign(folder, "other", sea, draw_points(rng, PREDICTED_ROWS))
    truth = draw_plant(logged, rng)
    logged_rows = list(simulate_rows(truth))
    measured = MeasuredRun(
        "hidden", tuple(row for row, _ in logged_rows), [window for _, window in logged_rows]
    )
    predicted = counterfactual_rows(measured, logged, other, FORCES)
    true = [row for row, _ in simulate_rows(truth._replace(points=other.points))]
    return Case(
        np.array([[row.power[name] for name in _POWERS] for row in predicted.rows]),
        np.array([[row.half_width[name] for name in _POWERS] for row in predicted.rows]),
        np.array([[row[f"power_{name}"] for name in _POWERS] for row in true]),
    )


def measure(short: bool) -> Result:
    """Predict rows of hidden plants, alternating between a regular and an irregular sea."""
    count = 10 if short else 200
    with tempfile.TemporaryDirectory() as scratch:
        cases = [predict_case(Path(scratch), seed) for seed in range(count)]
    error = np.abs(np.array([one.predicted - one.truth for one in cases]))
    true = np.array([one.truth for one in cases])
    half = np.array([one.half_width for one in cases])
    inside = 100.0 * np.mean(error <= half, axis=(0, 1))
    near = 100.0 * np.mean(
        error <= np.maximum(MAX_RELATIVE_ERROR * np.abs(true), MIN_ALLOWED_ERROR),
        axis=(0, 1),
    )
    figures = [
        figure(
            "all stations: true power inside the interval",
            "%",
            float(inside.mean()),
            at_least=MIN_INSIDE,
            at_most=None if short else MAX_INSIDE,
        ),
        *(
            figure(f"  {name}", "%", float(share))
            for name, share in zip(_POWERS, inside, strict=True)
        ),
        *(
            figure(
                f"within 5 % or 0.5 W of the true power: {name}",
                "%",
                float(share),
                at_least=MIN_NEAR,
            )
            for name, share in zip(_POWERS, near, strict=True)
        ),
        *(
            figure(f"half interval, median: {name}", "W", half[:, :, i].ravel().tolist())
            for i, name in enumerate(_POWERS)
        ),
    ]
    return Result(
        "counterfactual",
        "rows with other gains predicted in the waves of a run, compared with a hidden plant",
        f"{count} hidden plants, {LOGGED_ROWS} rows logged and {PREDICTED_ROWS} predicted each",
        tuple(figures),
    )
