"""Spring map of a run: a dataset over stator position and rotor angle, and its findings."""

import math
import os
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.kinds.wavebot.spring_map import passes
from rig.kinds.wavebot.spring_map.passes import (
    FIT_HALF_ANGLE,
    SMALL_HALF_ANGLE,
    Samples,
    StationCurve,
)
from rig.presentation.phrases import format_signed
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError, RunInfo, reader, run_info
from rig.recording.runs.windows import Window, complete_windows
from rig.spectra.periods import Floats

MAX_CELL_DISAGREEMENT = 0.05  # of the larger rate; larger differences of the cells are reported
_MIN_SPEED_SHARE = 0.2  # of the hoist's speed; a slower body is reversing
_FIELDS = (
    "load.rotor_angle", "load.slew", "load.lcb", "load.stator_a", "load.stator_b",
    "heave.estimate.velocity", "spring_sense.position", "tare.slew", "tare.lcb", "tare.samples",
)  # fmt: skip


class _RigConstants(NamedTuple):
    """Constants of the rig from the run's configuration; NaN if it lacks them."""

    metres_per_radian: float
    slew_lever: float  # m
    hydrostatic: float  # N/m
    moving_mass: float  # kg


class _Station(NamedTuple):
    """Results of one stator position."""

    curve: StationCurve
    values: dict[str, float]  # the stator's measured position (%), and those of `BY_STATION`


BY_STATION = {  # unit and description
    "rate": ("N/m", "spring rate, by the slew load cell"),
    "rate_interval": ("N/m", "half width of the 95 % interval"),
    "rate_column": ("N/m", "by the column load cell"),
    "rate_small": ("N/m", "small-displacement rate"),
    "passes": (),
    "peak": ("N*m", "Tp of T = Tp sin 2 theta"),
    "departure": ("N*m", "rms residual of that law"),
    "friction": ("N", "drivetrain friction at this speed"),
    "natural_frequency": ("Hz",),
    "reversal_below": ("rad", "stator force reverses"),
    "reversal_above": ("rad", "stator force reverses"),
    "reversal_stroke": ("m",),
    "travel": ("m", "measured, either direction"),
}
"""The results of a map that have one value for each stator position."""

_BY_ANGLE = {  # part of a `StationCurve`, unit and description
    "torque": ("torque", "N*m", "spring torque"),
    "stator_force": ("stator", "N", "axial"),
    "column_force": ("column", "N", "on the body"),
}


def is_hoisted(plan: dict[str, Any]) -> bool:
    """Return whether a plan is that of a run in which a hoist moved the body."""
    return bool(plan.get("hoist"))


def spring_map(run: str | os.PathLike[str], *, incomplete_rows: bool = False) -> xarray.Dataset:
    """Return the spring map of a run: curves by station and angle, rates by station.

    The units are in the attributes. The attribute ``left_out`` names the excluded rows;
    ``incomplete_rows`` includes rows for which the record lacks ticks. Raises RunError if no hoist
    moved the body, the rig file lacks `spring.mapping`, or no station was completed.
    """
    source = reader.open_files(run)
    run_facts = run_info(run, source.contents)
    if not is_hoisted(run_facts.plan):
        raise RunError(f"{run}: no spring map (its campaign has no hoist)")
    rig = _rig_constants(run_facts)
    balance, speed = _balance_angle(source), float(run_facts.plan["hoist"]["speed_m_per_s"])
    point_of_row = {row["row"]: row["point"] for row in run_facts.plan["rows"]}
    by_point: dict[int, list[Window]] = {}  # repetitions of a station are combined
    complete, excluded = complete_windows(
        run, source, _FIELDS, run_facts.plan, incomplete_rows=incomplete_rows
    )
    for window in complete:
        by_point.setdefault(point_of_row[window.row], []).append(window)
    stations = []
    for windows in by_point.values():
        parts = [
            _window_samples(window, rig, balance, _MIN_SPEED_SHARE * speed) for window in windows
        ]
        samples = Samples(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        stator = np.mean([window.data["spring_sense.position"].mean() for window in windows])
        stations.append(_evaluate_station(float(stator), samples, rig))
    stations.sort(key=lambda station: station.values["station"])
    if not stations:
        reason = "; ".join(["no stator position was completed", *excluded])
        raise RunError(f"{run}: {reason}")
    return _build_dataset(stations, rig).assign_attrs(
        run_facts.attributes()
        | {"balance_rad": balance, "hoist": str(run_facts.plan["hoist"].get("words", ""))}
        | ({"left_out": "; ".join(excluded)} if excluded else {})
    )


def _rig_constants(run_facts: RunInfo) -> _RigConstants:
    def number(*keys: str) -> float:
        value = run_facts.config_number("rig", *keys)
        return math.nan if value is None else value

    constants = _RigConstants(
        number("spring", "metres_per_radian"),
        number("spring", "mapping", "slew_lever_m"),
        number("stability", "hydrostatic_stiffness_n_per_m"),
        number("spring", "mapping", "moving_mass_kg"),
    )
    if math.isnan(constants.slew_lever) or math.isnan(constants.metres_per_radian):
        raise RunError(
            f"{run_facts.run}: its rig file lacks spring.mapping.slew_lever_m, the lever (m) of "
            "the load cell that takes the spring's torque"
        )
    return constants


def _balance_angle(source: reader.RunFiles) -> float:
    """Return the rotor angle (rad) of the floating body: mean over the tare; 0 without a tare."""
    total, count = 0.0, 0
    for block in reader.blocks(source):
        in_tare = block["plan.phase"] == Phase.TARE
        total += float(block["load.rotor_angle"][in_tare].sum())
        count += int(in_tare.sum())
        if count and not in_tare.any():
            break
    return total / count if count else 0.0


def _window_samples(
    window: Window, rig: _RigConstants, balance: float, min_speed: float
) -> Samples:
    data = window.data
    velocity = data["heave.estimate.velocity"]
    direction = np.where(velocity > min_speed, 1, np.where(velocity < -min_speed, -1, 0))
    slew: Floats = data["load.slew"] - data["tare.slew"]
    column: Floats = data["load.lcb"] - data["tare.lcb"]
    stator: Floats = data["load.stator_a"] + data["load.stator_b"]
    return Samples(
        data["load.rotor_angle"] - balance,
        direction.astype(np.int64),
        slew * rig.slew_lever,
        column,
        stator,
    )


def _evaluate_station(stator: float, samples: Samples, rig: _RigConstants) -> _Station:
    curve = passes.average_passes(samples)
    lever = rig.metres_per_radian
    torque = passes.estimate_rate(samples, curve)
    column = passes.window_slope(curve, curve.column, FIT_HALF_ANGLE)
    small = passes.window_slope(curve, curve.torque, SMALL_HALF_ANGLE)
    sine, reversal = passes.fit_sine(curve), passes.find_reversal(curve)
    rate = torque.slope / (lever * lever)
    return _Station(
        curve,
        {
            "station": stator,
            "rate": rate,
            "rate_interval": torque.interval / (lever * lever),
            "rate_column": -column / lever,
            "rate_small": small / (lever * lever),
            "passes": torque.passes,
            "peak": sine.peak,
            "departure": sine.residual,
            "friction": float(np.nanmean(curve.friction)),
            "natural_frequency": float(natural_frequency(rate, rig.hydrostatic, rig.moving_mass)),
            "reversal_below": reversal.below,
            "reversal_above": reversal.above,
            "reversal_stroke": lever * reversal.nearest,
            "travel": lever * float(np.nanmax(np.abs(curve.angle))),
        },
    )


def natural_frequency(rate: Any, hydrostatic: float, mass: float) -> Any:
    """Return sqrt((K_h + K_s) / (A + m)) / 2 pi in Hz: MASK4 report (Sandia), eq. 3.1.

    NaN where the total stiffness is not positive.
    """
    stiffness = np.asarray(hydrostatic + rate, dtype=np.float64)
    return np.sqrt(np.where(stiffness > 0.0, stiffness, np.nan) / mass) / (2.0 * math.pi)


def _build_dataset(stations: list[_Station], rig: _RigConstants) -> xarray.Dataset:
    low = min(int(station.curve.bins[0]) for station in stations)
    high = max(int(station.curve.bins[-1]) for station in stations)
    index = np.arange(low, high + 1)

    def surface(part: str) -> Any:
        grid = np.full((len(stations), len(index)), np.nan)
        for i, station in enumerate(stations):
            first = int(station.curve.bins[0]) - low
            values = getattr(station.curve, part)
            grid[i, first : first + len(values)] = values
        return grid

    def attributes(unit_and_text: Iterable[str]) -> dict[str, str]:
        return dict(zip(("units", "long_name"), unit_and_text, strict=False))

    def column(name: str, unit_and_text: tuple[str, ...]) -> Any:
        values = [station.values[name] for station in stations]
        return "station", values, attributes(unit_and_text)

    return xarray.Dataset(
        {
            name: (("station", "angle"), surface(part), attributes(unit_and_text))
            for name, (part, *unit_and_text) in _BY_ANGLE.items()
        }
        | {name: column(name, unit_and_text) for name, unit_and_text in BY_STATION.items()},
        {
            "station": column("station", ("%",)),
            "angle": ("angle", passes.bin_centres(index), {"units": "rad"}),
        },
        {
            "fit_half_angle_rad": FIT_HALF_ANGLE,
            "metres_per_radian": rig.metres_per_radian,
            "hydrostatic_n_per_m": rig.hydrostatic,
            "moving_mass_kg": rig.moving_mass,
            "convention": "rate > 0 restores; torque restores at a positive angle; "
            "column force on the body, heave up positive",
        },
    )


def findings(table: xarray.Dataset) -> list[str]:
    """Return the main results of a spring map, one message each."""
    rate = table["rate"].values
    finite = np.isfinite(rate)
    messages = []
    if finite.any():
        low, high = (format_signed(float(value)) for value in (np.nanmin(rate), np.nanmax(rate)))
        messages.append(f"spring rate {low} .. {high} N/m at {finite.sum()} stator positions")
    frequency = table["natural_frequency"].values
    if np.isfinite(frequency).any():
        slowest, fastest = float(np.nanmin(frequency)), float(np.nanmax(frequency))
        messages.append(f"natural frequency {slowest:.3f} .. {fastest:.3f} Hz (eq. 3.1)")
    stroke, station = table["reversal_stroke"].values, table["station"].values
    if np.isfinite(stroke).any():
        i = int(np.argmin(stroke))
        messages.append(
            f"the stator's force reverses at {np.isfinite(stroke).sum()} of them, at the smallest "
            f"stroke at {format_signed(float(station[i]))} %: {stroke[i]:.3f} m from balance"
        )
    else:
        messages.append("the stator's force does not reverse within the measured travel")
    if left_out := table.attrs.get("left_out"):
        messages.append(str(left_out))
    return [*messages, *_warnings(table)]


def _warnings(table: xarray.Dataset) -> Iterator[str]:
    """Yield warnings about stations without a rate or with disagreeing load cells."""
    half_angle = math.degrees(FIT_HALF_ANGLE)
    for station in (table.isel(station=i) for i in range(table.sizes["station"])):
        position, rate = f"{format_signed(float(station['station']))} %", float(station["rate"])
        column_rate = float(station["rate_column"])
        if math.isnan(rate):
            window = f"±{half_angle:.2f} deg"
            yield f"at {position} the travel does not cover {window} in both directions: no rate"
            continue
        largest = max(abs(rate), abs(column_rate), 1000.0)
        if abs(rate - column_rate) > MAX_CELL_DISAGREEMENT * largest:
            yield (
                f"at {position} the column load cell gives {format_signed(column_rate)} N/m, the "
                f"slew load cell {format_signed(rate)} N/m: a lever or a scale is wrong"
            )
